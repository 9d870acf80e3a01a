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

"""Trajectories read as tables against those that the middleware reads as messages."""

import struct

from builtin_interfaces.msg import Duration, Time
from flat_planner_ros.core import FlatPlannerError
from flat_planner_ros.core.arm import InvalidCommand, InvalidRequest
from flat_planner_ros.core.planning import RequestRejected
from flat_planner_ros.ros.wire import conversions
from flat_planner_ros.ros.wire.goal_reader import read_goal
from flat_planner_ros.ros.wire.point_reader import FIELDS, read_points
from flat_planner_ros.ros.wire.point_writer import trajectory_bytes
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

int32 = st.integers(-(2**31), 2**31 - 1)
uint32 = st.integers(0, 2**32 - 1)
names = st.text(st.characters(blacklist_categories=['Cs'], blacklist_characters='\0'), max_size=9)
numbers = st.floats()


@st.composite
def messages(draw):
    """Return a trajectory whose points are mostly alike."""
    joints = draw(st.lists(names, max_size=4))
    widths = [
        draw(st.one_of(st.sampled_from([0, len(joints)]), st.integers(0, 4))) for _ in FIELDS
    ]
    is_ragged = draw(st.sampled_from([False, False, True]))
    points = []
    for _ in range(draw(st.integers(0, 5))):
        point = JointTrajectoryPoint(
            time_from_start=Duration(sec=draw(int32), nanosec=draw(uint32))
        )
        for field, usual in zip(FIELDS, widths, strict=True):
            width = draw(st.integers(0, 4)) if is_ragged else usual
            setattr(point, field, draw(st.lists(numbers, min_size=width, max_size=width)))
        points.append(point)
    stamp = Time(sec=draw(int32), nanosec=draw(uint32))
    header = Header(stamp=stamp, frame_id=draw(names))
    return JointTrajectory(header=header, joint_names=joints, points=points)


def big_endian(msg: JointTrajectory) -> bytes:
    """Return a message as a machine of the other byte order writes it."""
    out = bytearray()

    def put(kind: str, *values: float) -> None:
        size = struct.calcsize('>' + kind)
        out.extend(bytes(-len(out) % size))
        out.extend(struct.pack(f'>{len(values)}{kind}', *values))

    def put_text(text: str) -> None:
        put('I', len(text.encode()) + 1)
        out.extend(text.encode() + b'\0')

    put('i', msg.header.stamp.sec)
    put('I', msg.header.stamp.nanosec)
    put_text(msg.header.frame_id)
    put('I', len(msg.joint_names))
    for name in msg.joint_names:
        put_text(name)
    put('I', len(msg.points))
    for point in msg.points:
        for field in FIELDS:
            values = getattr(point, field)
            put('I', len(values))
            if values:
                put('d', *values)
        put('i', point.time_from_start.sec)
        put('I', point.time_from_start.nanosec)
    return bytes(4) + bytes(out)


def outcome(read, *args):
    """Return what comes of a reading, comparable: bits of numbers, or the refusal."""
    try:
        found = read(*args)
    except FlatPlannerError as error:
        return str(error)
    return {
        name: value.tobytes() if isinstance(value, np.ndarray) else value
        for name, value in vars(found).items()
    }


def assert_same(points, expected):
    """Check that both readings are the same to whoever uses them."""
    assert points.joint_names == expected.joint_names
    assert points.stamp == expected.stamp
    assert points.times.tobytes() == expected.times.tobytes()
    plants = [[*expected.joint_names, 'passive'], ['a'], list(expected.joint_names)]
    for joints in filter(None, plants):
        assert outcome(conversions.effort_profile, points, joints, 5.0) == outcome(
            conversions.effort_profile, expected, joints, 5.0
        )
    assert outcome(conversions.planned_motion, points) == outcome(
        conversions.planned_motion, expected
    )
    for field in FIELDS:
        if field not in expected.misfits:
            assert points.fields[field].tobytes() == expected.fields[field].tobytes()


@settings(max_examples=200, deadline=None, derandomize=True, database=None)
@given(messages())
def test_what_is_read_is_what_the_middleware_reads(msg):
    for data in (serialize_message(msg), big_endian(msg)):
        expected = conversions.points_of_message(deserialize_message(data, JointTrajectory))
        assert_same(conversions.points_of(data), expected)
        lengths = {tuple(len(getattr(point, field)) for field in FIELDS) for point in msg.points}
        assert (read_points(data) is not None) == (len(lengths) == 1)


@settings(max_examples=200, deadline=None, derandomize=True, database=None)
@given(messages())
def test_a_goal_is_what_the_middleware_reads(msg):
    for data in (serialize_message(msg), big_endian(msg)):
        expected = conversions.goal_of_trajectory(deserialize_message(data, JointTrajectory))
        # As text: a number that is none equals nothing.
        assert repr(read_goal(data)) == repr(expected)


def usable(points=3):
    """Return a message that can be played."""
    values = np.linspace(0.0, 1.0, points).tolist()
    zeros = [0.0, 0.0]
    return JointTrajectory(
        header=Header(stamp=Time(sec=7)),
        joint_names=['joint1', 'gelenk_ä'],
        points=[
            JointTrajectoryPoint(
                positions=[x, -x],
                velocities=zeros,
                accelerations=zeros,
                effort=[x, 0.0],
                time_from_start=Duration(sec=k),
            )
            for k, x in enumerate(values)
        ],
    )


def test_a_usable_message_is_read_without_the_middleware():
    for count in (1, 2, 50):
        msg = usable(count)
        points = read_points(serialize_message(msg))
        assert_same(points, conversions.points_of_message(msg))
        motion = conversions.planned_motion(points)
        assert motion.positions.tolist() == [list(p.positions) for p in msg.points]
        profile = conversions.effort_profile(points, msg.joint_names, 0.0)
        assert profile.efforts[:, 0].tolist() == [p.effort[0] for p in msg.points]


@pytest.mark.parametrize('fields', range(5))
def test_what_the_writer_writes_is_read(fields):
    rng = np.random.default_rng(fields)
    tables = [rng.standard_normal((30, 3)) for _ in range(fields)]
    times = np.arange(30.0)
    points = read_points(trajectory_bytes(['a', 'b', 'c'], (3, 5), times, tables))
    assert points.joint_names == ('a', 'b', 'c')
    assert points.times.tolist() == times.tolist()
    for name, table in zip(FIELDS, tables, strict=False):
        assert (points.fields[name] == table).all()


def test_a_message_is_never_read_beyond_its_end():
    data = trajectory_bytes(['a', 'b'], (3, 5), np.arange(4.0), 4 * [np.ones((4, 2))])
    assert read_points(data) is not None
    assert read_goal(data) is not None
    for end in range(len(data)):
        assert read_points(data[:end]) is None
        assert read_goal(data[:end]) is None


@settings(max_examples=500, deadline=None, derandomize=True, database=None)
@given(
    st.sampled_from(
        [serialize_message(usable()), big_endian(usable()), serialize_message(JointTrajectory())]
    ),
    st.lists(st.tuples(st.integers(0, 10**4), st.integers(0, 255)), max_size=4),
    st.integers(0, 10**4),
)
def test_corrupted_bytes_are_read_alike_or_refused_in_one_sentence(data, changes, cut):
    corrupt = bytearray(data)
    for place, value in changes:
        corrupt[place % len(data)] = value
    corrupt = bytes(corrupt[: cut if cut < len(data) else None])
    try:
        expected = deserialize_message(corrupt, JointTrajectory)
    except RuntimeError:
        with pytest.raises(InvalidRequest, match=r'^it cannot be read: [^\n]+$'):
            conversions.points_of(corrupt)
        with pytest.raises(RequestRejected, match=r'^the goal cannot be read: [^\n]+$'):
            conversions.goal_from_trajectory(corrupt)
    else:
        points = conversions.points_of(corrupt)
        assert_same(points, conversions.points_of_message(expected))
        goal = read_goal(corrupt)
        assert goal is None or repr(goal) == repr(conversions.goal_of_trajectory(expected))


@settings(max_examples=200, deadline=None, derandomize=True, database=None)
@given(st.binary(max_size=200))
def test_random_bytes_never_crash(data):
    try:
        expected = deserialize_message(data, JointTrajectory)
    except RuntimeError:
        with pytest.raises(InvalidRequest, match='cannot be read'):
            conversions.points_of(data)
    else:
        assert_same(conversions.points_of(data), conversions.points_of_message(expected))


def command(names, *, moves=True, effort=(1.0, 0.0)):
    """Return a command of two points as tables."""
    points = [
        JointTrajectoryPoint(
            time_from_start=Duration(sec=second),
            positions=[0.0, 0.1 * second * moves],
            effort=[(1 - second) * value for value in effort],
        )
        for second in range(2)
    ]
    return conversions.points_of_message(JointTrajectory(joint_names=names, points=points))


def test_a_command_of_another_passive_joint_is_refused_with_both_lists():
    arm = ['joint1', 'joint2', 'joint3']
    with pytest.raises(InvalidCommand) as caught:
        conversions.effort_profile(command(arm[:2]), arm, 5.0)
    assert 'its joints are joint1, joint2,' in str(caught.value)
    assert 'here the joints are joint1, joint2, joint3' in str(caught.value)
    # A motor that is given an effort, or stands still, is none.
    conversions.effort_profile(command(arm[:2], effort=(1.0, 0.5)), arm, 5.0)
    conversions.effort_profile(command(arm[:2], moves=False), arm, 5.0)
    conversions.effort_profile(command(arm[:2]), arm[:2], 5.0)


def test_a_plan_of_another_passive_joint_is_refused_with_both_lists():
    arm = ['joint1', 'joint2', 'joint3']

    def planned(names):
        still = JointTrajectoryPoint(positions=[0.0] * len(names), velocities=[0.0] * len(names))
        end = JointTrajectoryPoint(
            time_from_start=Duration(sec=1),
            positions=[1.0] * len(names),
            velocities=[0.0] * len(names),
        )
        msg = JointTrajectory(joint_names=names, points=[still, end])
        msg.header.stamp.sec = 5
        return conversions.planned_motion_from_trajectory(msg)

    for there, here in ((arm[:2], arm), (arm, arm[:2])):
        with pytest.raises(InvalidRequest, match='joint2 is passive on one side only'):
            conversions.check_passive_joint(planned(there), here)
    conversions.check_passive_joint(planned(arm), arm)
    conversions.check_passive_joint(planned(['a', 'b']), arm)
