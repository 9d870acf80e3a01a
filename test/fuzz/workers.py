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

"""
Random cases on the engine of studies: those of this process, or of all of the machine.

`FUZZ_WORKERS` sets how many processes share the cases; a few are done in this one.
"""

from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
import os

from flat_planner_ros.core.study import chunks_of, here, on_executor

WORKERS = int(os.environ.get('FUZZ_WORKERS', '0')) or os.cpu_count()

BATCH = 50
"""Cases that a process takes at once."""

FEW = 500
"""Cases up to which other processes would take longer to start than to help."""


def in_chunks(work, first, stop):
    """Return what comes of the cases from one to before another, in order."""
    chunks = chunks_of(first, stop, BATCH)
    if stop - first <= FEW:
        found = here(work, chunks)
    else:
        # Not forked: the threads of the test runner would be lost while they hold locks.
        pool = partial(ProcessPoolExecutor, WORKERS, mp_context=get_context('spawn'))
        found = on_executor(work, chunks, pool, WORKERS)
    return (result for _, result in found)
