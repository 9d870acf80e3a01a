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

"""A swinging arm is caught by an ordinary motion, or brought to rest, by the session."""

from dataclasses import replace
from math import pi

from core.conftest import ARM, envelope
from flat_planner_ros.core.arm import Drive, JointSample
from flat_planner_ros.core.model_fit import seen_stiffness
from flat_planner_ros.core.planning import (
    JointLimits,
    PlanningOptions,
    Reason,
    RequestRejected,
    Strategy,
)
from flat_planner_ros.core.plant import DriveSettings, EffortProfile, SimulatedArm
from flat_planner_ros.core.session import (
    Goal,
    GoalPoint,
    Outcome,
    PlannerSession,
    ReplanFrom,
    SessionSettings,
    SettlePose,
    WhenMoving,
)
import numpy as np
import pytest

NOISE = 1e-4
"""Of the measured angles [rad]."""

PERIOD = 0.005
SWING = 0.3
"""Amplitude of the swing before [rad]."""

ONE_SWING = 2.0 * pi / ARM.natural_mode().damped_frequency
NOW = 100.0
SETTINGS = SessionSettings(
    joints=('joint1', 'joint2'),
    arm=ARM,
    options=PlanningOptions(strategy=Strategy.MIN_CONTROL_EFFORT),
)


def goal(angle, duration=ONE_SWING, stamp=None):
    """Return a goal for joint 1."""
    points = (GoalPoint(time=duration, positions=(angle,)),)
    return Goal(joint_names=('joint1',), points=points, stamp=stamp)


class Bench:
    """A session and a simulated arm, seen at 200 Hz and moved by the session's efforts."""

    def __init__(self, true=ARM, efforts=((0.012, 0.16), (-0.012, 0.16)), **changes):
        """Kick the arm, then look at it for a swing."""
        self.session = PlannerSession(replace(SETTINGS, **changes))
        self.arm, self.random = SimulatedArm(true), np.random.default_rng(3)
        for effort, duration in efforts:
            self.arm.hold([effort])
            self.arm.advance(self.arm.time + duration)
        self.arm.hold([0.0])
        self.look(1.2 * ONE_SWING)

    @property
    def now(self):
        """Return the present time [s]."""
        return NOW + self.arm.time

    @property
    def amplitude(self):
        """Return the envelope of the passive joint [rad]."""
        return envelope(self.arm.arm, self.arm.position[1], self.arm.velocity[1])

    def look(self, duration):
        """Go on for a time [s] and measure angles only."""
        for _ in range(round(duration / PERIOD)):
            self.arm.advance(self.arm.time + PERIOD)
            angles = self.arm.position + NOISE * self.random.standard_normal(2)
            self.session.measure(JointSample(time=self.now, positions=angles))

    def play(self, motion, rest=0.0):
        """Carry a motion out, and go on for a time [s]."""
        times, efforts = motion.samples.times, motion.samples.efforts[:, :1]
        profile = EffortProfile(start=motion.start - NOW, times=times, efforts=efforts)
        self.arm.command(profile, self.arm.time)
        self.look(motion.end + rest + PERIOD - self.now)


class ServoBench(Bench):
    """The same with an arm under servos, let go with its passive joint beside zero."""

    def __init__(self, true=ARM, **changes):
        """Look at it for a swing."""
        options = replace(changes.pop('options', SETTINGS.options), drive=Drive.POSITION)
        self.session = PlannerSession(replace(SETTINGS, options=options, **changes))
        self.random = np.random.default_rng(3)
        drives = DriveSettings(drive=Drive.POSITION)
        self.arm = SimulatedArm(true, position=np.array([0.4, 1.05 * SWING]), drives=drives)
        self.look(1.2 * ONE_SWING)

    @property
    def amplitude(self):
        """Return the envelope of the passive joint while the servo holds the other one [rad]."""
        arm = self.arm
        return envelope(arm.arm, arm.position[1], arm.velocity[1], held=True)

    def play(self, motion, rest=0.0):
        """Carry the motion's positions out, and go on for a time [s]."""
        samples = motion.samples
        profile = EffortProfile(
            start=motion.start - NOW,
            times=samples.times,
            efforts=np.zeros((len(samples.times), 1)),
            positions=samples.positions[:, :1],
            velocities=samples.velocities[:, :1],
        )
        self.arm.command(profile, self.arm.time)
        self.look(motion.end + rest + PERIOD - self.now)


def test_a_goal_given_to_a_swinging_arm_ends_at_rest():
    bench = Bench()
    assert bench.amplitude > SWING
    motion = bench.session.submit(goal(1.0), bench.now)
    assert motion.start == pytest.approx(bench.now + SETTINGS.lookahead)
    assert motion.swing == pytest.approx(bench.amplitude, rel=0.05)
    bench.play(motion)
    assert bench.amplitude < 0.01 * SWING
    assert bench.arm.position[0] == pytest.approx(1.0, abs=4e-3)


@pytest.mark.parametrize('bench_of', [Bench, ServoBench])
@pytest.mark.parametrize(
    ('factor', 'strategy', 'shares'),
    [
        (0.9, Strategy.MIN_CONTROL_EFFORT, (0.12, 0.02)),
        (1.1, Strategy.INSENSITIVE, (0.02, 0.02)),
    ],
)
def test_a_spring_wrong_by_a_tenth_leaves_a_ninth_and_then_next_to_nothing(
    bench_of, factor, strategy, shares
):
    options = replace(SETTINGS.options, strategy=strategy)
    bench = bench_of(ARM.scaled(stiffness=factor, damping=factor), options=options)
    before = bench.amplitude
    for share in shares:
        motion = bench.session.settle(bench.now)
        if motion is not None:
            bench.play(motion, rest=ONE_SWING)
        assert bench.amplitude < share * before


def test_what_a_swing_shows_of_the_spring_is_believed_as_far_as_it_shows_it():
    """A swing of the size of the noise shows nothing; the model's spring then counts."""
    random = np.random.default_rng(2)
    times = np.arange(200) * PERIOD
    mode = ARM.scaled(stiffness=0.9).natural_mode()
    for size, least, most in ((0.3, 0.0, 0.01), (1e-2, 0.01, 0.15), (0.0, 1.0, np.inf)):
        passive = size * np.cos(mode.frequency * times)
        link = -ARM.inertia_star.last / ARM.inertia_star.both * passive
        passive = passive + NOISE * random.standard_normal(200)
        link = link + NOISE * random.standard_normal(200)
        factor, error = seen_stiffness(times, link + passive, passive, ARM, ONE_SWING)
        assert least < error < most
        assert abs(factor - 0.9) < 3.0 * error


def test_settling_takes_the_shortest_time_within_the_limits():
    limits = JointLimits.of(2, effort=[0.015, np.inf])
    bench = Bench(limits=limits)
    motion = bench.session.settle(bench.now)
    assert motion.is_shortest
    assert np.abs(motion.samples.efforts).max() == pytest.approx(0.015, rel=1e-2)
    about = bench.arm.position[0]
    bench.play(motion)
    assert bench.amplitude < 0.01 * SWING
    assert bench.arm.position[0] == pytest.approx(about, abs=0.1)
    assert not bench.session.take_ended(bench.now), 'angles alone do not show rest at once'
    bench.look(ONE_SWING)
    assert [ended.outcome for ended in bench.session.take_ended(bench.now)] == [Outcome.STOPPED]
    assert bench.session.settle(bench.now) is None


def test_settling_ends_coasting_where_that_is_shortest():
    bench = Bench(efforts=((0.005, 0.2),))
    speed = bench.arm.velocity[0]
    assert speed > 1.0
    motion = bench.session.settle(bench.now)
    at = bench.arm.position[0]
    bench.play(motion)
    assert bench.amplitude < 3e-3
    assert abs(bench.arm.velocity).max() < 0.02
    assert 0.0 < bench.arm.position[0] - at < 2.0 * speed


def test_settling_may_return_to_the_last_goal():
    bench = Bench(efforts=((0.0, 0.1),), settle_pose=SettlePose.LAST_GOAL)
    assert bench.session.settle(bench.now) is None
    bench.play(bench.session.submit(goal(1.0, 1.0), bench.now))
    bench.arm.hold([0.01])
    bench.look(0.1)
    bench.arm.hold([-0.01])
    bench.look(0.1)
    bench.arm.hold([0.0])
    bench.look(ONE_SWING)
    motion = bench.session.settle(bench.now)
    assert motion.samples.positions[-1] == pytest.approx([1.0, 0.0])
    bench.play(motion)
    assert bench.arm.position == pytest.approx([1.0, 0.0], abs=5e-3)


def test_under_servos_the_swing_is_caught_by_the_joints_alone():
    """The true arm: the swing of link n under the planned angles of link n-1."""
    options = replace(SETTINGS.options, drive=Drive.POSITION)
    session = PlannerSession(replace(SETTINGS, options=options))
    mode = ARM.natural_mode(held=True)
    random = np.random.default_rng(4)

    def free(time):
        angle = SWING * np.exp((1j * mode.damped_frequency - mode.decay_rate) * time)
        return angle.real

    for k in range(201):
        angles = np.array([0.4, free(k * PERIOD)]) + NOISE * random.standard_normal(2)
        session.measure(JointSample(time=NOW + k * PERIOD, positions=angles))
    now = NOW + 200 * PERIOD
    motion = session.submit(goal(1.0), now)
    positions, velocities = motion.samples.positions, motion.samples.velocities
    ahead = motion.start - NOW
    assert positions[0] == pytest.approx([0.4, free(ahead)], abs=3e-3)
    slope = (free(ahead + 1e-6) - free(ahead - 1e-6)) / 2e-6
    assert velocities[0] == pytest.approx([0.0, slope], abs=0.03)
    assert positions[-1] == pytest.approx([1.0, 0.0])


def test_a_limit_too_low_for_the_swing_is_named_with_what_would_do():
    limits = JointLimits.of(2, effort=[0.002, np.inf])
    bench = Bench(limits=limits)
    with pytest.raises(RequestRejected) as caught:
        bench.session.submit(goal(0.5, 0.3), bench.now)
    assert caught.value.reason is Reason.EFFORT_LIMIT
    assert 'swings by 0.3' in caught.value.message
    assert 'of waiting would do' in caught.value.message
    assert caught.value.duration_min > 0.3
    found = bench.session.submit(goal(0.5, caught.value.duration_min), bench.now)
    assert np.abs(found.samples.efforts).max() <= 0.002 * (1.0 + 1e-6)


def test_swings_are_refused_where_that_is_wanted_or_too_little_is_seen():
    refusing = Bench(when_moving=WhenMoving.REFUSE)
    blind = PlannerSession(SETTINGS)
    position = np.array([0.0, 0.2])
    blind.measure(JointSample(time=NOW, positions=position, velocities=np.zeros(2)))
    offset = PlannerSession(SETTINGS)
    for k in range(200):
        offset.measure(JointSample(time=NOW + k * PERIOD, positions=np.array([0.0, 0.05])))
    driven = Bench()
    driven.session.measure(
        replace(driven.session.measured, time=driven.now + 1e-3, efforts=np.array([1e-3, 0.0]))
    )
    late = goal(1.0, stamp=refusing.now + 0.01)
    for session, now, asked, reason in (
        (refusing.session, refusing.now, goal(1.0), Reason.START_STATE_MISMATCH),
        (driven.session, driven.now, goal(1.0), Reason.START_STATE_MISMATCH),
        (blind, NOW, goal(1.0), Reason.START_STATE_MISMATCH),
        (offset, NOW + 1.0, goal(1.0), Reason.START_STATE_MISMATCH),
        (Bench().session, refusing.now, late, Reason.OLD_HEADER_TIMESTAMP),
    ):
        with pytest.raises(RequestRejected) as caught:
            session.submit(asked, now)
        assert caught.value.reason is reason


def test_a_goal_may_take_the_place_of_one_that_waits_to_catch_the_arm():
    bench = Bench()
    first = bench.session.submit(goal(1.0), bench.now)
    bench.look(0.02)
    with pytest.raises(RequestRejected):
        bench.session.submit(goal(0.5, stamp=first.start - 0.01), bench.now)
    later = replace(bench.session.settings, lookahead=0.05)
    bench.session.settings = later
    second = bench.session.submit(goal(0.5), bench.now)
    assert second.start == first.start
    assert second.samples.positions[0] == pytest.approx(first.samples.positions[0])
    bench.play(second)
    assert bench.amplitude < 0.01 * SWING
    assert bench.arm.position[0] == pytest.approx(0.5, abs=4e-3)


def test_planning_that_takes_too_long_for_the_start_is_said_so():
    bench = Bench()
    late = bench.now + 0.9 * SETTINGS.lookahead
    with pytest.raises(RequestRejected) as caught:
        bench.session.submit(goal(1.0), bench.now, lambda: late)
    assert caught.value.reason is Reason.BUSY


def residual_after_a_push(source):
    """Return what a push leaves when the goal is given again in the midst of the motion."""
    bench = Bench(efforts=((0.0, 0.1),), replan_from=source)
    first = bench.session.submit(goal(pi, 1.2), bench.now)
    times, efforts = first.samples.times, first.samples.efforts[:, 0].copy()
    efforts[(times > 0.2) & (times < 0.3)] += 0.006
    pushed = EffortProfile(start=first.start - NOW, times=times, efforts=efforts[:, None])
    bench.arm.command(pushed, bench.arm.time)
    bench.look(0.7)
    second = bench.session.submit(goal(pi, 0.9), bench.now)
    bench.look(second.start - bench.now)
    bench.play(second)
    return bench.amplitude, abs(bench.arm.position[0] - pi)


def test_replanning_from_what_is_measured_takes_a_push_into_account():
    planned, missed = residual_after_a_push(ReplanFrom.REFERENCE)
    measured, left = residual_after_a_push(ReplanFrom.MEASURED)
    assert planned > 0.03
    assert missed > 0.3
    assert measured < 0.1 * planned
    assert left < 0.03 * missed
