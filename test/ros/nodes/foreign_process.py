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
Somebody's process with all three nodes in one executor of rclpy.

Usage: foreign_process.py EXECUTOR, the name of a class in rclpy.executors.
"""

import sys

from flat_planner_ros.ros.nodes.monitor_node import MonitorNode
from flat_planner_ros.ros.nodes.planner_node import PlannerNode
from flat_planner_ros.ros.nodes.plant_node import PlantNode
import rclpy
from rclpy import executors
from rclpy.parameter import Parameter


def main(name):
    """Spin until killed."""
    rclpy.init(args=sys.argv)
    executor = getattr(executors, name)()
    delayed = [Parameter('start_delay', value=0.5)]
    executor.add_node(PlannerNode(parameter_overrides=delayed))
    for node_class in (PlantNode, MonitorNode):
        executor.add_node(node_class())
    executor.spin()


if __name__ == '__main__':
    main(sys.argv[1])
