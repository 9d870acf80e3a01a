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

"""Motions of the paper's arm, and of an arm with weight, tracked against what no plan knows."""

from dataclasses import replace
from math import pi

from core.conftest import ARM, envelope
from core.tracking.closed_loop import ClosedLoop, ENCODER, motion_of, samples_of, settling
from flat_planner_ros.core.arm import PlanarArm
from flat_planner_ros.core.monitor.model_estimate import estimate_model
from flat_planner_ros.core.plant import EffortProfile, rollout
from flat_planner_ros.core.tracking import Phase, Tracker, TrackerSettings
import numpy as np
import pytest

SETTINGS = TrackerSettings(delay=0.002)
START = 0.02
"""When motions begin [s]."""

PLANT = {
    'nominal': ARM,
    'k, c +10 %': ARM.scaled(stiffness=1.1, damping=1.1),
    'k, c -10 %': ARM.scaled(stiffness=0.9, damping=0.9),
    'k, c +25 %': ARM.scaled(stiffness=1.25, damping=1.25),
    'k, c -25 %': ARM.scaled(stiffness=0.75, damping=0.75),
    'inertia +10 %': ARM.scaled(inertia=1.1),
    'inertia -10 %': ARM.scaled(inertia=0.9),
    'friction': replace(ARM, viscous_friction=[2e-4], coulomb_friction=[5e-4]),
}
WITHIN = dict(zip(PLANT, [0.0, 0.4, 0.4, 0.8, 0.8, 0.4, 0.4, 0.1], strict=True))
"""Time after the motion until all errors stay below 5 mrad [s]."""

VERTICAL = PlanarArm.from_links(
    link_length=[0.30, 0.25, 0.25, 0.20],
    link_com=[0.256, 0.211, 0.173, 0.100],
    link_mass=[0.846, 0.655, 0.155, 0.060],
    link_inertia=[6.14e-3, 3.47e-3, 1.08e-3, 2.0e-4],
    counterbalance_mass=[0.71815, 0.12],
    counterbalance_arm=[0.10, 0.05],
    stiffness=0.25,
    damping=3.3e-4,
    gravity=9.81,
)
"""The arm of config/arm_4dof.yaml."""


@pytest.fixture(scope='module')
def plan_of_paper():
    """Return the samples of 0 to pi in 1 s."""
    return samples_of()


def tracked(samples, true, *, arm=ARM, settings=SETTINGS, duration=2.1, **options):
    """Return times, errors, efforts and tracker of one motion."""
    loop = ClosedLoop(
        Tracker(arm, settings), true, period=settings.period, **{'late': 1, **options}
    )
    loop.run(START)
    motion = motion_of(samples, start=loop.arm.time)
    loop.tracker.follow(motion, loop.arm.time)
    times, positions, efforts = loop.run(duration)
    errors = positions - np.array([motion.at(time).positions for time in times])
    return times, errors, efforts, loop.tracker


@pytest.mark.parametrize('name', PLANT)
def test_a_wrong_model_ends_at_rest_where_it_should(plan_of_paper, name):
    """14-bit encoders, 500 Hz, one sample of delay."""
    times, errors, efforts, tracker = tracked(plan_of_paper, PLANT[name])
    assert tracker.phase is Phase.TRACKING
    assert settling(times, errors, START + 1.0) <= WITHIN[name]
    assert np.abs(efforts).max() <= 1.3 * np.abs(plan_of_paper.efforts).max()
    assert np.abs(errors[-1]).max() < 2e-3


@pytest.mark.parametrize('factor', [0.9, 1.1])
def test_the_swing_at_the_end_is_half_of_what_no_feedback_leaves(plan_of_paper, factor):
    true = ARM.scaled(stiffness=factor, damping=factor)
    profile = EffortProfile(
        start=0.0, times=plan_of_paper.times, efforts=plan_of_paper.efforts[:, :1]
    )
    open_loop = rollout(true, profile, 1.0)
    free = envelope(true, open_loop.positions[-1, 1], open_loop.velocities[-1, 1])
    times, errors, _, _ = tracked(plan_of_paper, true, duration=1.1)
    end = int(np.argmin(np.abs(times - START - 1.0)))
    rate = (errors[end + 1, 1] - errors[end - 1, 1]) / (times[end + 1] - times[end - 1])
    assert envelope(true, errors[end, 1], rate) < 0.5 * free


@pytest.mark.parametrize(('rate', 'within'), [(200.0, 0.65), (1000.0, 0.35)])
@pytest.mark.parametrize('late', [1, 2])
def test_other_rates_and_delays(plan_of_paper, rate, within, late):
    """At 200 Hz the fastest loop that is certified is slower than the one asked for."""
    settings = replace(SETTINGS, rate=rate, delay=late / rate)
    times, errors, _, tracker = tracked(
        plan_of_paper, PLANT['k, c -10 %'], settings=settings, late=late, duration=1.8
    )
    assert tracker.phase is Phase.TRACKING
    assert settling(times, errors, START + 1.0) <= within


def test_noise_of_a_milliradian_stays_small(plan_of_paper):
    _, errors, efforts, tracker = tracked(plan_of_paper, ARM, noise=1e-3, settings=SETTINGS)
    assert tracker.phase is Phase.TRACKING
    assert np.abs(errors).max() < 5e-3
    assert np.abs(efforts).max() <= 2.0 * np.abs(plan_of_paper.efforts).max()


@pytest.mark.parametrize('name', ['nominal', 'k, c -10 %', 'inertia +10 %'])
@pytest.mark.parametrize('limit', [0.015, 0.05])
def test_a_swing_dies_away_within_the_limits(name, limit):
    """The last link is let go 0.3 rad from its place; the smaller limit is the plan's peak."""
    settings = replace(SETTINGS, jump=0.4, effort_limit=(limit,))
    tracker = Tracker(ARM, settings)
    loop = ClosedLoop(tracker, PLANT[name], late=1, position=np.array([0.2, 0.3]))
    loop.run(0.004)
    tracker.follow(motion_of(samples_of(start=[0.2, 0.0], final=[0.2, 0.0])), loop.arm.time)
    times, positions, efforts = loop.run(1.5)
    assert settling(times, positions - [0.2, 0.0], 0.0) <= 0.9
    assert np.abs(efforts).max() <= limit
    assert tracker.phase is Phase.TRACKING


@pytest.mark.parametrize('limit', [np.inf, 0.02])
def test_a_push_at_the_last_link_dies_away(limit):
    """It starts a swing of 0.3 rad, and takes little more effort than the motion of 1 s to pi."""
    tracker = Tracker(ARM, replace(SETTINGS, effort_limit=(limit,)))
    loop = ClosedLoop(tracker, ARM, late=1)
    loop.run(START)
    tracker.follow(motion_of(samples_of(final=[0.2, 0.0]), loop.arm.time), loop.arm.time)
    loop.run(1.1)
    end = loop.arm.time + 0.03
    loop.arm.push([3.2e-3, 3.2e-3], end)  # a torque on the last link acts at both joints
    times, positions, efforts = loop.run(1.2)
    errors = positions - [0.2, 0.0]
    assert np.abs(errors[:, 1]).max() > 0.3
    assert settling(times, errors, end) <= 0.9
    assert np.abs(efforts).max() <= min(limit, 0.03)
    assert tracker.phase is Phase.TRACKING


def test_a_push_that_turns_the_whole_arm_dies_away():
    """At joint 1, with a hundred times the momentum: the effort is as large as the push."""
    tracker = Tracker(ARM, SETTINGS)
    loop = ClosedLoop(tracker, ARM, late=1)
    loop.run(START)
    tracker.follow(motion_of(samples_of(final=[0.2, 0.0]), loop.arm.time), loop.arm.time)
    loop.run(1.1)
    end = loop.arm.time + 0.03
    loop.push = lambda time: 0.4 if time < end else 0.0
    times, positions, _ = loop.run(1.2)
    errors = positions - [0.2, 0.0]
    assert np.abs(errors[:, 1]).max() > 0.3
    assert settling(times, errors, end) <= 0.9
    assert tracker.phase is Phase.TRACKING


@pytest.mark.parametrize(
    'factors', [{}, {'stiffness': 0.75, 'damping': 0.75}, {'inertia': 1.1}], ids=str
)
def test_an_arm_with_weight(factors):
    """Which no feed-forward holds."""
    start = np.array([-1.5, 0.5, 0.3, 0.0])
    samples = samples_of(VERTICAL, start=start, final=[-0.8, 0.9, 1.3, 0.0])
    times, errors, efforts, tracker = tracked(
        samples,
        VERTICAL.scaled(**factors),
        arm=VERTICAL,
        position=start,
        duration=1.6,
    )
    assert tracker.phase is Phase.TRACKING
    assert settling(times, errors, START + 1.0) <= 0.4
    assert (np.abs(efforts).max(axis=0) <= 1.5 * np.abs(samples.efforts).max(axis=0)[:3]).all()


def test_with_the_model_of_the_first_motion_the_next_one_needs_next_to_no_feedback(plan_of_paper):
    """Efforts begin to act anywhere between two samples, which joint states do not show."""
    true = PLANT['k, c -10 %']
    first = ClosedLoop(Tracker(ARM, SETTINGS), true, uneven=True)
    first.tracker.follow(motion_of(plan_of_paper, START), 0.0)
    times, positions, efforts = first.run(START + 2.0)
    shown = ENCODER * np.round(positions / ENCODER)
    padded = np.column_stack((efforts, 0.0 * efforts))
    found = estimate_model(times, shown, padded, ARM, are_held=True)
    assert found.is_trustworthy, found.reason
    model = found.values.applied_to(ARM)
    planned = samples_of(model)
    second = ClosedLoop(Tracker(model, SETTINGS), true, uneven=True)
    second.tracker.follow(motion_of(planned, START), 0.0)
    times, positions, efforts = second.run(START + 1.5)
    assert np.abs(positions[times > START + 1.0] - [pi, 0.0]).max() < 1e-3
    fed_forward = np.interp(times, START + planned.times, planned.efforts[:, 0])
    feedback = np.abs(efforts[:, 0] - fed_forward)[times < START + 1.0].max()
    assert feedback < 0.1 * np.abs(planned.efforts).max()


def test_known_friction_is_compensated(plan_of_paper):
    """On an arm without errors nothing is left for the feedback."""
    rough = PLANT['friction']
    _, known, _, _ = tracked(plan_of_paper, rough, arm=rough, duration=1.1)
    _, unknown, _, _ = tracked(plan_of_paper, rough, duration=1.1)
    assert np.abs(known).max() < 0.5 * np.abs(unknown).max()


def test_a_tracker_for_the_right_model_goes_on_where_the_other_one_holds():
    true = ARM.scaled(stiffness=0.8, damping=0.8)
    first, second = Tracker(ARM, SETTINGS), Tracker(true, SETTINGS)
    loop = ClosedLoop(first, true, late=1)
    loop.run(0.1)
    first.follow(motion_of(samples_of(), loop.arm.time), loop.arm.time)
    assert first.is_moving(loop.arm.time)
    assert not first.is_moving(loop.arm.time - 0.05), 'as long as it waits'
    _, _, before = loop.run(2.0)
    assert not first.is_moving(loop.arm.time)
    second.continue_from(first)
    loop.tracker = second
    since = len(before)
    _, positions, efforts = loop.run(0.5)
    assert np.abs(efforts[since:]).max() < 0.1 * np.abs(before).max()
    assert np.abs(positions[since:] - [pi, 0.0]).max() < 5e-3
    begin = loop.arm.time
    back = samples_of(true, start=[pi, 0.0], final=[0.0, 0.0])
    second.follow(motion_of(back, begin), begin)
    times, positions, _ = loop.run(1.5)
    assert settling(times, positions, begin + 1.0) == 0.0
