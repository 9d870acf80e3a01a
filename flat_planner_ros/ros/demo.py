"""The planner, the plant and the monitor in one process, for a first look."""

from collections.abc import Sequence
import sys

from flat_planner_ros.ros.monitor_node import MonitorNode
from flat_planner_ros.ros.node_runner import run
from flat_planner_ros.ros.planner_node import PlannerNode
from flat_planner_ros.ros.plant_node import PlantNode


def main(args: Sequence[str] | None = None) -> int:
    """Run the three nodes."""
    return run([PlannerNode, PlantNode, MonitorNode], args)


if __name__ == '__main__':
    sys.exit(main())
