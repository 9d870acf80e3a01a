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

"""Serialised joint states as a table: what the middleware reads, or nothing."""

from array import array

from flat_planner_ros.ros.wire import stamps
from flat_planner_ros.ros.wire.state_table import read_states
import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState


def messages(names=('joint1', 'joint2'), velocities=True, efforts=True, frame='', count=20):
    """Return random joint states."""
    random = np.random.default_rng(3)
    made = []
    for _ in range(count):
        msg = JointState(name=list(names), position=array('d', random.random(len(names))))
        msg.header.stamp = stamps.time_msg(1.7e9 * float(random.random()))
        msg.header.frame_id = frame
        if velocities:
            msg.velocity = array('d', random.random(len(names)))
        if efforts:
            msg.effort = array('d', [np.nan, *random.random(len(names) - 1)])
        made.append(msg)
    return made


@pytest.mark.parametrize('frame', ['', 'a', 'base', 'seventeen_letters'])
@pytest.mark.parametrize('velocities', [True, False])
@pytest.mark.parametrize('efforts', [True, False])
@pytest.mark.parametrize('names', [('a', 'bc'), ('joint1', 'joint2', 'j')])
def test_a_table_has_what_the_middleware_reads(names, velocities, efforts, frame):
    data = [serialize_message(msg) for msg in messages(names, velocities, efforts, frame)]
    table = read_states(data)
    for row, message in enumerate(data):
        msg, sample = deserialize_message(message, JointState), table.samples.sample(row)
        assert table.names == msg.name
        assert sample.time == stamps.seconds(msg.header.stamp)
        np.testing.assert_array_equal(sample.positions, msg.position)
        for found, expected in ((sample.velocities, msg.velocity), (sample.efforts, msg.effort)):
            assert (found is not None) == bool(expected)
            if expected:
                np.testing.assert_array_equal(found, expected)


def test_padding_may_be_anything():
    data = [bytearray(serialize_message(msg)) for msg in messages(frame='a')]
    expected = read_states([bytes(message) for message in data])
    for number, message in enumerate(data):
        # After the encapsulation, the stamp, the length of a string and "a" with its zero.
        message[4 + 8 + 4 + 2 : 4 + 8 + 4 + 4] = bytes([number, 255 - number])
    found = read_states([bytes(message) for message in data])
    assert found.names == expected.names
    np.testing.assert_array_equal(found.samples.positions, expected.samples.positions)
    np.testing.assert_array_equal(found.samples.times, expected.samples.times)


def test_what_is_not_alike_is_left_to_the_middleware():
    alike = [serialize_message(msg) for msg in messages()]
    assert read_states(alike) is not None
    other = [serialize_message(msg) for msg in messages(names=('joint1', 'joint3'))]
    assert read_states([*alike, other[0]]) is None
    unstamped = serialize_message(JointState(name=['a'], position=[1.0]))
    assert read_states([unstamped]) is None
    misfit = JointState(name=['a', 'b'], position=[1.0])
    misfit.header.stamp.sec = 1
    assert read_states([serialize_message(misfit)]) is None
    for size in range(len(alike[0])):
        assert read_states([alike[0][:size]] * 2) is None
