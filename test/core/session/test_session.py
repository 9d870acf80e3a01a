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

"""A session answers goals by time and measurement, without a clock and without ROS."""

from dataclasses import replace
from math import inf, nan, pi
from typing import NamedTuple

from core.conftest import envelope
from flat_planner_ros.core.arm.errors import InvalidRequest
from flat_planner_ros.core.arm.planar_arm import PlanarArm
from flat_planner_ros.core.arm.samples import JointSample
from flat_planner_ros.core.motion_law.cost import Strategy
from flat_planner_ros.core.planning.duration_rules import OnViolation
from flat_planner_ros.core.planning.limits import JointLimits
from flat_planner_ros.core.planning.planner import plan
from flat_planner_ros.core.planning.request import PlanningOptions, Reason, RequestRejected
from flat_planner_ros.core.planning.tradeoff import residual_of_plan
from flat_planner_ros.core.plant.effort_profile import EffortProfile
from flat_planner_ros.core.plant.simulation import SimulatedArm
from flat_planner_ros.core.session.execution import Outcome
from flat_planner_ros.core.session.goal import Goal, GoalPoint
from flat_planner_ros.core.session.session import PlannerSession
from flat_planner_ros.core.session.settings import SessionSettings, StartSource
import numpy as np
import pytest

SETTINGS = SessionSettings(
    joints=('joint1', 'joint2'),
    arm=PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5),
    options=PlanningOptions(strategy=Strategy.MIN_CONTROL_EFFORT),
)
NOW = 100.0
GOAL = Goal(joint_names=('joint1',), points=(GoalPoint(time=1.0, positions=(pi,)),))
BACK = replace(GOAL, points=(GoalPoint(time=1.0, positions=(0.0,)),))


def sample(position=(0.5, 0.0), velocity=(0.0, 0.0), time=NOW) -> JointSample:
    """Return a measured state."""
    return JointSample(time=time, positions=np.array(position), velocities=np.array(velocity))


def session(**changes: object) -> PlannerSession:
    """Return a session that has seen the arm at rest."""
    result = PlannerSession(replace(SETTINGS, **changes))
    result.measure(sample())
    return result


def ended(planner, now):
    """Return the motions that have ended, and how."""
    return [(end.motion, end.outcome) for end in planner.take_ended(now)]


def reason_of(call, *args: object) -> RequestRejected:
    """Return how a call is refused."""
    with pytest.raises(RequestRejected) as caught:
        call(*args)
    return caught.value


def test_a_motion_goes_from_the_measured_start_to_the_goal():
    motion = session().submit(GOAL, NOW)
    assert motion.samples.positions[0] == pytest.approx([0.5, 0.0], abs=0.0)
    assert motion.samples.positions[-1] == pytest.approx([pi, 0.0], abs=0.0)
    assert motion.start == pytest.approx(NOW + SETTINGS.start_delay)
    assert motion.end == motion.start + 1.0
    assert motion.plan_id == 1


def test_planning_time_does_not_eat_the_start_delay():
    motion = session().submit(GOAL, NOW, lambda: NOW + 2.0)
    assert motion.start == NOW + 2.0 + SETTINGS.start_delay
    stamped = replace(GOAL, stamp=NOW + 7.0)
    assert session().submit(stamped, NOW, lambda: NOW + 2.0).start == NOW + 7.0
    error = reason_of(session().submit, stamped, NOW, lambda: NOW + 8.0)
    assert error.reason is Reason.OLD_HEADER_TIMESTAMP


VIA = replace(
    GOAL,
    points=(
        GoalPoint(time=0.4, positions=(1.0,)),
        GoalPoint(time=0.9, positions=(0.2,)),
        GoalPoint(time=1.5, positions=(2.0,)),
    ),
)
"""Three points for joint 1, two of them on the way."""


def test_via_points_are_passed_at_their_times():
    motion = session().submit(VIA, NOW)
    assert motion.end == motion.start + 1.5
    passed = motion.plan.at(np.array([0.4, 0.9])).positions.sum(axis=1)
    assert passed == pytest.approx([1.0, 0.2], abs=1e-12)
    assert motion.samples.positions[-1].tolist() == [2.0, 0.0]
    # The grid of a command stays even, whatever the times of the points.
    assert np.ptp(np.diff(motion.samples.times)) < 1e-12


def test_via_points_without_times_are_passed_when_it_costs_least():
    points = tuple(replace(point, time=0.0) for point in VIA.points)
    motion = session(default_duration=1.5).submit(replace(VIA, points=points), NOW)
    prescribed = session().submit(VIA, NOW)
    assert motion.plan.duration == 1.5
    assert motion.plan.cost_value < prescribed.plan.cost_value
    times = np.array([point.time for point in motion.plan.request.via])
    passed = motion.plan.at(times).positions.sum(axis=1)
    assert passed == pytest.approx([1.0, 0.2], abs=1e-12)


def test_via_points_keep_their_shares_of_the_shortest_duration():
    limits = JointLimits.of(2, velocity=(2.5, inf))
    free = session(limits=limits)
    error = reason_of(free.submit, VIA, NOW)
    assert error.reason is Reason.VELOCITY_LIMIT
    scaled = session(limits=limits, on_violation=OnViolation.SCALE).submit(VIA, NOW)
    assert scaled.plan.duration == pytest.approx(error.duration_min, rel=1e-3)
    shares = [point.time / scaled.plan.duration for point in scaled.plan.request.via]
    assert shares == pytest.approx([0.4 / 1.5, 0.9 / 1.5])
    points = tuple(replace(point, time=0.0) for point in VIA.points)
    chosen = session(limits=limits).submit(replace(VIA, points=points), NOW)
    assert chosen.is_shortest
    assert chosen.plan.duration < scaled.plan.duration
    assert chosen.plan.peak_velocity[0] == pytest.approx(2.5, rel=3e-3)
    times = np.array([point.time for point in chosen.plan.request.via])
    passed = chosen.plan.at(times).positions.sum(axis=1)
    assert passed == pytest.approx([1.0, 0.2], abs=1e-12)


def test_via_points_beyond_the_position_limits_are_refused():
    limits = JointLimits.of(2, position_max=(0.9, inf))
    error = reason_of(session(limits=limits).submit, VIA, NOW)
    assert error.reason is Reason.POSITION_LIMIT
    assert 'via point 0' in str(error)


def test_the_strategy_of_least_peak_refuses_via_points():
    options = PlanningOptions(strategy=Strategy.MIN_PEAK_EFFORT)
    error = reason_of(session(options=options).submit, VIA, NOW)
    assert error.reason is Reason.INVALID_GOAL
    assert 'min_peak_effort' in str(error)


def test_a_start_in_motion_is_insensitive_and_a_stop_is_the_cheapest():
    options = PlanningOptions(strategy=Strategy.INSENSITIVE)
    planner = session(options=options)
    first = planner.submit(GOAL, NOW)
    assert first.plan.options.strategy is Strategy.INSENSITIVE
    second = planner.submit(BACK, NOW + 0.4)
    assert second.plan.options.strategy is Strategy.INSENSITIVE
    plain = PlanningOptions(strategy=Strategy.POLYNOMIAL)
    other = plan(second.plan.request, SETTINGS.arm, plain)
    left, left_by_other = residual_of_plan(second.plan), residual_of_plan(other)
    assert left.worst < left_by_other.worst
    # At rest again, between the end of a motion and the start of one that waits.
    third = planner.submit(replace(GOAL, stamp=second.end + 1.0), NOW + 0.8)
    assert third.plan.options.strategy is Strategy.INSENSITIVE
    assert planner.stop(third.start + 0.4).plan.options.strategy is Strategy.POLYNOMIAL


def test_via_points_of_a_start_in_motion():
    planner = session()
    planner.submit(GOAL, NOW)
    now = NOW + 0.4
    motion = planner.submit(VIA, now)
    assert motion.plan.request.start_jets is not None
    passed = motion.plan.at(np.array([0.4, 0.9])).positions.sum(axis=1)
    assert passed == pytest.approx([1.0, 0.2], abs=1e-12)


def test_via_points_too_close_in_time_are_refused():
    points = (VIA.points[0], replace(VIA.points[1], time=0.4 + 1e-9), VIA.points[2])
    error = reason_of(session().submit, replace(VIA, points=points), NOW)
    assert error.reason is Reason.ILL_CONDITIONED


def test_a_small_measured_deflection_does_not_enter_the_plan():
    planner = session()
    planner.measure(sample(position=(0.5, 0.008)))
    assert planner.submit(GOAL, NOW).samples.positions[0].tolist() == [0.5, 0.0]


def test_a_stamp_in_the_future_is_the_start():
    assert session().submit(replace(GOAL, stamp=NOW + 7.0), NOW).start == NOW + 7.0


def test_a_stamp_in_the_past_is_refused():
    error = reason_of(session().submit, replace(GOAL, stamp=NOW - 2.0), NOW)
    assert error.reason is Reason.OLD_HEADER_TIMESTAMP
    assert error.value == NOW - 2.0
    assert error.limit == NOW


def test_a_goal_without_a_time_takes_the_default_duration():
    goal = replace(GOAL, points=(replace(GOAL.points[0], time=0.0),))
    assert session(default_duration=1.5).submit(goal, NOW).plan.request.duration == 1.5
    error = reason_of(session().submit, goal, NOW)
    assert error.reason is Reason.DURATION_OUT_OF_RANGE


@pytest.mark.parametrize(('time', 'limit'), [(0.1, 0.2), (30.0, 20.0)])
def test_a_duration_outside_the_range_is_refused(time, limit):
    goal = replace(GOAL, points=(replace(GOAL.points[0], time=time),))
    error = reason_of(session(min_duration=0.2, max_duration=20.0).submit, goal, NOW)
    assert error.reason is Reason.DURATION_OUT_OF_RANGE
    assert (error.value, error.limit) == (time, limit)


def test_a_motion_ends_once():
    planner = session()
    motion = planner.submit(GOAL, NOW)
    assert ended(planner, motion.end - 0.01) == []
    assert ended(planner, motion.end) == [(motion, Outcome.FINISHED)]
    assert ended(planner, motion.end + 1.0) == []


def test_a_goal_in_motion_takes_over_without_a_step():
    planner = session()
    first = planner.submit(GOAL, NOW)
    now = first.start + 0.4321
    second = planner.submit(BACK, now)
    # A point that is sent anyway, at least the lookahead ahead.
    assert 0.0 <= second.start - now - SETTINGS.lookahead <= SETTINGS.period
    there = first.plan.at(np.array([second.start - first.start]))
    for quantity in ('positions', 'velocities', 'accelerations', 'efforts'):
        before, after = getattr(there, quantity)[0], getattr(second.samples, quantity)[0]
        scale = np.abs(getattr(first.samples, quantity)).max()
        assert after == pytest.approx(before, abs=1e-9 * scale)
    assert second.samples.positions[-1].tolist() == [0.0, 0.0]
    assert ended(planner, now) == [(first, Outcome.PREEMPTED)]
    assert ended(planner, second.end) == [(second, Outcome.FINISHED)]


def test_no_motion_takes_over_from_one_that_the_arm_does_not_carry_out():
    planner = session()
    first = planner.submit(GOAL, NOW)
    now = first.start + 0.9
    planned = first.reference(now - 0.01).positions[0]
    assert planned[0] - 0.5 > SETTINGS.replan_tolerance
    planner.measure(sample(time=now - 0.01))  # back at the start, as a restarted plant is
    for goal in (BACK, planner.last_goal, replace(BACK, stamp=first.end + 1.0)):
        error = reason_of(planner.submit, goal, now)
        assert error.reason is Reason.START_STATE_MISMATCH
        assert (error.joint, error.value, error.limit) == ('joint1', 0.5, 0.5)
        assert 'replan.tolerance' in str(error)
        assert planner.motion is first
    # At its own time the sample is where it should be, and the elastic joint may be anywhere.
    earlier = first.reference(now - 0.3).positions[0]
    assert abs(earlier - first.reference(now).positions[0]).max() > 0.5
    planner = session()
    first = planner.submit(GOAL, NOW)
    planner.measure(sample(position=(earlier[0], 3.0), time=now - 0.3))
    assert planner.submit(BACK, now).plan_id == 2


@pytest.mark.parametrize(
    ('changes', 'age'),
    [({'replan_tolerance': 0.0}, 0.01), ({}, 0.501), ({'joint_state_timeout': 2.0}, 0.95)],
)
def test_only_a_fresh_state_of_its_time_tells_that_the_arm_is_elsewhere(changes, age):
    planner = session(**changes)
    first = planner.submit(GOAL, NOW)
    now = first.start + 0.9
    planner.measure(sample(position=(-3.0, 0.0), time=now - age))
    assert planner.submit(BACK, now).plan_id == 2


def test_a_stop_is_planned_wherever_the_arm_is():
    planner = session()
    first = planner.submit(GOAL, NOW)
    now = first.start + 0.5
    planner.measure(sample(position=(-3.0, 0.0), time=now))
    assert planner.stop(now).is_stop


def test_two_goals_within_a_period_of_the_command_take_over_at_the_same_time():
    planner = session()
    first = planner.submit(GOAL, NOW)
    overtaken = planner.submit(BACK, first.start + 0.3012)
    motion = planner.submit(replace(GOAL, stamp=None), first.start + 0.3018)
    assert motion.start == overtaken.start
    assert motion.samples.positions[0, 1] != 0.0
    at = np.array([motion.start - first.start])
    assert motion.samples.positions[0] == pytest.approx(first.plan.at(at).positions[0], abs=1e-12)
    assert motion.samples.efforts[0] == pytest.approx(first.plan.at(at).efforts[0], abs=1e-9)
    assert motion.samples.positions[-1].tolist() == [pi, 0.0]
    too_soon = replace(BACK, stamp=motion.start)
    error = reason_of(planner.submit, too_soon, motion.start - 0.5 * SETTINGS.lookahead)
    assert error.reason is Reason.OLD_HEADER_TIMESTAMP


def test_what_is_being_played_stays_as_it_is():
    planner = session()
    first = planner.submit(GOAL, NOW)
    now = first.start + 0.4321
    second = planner.submit(BACK, now)
    track = planner.track(now)
    origin = round((track.start - first.start) / SETTINGS.period)
    assert now - SETTINGS.period < track.start <= now
    splice = round((second.start - track.start) / SETTINGS.period)
    for quantity in ('positions', 'velocities', 'accelerations', 'efforts'):
        sent = getattr(track, quantity)
        assert (sent[:splice] == getattr(first.samples, quantity)[origin : origin + splice]).all()
        assert (sent[splice:] == getattr(second.samples, quantity)).all()
    assert track.times[0] == 0.0
    assert np.diff(track.times) == pytest.approx(SETTINGS.period, abs=1e-6)
    assert track.flat.shape == (1, 6, len(track.times))


def test_a_stamp_in_motion_is_kept_to_the_last_bit():
    planner = session()
    first = planner.submit(GOAL, NOW)
    stamp = first.start + 0.61234
    second = planner.submit(replace(BACK, stamp=stamp), first.start + 0.1)
    assert second.start == stamp
    times = planner.track(first.start + 0.1).times
    assert (np.diff(times) > 0.0).all()
    error = reason_of(planner.submit, replace(BACK, stamp=stamp + 0.02), stamp)
    assert error.reason is Reason.OLD_HEADER_TIMESTAMP
    assert error.limit == pytest.approx(stamp + SETTINGS.lookahead)


def test_goals_queue_by_their_stamps():
    planner = session()
    first = planner.submit(GOAL, NOW)
    second = planner.submit(replace(BACK, stamp=first.end + 0.5), NOW)
    third = planner.submit(replace(GOAL, stamp=second.end), NOW)
    assert second.samples.positions[0].tolist() == [pi, 0.0]
    assert third.samples.positions[0].tolist() == [0.0, 0.0]
    track = planner.track(NOW)
    assert track.start == first.start
    assert track.start + track.times[-1] == pytest.approx(third.end)
    assert (np.diff(track.times) > 0.0).all()
    assert planner.reference(first.end + 0.25).positions[0].tolist() == [pi, 0.0]
    assert ended(planner, first.end + 0.25) == [(first, Outcome.FINISHED)]
    assert ended(planner, third.end) == [(second, Outcome.FINISHED), (third, Outcome.FINISHED)]


def test_a_goal_replaces_all_that_was_planned_from_its_start_on():
    planner = session()
    first = planner.submit(GOAL, NOW)
    second = planner.submit(replace(BACK, stamp=first.end + 0.5), NOW)
    third = planner.submit(replace(BACK, stamp=second.end + 0.5), NOW)
    now = first.end + 0.1
    last = planner.submit(replace(GOAL, stamp=second.start + 0.3), now)
    assert ended(planner, now) == [
        (first, Outcome.FINISHED),
        (second, Outcome.PREEMPTED),
        (third, Outcome.PREEMPTED),
    ]
    assert planner.track(now).times[-1] == pytest.approx(last.end - second.start)


def test_a_motion_that_waits_for_its_start_gives_way():
    planner = session()
    first = planner.submit(replace(GOAL, stamp=NOW + 10.0), NOW)
    second = planner.submit(GOAL, NOW + 1.0)
    assert second.start == pytest.approx(NOW + 1.0 + SETTINGS.lookahead)
    assert second.samples.positions[0].tolist() == [0.5, 0.0]
    assert ended(planner, NOW + 1.0) == [(first, Outcome.PREEMPTED)]


def test_commands_without_a_stamp_cannot_be_spliced():
    planner = session(is_stamped=False)
    first = planner.submit(GOAL, NOW)
    assert reason_of(planner.submit, BACK, first.end - 0.2).reason is Reason.BUSY
    assert reason_of(planner.stop, first.end - 0.2).reason is Reason.BUSY
    planner.measure(sample(position=(pi, 0.0), time=first.end))
    assert planner.submit(BACK, first.end).plan_id == 2


def test_planning_that_takes_too_long_leaves_the_motion_alone():
    planner = session()
    first = planner.submit(GOAL, NOW)
    now = first.start + 0.3
    track = planner.track(now)
    error = reason_of(planner.submit, BACK, now, lambda: now + 0.09)
    assert error.reason is Reason.BUSY
    assert planner.motion is first
    assert ended(planner, now) == []
    assert (planner.track(now).efforts == track.efforts).all()
    assert planner.submit(BACK, now, lambda: now + 0.05).plan_id == 2


@pytest.mark.parametrize('elapsed', [0.05, 0.3, 0.5, 0.8])
def test_a_stop_comes_to_rest_early_with_bounded_effort(elapsed):
    planner = session()
    first = planner.submit(GOAL, NOW)
    now = first.start + elapsed
    stop = planner.stop(now)
    assert stop.end < first.end
    track = planner.track(now)
    assert not track.velocities[-1].any()
    assert not track.efforts[-1].any()
    assert track.positions[-1, 1] == 0.0
    peak = np.abs(first.samples.efforts).max()
    assert np.abs(stop.samples.efforts).max() <= 2.0 * peak
    assert ended(planner, stop.end) == [(stop, Outcome.STOPPED)]


def test_a_stop_of_a_motion_that_waits_stays_at_the_start():
    planner = session()
    planner.submit(replace(GOAL, stamp=NOW + 10.0), NOW)
    stop = planner.stop(NOW + 1.0)
    assert (stop.samples.positions == [0.5, 0.0]).all()
    assert not stop.samples.efforts.any()
    assert ended(planner, stop.end) == [(stop, Outcome.STOPPED)]


def test_a_stop_may_be_overtaken_by_a_goal():
    planner = session()
    first = planner.submit(GOAL, NOW)
    stop = planner.stop(first.start + 0.3)
    second = planner.submit(BACK, first.start + 0.35)
    assert ended(planner, first.start + 0.35) == [(stop, Outcome.PREEMPTED)]
    assert ended(planner, second.end) == [(second, Outcome.FINISHED)]


def test_there_is_nothing_to_stop_at_rest():
    planner = session()
    assert planner.stop(NOW) is None
    end = planner.submit(GOAL, NOW).end
    assert reason_of(planner.stop, end - 0.01).reason is Reason.BUSY
    assert planner.stop(end) is None


def residual(track, arm) -> float:
    """Return what a command leaves behind on the simulated arm, the amplitude of q_n [rad]."""
    plant = SimulatedArm(arm, step=2.5e-4)
    plant.reset(track.positions[0])
    plant.command(EffortProfile(start=0.0, times=track.times, efforts=track.efforts[:, :-1]), 0.0)
    plant.advance(track.times[-1])
    return envelope(arm, plant.position[-1], plant.velocity[-1])


@pytest.mark.parametrize('seed', range(5))
def test_a_chain_of_goals_leaves_no_more_than_one(seed):
    random = np.random.default_rng(seed)
    planner = session()
    now = planner.submit(GOAL, NOW).start
    tracks = [planner.track(NOW)]
    for _ in range(10):
        now += random.uniform(0.05, 0.9)
        point = GoalPoint(time=random.uniform(0.7, 1.5), positions=(random.uniform(-pi, pi),))
        planner.submit(replace(GOAL, points=(point,)), now)
        planner.take_ended(now)
        tracks.append(planner.track(now))
    assert residual(spliced(tracks), SETTINGS.arm) < 1e-5


class Played(NamedTuple):
    """What an executor has played, as a track has it."""

    positions: np.ndarray
    times: np.ndarray
    efforts: np.ndarray


def spliced(tracks):
    """Return what an executor has played that takes over every command on arrival."""
    begin, times, efforts = tracks[0].start, [], []
    for track, after in zip(tracks, [*tracks[1:], None], strict=True):
        until = np.inf if after is None else after.start - track.start - 1e-7
        chosen = track.times < until
        times.append(track.times[chosen] + (track.start - begin))
        efforts.append(track.efforts[chosen])
    return Played(tracks[0].positions, np.concatenate(times), np.concatenate(efforts))


def test_a_new_goal_is_answered_after_the_end():
    planner = session()
    end = planner.submit(GOAL, NOW).end
    planner.measure(sample(position=(pi, 0.0), time=end))
    second = planner.submit(BACK, end)
    assert second.plan_id == 2
    assert second.samples.positions[0, 0] == pi


def test_plans_that_are_not_executed_keep_nothing_busy():
    planner = session(execute=False)
    first = planner.submit(GOAL, NOW)
    assert planner.submit(GOAL, NOW).plan_id == first.plan_id + 1
    assert ended(planner, first.end) == []
    assert planner.track(NOW).times[-1] == 1.0


def test_the_last_goal_is_planned_again_with_changed_settings():
    planner = session(execute=False)
    planner.submit(replace(GOAL, stamp=NOW + 1.0), NOW)
    planner.settings = replace(
        planner.settings, options=PlanningOptions(strategy=Strategy.POLYNOMIAL)
    )
    again = planner.submit(planner.last_goal, NOW + 0.2)
    assert again.plan.options.strategy is Strategy.POLYNOMIAL
    assert again.start == pytest.approx(NOW + 0.2 + SETTINGS.start_delay)


def test_there_is_no_last_goal_before_the_first():
    planner = session()
    assert reason_of(lambda: planner.last_goal).reason is Reason.EMPTY_GOAL
    reason_of(planner.submit, replace(GOAL, stamp=1.0), NOW)
    assert reason_of(lambda: planner.last_goal).reason is Reason.EMPTY_GOAL


def test_without_a_measurement_there_is_no_start():
    error = reason_of(PlannerSession(SETTINGS).submit, GOAL, NOW)
    assert error.reason is Reason.START_STATE_UNKNOWN


def test_what_joint_states_in_parts_lack_is_the_reason_of_a_refusal():
    planner = PlannerSession(SETTINGS)
    planner.lack = 'joint2 has not been heard on joint_states; heard: joint1'
    assert str(reason_of(planner.submit, GOAL, NOW)) == planner.lack
    planner.measure(sample())
    error = reason_of(planner.submit, GOAL, NOW + 0.6)
    assert error.reason is Reason.START_STATE_STALE
    assert str(error).endswith(f'more than 0.5 s: {planner.lack}')


def test_an_old_measurement_is_stale():
    error = reason_of(session().submit, GOAL, NOW + 0.6)
    assert error.reason is Reason.START_STATE_STALE
    assert error.value == pytest.approx(0.6)
    assert error.limit == SETTINGS.joint_state_timeout


def test_a_measurement_by_another_clock_is_no_start():
    planner = session()
    planner.measure(sample(time=NOW + 1e9))
    error = reason_of(planner.submit, GOAL, NOW)
    assert error.reason is Reason.START_STATE_STALE
    assert 'use_sim_time' in str(error)


@pytest.mark.parametrize(('ahead', 'is_accepted'), [(0.09, True), (0.2, False), (5.0, False)])
def test_a_state_from_the_future_is_refused_with_its_offset(ahead, is_accepted):
    planner = session()
    planner.measure(sample(time=NOW + ahead))
    if is_accepted:
        assert planner.submit(GOAL, NOW)
        return
    error = reason_of(planner.submit, GOAL, NOW)
    assert error.reason is Reason.START_STATE_STALE
    assert (error.value, error.limit) == pytest.approx((-ahead, -0.1))
    assert f'stamped {ahead:.3f} s ahead of the present, more than 0.1 s' in str(error)


@pytest.mark.parametrize(
    ('changes', 'is_known'),
    [
        ({}, False),
        ({'start_source': StartSource.PARAMETER, 'start_position': (0.0, 0.0)}, True),
        ({'start_source': StartSource.REFERENCE}, True),
    ],
)
def test_only_goals_that_need_a_measured_state_wait_for_it(changes, is_known):
    planner = PlannerSession(replace(SETTINGS, **changes))
    assert planner.knows_start(NOW) is is_known
    assert not planner.knows_start(0.0)
    planner.measure(sample())
    assert planner.knows_start(NOW)
    assert planner.patience(GOAL, NOW) == SETTINGS.start_wait
    assert planner.patience(replace(GOAL, stamp=NOW + 1.0), NOW) == pytest.approx(0.95)
    assert planner.patience(replace(GOAL, stamp=NOW), NOW) == 0.0


def test_goals_that_break_a_rule_need_not_wait():
    planner = PlannerSession(SETTINGS)
    assert reason_of(planner.patience, replace(GOAL, points=()), NOW).reason is Reason.EMPTY_GOAL
    assert (
        reason_of(
            planner.patience, replace(GOAL, points=(GoalPoint(time=0.0, positions=(1.0,)),)), NOW
        )
    ).reason is Reason.DURATION_OUT_OF_RANGE


def test_nothing_starts_before_there_is_a_time():
    error = reason_of(session().submit, GOAL, 0.0)
    assert error.reason is Reason.START_STATE_UNKNOWN
    assert '/clock' in str(error)


@pytest.mark.parametrize(
    ('measured', 'reason', 'joint'),
    [
        (sample(velocity=(0.2, 0.0)), Reason.NOT_AT_REST, 'joint1'),
        (sample(velocity=(0.0, -0.2)), Reason.NOT_AT_REST, 'joint2'),
        (sample(position=(0.5, 0.02)), Reason.START_STATE_MISMATCH, 'joint2'),
        (sample(position=(0.5, nan)), Reason.START_STATE_MISMATCH, 'joint2'),
    ],
)
def test_an_arm_that_is_not_at_rest_does_not_start(measured, reason, joint):
    planner = session()
    planner.measure(measured)
    error = reason_of(planner.submit, GOAL, NOW)
    assert (error.reason, error.joint) == (reason, joint)


@pytest.mark.parametrize('velocities', [None, np.array([nan, nan])])
def test_unknown_velocities_are_tolerated(velocities):
    planner = session()
    planner.measure(JointSample(time=NOW, positions=np.array([0.5, 0.0]), velocities=velocities))
    assert planner.submit(GOAL, NOW).plan_id == 1


def test_a_measured_position_that_is_not_finite_is_no_start():
    planner = session()
    planner.measure(sample(position=(nan, 0.0)))
    assert reason_of(planner.submit, GOAL, NOW).reason is Reason.START_STATE_MISMATCH


def test_the_start_may_be_given():
    changes = {'start_source': StartSource.PARAMETER, 'start_position': (0.25, 0.0)}
    planner = PlannerSession(replace(SETTINGS, **changes))
    assert planner.submit(GOAL, NOW).samples.positions[0, 0] == 0.25
    # A measured state, where there is one, must agree.
    error = reason_of(session(**changes).submit, GOAL, NOW)
    assert error.reason is Reason.START_STATE_MISMATCH
    assert error.value == 0.5


def test_the_start_may_be_the_end_of_the_last_motion():
    planner = PlannerSession(replace(SETTINGS, start_source=StartSource.REFERENCE))
    assert reason_of(planner.submit, GOAL, NOW).reason is Reason.START_STATE_UNKNOWN
    planner.settings = replace(
        SETTINGS, start_source=StartSource.PARAMETER, start_position=(0.0, 0.0)
    )
    end = planner.submit(GOAL, NOW).end
    planner.settings = replace(SETTINGS, start_source=StartSource.REFERENCE)
    assert planner.submit(GOAL, end).samples.positions[0, 0] == pi


def test_the_reference_is_at_rest_before_and_after():
    motion = session().submit(GOAL, NOW)
    before, after = motion.reference(NOW - 5.0), motion.reference(motion.end + 5.0)
    assert before.positions[0].tolist() == [0.5, 0.0]
    assert after.positions[0].tolist() == [pi, 0.0]
    assert not before.efforts.any()
    assert not after.efforts.any()
    middle = motion.reference(0.5 * (motion.start + motion.end))
    assert middle.velocities[0, 0] > 1.0


@pytest.mark.parametrize(
    'changes',
    [
        {'joints': ('joint1',)},
        {'joints': ('joint1', 'joint1')},
        {'min_duration': 2.0, 'max_duration': 1.0},
        {'start_source': StartSource.PARAMETER},
        {'start_source': StartSource.PARAMETER, 'start_position': (0.0, 0.1)},
    ],
)
def test_contradictory_settings_are_refused(changes):
    with pytest.raises(InvalidRequest):
        replace(SETTINGS, **changes)


def test_a_request_beyond_double_precision_is_ill_conditioned(monkeypatch):
    monkeypatch.setattr('flat_planner_ros.core.planning.certified_plan.BOUNDARY_TOLERANCE', 0.0)
    error = reason_of(session().submit, GOAL, NOW)
    assert error.reason is Reason.ILL_CONDITIONED
    assert error.value > 0.0
