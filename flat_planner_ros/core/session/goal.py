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

"""Goals as users send them, and the rules that an admissible one obeys (docs/interfaces.md)."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isfinite

from flat_planner_ros.core.planning import Reason, RequestRejected

MAX_ANGLE = 1e6
"""Largest joint angle of a goal [rad]: beyond, a motion drowns in the rounding of its position."""

MAX_POINTS = 51
"""Most points of a goal: 50 via points and the final one."""

MAX_NAME = 64
"""Characters of a foreign name that a message repeats."""


@dataclass(frozen=True, kw_only=True)
class GoalPoint:
    """
    One point of a goal; entries follow the goal's joint names.

    Attributes
    ----------
    time
        From the start of the motion [s]; 0 when the planner is to choose.
    positions, velocities, accelerations, effort
        [rad, rad/s, rad/s^2, N m]; empty where not given.

    """

    time: float
    positions: tuple[float, ...]
    velocities: tuple[float, ...] = ()
    accelerations: tuple[float, ...] = ()
    effort: tuple[float, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Goal:
    """
    A request as received, not yet checked.

    Attributes
    ----------
    joint_names
        In any order.
    points
        Via points and, last, the final pose at rest.
    stamp
        Absolute time of the start [s]; None for as soon as possible.
    start
        Where the actuated joints are at the start, as the sender believes, in kinematic order
        [rad]; None where nothing is said. Only a checked goal has it: a first point at time 0.
    remarks
        Clauses on what was changed about it.

    """

    joint_names: tuple[str, ...]
    points: tuple[GoalPoint, ...]
    stamp: float | None = None
    start: tuple[float, ...] | None = None
    remarks: tuple[str, ...] = ()

    @property
    def begins_with_start(self) -> bool:
        """Tell whether the first point is the start: at time 0, and later ones have times."""
        if len(self.points) < 2 or self.points[0].time != 0.0:
            return False
        return any(point.time for point in self.points)

    @property
    def without_start(self) -> 'Goal':
        """Return the goal without a first point that is the start."""
        return replace(self, points=self.points[1:]) if self.begins_with_start else self

    @property
    def duration(self) -> float | None:
        """Prescribed time of the whole motion [s]; None when the planner is to choose."""
        return self.points[-1].time or None


def checked_goal(goal: Goal, joints: Sequence[str]) -> Goal:
    """
    Return a goal that obeys every rule, by all joints in kinematic order.

    A first point at time 0 before points with times is the start, as motion planners send it: it
    becomes the goal's `start`, and no rule is about its derivatives or its passive joint.

    Parameters
    ----------
    goal
        The request.
    joints
        The arm's joints in kinematic order, the passive one last.

    Raises
    ------
    RequestRejected
        The first rule that the goal breaks, with joint, value and limit.

    """
    _check_joints(goal, joints)
    for index, point in enumerate(goal.points):
        _check_point(goal, index, point)
    asked = goal.without_start
    _check_times(goal)
    for point in asked.points:
        _check_derivatives(asked, point)
    points = tuple(
        GoalPoint(time=point.time, positions=_angles(asked, point, joints))
        for point in asked.points
    )
    start = None
    if goal.begins_with_start:
        said = dict(zip(goal.joint_names, goal.points[0].positions, strict=True))
        start = tuple(said[name] for name in joints[:-1])
    return Goal(
        joint_names=tuple(joints),
        points=points,
        stamp=goal.stamp,
        start=start,
        remarks=goal.remarks,
    )


def check_point_count(count: int) -> None:
    """Refuse more points than any goal may have."""
    if count > MAX_POINTS:
        raise RequestRejected(
            Reason.INVALID_GOAL,
            f'the goal has {count} points, more than {MAX_POINTS}',
            value=float(count),
            limit=float(MAX_POINTS),
        )


def _check_joints(goal: Goal, joints: Sequence[str]) -> None:
    """Refuse an empty goal and names that are not each actuated joint once."""
    if not goal.joint_names or not goal.points:
        missing = 'joint names' if not goal.joint_names else 'points'
        raise RequestRejected(Reason.EMPTY_GOAL, f'the goal has no {missing}')
    check_point_count(len(goal.points))
    known = ', '.join(joints)
    for name, count in Counter(goal.joint_names).items():
        if name not in joints:
            problem = f'unknown joint {name[:MAX_NAME]!r}'
        elif count > 1:
            problem = f'joint {name!r} occurs {count} times'
        else:
            continue
        raise RequestRejected(
            Reason.INVALID_JOINTS, f'{problem}; the arm has {known}', joint=name[:MAX_NAME]
        )
    for name in joints[:-1]:
        if name not in goal.joint_names:
            raise RequestRejected(
                Reason.INVALID_JOINTS,
                f'the actuated joint {name!r} is missing; the arm has {known}',
                joint=name,
            )


def _check_point(goal: Goal, index: int, point: GoalPoint) -> None:
    """Refuse wrong sizes, efforts, and numbers that no motion could reach."""
    count = len(goal.joint_names)
    if point.effort:
        raise RequestRejected(
            Reason.EFFORT_NOT_ALLOWED,
            f'point {index} has {len(point.effort)} efforts; leave them out, the planner computes '
            f'them',
            value=float(len(point.effort)),
            limit=0.0,
            time=point.time,
        )
    for quantity in ('positions', 'velocities', 'accelerations'):
        values = getattr(point, quantity)
        if len(values) != count and (values or quantity == 'positions'):
            names = ', '.join(goal.joint_names)
            message = f'point {index} has {len(values)} {quantity} for {names}'
            raise RequestRejected(
                Reason.SIZE_MISMATCH,
                message,
                value=float(len(values)),
                limit=float(count),
                time=point.time,
            )
        for name, value in zip(goal.joint_names, values, strict=False):
            if not isfinite(value):
                message = f'{quantity} of {name} in point {index} are not finite: {value}'
                raise RequestRejected(
                    Reason.NON_FINITE, message, joint=name, value=value, time=point.time
                )
    for name, value in zip(goal.joint_names, point.positions, strict=True):
        if abs(value) > MAX_ANGLE:
            message = (
                f'position {value:g} rad of {name} in point {index} exceeds {MAX_ANGLE:g} rad'
            )
            raise RequestRejected(
                Reason.POSITION_LIMIT,
                message,
                joint=name,
                value=value,
                limit=MAX_ANGLE,
                time=point.time,
            )


def _check_derivatives(goal: Goal, point: GoalPoint) -> None:
    """Refuse an end in motion, and derivatives at via points, which the planner chooses."""
    for quantity, values in (
        ('velocity', point.velocities),
        ('acceleration', point.accelerations),
    ):
        for name, value in zip(goal.joint_names, values, strict=False):
            if value == 0.0:
                continue
            if point is goal.points[-1]:
                message = (
                    f'the motion must end at rest, but the final {quantity} of {name} is '
                    f'{value:g}; leave it out or set it to 0'
                )
                raise RequestRejected(
                    Reason.NONZERO_END_STATE, message, joint=name, value=value, limit=0.0
                )
            message = (
                f'via points prescribe positions only, but there the {quantity} of {name} is '
                f'{value:g}; leave it out, the planner chooses it'
            )
            raise RequestRejected(
                Reason.INVALID_GOAL, message, joint=name, value=value, limit=0.0, time=point.time
            )


def _angles(goal: Goal, point: GoalPoint, joints: Sequence[str]) -> tuple[float, ...]:
    """Return a point's angles in kinematic order; refuse a loaded spring."""
    angles = dict(zip(goal.joint_names, point.positions, strict=True))
    passive = joints[-1]
    if angles.setdefault(passive, 0.0) != 0.0:
        place = 'final position' if point is goal.points[-1] else 'position in a via point'
        raise RequestRejected(
            Reason.PASSIVE_JOINT_NOT_ZERO,
            f'the spring of {passive} holds no angle that could be asked for: its {place} must '
            f'be 0 rad, got {angles[passive]:g} rad',
            joint=passive,
            value=angles[passive],
            limit=0.0,
            time=point.time,
        )
    return tuple(angles[name] for name in joints)


def _check_times(goal: Goal) -> None:
    """Refuse times that are neither all zero nor increase from above zero."""
    times = [point.time for point in goal.points]
    if not any(times):
        return
    previous = 0.0
    for index, time in enumerate(times):
        if index == 0 and goal.begins_with_start:
            continue
        if not time > previous:
            message = (
                f'time_from_start must be zero in all points or increase from above zero, but '
                f'point {index} has {time:g} s after {previous:g} s'
            )
            if time == 0.0:
                message = f'time_from_start is 0 s in point {index}, but not in all points'
            raise RequestRejected(
                Reason.TIME_NOT_INCREASING, message, value=time, limit=previous, time=time
            )
        previous = time
