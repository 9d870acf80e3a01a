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

"""The planner, the plant and the monitor in one process, for a first look."""

from collections.abc import Sequence
import os
import sys

from flat_planner_ros.ros.dds_profile import profile_environment
from flat_planner_ros.ros.nodes.monitor_node import MonitorNode
from flat_planner_ros.ros.nodes.node_runner import run
from flat_planner_ros.ros.nodes.planner_node import PlannerNode
from flat_planner_ros.ros.nodes.plant_node import PlantNode


def main(args: Sequence[str] | None = None) -> int:
    """Run the three nodes."""
    os.environ.update(profile_environment(os.environ))
    return run([PlannerNode, PlantNode, MonitorNode], args)


if __name__ == '__main__':
    sys.exit(main())
