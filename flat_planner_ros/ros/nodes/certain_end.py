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
The end of a process after a signal: certain, whatever its main thread is in.

Python runs the handler of a signal in the main thread, between two of its own instructions. A main
thread that does not come back from an executor or a callback never gets there. The number of the
signal is therefore read from a pipe too, by a thread that wakes the executor, and after a bounded
time ends the process.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
import os
import signal
import sys
from threading import Event, Thread
from time import monotonic

from flat_planner_ros.programs import SIGNALS

PATIENCE = 5.0
"""Time that a process is given to end by itself after a signal [s]."""

WAKE_PERIOD = 0.2
"""Time between two attempts to wake the executor [s]."""

FORCED = 1
"""Exit code of a process that had to be ended."""


@contextmanager
def certain_end(wake: Callable[[], object], rest: Callable[[], object]) -> Iterator[None]:
    """
    End the process within `PATIENCE` after a signal, unless what is done in this context ends.

    Parameters
    ----------
    wake
        Called again and again after a signal, in another thread; wakes whatever waits.
    rest
        Called before the process is ended by force; brings efforts to zero.

    """
    heard, told = os.pipe()
    os.set_blocking(told, False)
    before = signal.set_wakeup_fd(told, warn_on_full_buffer=False)
    done = Event()
    watch = Thread(target=_watch, args=(heard, done, wake, rest), daemon=True)
    watch.start()
    try:
        yield
    finally:
        done.set()
        signal.set_wakeup_fd(before)
        os.close(told)
        watch.join()
        os.close(heard)


def _watch(
    heard: int, done: Event, wake: Callable[[], object], rest: Callable[[], object]
) -> None:
    """Wait for a signal, and then for the end; make it if it does not come."""
    number = _signal_from(heard)
    until = monotonic() + PATIENCE
    while number and not done.wait(WAKE_PERIOD):
        if monotonic() < until:
            with suppress(Exception):  # It may be gone, or not there yet.
                wake()
            continue
        with suppress(Exception):
            rest()
        name = signal.Signals(number).name
        print(f'ended by force, {PATIENCE:g} s after {name}', file=sys.stderr, flush=True)
        os._exit(FORCED)


def _signal_from(heard: int) -> int:
    """Return the next signal that ends a process; 0 where the other end of the pipe is closed."""
    while True:
        data = os.read(heard, 1)
        if not data:
            return 0
        if data[0] in SIGNALS:
            return data[0]
