"""The life of a process of nodes: start, spin, and a clear end."""

from collections.abc import Callable, Sequence
import sys

from flat_planner_ros.core import FlatPlannerError
import rclpy
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node


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
    executor = None
    try:
        # RuntimeError is what rcl raises for arguments and parameter files it cannot read.
        try:
            rclpy.init(args=args)
            executor = SingleThreadedExecutor()
            for create in creators:
                nodes.append(create())
        except (FlatPlannerError, ParameterException, RuntimeError) as error:
            if executor is not None and not rclpy.ok():
                return 0  # A signal came while the nodes were made.
            print(f'cannot start: {" ".join(str(error).split())}', file=sys.stderr)
            return 1
        for node in nodes:
            executor.add_node(node)
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except RuntimeError:
        # A signal may end the context in the middle of a callback, which then fails to publish.
        if rclpy.ok():
            raise
    finally:
        for node in nodes:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0
