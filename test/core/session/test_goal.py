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

"""Every rule for goals: what obeys it passes, what breaks it is refused with the numbers."""

from dataclasses import replace
from itertools import pairwise
from math import inf, nan, pi

from flat_planner_ros.core.planning.request import Reason, RequestRejected
from flat_planner_ros.core.session.goal import (
    checked_goal,
    Goal,
    GoalPoint,
    MAX_ANGLE,
    MAX_POINTS,
)
from hypothesis import given
from hypothesis import strategies as st
import pytest

JOINTS = ('shoulder', 'elastic')
FINAL = GoalPoint(time=1.0, positions=(pi,))
GOAL = Goal(joint_names=('shoulder',), points=(FINAL,))


def with_point(**changes: object) -> Goal:
    """Return the plain goal with another final point."""
    return replace(GOAL, points=(replace(FINAL, **changes),))


def rejection(goal: Goal) -> RequestRejected:
    """Return how a goal is refused."""
    with pytest.raises(RequestRejected) as caught:
        checked_goal(goal, JOINTS)
    return caught.value


def points_of(goal: Goal) -> tuple[tuple[tuple[float, ...], float], ...]:
    """Return positions of all joints and time of every point of an admissible goal."""
    checked = checked_goal(goal, JOINTS)
    assert checked.joint_names == JOINTS
    return tuple((point.positions, point.time) for point in checked.points)


def test_the_passive_joint_may_be_left_out():
    assert points_of(GOAL) == (((pi, 0.0), 1.0),)


def test_joints_may_come_in_any_order():
    goal = Goal(
        joint_names=('elastic', 'shoulder'),
        points=(GoalPoint(time=2.0, positions=(0.0, -1.0)),),
    )
    assert points_of(goal) == (((-1.0, 0.0), 2.0),)


def test_time_zero_leaves_the_duration_open():
    assert checked_goal(with_point(time=0.0), JOINTS).duration is None


def test_zero_end_velocities_and_accelerations_are_allowed():
    goal = with_point(velocities=(0.0,), accelerations=(-0.0,))
    assert checked_goal(goal, JOINTS).points[-1].positions == (pi, 0.0)


def test_via_points_are_read_in_kinematic_order():
    points = (
        GoalPoint(time=0.5, positions=(0.0, 0.7), velocities=(0.0, 0.0)),
        GoalPoint(time=2.0, positions=(0.0, -1.0)),
    )
    goal = Goal(joint_names=('elastic', 'shoulder'), points=points)
    assert points_of(goal) == (((0.7, 0.0), 0.5), ((-1.0, 0.0), 2.0))
    without = replace(goal, points=tuple(replace(point, time=0.0) for point in points))
    assert points_of(without) == (((0.7, 0.0), 0.0), ((-1.0, 0.0), 0.0))
    assert checked_goal(without, JOINTS).duration is None


def test_the_largest_goal_is_admitted():
    points = tuple(GoalPoint(time=0.1 * i, positions=(i,)) for i in range(1, MAX_POINTS + 1))
    target = checked_goal(replace(GOAL, points=points), JOINTS)
    assert len(target.points) == MAX_POINTS
    assert target.points[-2].time < target.duration == points[-1].time


BROKEN = {
    'no joints': (Goal(joint_names=(), points=(FINAL,)), Reason.EMPTY_GOAL, None, None, None),
    'no points': (replace(GOAL, points=()), Reason.EMPTY_GOAL, None, None, None),
    'unknown joint': (
        Goal(joint_names=('shoulder', 'knee'), points=(GoalPoint(time=1.0, positions=(1, 0)),)),
        Reason.INVALID_JOINTS,
        'knee',
        None,
        None,
    ),
    'joint twice': (
        Goal(
            joint_names=('shoulder', 'shoulder'),
            points=(GoalPoint(time=1.0, positions=(1.0, 1.0)),),
        ),
        Reason.INVALID_JOINTS,
        'shoulder',
        None,
        None,
    ),
    'actuated joint missing': (
        Goal(joint_names=('elastic',), points=(GoalPoint(time=1.0, positions=(0.0,)),)),
        Reason.INVALID_JOINTS,
        'shoulder',
        None,
        None,
    ),
    'effort': (with_point(effort=(0.1,)), Reason.EFFORT_NOT_ALLOWED, None, 1.0, 0.0),
    'no positions': (with_point(positions=()), Reason.SIZE_MISMATCH, None, 0.0, 1.0),
    'too many positions': (with_point(positions=(1.0, 2.0)), Reason.SIZE_MISMATCH, None, 2.0, 1.0),
    'velocities of other size': (
        with_point(velocities=(0.0, 0.0)),
        Reason.SIZE_MISMATCH,
        None,
        2.0,
        1.0,
    ),
    'NaN position': (with_point(positions=(nan,)), Reason.NON_FINITE, 'shoulder', nan, None),
    'infinite velocity': (with_point(velocities=(inf,)), Reason.NON_FINITE, 'shoulder', inf, None),
    'NaN acceleration': (
        with_point(accelerations=(nan,)),
        Reason.NON_FINITE,
        'shoulder',
        nan,
        None,
    ),
    'angle beyond precision': (
        with_point(positions=(-2e6,)),
        Reason.POSITION_LIMIT,
        'shoulder',
        -2e6,
        MAX_ANGLE,
    ),
    'negative time': (with_point(time=-1.0), Reason.TIME_NOT_INCREASING, None, -1.0, 0.0),
    'times not increasing': (
        replace(GOAL, points=(FINAL, FINAL)),
        Reason.TIME_NOT_INCREASING,
        None,
        1.0,
        1.0,
    ),
    'mixed times': (
        replace(GOAL, points=(FINAL, replace(FINAL, time=0.0))),
        Reason.TIME_NOT_INCREASING,
        None,
        0.0,
        1.0,
    ),
    'moving end': (
        with_point(velocities=(0.2,)),
        Reason.NONZERO_END_STATE,
        'shoulder',
        0.2,
        0.0,
    ),
    'accelerated end': (
        with_point(accelerations=(-3.0,)),
        Reason.NONZERO_END_STATE,
        'shoulder',
        -3.0,
        0.0,
    ),
    'loaded spring': (
        Goal(
            joint_names=JOINTS,
            points=(GoalPoint(time=1.0, positions=(1.0, 0.1)),),
        ),
        Reason.PASSIVE_JOINT_NOT_ZERO,
        'elastic',
        0.1,
        0.0,
    ),
    'velocity in a via point': (
        replace(GOAL, points=(replace(FINAL, velocities=(0.5,)), replace(FINAL, time=2.0))),
        Reason.INVALID_GOAL,
        'shoulder',
        0.5,
        0.0,
    ),
    'acceleration in a via point': (
        replace(GOAL, points=(replace(FINAL, accelerations=(-2.0,)), replace(FINAL, time=2.0))),
        Reason.INVALID_GOAL,
        'shoulder',
        -2.0,
        0.0,
    ),
    'loaded spring in a via point': (
        Goal(
            joint_names=JOINTS,
            points=(
                GoalPoint(time=1.0, positions=(1.0, 0.2)),
                GoalPoint(time=2.0, positions=(1.0, 0.0)),
            ),
        ),
        Reason.PASSIVE_JOINT_NOT_ZERO,
        'elastic',
        0.2,
        0.0,
    ),
    'too many points': (
        replace(GOAL, points=(FINAL,) * (MAX_POINTS + 1)),
        Reason.INVALID_GOAL,
        None,
        MAX_POINTS + 1.0,
        float(MAX_POINTS),
    ),
}


@pytest.mark.parametrize('name', BROKEN)
def test_a_broken_rule_is_named_with_its_numbers(name):
    goal, reason, joint, value, limit = BROKEN[name]
    error = rejection(goal)
    assert error.reason is reason
    assert error.joint == joint
    assert error.value == pytest.approx(value, nan_ok=True)
    assert error.limit == pytest.approx(limit)
    for text in filter(None, (joint, None if value is None else f'{abs(value):g}')):
        assert text in str(error)


def test_a_first_point_at_time_0_is_the_start():
    present = GoalPoint(time=0.0, positions=(1e-5, 0.3), velocities=(2e-4, -1e-4))
    via, final = (
        GoalPoint(time=0.5, positions=(0.0, 0.4)),
        GoalPoint(time=1.0, positions=(0.0, 1.0)),
    )
    goal = Goal(joint_names=JOINTS[::-1], points=(present, via, final))
    checked = checked_goal(goal, JOINTS)
    assert checked.start == (0.3,)
    assert [point.positions for point in checked.points] == [(0.4, 0.0), (1.0, 0.0)]
    assert checked.duration == 1.0


def test_without_times_the_first_point_is_a_via_point():
    points = tuple(GoalPoint(time=0.0, positions=(angle,)) for angle in (0.5, 1.0))
    checked = checked_goal(replace(GOAL, points=points), JOINTS)
    assert checked.start is None
    assert len(checked.points) == 2


def test_a_start_of_the_wrong_size_is_refused():
    present = GoalPoint(time=0.0, positions=(0.0, 0.0))
    assert rejection(replace(GOAL, points=(present, FINAL))).reason is Reason.SIZE_MISMATCH


def test_a_foreign_name_is_repeated_in_part_only():
    goal = Goal(joint_names=('x' * 10_000,), points=(FINAL,))
    assert len(str(rejection(goal))) < 200


numbers = st.floats(allow_nan=True, allow_infinity=True)
rows = st.lists(numbers, max_size=3).map(tuple)
points = st.builds(
    GoalPoint, time=numbers, positions=rows, velocities=rows, accelerations=rows, effort=rows
)
names = st.lists(st.sampled_from(['shoulder', 'elastic', 'knee', '']), max_size=3).map(tuple)


@given(names, st.lists(points, max_size=3).map(tuple))
def test_a_goal_is_either_admissible_or_refused(joint_names, goal_points):
    goal = Goal(joint_names=joint_names, points=goal_points)
    try:
        target = checked_goal(goal, JOINTS)
    except RequestRejected:
        return
    assert all(point.positions[-1] == 0.0 for point in target.points)
    assert all(abs(point.positions[0]) <= MAX_ANGLE for point in target.points)
    assert target.duration is None or target.duration > 0.0
    times = [point.time for point in target.points]
    if target.duration is None:
        assert set(times) == {0.0}
    else:
        assert all(a < b for a, b in pairwise([0.0, *times]))
