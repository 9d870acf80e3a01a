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

"""What the tracker does not understand ends in efforts of zero, one reason, and idleness."""

from collections import deque
from dataclasses import replace
from math import tau
import re

from core.conftest import ARM
from core.tracking.closed_loop import ClosedLoop, motion_of, samples_of
from flat_planner_ros.core.arm import InvalidCommand, InvalidRequest, JointSample
from flat_planner_ros.core.tracking import (
    Phase,
    TrackedMotion,
    Tracker,
    TrackerSettings,
    Uncertainty,
)
import numpy as np
import pytest

SETTINGS = TrackerSettings(delay=0.002)
START = 0.02


@pytest.fixture(scope='module')
def samples():
    """Return the samples of 0 to pi in 1 s."""
    return samples_of()


def moving(samples, *, until=0.4, settings=SETTINGS, **options):
    """Return a loop in the midst of its motion."""
    loop = ClosedLoop(Tracker(ARM, settings), ARM, **options)
    loop.run(START)
    loop.tracker.follow(motion_of(samples, start=loop.arm.time), loop.arm.time)
    loop.run(until)
    assert loop.tracker.phase is Phase.TRACKING
    assert np.abs(loop.acting).max() > 1e-4
    return loop


def assert_given_up(loop, reason):
    """Check that one reason is given, the effort is zero, and nothing follows."""
    assert reason in loop.tracker.take_fault()
    assert loop.tracker.take_fault() == ''
    assert loop.tracker.phase is Phase.IDLE
    assert not loop.acting.any()
    count = len(loop.efforts)
    loop.run(0.1)
    assert not np.any(loop.efforts[count:])
    assert loop.tracker.take_fault() == ''


def test_nothing_is_sent_before_the_first_command():
    loop = ClosedLoop(Tracker(ARM, SETTINGS), ARM)
    for _ in range(50):
        now = loop.arm.time
        assert loop.tracker.hear(loop.sample(), now) is None
        assert loop.tracker.watch(now) is None
        loop.arm.advance(now + loop.period)


def test_nothing_is_sent_before_the_motion_begins(samples):
    loop = ClosedLoop(Tracker(ARM, SETTINGS), ARM)
    loop.run(START)
    loop.tracker.follow(motion_of(samples, start=START + 0.1), START)
    loop.run(0.09)
    assert loop.tracker.phase is Phase.IDLE
    assert not loop.commanded
    loop.run(0.03)
    assert loop.tracker.phase is Phase.TRACKING
    assert loop.commanded


def test_a_turn_that_is_counted_before_a_motion_begins_is_no_jump(samples):
    loop = ClosedLoop(Tracker(ARM, SETTINGS), ARM)
    loop.run(START, lambda sample: replace(sample, positions=sample.positions - [tau, 0.0]))
    loop.tracker.follow(motion_of(samples, start=START + 0.05), START)
    loop.run(0.2)
    assert loop.tracker.phase is Phase.TRACKING
    assert loop.tracker.error < 5e-3


@pytest.mark.parametrize(
    ('spoil', 'reason'),
    [
        (lambda sample: None, 'old'),
        (lambda sample: replace(sample, positions=np.array([np.nan, 0.0])), 'not finite'),
        (lambda sample: replace(sample, positions=sample.positions + [0.3, 0.0]), 'jumped by 0.3'),
    ],
    ids=['silence', 'not a number', 'jump'],
)
def test_bad_samples_end_the_motion(samples, spoil, reason):
    loop = moving(samples)
    loop.run(0.1, spoil)
    loop.run(0.15)
    assert_given_up(loop, reason)


def test_a_single_gap_is_bridged(samples):
    loop = moving(samples)
    loop.run(0.04, lambda sample: None)
    loop.run(0.2)
    assert loop.tracker.phase is Phase.TRACKING
    assert loop.tracker.error < 5e-3


def test_the_effort_goes_to_zero_along_the_ramp(samples):
    loop = moving(samples, settings=replace(SETTINGS, ramp=0.2))
    last = loop.acting.copy()
    loop.run(0.002, lambda sample: replace(sample, positions=sample.positions * np.nan))
    count = len(loop.efforts)
    loop.run(0.25)
    found = np.array(loop.efforts[count:])[:, 0]
    times = np.array(loop.times[count:]) - loop.times[count - 1]
    expected = last[0] * np.maximum(0.0, 1.0 - times / 0.2)
    np.testing.assert_allclose(found, expected, atol=0.02 * abs(last[0]))


@pytest.mark.parametrize('leap', [-10.0, -0.1, 0.5, 1e9])
@pytest.mark.parametrize('is_heard', [True, False])
def test_where_the_clock_is_set_the_effort_goes_to_zero_along_the_ramp(samples, leap, is_heard):
    """By the new time, be joint samples heard in it or not."""
    loop = moving(samples)
    tracker, begin = loop.tracker, loop.arm.time
    last, given = loop.acting, []
    assert tracker.watch(begin) is None
    for now in begin + leap + loop.period * np.arange(1.0, 76.0):
        sample = JointSample(time=now, positions=loop.arm.position)
        efforts = tracker.hear(sample, now) if is_heard else tracker.watch(now)
        given.append(np.zeros(1) if efforts is None else efforts)
    expected = last[0] * np.maximum(0.0, 1.0 - np.arange(75) * loop.period / SETTINGS.ramp)
    np.testing.assert_allclose(np.array(given)[:, 0], expected, atol=0.05 * abs(last[0]))
    assert tracker.phase is Phase.IDLE
    assert re.search('sample|set back', tracker.take_fault())
    assert tracker.take_fault() == ''


def test_lasting_saturation_ends_the_motion(samples):
    limited = replace(SETTINGS, effort_limit=(0.002,), saturation_timeout=0.2, max_error=10.0)
    loop = ClosedLoop(Tracker(ARM, limited), ARM)
    loop.run(START)
    loop.tracker.follow(motion_of(samples, start=START), START)
    loop.run(0.7)
    assert np.abs(loop.efforts).max() == pytest.approx(0.002)
    assert_given_up(loop, 'at its limit')


def old(samples):
    """Return what spoils samples so that each is some samples old when it is used."""
    waiting = deque()

    def spoil(sample):
        waiting.append(sample)
        return waiting.popleft() if len(waiting) > samples else None

    return spoil


def test_samples_that_are_late_are_made_up_for_as_long_as_that_is_safe(samples):
    """The loop knows their age; that of its efforts it does not."""
    loop = moving(samples, late=1)
    loop.run(0.3, old(2))
    assert loop.tracker.phase is Phase.TRACKING
    assert loop.tracker.ages.mean == pytest.approx(0.004, rel=0.3)
    assert loop.tracker.ages.oldest == pytest.approx(0.004)
    assert loop.tracker.error < 0.02
    late = loop.tracker.certificate.late
    loop.run(0.3, old(round(2.0 * late / loop.period)))
    loop.run(0.15)
    assert_given_up(loop, 'ms old when they are used')
    for _ in range(120):
        loop.tracker.hear(replace(loop.sample(), time=loop.arm.time - 0.02), loop.arm.time)
        loop.arm.advance(loop.arm.time + loop.period)
    again = motion_of(samples, start=loop.arm.time)
    with pytest.raises(InvalidCommand, match='lower bandwidth'):
        loop.tracker.follow(again, loop.arm.time)


@pytest.mark.parametrize(('busy', 'is_too_late'), [(0.01, False), (0.03, True)])
def test_a_machine_that_is_busy_ends_in_one_error_not_in_a_swing(busy, is_too_late):
    """Samples come in bursts, and efforts with them; the arm is pushed meanwhile."""
    loop = ClosedLoop(Tracker(ARM, SETTINGS), ARM, late=1)
    loop.run(START)
    still = samples_of(final=[0.2, 0.0])
    loop.tracker.follow(motion_of(still, start=loop.arm.time), loop.arm.time)
    loop.run(1.1)
    end = loop.arm.time + 0.03
    loop.push = lambda time: 0.1 if time < end else 0.0
    faults, largest, waiting, wake = [], 0.0, [], 0.0
    while loop.arm.time < 3.0:
        now = loop.arm.time
        waiting.append(loop.sample())
        if now >= wake:
            for sample in waiting:
                efforts = loop.tracker.hear(sample, now)
                loop.acting = loop.acting if efforts is None else efforts
            waiting, wake = [], now + busy
        loop.arm.hold(loop.acting + loop.push(now))
        loop.arm.advance(now + loop.period)
        faults.append(loop.tracker.take_fault())
        if loop.tracker.phase is Phase.TRACKING:
            largest = max(largest, loop.tracker.error)
    assert largest < 0.4
    assert (loop.tracker.phase is Phase.IDLE) == is_too_late
    if not is_too_late:
        assert not any(faults)
        assert loop.tracker.error < 5e-3
        return
    (fault,) = filter(None, faults)
    assert 'ms old' in fault or 'grow from swing to swing' in fault
    assert not loop.acting.any()


@pytest.mark.parametrize('late', [6, 7, 10])
def test_efforts_that_act_late_end_in_one_error_before_the_swing_has_grown(late):
    """Which no age of a sample shows."""
    loop = ClosedLoop(Tracker(ARM, SETTINGS), ARM, late=late)
    loop.run(START)
    still = samples_of(final=[0.2, 0.0])
    loop.tracker.follow(motion_of(still, start=loop.arm.time), loop.arm.time)
    loop.run(1.1)
    end = loop.arm.time + 0.03
    loop.push = lambda time: 0.02 if time < end else 0.0
    loop.run(2.0)
    assert np.abs(np.array(loop.efforts)).max() < 1.0
    assert_given_up(loop, 'grow from swing to swing')


def test_a_diverging_error_ends_the_motion(samples):
    loop = ClosedLoop(
        Tracker(ARM, replace(SETTINGS, max_error=0.1)), ARM.scaled(inertia=3.0), saturation=[0.004]
    )
    loop.run(START)
    loop.tracker.follow(motion_of(samples, start=START), START)
    loop.run(0.9)
    assert_given_up(loop, 'rad from its plan')


def test_a_motion_that_begins_elsewhere_is_not_begun():
    loop = ClosedLoop(Tracker(ARM, SETTINGS), ARM)
    loop.run(START)
    far = samples_of(start=[1.0, 0.0], final=[2.0, 0.0])
    loop.tracker.follow(motion_of(far, start=START), START)
    loop.run(0.1)
    assert not loop.commanded
    assert 'begins 1 rad from the arm' in loop.tracker.take_fault()


def test_the_next_command_is_obeyed_after_a_fault(samples):
    loop = moving(samples)
    loop.run(0.1, lambda sample: None)
    loop.run(1.0)
    assert 'old' in loop.tracker.take_fault()
    assert np.abs(loop.arm.velocity).max() > 0.5  # let go in its midst, it turns on
    loop.arm.reset(np.array([1.0, 0.0]))
    loop.run(0.1)
    again = motion_of(samples_of(start=[1.0, 0.0], final=[0.5, 0.0]), start=loop.arm.time)
    loop.tracker.follow(again, loop.arm.time)
    loop.run(1.1)
    assert loop.tracker.take_fault() == ''
    np.testing.assert_allclose(loop.arm.position, [0.5, 0.0], atol=2e-3)


def test_a_motion_follows_another_without_a_step(samples):
    loop = moving(samples, until=1.1)
    on = samples_of(start=[np.pi, 0.0], final=[2.0, 0.0])
    loop.tracker.follow(motion_of(on, start=loop.arm.time + 0.1), loop.arm.time)
    loop.run(0.05)
    np.testing.assert_allclose(loop.arm.position, [np.pi, 0.0], atol=2e-3)
    loop.run(1.1)
    np.testing.assert_allclose(loop.arm.position, [2.0, 0.0], atol=2e-3)
    # 5e-3 N m: a third of the plan's peak; a step of the reference would show.
    assert np.abs(np.diff(np.array(loop.efforts)[:, 0])).max() < 5e-3


def test_without_hold_the_arm_is_let_go(samples):
    loop = ClosedLoop(Tracker(ARM, replace(SETTINGS, hold=False)), ARM, late=1)
    loop.run(START)
    loop.tracker.follow(motion_of(samples, start=START), START)
    loop.run(1.2)
    assert loop.tracker.phase is Phase.IDLE
    assert loop.tracker.take_fault() == ''
    assert not loop.acting.any()
    np.testing.assert_allclose(loop.arm.position, [np.pi, 0.0], atol=5e-3)


def test_a_motion_that_is_yet_to_begin_waits_for_joint_samples(samples):
    """None before the command, and none for half a second after the first of them."""
    loop = ClosedLoop(Tracker(ARM, SETTINGS), ARM, late=1)
    loop.tracker.follow(motion_of(samples, start=1.0), 0.0)
    loop.run(0.9, lambda sample: sample if 0.2 < sample.time < 0.3 or sample.time > 0.8 else None)
    assert not loop.commanded
    assert loop.tracker.take_fault() == ''
    loop.run(1.2)
    assert loop.tracker.phase is Phase.TRACKING
    np.testing.assert_allclose(loop.arm.position, [np.pi, 0.0], atol=2e-3)


@pytest.mark.parametrize(
    ('heard', 'reason'),
    [(0.0, 'no joint sample yet'), (0.3, 'no joint sample for 0.1')],
)
def test_a_motion_is_not_begun_without_joint_samples(samples, heard, reason):
    loop = ClosedLoop(Tracker(ARM, SETTINGS), ARM, late=1)
    loop.tracker.follow(motion_of(samples, start=0.4), 0.0)
    loop.run(0.39, lambda sample: sample if sample.time < heard else None)
    assert loop.tracker.take_fault() == ''
    loop.run(0.6, lambda sample: None)
    assert_given_up(loop, reason)
    assert not loop.commanded


def test_refuses_what_it_cannot_follow(samples):
    tracker = Tracker(ARM, SETTINGS)
    with pytest.raises(InvalidCommand, match='no joint sample yet.* is not begun'):
        tracker.follow(motion_of(samples), 0.0)
    tracker.hear(JointSample(time=5.0, positions=np.zeros(2)), 5.0)
    with pytest.raises(InvalidCommand, match='ended 4.000 s ago'):
        tracker.follow(motion_of(samples), 5.0)
    three = TrackedMotion(
        start=5.0,
        times=np.array([0.0, 1.0]),
        positions=np.zeros((2, 3)),
        velocities=np.zeros((2, 3)),
    )
    with pytest.raises(InvalidCommand, match='2 joints, the motion 3'):
        tracker.follow(three, 5.0)


@pytest.mark.parametrize(
    ('field', 'values'),
    [
        ('times', [0.0, 0.0, 1.0]),
        ('positions', [[0.0, 0.0], [np.nan, 0.0], [1.0, 0.0]]),
        ('velocities', [[0.0, 0.0], [1.0, 0.0], [1.0, 0.0]]),
        ('velocities', [[0.0, 0.0]]),
    ],
)
def test_refuses_motions_without_meaning(field, values):
    fine = {
        'start': 0.0,
        'times': np.array([0.0, 0.5, 1.0]),
        'positions': np.array([[0.0, 0.0], [0.5, 0.0], [1.0, 0.0]]),
        'velocities': np.zeros((3, 2)),
    }
    TrackedMotion(**fine)
    with pytest.raises(InvalidCommand):
        TrackedMotion(**{**fine, field: np.array(values)})


@pytest.mark.parametrize(
    'setting',
    [
        {'rate': 0.0},
        {'damping': np.nan},
        {'delay': -1.0},
        {'timeout': 0.0},
        {'margin': 1.0},
        {'effort_limit': (0.0,)},
        {'uncertainty': {'inertia': 1.0}},
    ],
    ids=str,
)
def test_refuses_settings_without_meaning(setting):
    if 'uncertainty' in setting:
        with pytest.raises(InvalidRequest, match='inertia'):
            Uncertainty(**setting['uncertainty'])
        return
    with pytest.raises(InvalidRequest, match=next(iter(setting))):
        TrackerSettings(**setting)


def test_refuses_limits_of_another_arm():
    with pytest.raises(InvalidRequest, match='1 or 1 entries, got 3'):
        Tracker(ARM, replace(SETTINGS, effort_limit=(1.0, 1.0, 1.0)))
