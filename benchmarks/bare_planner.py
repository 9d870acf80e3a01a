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
A node of rclpy that answers each goal with a command and a verdict made beforehand.

The least that an answer takes: the same executor, topics, qualities of service and sizes as the
planner's, and no work in between. It hears the joint states as the planner has to.
"""

from array import array

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from flat_planner_ros.ros.wire import interfaces, stamps
from processes import EVENTS, spin
import rclpy
from rclpy.node import Node
from rclpy.serialization import serialize_message
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

POINTS, PERIOD = 201, 0.0025
"""Of the command, and their spacing [s], as in `goal_stream`."""

JOINTS = ('joint1', 'joint2')
"""Of the plant."""

VALUES = 34
"""Values of a verdict."""


def command() -> bytes:
    """Return a command that leaves the arm where it is, serialised."""
    nothing = array('d', bytes(8 * len(JOINTS)))
    points = [
        JointTrajectoryPoint(
            positions=nothing,
            velocities=nothing,
            accelerations=nothing,
            effort=nothing,
            time_from_start=stamps.duration_msg(number * PERIOD),
        )
        for number in range(POINTS)
    ]
    return serialize_message(JointTrajectory(joint_names=JOINTS, points=points))


def verdict() -> bytes:
    """Return a verdict, serialised."""
    values = [
        KeyValue(key=f'some.quantity.{k}', value=f'{k + 0.123456789:.9f}') for k in range(VALUES)
    ]
    status = DiagnosticStatus(name='goal', message='ACCEPTED: ' + 'words ' * 20, values=values)
    return serialize_message(DiagnosticArray(status=[status]))


def main() -> None:
    """Spin until the process is asked to end."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.ALL)
    node = Node(interfaces.PLANNER)
    commands = node.create_publisher(JointTrajectory, interfaces.COMMAND, interfaces.RELIABLE)
    verdicts = node.create_publisher(DiagnosticArray, interfaces.STATUS, interfaces.VERDICTS)
    answers = command(), verdict()

    def answer(_: bytes) -> None:
        commands.publish(answers[0])
        verdicts.publish(answers[1])

    node.create_subscription(JointTrajectory, interfaces.GOAL, answer, interfaces.BURST, raw=True)
    node.create_subscription(
        JointState, interfaces.JOINT_STATES, lambda _: None, interfaces.SENSOR_DATA
    )
    spin(node, EVENTS)


if __name__ == '__main__':
    main()
