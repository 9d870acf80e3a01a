"""The life of a node's process: start, spin, and an end that tells what was wrong in one line."""

from collections.abc import Callable, Sequence
import sys

from flat_planner_ros.core import FlatPlannerError
import rclpy
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node


def run(create: Callable[[], Node], args: Sequence[str] | None = None) -> int:
    """
    Spin a node until it is interrupted.

    Parameters
    ----------
    create
        Makes the node in the default context.
    args
        Command line; the process's own by default.

    Returns
    -------
    int
        Exit code: 0 after Ctrl-C, SIGTERM or a shutdown of the context, 1 if the node could not
        start with what it was given.

    """
    node = None
    try:
        # RuntimeError is what rcl raises for arguments and parameter files it cannot read.
        try:
            rclpy.init(args=args)
            node = create()
        except (FlatPlannerError, ParameterException, RuntimeError) as error:
            print(f'cannot start: {" ".join(str(error).split())}', file=sys.stderr)
            return 1
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0
