# Copyright 2026 flat_planner_ros developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Who does the work of a study: processes of this machine, or a Dask cluster."""

from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from functools import partial
from multiprocessing import get_context
import signal

from flat_planner_ros.child_process import end_with_parent


def serve_parent() -> None:
    """
    Leave Ctrl-C, which reaches all processes of a terminal, to the one that asks for work.

    If that one ends without a word, so does this one, which would wait for work for ever.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent(signal.SIGKILL)


def processes(workers: int) -> Callable[[], Executor]:
    """Return what makes an executor of so many processes."""
    # Not forked: threads of the present process would be lost while they hold locks.
    return partial(
        ProcessPoolExecutor,
        workers,
        mp_context=get_context('spawn'),
        initializer=serve_parent,
    )


@contextmanager
def dask_cluster(address: str) -> Iterator[tuple[Callable[[], Executor], int]]:
    """
    Connect to a Dask cluster.

    Parameters
    ----------
    address
        Of its scheduler, e.g. ``tcp://10.0.0.1:8786``.

    Yields
    ------
    tuple
        What makes an executor, and how many threads of workers there are.

    """
    # Imported here: an extra.
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        # One chunk at a time is lost with a worker; the scheduler gives it to another one.
        yield partial(client.get_executor, pure=False), max(1, sum(client.nthreads().values()))
