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

"""Joint states and times in serialised form against those that the middleware writes."""

import struct

from builtin_interfaces.msg import Time
from flat_planner_ros.ros.wire.joint_state_writer import clock_bytes, JointStateWriter
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

names = st.text(
    st.characters(blacklist_categories=['Cs'], blacklist_characters='\0'), min_size=1, max_size=20
)
seconds = st.integers(-(2**31), 2**31 - 1)
nanoseconds = st.integers(0, 2**32 - 1)


@settings(max_examples=200, deadline=None, derandomize=True, database=None)
@given(st.data(), st.lists(names, min_size=1, max_size=7), seconds, nanoseconds)
def test_joint_states_are_what_the_middleware_writes(data, joints, sec, nanosec):
    numbers = st.lists(st.floats(allow_nan=False), min_size=len(joints), max_size=len(joints))
    position, velocity, effort = (data.draw(numbers) for _ in range(3))
    written = JointStateWriter(joints).message(
        (sec, nanosec), np.array(position), np.array(velocity), np.array(effort)
    )
    same = JointState(
        header=Header(stamp=Time(sec=sec, nanosec=nanosec)),
        name=joints,
        position=position,
        velocity=velocity,
        effort=effort,
    )
    assert deserialize_message(written, JointState) == same
    # Bytes for alignment mean nothing, and the middleware leaves in them what was there.
    assert len(written) == len(serialize_message(same))


@settings(max_examples=50, deadline=None, derandomize=True, database=None)
@given(seconds, nanoseconds)
def test_times_are_what_the_middleware_writes(sec, nanosec):
    same = Clock(clock=Time(sec=sec, nanosec=nanosec))
    written = clock_bytes((sec, nanosec))
    assert deserialize_message(written, Clock) == same
    assert written == serialize_message(same)


def test_arrays_of_another_length_are_no_joint_state():
    writer, pair, single = JointStateWriter(['a', 'b']), np.zeros(2), np.zeros(1)
    with pytest.raises(struct.error, match='pack expected'):
        writer.message((1, 0), pair, single, pair)
