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
A node of rclpy that answers each goal with a command and a verdict, and plans nothing.

The least that an answer takes: the same executor, topics, qualities of service and sizes as the
planner's. It hears the joint states as the planner has to. The answers are made beforehand, or for
each goal, which it then reads, from ready arrays: as rclpy's messages, or as bytes in the
package's way.
"""

from array import array
from collections.abc import Callable, Iterator
import sys
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from flat_planner_ros.ros.wire import conversions, interfaces, stamps
from flat_planner_ros.ros.wire.point_writer import trajectory_bytes
from flat_planner_ros.ros.wire.status_writer import array_bytes, Pair, Status
import numpy as np
from processes import AS_BYTES, AS_MESSAGES, EVENTS, spin
import rclpy
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

POINTS, PERIOD = 201, 0.0025
"""Of the command, and their spacing [s], as in `goal_stream`."""

JOINTS = ('joint1', 'joint2')
"""Of the plant."""

TIMES, TABLE = PERIOD * np.arange(POINTS), np.zeros((POINTS, len(JOINTS)))
"""Of the points, and each of their four fields: the arm stays where it is."""

VALUES = 34
"""Values of a verdict."""

WORDS = 'ACCEPTED: ' + 'words ' * 20
"""Of a verdict."""

KEYS = [f'some.quantity.{k}' for k in range(VALUES)]
"""Of these values."""

Answers = Iterator[Any]
"""A command, and once it is sent a verdict."""


def command() -> JointTrajectory:
    """Return a command that leaves the arm where it is."""
    rows = [array('d', row.tobytes()) for row in TABLE]
    points = [
        JointTrajectoryPoint(
            positions=row,
            velocities=row,
            accelerations=row,
            effort=row,
            time_from_start=stamps.duration_msg(time),
        )
        for row, time in zip(rows, TIMES.tolist(), strict=True)
    ]
    return JointTrajectory(joint_names=JOINTS, points=points)


def verdict() -> DiagnosticArray:
    """Return a verdict."""
    values = [KeyValue(key=key, value=value) for key, value in pairs()]
    return DiagnosticArray(status=[DiagnosticStatus(name='goal', message=WORDS, values=values)])


def pairs() -> list[Pair]:
    """Return the values of a verdict."""
    return [Pair(key, f'{k + 0.123456789:.9f}') for k, key in enumerate(KEYS)]


def as_messages(data: bytes) -> Answers:
    """Answer a serialised goal with messages."""
    deserialize_message(data, JointTrajectory)
    yield command()
    yield verdict()


def as_bytes(data: bytes) -> Answers:
    """Answer a serialised goal with bytes."""
    conversions.goal_from_trajectory(data)
    yield trajectory_bytes(JOINTS, (0, 0), TIMES, 4 * [TABLE])
    status = Status(level=DiagnosticStatus.OK, name='goal', message=WORDS, values=pairs())
    yield array_bytes(status, (0, 0))


def beforehand() -> Callable[[bytes], Answers]:
    """Return what has the answers."""
    answers = serialize_message(command()), serialize_message(verdict())
    return lambda _: iter(answers)


def main() -> None:
    """Spin until the process is asked to end."""
    ways = {AS_MESSAGES: as_messages, AS_BYTES: as_bytes}
    answers_to = ways.get(sys.argv[1]) or beforehand()
    rclpy.init(signal_handler_options=SignalHandlerOptions.ALL)
    node = Node(interfaces.PLANNER)
    commands = node.create_publisher(JointTrajectory, interfaces.COMMAND, interfaces.RELIABLE)
    verdicts = node.create_publisher(DiagnosticArray, interfaces.STATUS, interfaces.VERDICTS)

    def answer(data: bytes) -> None:
        for publisher, message in zip((commands, verdicts), answers_to(data), strict=True):
            publisher.publish(message)

    node.create_subscription(JointTrajectory, interfaces.GOAL, answer, interfaces.BURST, raw=True)
    node.create_subscription(
        JointState, interfaces.JOINT_STATES, lambda _: None, interfaces.SENSOR_DATA
    )
    spin(node, EVENTS)


if __name__ == '__main__':
    main()
