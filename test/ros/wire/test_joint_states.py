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

"""Joint states as drivers send them: in parts, without stamps."""

from math import pi

from flat_planner_ros.core.arm import InvalidRequest, JointStateRules
from flat_planner_ros.ros.wire import stamps
from flat_planner_ros.ros.wire.joint_states import JointStateReader
import numpy as np
import pytest
from sensor_msgs.msg import JointState

JOINTS = ('joint1', 'joint2')


def message(time, **positions):
    """Return a joint state with a stamp; nothing is known of velocities and efforts."""
    msg = JointState(name=list(positions), position=list(positions.values()))
    msg.header.stamp = stamps.time_msg(time)
    return msg


def read(reader, *messages, arrival=0.0):
    """Return the times and positions of the samples that messages give."""
    samples = [s for msg in messages for s in reader.read(msg, lambda: arrival)]
    return [(s.time, s.positions.tolist()) for s in samples]


def test_a_joint_state_without_a_stamp_is_of_its_arrival():
    reader = JointStateReader(JOINTS)
    assert read(reader, message(0.0, joint1=1.0, joint2=2.0), arrival=7.0) == [(7.0, [1.0, 2.0])]
    assert reader.take_remarks() == [
        'joint states have no stamp: the time of their arrival is taken'
    ]
    assert read(reader, message(0.0, joint1=1.0, joint2=2.0), arrival=8.0) == [(8.0, [1.0, 2.0])]
    assert read(reader, message(9.0, joint1=1.0, joint2=2.0), arrival=8.0) == [(9.0, [1.0, 2.0])]
    assert not reader.take_remarks()


def test_parts_are_merged_by_name_whatever_else_is_in_them():
    reader = JointStateReader(JOINTS)
    wheel = message(1.0, wheel=9.0, joint2=0.5)
    assert not read(reader, wheel)
    assert reader.is_in_parts
    assert reader.lack == 'joint1 has not been heard on joint_states; heard: joint2'
    assert read(reader, message(0.99, joint1=1.0), message(1.01, joint1=3.0)) == [
        (1.0, [2.0, 0.5])
    ]
    assert reader.lack == ''
    assert reader.take_remarks() == [
        'joint states come in parts (joint2 by itself): they are merged within '
        'joint_states.tolerance 0.05 s',
        'joint states come in parts (joint1 by itself): they are merged within '
        'joint_states.tolerance 0.05 s',
    ]


def test_parts_beside_whole_messages_are_refused_as_long_as_these_come():
    reader = JointStateReader(JOINTS)
    assert not read(reader, message(1.0, joint2=0.5))
    assert read(reader, message(1.0, joint2=4.0, joint1=3.0)) == [(1.0, [3.0, 4.0])]
    assert not reader.is_in_parts
    with pytest.raises(InvalidRequest, match='no joint joint1 among joint2'):
        read(reader, message(1.5, joint2=0.5))
    assert read(reader, message(2.5, joint2=0.5), message(2.5, joint1=1.5)) == [(2.5, [1.5, 0.5])]


def test_whole_messages_are_read_without_a_copy():
    msg = message(1.0, joint1=1.0, joint2=2.0)
    (sample,) = JointStateReader(JOINTS).read(msg, lambda: 0.0)
    assert np.shares_memory(sample.positions, np.frombuffer(msg.position))


def test_turns_of_a_wrapped_joint_are_counted_in_whole_messages_and_in_parts():
    reader = JointStateReader(JOINTS)
    whole = [message(1.0 + 0.01 * k, joint2=0.0, joint1=q) for k, q in enumerate((3.1, -3.1))]
    assert read(reader, *whole)[1] == (1.01, [2 * pi - 3.1, 0.0])
    (remark,) = reader.take_remarks()
    assert remark.startswith('joint1 is wrapped to +-pi in joint states: its turns are counted')
    reader = JointStateReader(JOINTS)
    parts = [message(1.0 + 0.01 * k, joint1=q) for k, q in enumerate((3.1, -3.1))]
    assert read(reader, *parts, message(1.01, joint2=0.0)) == [(1.01, [2 * pi - 3.1, 0.0])]
    reader = JointStateReader(JOINTS, JointStateRules(unwrap=False))
    assert read(reader, *whole)[1] == (1.01, [-3.1, 0.0])


def test_a_plan_tells_the_turns_of_before():
    reader = JointStateReader(JOINTS)
    reader.align(np.array([2 * pi + 1.0, 0.0]))
    assert read(reader, message(1.0, joint1=1.0, joint2=0.0)) == [(1.0, [2 * pi + 1.0, 0.0])]
    assert len(reader.take_remarks()) == 1
    reader.align(np.array([1.0, 0.0]))
    assert read(reader, message(1.01, joint1=1.0, joint2=0.0)) == [(1.01, [1.0, 0.0])]


def test_many_lists_of_names_are_no_matter():
    reader = JointStateReader(JOINTS)
    for index in range(100):
        read(reader, message(1.0 + index, joint1=float(index), **{f'wheel{index}': 0.0}))
    assert len(reader.take_remarks()) == 1
