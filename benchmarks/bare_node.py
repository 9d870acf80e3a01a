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
A node of rclpy that answers one service and does nothing else: the least that a start takes.

It has topics of the planner's types, as loading them is a part of that.
"""

from diagnostic_msgs.msg import DiagnosticStatus
from processes import BARE_ANSWER, EVENTS, spin
import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

DEPTH = 10
"""Messages that a topic keeps [-]."""


def _answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
    """Say something."""
    response.message = 'here'
    return response


def main() -> None:
    """Spin until the process is asked to end."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.ALL)
    node = Node('bare')
    for kind in (DiagnosticStatus, Float64MultiArray, JointTrajectory):
        node.create_publisher(kind, f'~/{kind.__name__.lower()}', DEPTH)
    node.create_subscription(JointState, '~/jointstate', lambda _: None, DEPTH)
    node.create_service(Trigger, BARE_ANSWER, _answer)
    spin(node, EVENTS)


if __name__ == '__main__':
    main()
