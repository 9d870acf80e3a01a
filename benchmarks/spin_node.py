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

"""Run one node under a given executor: spin_node.py NODE EXECUTOR [--ros-args ...]."""

from importlib import import_module
import sys

from processes import spin
import rclpy


def main() -> None:
    """Spin until the process is asked to end."""
    name, executor_name, *arguments = sys.argv[1:]
    rclpy.init(args=[sys.argv[0], *arguments])
    module = import_module(f'flat_planner_ros.ros.nodes.{name}_node')
    node = getattr(module, f'{name.capitalize()}Node')()
    spin(node, executor_name)


if __name__ == '__main__':
    main()
