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
Entry points of the programs: signals count before the libraries are loaded.

Loading them takes most of a second. A SIGINT or SIGTERM ends a node in that time as later on: at
once, with exit code 0 and without a word. It ends a tool, whose work is not done then, with 130.
"""

import gc
from importlib import import_module
import os
import signal
import sys
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM)
"""Signals that end a program."""

THREADS = ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS')
"""Variables that libraries of linear algebra read when they are loaded."""

INTERRUPTED = 130
"""Exit code of a tool that was ended before it was done."""


def planner_node() -> int:
    """Run the planner node."""
    return _run('nodes.planner_node')


def plant_node() -> int:
    """Run the plant node."""
    return _run('nodes.plant_node')


def monitor_node() -> int:
    """Run the monitor node."""
    return _run('nodes.monitor_node')


def tracker_node() -> int:
    """Run the tracker node."""
    return _run('nodes.tracker_node')


def demo() -> int:
    """Run the three nodes."""
    return _run('programs.demo')


def record() -> int:
    """Record the graph."""
    return _run('programs.record')


def live_view() -> int:
    """Show the graph in web browsers."""
    return _run('programs.live_view')


def flat_plan() -> int:
    """Plan on the command line."""
    return _run_tool('programs.flat_plan')


def tradeoff() -> int:
    """Show effort against residual."""
    return _run_tool('programs.tradeoff')


def study() -> int:
    """Do the rows of a study."""
    return _run_tool('study.program')


def make_urdf() -> int:
    """Write a robot description."""
    return _run_tool('programs.make_urdf')


def analyse() -> int:
    """Judge a recording."""
    return _run_tool('programs.analyse')


def identify() -> int:
    """Fit a model to recordings."""
    return _run_tool('programs.identify')


def excite() -> int:
    """Move an arm until its model is known."""
    return _run('programs.excite', INTERRUPTED)


def paper_table() -> int:
    """Carry out the paper's experiment."""
    return _run('programs.paper_table', INTERRUPTED)


def _run_tool(module: str) -> int:
    """Run a program that prints and ends; whoever reads it may stop reading, as `head` does."""
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    return _run(module, INTERRUPTED)


def _run(module: str, interrupted: int = 0) -> int:
    """Load a module of the ROS layer and run its `main`; return the exit code."""
    if sys.argv[1:] == ['--version']:
        # Imported here: the start of a node does not need it. Nor does the answer need a library.
        from flat_planner_ros.version import version_line

        print(version_line())
        return 0

    def leave(_number: int, _frame: FrameType | None) -> None:
        # No exception: it would come up in the middle of an import, where some libraries turn it
        # into another one. There is nothing to be cleaned up yet, or nothing any more.
        os._exit(interrupted)

    for number in SIGNALS:
        signal.signal(number, leave)
    # Matrices are small here: more threads would only wait for each other.
    for variable in THREADS:
        os.environ.setdefault(variable, '1')
    try:
        # All that is loaded stays, and the garbage collector would look at it a dozen times.
        gc.disable()
        program = import_module(f'flat_planner_ros.ros.{module}')
        gc.freeze()
        gc.enable()
        # A module with nodes catches signals by itself from here on, while they exist.
        return int(program.main())
    finally:
        # A late signal must not spoil the exit code while the interpreter is taken down.
        for number in SIGNALS:
            signal.signal(number, signal.SIG_IGN)
