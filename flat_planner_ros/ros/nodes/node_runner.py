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

"""The life of a process of nodes: start, spin, and a clear end."""

from argparse import ArgumentParser
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
import gc
import os
import re
import signal
import sys
from threading import Event

from flat_planner_ros.core.arm import FlatPlannerError
from flat_planner_ros.programs import SIGNALS
from flat_planner_ros.ros.nodes.certain_end import certain_end
from flat_planner_ros.ros.nodes.early_loading import LOADED
from flat_planner_ros.ros.nodes.guarded_callbacks import GuardedNode
from flat_planner_ros.ros.nodes.introduction import introduce
from flat_planner_ros.ros.wire.log_lines import write_line
from flat_planner_ros.version import ShowVersion
import rclpy
from rclpy.exceptions import NotInitializedException, ParameterException
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.logging import get_logger_level, LoggingSeverity, set_logger_level
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import get_default_context, remove_ros_args

EXECUTOR = 'FLAT_PLANNER_EXECUTOR'
"""Environment variable: `events`, the default where ROS has it, or `single`."""

HINTS = {
    'Sequence should be of same type': ' (write every number of a list as 1.0, not 1)',
    'Sequences can only be values': ' (every block of a parameter file needs ros__parameters:)',
    'Error opening YAML file': ' (no such file)',
}
"""What to write instead, by a part of what rcl says of a parameter file."""

SOURCE_PLACE = re.compile(r',? at /\S+:\d+')
"""Where in its own sources rcl has met an error."""

NO_LOGGING = 'failed to initialize logging'
"""What rcl says where the directory of the log files cannot be made."""

WITHOUT_LOG_FILE = ('--ros-args', '--disable-external-lib-logs')
"""Arguments by which a process logs to the console and to /rosout only."""

RCL = 'rcl'
"""Logger of the client library below rclpy."""

ROS_FLAGS = ('--params-file', '-p', '--param', '-r', '--remap', '--log-level', '--enclave', '-e')
"""Options that are for ROS, and mean nothing without --ros-args before them."""

SPIN_PERIOD = 0.1
"""Longest wait in the executor [s]; without one an EventsExecutor would never run a callback."""


def run(creators: Sequence[Callable[[], GuardedNode]], args: Sequence[str] | None = None) -> int:
    """
    Spin nodes in one process until it is interrupted.

    Parameters
    ----------
    creators
        Each makes a node in the default context.
    args
        Command line; the process's own by default.

    Returns
    -------
    int
        Exit code: 0 after Ctrl-C, SIGTERM or a shutdown of the context, 1 if a node could not
        start with what it was given.

    """
    nodes: list[GuardedNode] = []
    is_open = is_ready = False
    executors: list[Executor] = []

    def wake() -> None:
        for executor in executors:
            executor.wake()

    def rest() -> None:
        for node in nodes:
            node.rest()

    with signals_caught() as interrupted, certain_end(wake, rest):
        try:
            gc.disable()  # until there is what stays, `_leave_alone`
            _refuse_strays(sys.argv if args is None else args)
            _init(args)
            is_open = True
            executor = new_executor()
            executors.append(executor)
            for create in creators:
                if interrupted.is_set():
                    return 0
                nodes.append(create())
                executor.add_node(nodes[-1])
            introduce(nodes, sys.argv if args is None else args)
            for node in nodes:
                write_line(node.get_logger(), LoggingSeverity.INFO, 'ready')
            is_ready = True
            _leave_alone()
            is_settled = False
            while rclpy.ok() and not interrupted.is_set():
                executor.spin_once(timeout_sec=SPIN_PERIOD)
                if LOADED.is_set() and not is_settled:
                    is_settled = True
                    _leave_alone()
        except ExternalShutdownException:
            pass
        # RuntimeError is what rcl raises for arguments and parameter files it cannot read, and for
        # whatever is attempted in a context that has been shut down; for a node that is made then,
        # it is NotInitializedException.
        except (
            FlatPlannerError,
            ParameterException,
            NotInitializedException,
            RuntimeError,
        ) as error:
            if not is_open or rclpy.ok():
                if is_ready:
                    raise
                return _explained(error)
        finally:
            gc.enable()
            for node in nodes:
                node.destroy_node()
            rclpy.try_shutdown()
    return 0


def _leave_alone() -> None:
    """
    Take all that there is out of the garbage collector's sight.

    It would look at every object of every module again, for 40 ms each time, in which a goal or a
    sample waits. Only where the process is the nodes' own: what is frozen is never collected.
    """
    gc.freeze()
    gc.enable()


def _explained(error: Exception) -> int:
    """Print why there are no nodes; return the exit code."""
    text = SOURCE_PLACE.sub('', ' '.join(str(error).split()))
    hint = next((hint for part, hint in HINTS.items() if part in text), '')
    print(f'cannot start: {text}{hint}', file=sys.stderr)
    return 1


def _init(args: Sequence[str] | None) -> None:
    """Open the default context; complaints come as exceptions alone, not as log entries too."""
    set_logger_level(RCL, LoggingSeverity.FATAL)
    try:
        try:
            rclpy.init(
                args=None if args is None else list(args),
                signal_handler_options=SignalHandlerOptions.NO,
            )
        except RuntimeError as error:
            if NO_LOGGING not in str(error):
                raise
            # A disk that cannot be written is no reason to stand still: the console and /rosout
            # have the log as well.
            print(f'no log file: {SOURCE_PLACE.sub("", str(error))}', file=sys.stderr)
            get_default_context(shutting_down=True)  # The next one is new: none is opened twice.
            rclpy.init(
                args=[*(sys.argv if args is None else args), *WITHOUT_LOG_FILE],
                signal_handler_options=SignalHandlerOptions.NO,
            )
    finally:
        if get_logger_level(RCL) == LoggingSeverity.FATAL:  # not what --log-level has asked for
            set_logger_level(RCL, LoggingSeverity.UNSET)


def _refuse_strays(args: Sequence[str]) -> None:
    """Explain the command line, and end with exit code 2, if there is more than ROS arguments."""
    parser = ArgumentParser(
        usage='%(prog)s [-h] [--version] [--ros-args ...]',
        description='A node of flat_planner_ros; it runs until Ctrl-C.',
        epilog='ROS arguments follow --ros-args, e.g. --ros-args --params-file arm.yaml',
    )
    parser.add_argument('--version', action=ShowVersion)
    _, strays = parser.parse_known_args(remove_ros_args(list(args))[1:])
    if strays:
        flag = next((stray for stray in strays if stray in ROS_FLAGS), None)
        hint = '' if flag is None else f': put --ros-args before {flag}'
        parser.error(f'unrecognized arguments: {" ".join(strays)}{hint}')


@contextmanager
def signals_caught() -> Iterator[Event]:
    """
    Turn SIGINT and SIGTERM into an event, as often as they come.

    Left to ROS, a signal would end the context in the middle of a callback, which then fails.
    """
    interrupted = Event()
    before = {number: signal.getsignal(number) for number in SIGNALS}

    for number in before:
        signal.signal(number, lambda *_: interrupted.set())
    try:
        yield interrupted
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def new_executor() -> Executor:
    """Return the executor that needs least time per message (benchmarks/README.md)."""
    if os.environ.get(EXECUTOR, 'events') == 'events':
        try:
            from rclpy.experimental import EventsExecutor
        except ImportError:
            pass
        else:
            return EventsExecutor()
    return SingleThreadedExecutor()
