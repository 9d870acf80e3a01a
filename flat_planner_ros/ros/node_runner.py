"""The life of a process of nodes: start, spin, and a clear end."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
import os
import signal
import sys
from threading import Event

from flat_planner_ros.core import FlatPlannerError
import rclpy
from rclpy.exceptions import ParameterException
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

EXECUTOR = 'FLAT_PLANNER_EXECUTOR'
"""Environment variable: `events`, the default where ROS has it, or `single`."""

SPIN_PERIOD = 0.1
"""Longest wait in the executor [s]; without one an EventsExecutor would never run a callback."""


def run(creators: Sequence[Callable[[], Node]], args: Sequence[str] | None = None) -> int:
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
    nodes: list[Node] = []
    with _signals_caught() as interrupted:
        try:
            # RuntimeError is what rcl raises for arguments and parameter files it cannot read.
            try:
                rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
                executor = _new_executor()
                for create in creators:
                    nodes.append(create())
                    executor.add_node(nodes[-1])
            except (FlatPlannerError, ParameterException, RuntimeError) as error:
                print(f'cannot start: {" ".join(str(error).split())}', file=sys.stderr)
                return 1
            while rclpy.ok() and not interrupted.is_set():
                executor.spin_once(timeout_sec=SPIN_PERIOD)
        except ExternalShutdownException:
            pass
        finally:
            for node in nodes:
                node.destroy_node()
            rclpy.try_shutdown()
    return 0


@contextmanager
def _signals_caught() -> Iterator[Event]:
    """
    Turn the first SIGINT or SIGTERM into an event; a second one acts as ever.

    Left to ROS, a signal would end the context in the middle of a callback, which then fails.
    """
    interrupted = Event()
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def restore() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)

    def interrupt(*_: object) -> None:
        interrupted.set()
        restore()

    for number in before:
        signal.signal(number, interrupt)
    try:
        yield interrupted
    finally:
        restore()


def _new_executor() -> Executor:
    """Return the executor that needs least time per message (benchmarks/README.md)."""
    if os.environ.get(EXECUTOR, 'events') == 'events':
        try:
            from rclpy.experimental import EventsExecutor
        except ImportError:
            pass
        else:
            return EventsExecutor()
    return SingleThreadedExecutor()
