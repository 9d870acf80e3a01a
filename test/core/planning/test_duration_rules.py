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

"""Rules for durations: kept, refused with the numbers, stretched or found."""

from dataclasses import replace
from math import inf, pi

from flat_planner_ros.core.arm.planar_arm import PlanarArm
from flat_planner_ros.core.arm.samples import JointSample
from flat_planner_ros.core.motion_law.cost import Strategy
from flat_planner_ros.core.planning.duration_rules import DurationRules, OnViolation
from flat_planner_ros.core.planning.extrema import extrema_of, Quantity
from flat_planner_ros.core.planning.limits import JointLimits
from flat_planner_ros.core.planning.planner import plan
from flat_planner_ros.core.planning.request import (
    MotionRequest,
    PlanningOptions,
    Reason,
    RequestRejected,
)
from flat_planner_ros.core.session.goal import Goal, GoalPoint
from flat_planner_ros.core.session.session import PlannerSession
from flat_planner_ros.core.session.settings import SessionSettings
import numpy as np
import pytest

EFFORT = 0.015
"""Limit of joint 1 [N m]."""

LOADED = PlanarArm.reduced(
    inertia_star=(0.04, 0.01),
    stiffness=2.0,
    damping=0.01,
    link_length=[0.3],
    link_com=[0.15],
    link_mass=[1.0],
    link_inertia=[0.01],
    tip_mass=1.5,
    gravity=9.81,
)
"""An arm whose weight the limits may not allow to be held or lifted."""


def rules_of(limits, on_violation=OnViolation.REJECT, joints=('shoulder', 'elbow'), **changes):
    """Return rules."""
    return DurationRules(
        joints=joints,
        limits=limits,
        on_violation=on_violation,
        **{'shortest': 0.05, 'longest': 600.0, **changes},
    )


def half_turn(arm, duration):
    """Return the paper's motion, its arm and its cost."""
    request = MotionRequest(start=[0.0, 0.0], final=[pi, 0.0], duration=duration)
    return request, arm, PlanningOptions(strategy=Strategy.POLYNOMIAL)


def peak_effort(planned):
    """Return that of joint 1."""
    return extrema_of(planned, [Quantity.EFFORT])[0].peak[0]


def test_a_duration_that_obeys_is_kept(paper_arm):
    rules = rules_of(JointLimits.of(2, effort=[EFFORT, inf]))
    found, exceeded = rules.plan_within(*half_turn(paper_arm, 1.1), is_prescribed=True)
    assert found.duration == 1.1
    assert exceeded is None


def test_a_duration_too_short_is_refused_with_the_joint_and_all_numbers(paper_arm):
    rules = rules_of(JointLimits.of(2, effort=[EFFORT, inf], velocity=[50.0, inf]))
    with pytest.raises(RequestRejected) as refusal:
        rules.plan_within(*half_turn(paper_arm, 0.8), is_prescribed=True)
    error = refusal.value
    tight = plan(*half_turn(paper_arm, 0.8))
    assert error.reason is Reason.EFFORT_LIMIT
    assert error.joint == 'shoulder'
    assert abs(error.value) == pytest.approx(peak_effort(tight), rel=1e-9)
    assert abs(error.limit) == EFFORT
    assert tight.at(np.array([error.time])).efforts[0, 0] == pytest.approx(error.value, rel=1e-9)
    assert error.duration_min == pytest.approx(1.00410, rel=1e-3)
    for number in ('shoulder', '0.015', f'{error.duration_min:.9g} s', f'{error.value:.6g} N m'):
        assert number in str(error)
    # The text is the number, and the number obeys.
    again = float(f'{error.duration_min:.9g}')
    found, _ = rules.plan_within(*half_turn(paper_arm, again), is_prescribed=True)
    assert found.duration == again


def test_a_velocity_is_told_from_an_effort(paper_arm):
    rules = rules_of(JointLimits.of(2, effort=[1.0, inf], velocity=[6.0, inf]))
    with pytest.raises(RequestRejected) as refusal:
        rules.plan_within(*half_turn(paper_arm, 0.8), is_prescribed=True)
    assert refusal.value.reason is Reason.VELOCITY_LIMIT
    assert 'rad/s' in str(refusal.value)


def test_a_duration_too_short_is_stretched_on_request(paper_arm):
    rules = rules_of(JointLimits.of(2, effort=[EFFORT, inf]), OnViolation.SCALE)
    found, exceeded = rules.plan_within(*half_turn(paper_arm, 0.8), is_prescribed=True)
    assert found.duration == pytest.approx(1.00410, rel=1e-3)
    assert peak_effort(found) <= EFFORT
    assert abs(exceeded.value) == pytest.approx(peak_effort(plan(*half_turn(paper_arm, 0.8))))


def test_to_stretch_is_not_to_shorten():
    # Only motions of 1.3 to 2.8 s lift this load; 5 s cannot be stretched to that.
    request = MotionRequest(start=[-1.5, 1.5, 0.0], final=[0.6, -0.6, 0.0], duration=5.0)
    lift = (request, LOADED, PlanningOptions(strategy=Strategy.POLYNOMIAL))
    limits = JointLimits.of(3, effort=[5.6, inf, inf])
    joints = ('a', 'b', 'c')
    with pytest.raises(RequestRejected) as stretched:
        rules_of(limits, OnViolation.SCALE, joints).plan_within(*lift, is_prescribed=True)
    assert stretched.value.duration_min is None
    assert 'no duration from 5 to 600 s' in str(stretched.value)
    with pytest.raises(RequestRejected) as refused:
        rules_of(limits, OnViolation.REJECT, joints).plan_within(*lift, is_prescribed=True)
    assert 1.0 < refused.value.duration_min < 2.0
    assert refused.value.reason is Reason.EFFORT_LIMIT


def test_a_static_load_is_named_as_such():
    request = MotionRequest(start=[pi / 2, 0.0, 0.0], final=[0.0, 0.0, 0.0], duration=2.0)
    words = 'the effort of a at rest in the final pose is 5.886 N m'
    rules = rules_of(JointLimits.of(3, effort=[3.0, inf, inf]), joints=('a', 'b', 'c'))
    for is_prescribed in (False, True):
        with pytest.raises(RequestRejected, match=words) as refusal:
            rules.plan_within(
                request,
                LOADED,
                PlanningOptions(strategy=Strategy.POLYNOMIAL),
                is_prescribed=is_prescribed,
            )
        assert refusal.value.reason is Reason.EFFORT_LIMIT
        assert refusal.value.value == pytest.approx(5.886, rel=1e-3)


def test_poses_outside_the_range_are_refused_and_named():
    rules = rules_of(JointLimits.of(2, position_max=[3.0, inf]))
    rules.check_pose('the final', np.array([3.0, 0.0]))
    with pytest.raises(RequestRejected, match='the final position 3.1 rad of shoulder') as refusal:
        rules.check_pose('the final', np.array([3.1, 0.0]))
    error = refusal.value
    assert error.reason is Reason.POSITION_LIMIT
    assert (error.joint, error.value, error.limit) == ('shoulder', 3.1, 3.0)


def test_an_arm_just_outside_its_range_may_move_back_but_not_further_out():
    limits = JointLimits.of(2, position_min=[0.0, -inf]).reaching(np.array([-0.005, 0.0]), 0.01)
    assert limits.position_min.tolist() == [-0.005, -inf]
    limits = JointLimits.of(2, position_min=[0.0, -inf]).reaching(np.array([-0.05, 0.0]), 0.01)
    assert limits.position_min.tolist() == [0.0, -inf]
    limits = JointLimits.of(2, position_max=[1.0, inf]).reaching(np.array([1.005, 0.0]), 0.01)
    assert limits.position_max.tolist() == [1.005, inf]


def session(arm, position=0.0, **changes):
    """Return a session that has seen its arm at rest."""
    settings = SessionSettings(
        joints=('shoulder', 'elbow'),
        arm=arm,
        options=PlanningOptions(strategy=Strategy.POLYNOMIAL),
        **changes,
    )
    made = PlannerSession(settings)
    made.measure(
        JointSample(time=10.0, positions=np.array([position, 0.0]), velocities=np.zeros(2))
    )
    return made


def goal(angle=pi, time=0.0):
    """Return a goal for the shoulder."""
    return Goal(joint_names=('shoulder',), points=(GoalPoint(time=time, positions=(angle,)),))


def test_a_session_finds_the_duration_of_goals_without_one(paper_arm):
    limits = JointLimits.of(2, effort=[EFFORT, inf])
    motion = session(paper_arm, limits=limits).submit(goal(), 10.0)
    assert motion.is_shortest
    assert motion.plan.duration == pytest.approx(1.00410, rel=1e-3)
    assert np.abs(motion.samples.efforts).max() <= EFFORT
    quick = session(paper_arm, limits=limits, min_duration=1.5).submit(goal(), 10.0)
    assert quick.plan.duration == 1.5


@pytest.mark.parametrize('limits', [None, JointLimits.of(2, position_max=[4.0, 1.0])])
def test_a_session_says_what_to_set_where_no_duration_is_the_shortest(paper_arm, limits):
    with pytest.raises(RequestRejected, match=r'duration\.default.*limits\.effort') as refusal:
        session(paper_arm, limits=limits).submit(goal(), 10.0)
    assert refusal.value.reason is Reason.DURATION_OUT_OF_RANGE


def test_a_session_refuses_poses_at_once_but_lets_an_arm_return(paper_arm):
    limits = JointLimits.of(2, position_min=[0.0, -inf], position_max=[2.0, inf])
    with pytest.raises(RequestRejected, match='the final position') as refusal:
        session(paper_arm, limits=limits).submit(goal(time=1.0), 10.0)
    assert refusal.value.reason is Reason.POSITION_LIMIT
    with pytest.raises(RequestRejected, match='the start position -0.05 rad'):
        session(paper_arm, -0.05, limits=limits).submit(goal(1.0, 1.0), 10.0)
    motion = session(paper_arm, -0.005, limits=limits).submit(goal(1.0, 1.0), 10.0)
    assert motion.samples.positions[:, 0].min() == -0.005


def test_a_stretched_motion_stays_within_the_longest_duration(paper_arm):
    limits = JointLimits.of(2, effort=[1e-3, inf])
    stretching = session(
        paper_arm, limits=limits, on_violation=OnViolation.SCALE, max_duration=2.0
    )
    with pytest.raises(RequestRejected, match='no duration from 1 to 2 s obeys') as refusal:
        stretching.submit(goal(time=1.0), 10.0)
    assert refusal.value.reason is Reason.EFFORT_LIMIT
    assert stretching.motion is None


def test_limits_of_another_arm_are_refused(paper_arm):
    with pytest.raises(Exception, match='limits of 3 joints for an arm of 2'):
        session(paper_arm, limits=JointLimits.of(3))


def test_a_goal_in_motion_obeys_the_limits_too(paper_arm):
    limits = JointLimits.of(2, effort=[EFFORT, inf], velocity=[6.0, inf])
    moving = session(paper_arm, limits=limits)
    first = moving.submit(goal(time=2.0), 10.0)
    second = moving.submit(goal(-1.0), 10.4)
    assert second.plan.request.start_jets is not None
    assert second.is_shortest
    times = np.linspace(0.0, second.plan.duration, 20_001)
    assert np.abs(second.plan.at(times).efforts).max() <= EFFORT * (1.0 + 1e-9)
    assert second.start < first.start + first.plan.duration
    with pytest.raises(RequestRejected) as refusal:
        moving.submit(goal(pi, 0.3), 10.6)
    assert refusal.value.reason in (Reason.EFFORT_LIMIT, Reason.VELOCITY_LIMIT)
    assert moving.motion is second


def test_a_stop_obeys_the_limits(paper_arm):
    limits = JointLimits.of(2, effort=[1.5 * peak_effort(plan_of_session(paper_arm)), inf])
    free, limited = (session(paper_arm, limits=each) for each in (None, limits))
    first, _ = (each.submit(goal(time=1.0), 10.0) for each in (free, limited))
    unlimited, stop = free.stop(10.25), limited.stop(10.25)
    assert limits.worst(unlimited.plan).is_exceeded  # else the case shows nothing
    assert not limits.worst(stop.plan).is_exceeded
    assert unlimited.end < stop.end <= first.end


@pytest.mark.parametrize('elapsed', [0.0, 0.2, 0.4, 0.6, 0.8])
def test_a_motion_at_its_limits_can_be_stopped_within_them(paper_arm, elapsed):
    limits = JointLimits.of(2, effort=[peak_effort(plan_of_session(paper_arm)) * 1.001, inf])
    moving = session(paper_arm, limits=limits)
    motion = moving.submit(goal(time=1.0), 10.0)
    stop = moving.stop(10.0 + elapsed)
    assert not limits.worst(stop.plan).is_exceeded
    assert stop.end <= motion.end


def test_an_arm_stops_even_if_its_limits_were_lowered_in_motion(paper_arm):
    moving = session(paper_arm)
    motion = moving.submit(goal(time=1.0), 10.0)
    moving.settings = replace(moving.settings, limits=JointLimits.of(2, effort=[1e-4, inf]))
    assert moving.stop(10.3).end == pytest.approx(motion.end)


def plan_of_session(arm):
    """Return the half turn of 1 s that sessions here plan."""
    request = MotionRequest(start=[0.0, 0.0], final=[pi, 0.0], duration=1.0)
    return plan(request, arm, PlanningOptions(strategy=Strategy.POLYNOMIAL))
