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

"""Serialised trajectories against those that the middleware makes of messages."""

from flat_planner_ros.ros.wire.point_writer import trajectory_bytes
from flat_planner_ros.ros.wire.stamps import duration_msg, time_msg
import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

FIELDS = ('positions', 'velocities', 'accelerations', 'effort')


def message(names, stamp, times, tables):
    """Return the trajectory as a message, entry by entry."""
    msg = JointTrajectory(joint_names=names)
    msg.header.stamp = stamp
    for i, time in enumerate(times.tolist()):
        values = {f: table[i].tolist() for f, table in zip(FIELDS, tables, strict=False)}
        msg.points.append(JointTrajectoryPoint(time_from_start=duration_msg(time), **values))
    return msg


@pytest.mark.parametrize('columns', [1, 2, 3, 7])
@pytest.mark.parametrize('points', [1, 2, 3, 50])
@pytest.mark.parametrize('fields', range(5))
@pytest.mark.parametrize('name', ['a', 'ab', 'abc', 'joint', 'gelenk_ä'])
def test_the_middleware_reads_what_it_would_have_written(name, fields, points, columns):
    rng = np.random.default_rng(points)
    names = [f'{name}{k}' for k in range(columns)]
    times = np.cumsum(rng.random(points))
    tables = [rng.standard_normal((points, columns)) for _ in range(fields)]
    stamp = time_msg(1.7e9 + 0.3)
    expected = message(names, stamp, times, tables)
    written = trajectory_bytes(names, (stamp.sec, stamp.nanosec), times, tables)
    assert deserialize_message(written, JointTrajectory) == expected
    # The middleware may leave room at the end, and leaves padding undefined.
    assert len(written) <= len(serialize_message(expected))
    assert written[:4] == serialize_message(expected)[:4]


def test_nothing_of_an_earlier_trajectory_is_left_in_one_of_the_same_form():
    names, times = ['a', 'b'], np.array([0.0, 0.5, 1.0])
    for number in range(3):
        tables = [np.full((3, 2), number + 0.1 * field) for field in range(3)]
        stamp = time_msg(1e8 * number + 0.3)
        written = trajectory_bytes(names, (stamp.sec, stamp.nanosec), times, tables)
        expected = message(names, stamp, times, tables)
        assert deserialize_message(written, JointTrajectory) == expected


def test_times_are_rounded_as_in_messages():
    times = np.array([0.0, 0.9999999994, 0.9999999996, 1.0000000005, 12345.678901234])
    written = trajectory_bytes(['a'], (0, 0), times, [])
    points = deserialize_message(written, JointTrajectory).points
    assert [point.time_from_start for point in points] == [duration_msg(t) for t in times.tolist()]
