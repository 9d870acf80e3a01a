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

"""Messages to core types and back; the only place where one becomes the other."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeVar

from flat_planner_ros.core.arm import (
    Drive,
    FloatArray,
    InvalidCommand,
    InvalidRequest,
    sparse_rows,
)
from flat_planner_ros.core.monitor import joint_indices, PlannedMotion, Residual
from flat_planner_ros.core.planning import PlanSamples, Reason, RequestRejected
from flat_planner_ros.core.session import check_point_count, Goal, GoalPoint, Track
from flat_planner_ros.ros.wire import stamps
from flat_planner_ros.ros.wire.command_form import CommandForm, WHOLE
from flat_planner_ros.ros.wire.goal_reader import read_goal
from flat_planner_ros.ros.wire.point_reader import (
    FIELDS,
    joints_in_words,
    PointTable,
    read_points,
)
from flat_planner_ros.ros.wire.point_writer import trajectory_bytes
import numpy as np
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header
from trajectory_msgs.msg import JointTrajectory

if TYPE_CHECKING:
    from flat_planner_ros.core.plant import EffortProfile

Message = TypeVar('Message')

MAX_GOAL_BYTES = 100_000
"""Longest goal that is read; 51 points of seven joints take a tenth of it."""


def points_of(data: bytes) -> PointTable:
    """
    Return a serialised trajectory as tables.

    Raises
    ------
    InvalidRequest
        The bytes are no trajectory.

    """
    points = read_points(data)
    if points is not None:
        return points
    try:
        return points_of_message(deserialize_message(data, JointTrajectory))
    except RuntimeError as error:
        raise InvalidRequest(f'it cannot be read: {_first_line(error)}') from error


def points_of_message(msg: JointTrajectory) -> PointTable:
    """Return a trajectory as tables; arrays that do not fit the joints are told, not raised."""
    count, fields, misfits = len(msg.joint_names), {}, {}
    words = joints_in_words(count)
    for field in FIELDS:
        rows = [getattr(point, field) for point in msg.points]
        width = count if any(map(len, rows)) else 0
        odd = next((i for i, row in enumerate(rows) if len(row) != width), None)
        if odd is None:
            fields[field] = np.array(rows, dtype=float).reshape(len(rows), width)
        else:
            misfits[field] = f'point {odd} has {len(rows[odd])} {field} for {words}'
    times = [stamps.seconds(point.time_from_start) for point in msg.points]
    return PointTable(
        joint_names=tuple(msg.joint_names),
        stamp=stamps.seconds(msg.header.stamp),
        times=np.array(times, dtype=float),
        fields=fields,
        misfits=misfits,
    )


def goal_from_trajectory(data: bytes) -> Goal:
    """
    Return the goal that a serialised trajectory states, unchecked but for its length.

    Raises
    ------
    RequestRejected
        The bytes are no trajectory, or one with more bytes or points than any goal may have.

    """
    _check_length(data)
    goal = read_goal(data)
    if goal is not None:
        return goal
    msg = _goal_message(data, JointTrajectory)
    check_point_count(len(msg.points))
    return goal_of_trajectory(msg)


def goal_of_trajectory(msg: JointTrajectory) -> Goal:
    """Return the goal that a trajectory states, unchecked."""
    points = tuple(
        GoalPoint(
            time=stamps.seconds(point.time_from_start),
            positions=tuple(point.positions),
            velocities=tuple(point.velocities),
            accelerations=tuple(point.accelerations),
            effort=tuple(point.effort),
        )
        for point in msg.points
    )
    return Goal(joint_names=tuple(msg.joint_names), points=points, stamp=_stamp(msg))


def goal_from_joint_state(data: bytes) -> Goal:
    """
    Return the goal that a serialised joint state states: a final pose, the duration left open.

    Raises
    ------
    RequestRejected
        The bytes are no joint state, or one with more bytes than any goal may have.

    """
    _check_length(data)
    msg = _goal_message(data, JointState)
    point = GoalPoint(
        time=0.0,
        positions=tuple(msg.position),
        velocities=tuple(msg.velocity),
        effort=tuple(msg.effort),
    )
    return Goal(joint_names=tuple(msg.name), points=(point,), stamp=_stamp(msg))


def _check_length(data: bytes) -> None:
    """Refuse a serialised goal that is longer than any goal may be."""
    # A message with a hundred thousand points takes seconds to become Python objects; its length
    # tells beforehand that it is no goal.
    if len(data) > MAX_GOAL_BYTES:
        raise RequestRejected(
            Reason.INVALID_GOAL,
            f'the goal is {len(data)} bytes long, more than {MAX_GOAL_BYTES}',
            value=float(len(data)),
            limit=float(MAX_GOAL_BYTES),
        )


def _goal_message(data: bytes, message_type: type[Message]) -> Message:
    """Return a serialised goal as a message."""
    try:
        message: Message = deserialize_message(data, message_type)
    except RuntimeError as error:
        raise RequestRejected(
            Reason.INVALID_GOAL, f'the goal cannot be read: {_first_line(error)}'
        ) from error
    return message


def planned_motion_from_trajectory(msg: JointTrajectory) -> PlannedMotion:
    """Return the motion that a plan states; see `planned_motion`."""
    return planned_motion(points_of_message(msg))


def planned_motion(points: PointTable) -> PlannedMotion:
    """
    Return the motion that a plan states.

    Times are in seconds since the epoch, as stamped. That resolves 0.2 microseconds: it leaves the
    amplitude of an oscillation within 1e-7 of itself, and residuals during a motion within that
    time's travel, 1e-6 rad at 6 rad/s.

    Raises
    ------
    InvalidRequest
        The message is no complete, finite motion with an absolute start.

    """
    if not points.stamp:
        raise InvalidRequest('a plan needs the absolute time of its start in header.stamp')
    return PlannedMotion(
        joint_names=points.joint_names,
        start=points.stamp,
        times=points.times,
        positions=points.table('positions'),
        velocities=points.optional_table('velocities'),
        efforts=points.optional_table('effort'),
    )


def check_passive_joint(motion: PlannedMotion, joints: Sequence[str]) -> None:
    """
    Refuse a motion of an arm in which other joints are actuated than here.

    Parameters
    ----------
    motion
        As planned; a joint that is not known here is nobody's motor.
    joints
        The joints here, the passive one last.

    Raises
    ------
    InvalidRequest
        The passive joint of one is a motor of the other.

    """
    theirs = motion.joint_names
    for passive, motors in ((theirs[-1], joints[:-1]), (joints[-1], theirs[:-1])):
        if passive in motors:
            raise InvalidRequest(
                f'it is of another arm: its joints are {", ".join(theirs)}, here they are '
                f'{", ".join(joints)}, so that {passive} is passive on one side only'
            )


def effort_profile(
    points: PointTable, joints: Sequence[str], now: float, drive: Drive = Drive.EFFORT
) -> EffortProfile:
    """
    Return the command that a trajectory states.

    Parameters
    ----------
    points
        Joints in any order, the passive one with zero effort or left out; stamp 0 means now.
    joints
        The plant's joints, the passive one last.
    now
        Present time [s].
    drive
        What of it is played; positions need no efforts with them.

    Raises
    ------
    InvalidCommand
        The trajectory cannot be played as it stands.

    """
    # A plant alone needs it, and has loaded it.
    from flat_planner_ros.core.plant import EffortProfile

    names = list(points.joint_names)
    if sorted(names) not in (sorted(joints), sorted(joints[:-1])):
        raise InvalidCommand(f'joints are {names}, expected {list(joints)}')
    try:
        efforts = points.optional_table('effort')
        if efforts is None:
            needed = 'effort' if drive is Drive.EFFORT else 'positions'
            efforts = np.zeros(points.table(needed).shape)
        positions = points.optional_table('positions')
        velocities = points.optional_table('velocities')
        accelerations = points.optional_table('accelerations')
    except InvalidRequest as error:
        raise InvalidCommand(str(error)) from error
    if joints[-1] in names and efforts[:, names.index(joints[-1])].any():
        raise InvalidCommand(f'the passive joint {joints[-1]} cannot be given an effort')
    # What is not played is a part of the command all the same: with it, all of it is broken.
    for field, table in {
        'positions': positions,
        'velocities': velocities,
        'accelerations': accelerations,
    }.items():
        if table is not None and not np.isfinite(table).all():
            raise InvalidCommand(f'{field} must be finite')
    _refuse_other_passive_joint(names, joints, efforts, positions)
    actuated = joint_indices(names, joints[:-1])
    return EffortProfile(
        start=points.stamp or now,
        times=points.times,
        efforts=efforts[:, actuated],
        positions=None if positions is None else positions[:, actuated],
        velocities=None if velocities is None else velocities[:, actuated],
    )


def _refuse_other_passive_joint(
    names: Sequence[str], joints: Sequence[str], efforts: FloatArray, positions: FloatArray | None
) -> None:
    """Refuse a command that moves its last joint without an effort, where that is a motor here."""
    if positions is None or names[-1] not in joints[:-1] or not efforts.any():
        return
    if (positions[:, -1] != positions[:1, -1]).any() and not efforts[:, -1].any():
        raise InvalidCommand(
            f'the command is for another arm: its joints are {", ".join(names)}, the last one '
            f'passive (it moves without an effort), but here the joints are {", ".join(joints)}, '
            f'and {names[-1]} is a motor'
        )


def command_bytes(track: Track, joints: Sequence[str], form: CommandForm = WHOLE) -> bytes:
    """Return a command, serialised, as joint_trajectory_controller plays it."""
    count = len(joints) if form.include_passive_joint else len(joints) - 1
    columns = slice(count)
    nothing = slice(0)
    tables = [
        track.positions[:, columns],
        track.velocities[:, columns],
        track.accelerations[:, columns if form.include_acceleration else nothing],
        track.efforts[:, columns if form.include_effort else nothing],
    ]
    times = track.times
    if form.tolerance:
        rows = sparse_rows(times, tables[0], tables[1], form.tolerance)
        times, tables = times[rows], [table[rows] for table in tables]
    start = track.start if form.absolute_stamp else 0.0
    return trajectory_bytes(joints[:count], stamps.sec_and_nanosec(start), times, tables)


def flat_plan_bytes(track: Track) -> bytes:
    """Return the flat outputs of a command and the higher derivatives of y1, serialised."""
    flat = track.flat
    names = [f'y{k + 1}' for k in range(len(flat))] + ['y1_d3']
    tables = np.concatenate([flat[:, :3], flat[:1, 3:]]).transpose(1, 2, 0)
    return trajectory_bytes(names, stamps.sec_and_nanosec(track.start), track.times, [*tables])


def effort_msg(efforts: FloatArray) -> Float64MultiArray:
    """Return efforts of the actuated joints."""
    return Float64MultiArray(data=_doubles(efforts))


def reference_msg(samples: PlanSamples, joints: Sequence[str], now: float) -> JointState:
    """Return what is planned for the present time."""
    msg = JointState(name=list(joints))
    msg.header.stamp = stamps.time_msg(now)
    msg.position, msg.velocity = _doubles(samples.positions[0]), _doubles(samples.velocities[0])
    msg.effort = _doubles(samples.efforts[0])
    return msg


def residual_msg(header: Header, joints: Sequence[str], residual: Residual) -> JointState:
    """Return deviations of positions and, where measured, velocities, stamped as measured."""
    msg = JointState(header=header, name=joints, position=_doubles(residual.positions))
    if residual.velocities is not None:
        msg.velocity = _doubles(residual.velocities)
    return msg


def _doubles(values: FloatArray) -> array[float]:
    """Return what a float64[] field takes without looking at every number."""
    return array('d', np.ascontiguousarray(values, dtype=float).tobytes())


def _stamp(msg: JointTrajectory | JointState) -> float | None:
    """Return the absolute time of a header, None for the stamp 0."""
    return stamps.seconds(msg.header.stamp) or None


def _first_line(error: Exception) -> str:
    """Return what an error says, in one line."""
    return str(error).partition('\n')[0]
