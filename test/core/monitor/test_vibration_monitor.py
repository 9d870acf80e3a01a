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

"""The monitor gives one true report per motion, whatever the samples and plans do."""

from dataclasses import replace
from time import process_time

from flat_planner_ros.core.arm.errors import InvalidRequest
from flat_planner_ros.core.arm.samples import JointSample
from flat_planner_ros.core.monitor.motion_record import (
    joint_indices,
    PlannedMotion,
    Record,
    RECORD_LIMIT,
)
from flat_planner_ros.core.monitor.settings import Level, MonitorSettings
from flat_planner_ros.core.monitor.vibration_monitor import Phase, VibrationMonitor
import numpy as np
import pytest

PERIOD = 0.005
"""Sampling period [s]."""

WINDOW, TIMEOUT = 2.0, 0.5
"""Window and timeout of the monitor [s]."""

FREQUENCY, DECAY = 2.0, 0.8
"""Damped frequency [Hz] and decay [1/s] of the simulated oscillation."""

SETTINGS = MonitorSettings(
    window=WINDOW,
    amplitude_ok=5e-3,
    amplitude_error=5e-2,
    settling_band=2e-3,
    timeout=TIMEOUT,
    expected_frequency=2.1,
    expected_damping_ratio=0.05,
)

NAMES = ('joint1', 'joint2')


def planned(start=10.0, duration=1.0, goal=1.0, **changes):
    """Return a cubic rest-to-rest motion of joint 1 with 51 points."""
    s = np.linspace(0.0, 1.0, 51)
    still = np.zeros_like(s)
    fields = {
        'joint_names': NAMES,
        'start': start,
        'times': s * duration,
        'positions': np.stack((goal * s**2 * (3 - 2 * s), still), axis=-1),
        'velocities': np.stack((goal * 6 * s * (1 - s) / duration, still), axis=-1),
    }
    return PlannedMotion(**(fields | changes))


def sample(time, motion, amplitude=0.02, **changes):
    """Return the planned state before, a free oscillation of joint 2 after the motion."""
    position, velocity = motion.reference(time)
    elapsed = time - motion.end
    swing = amplitude * np.exp(-DECAY * elapsed) * np.cos(2 * np.pi * FREQUENCY * elapsed)
    fields = {
        'time': time,
        'positions': position + np.array((0.0, swing if elapsed >= 0.0 else 0.0)),
        'velocities': velocity,
        'efforts': np.array((np.sin(2 * np.pi * (time - motion.start)), np.nan)),
    }
    return JointSample(**(fields | changes))


def feed(monitor, motion, start, end, amplitude=0.02, **changes):
    """Add samples of [start, end) and return the reports."""
    steps = range(round(start / PERIOD), round(end / PERIOD))
    reports = [monitor.add(sample(i * PERIOD, motion, amplitude, **changes)) for i in steps]
    return sum(reports, [])


@pytest.fixture
def monitor():
    return VibrationMonitor(SETTINGS)


def only(reports):
    """Return the one report."""
    assert len(reports) == 1
    return reports[0]


def test_a_motion_yields_one_report_with_what_was_simulated(monitor):
    motion = planned()
    assert monitor.watch(motion) == []
    report = only(feed(monitor, motion, 9.0, 15.0))
    assert report.level is Level.WARN
    assert report.joint == 'joint2'
    assert (report.start_time, report.end_time) == (10.0, 11.0)
    assert report.fit.amplitude == pytest.approx(0.02, rel=1e-6)
    assert report.fit.frequency == pytest.approx(FREQUENCY, rel=1e-6)
    omega = 2 * np.pi * FREQUENCY
    assert report.fit.damping_ratio == pytest.approx(DECAY / np.hypot(DECAY, omega), rel=1e-6)
    assert report.frequency_expected == 2.1
    assert report.damping_expected == 0.05
    assert report.window == pytest.approx(WINDOW)
    assert report.samples == round(WINDOW / PERIOD) + 1
    assert report.fit.fit_rms < 1e-12
    assert report.fit.bias == pytest.approx(0.0, abs=1e-12)
    assert report.rms_effort[0] == pytest.approx(np.sqrt(0.5), rel=1e-6)
    assert report.rms_effort[1] is None
    for part in ('0.02 rad above 0.005 rad', '2 Hz (expected 2.1)', 'effort of joint2'):
        assert part in report.message
    assert monitor.phase is Phase.DONE
    assert monitor.dropped == 0


def test_phases_follow_the_samples(monitor):
    motion = planned()
    assert monitor.phase is Phase.IDLE
    monitor.watch(motion)
    assert monitor.phase is Phase.IDLE
    changes = []
    for i in range(round(9.0 / PERIOD), round(14.0 / PERIOD)):
        before = monitor.phase
        monitor.add(sample(i * PERIOD, motion))
        if monitor.phase is not before:
            changes.append((pytest.approx(i * PERIOD), monitor.phase))
    assert changes == [(10.0, Phase.MOVING), (11.0, Phase.SETTLING), (13.0, Phase.DONE)]


@pytest.mark.parametrize(
    ('amplitude', 'level'), [(1e-3, Level.OK), (0.02, Level.WARN), (0.2, Level.ERROR)]
)
def test_the_level_follows_the_amplitude(monitor, amplitude, level):
    motion = planned()
    monitor.watch(motion)
    assert only(feed(monitor, motion, 9.9, 13.1, amplitude)).level is level


def test_a_perfect_motion_is_fine_without_a_frequency(monitor):
    motion = planned()
    monitor.watch(motion)
    report = only(feed(monitor, motion, 9.9, 13.1, 0.0))
    assert report.level is Level.OK
    assert report.fit.frequency is None
    assert report.fit.amplitude == 0.0
    assert report.settling_time == 0.0
    assert 'no oscillation' in report.message


def test_settling_time_is_when_the_envelope_has_left_the_band(monitor):
    motion = planned()
    monitor.watch(motion)
    report = only(feed(monitor, motion, 9.9, 13.1, 5e-3))
    elapsed = np.arange(0.0, WINDOW, PERIOD / 50)
    swing = 5e-3 * np.exp(-DECAY * elapsed) * np.cos(2 * np.pi * FREQUENCY * elapsed)
    last = elapsed[np.abs(swing) > SETTINGS.settling_band][-1]
    assert report.is_settled
    assert last <= report.settling_time <= last + 2 * PERIOD
    assert report.settling_time > 0.5


def test_an_oscillation_that_stays_above_the_band_is_not_settled(monitor):
    motion = planned()
    monitor.watch(motion)
    report = only(feed(monitor, motion, 9.9, 13.2, 0.1))
    assert not report.is_settled
    assert report.settling_time is None
    assert 'not settled' in report.message
    assert report.fit.amplitude == pytest.approx(0.1, rel=1e-6)


def test_passing_through_the_band_is_not_settling():
    # The window ends after 3.75 periods, where the oscillation is at zero.
    monitor = VibrationMonitor(replace(SETTINGS, window=3.75 / FREQUENCY, settling_band=8e-3))
    motion = planned()
    monitor.watch(motion)
    assert not only(feed(monitor, motion, 9.9, 13.1, 0.1)).is_settled
    last = sample(motion.end + 3.75 / FREQUENCY, motion, 0.1)
    assert abs(last.positions[1]) < 1e-3


def test_final_error_is_the_mean_over_the_last_whole_period(monitor):
    motion = planned()
    monitor.watch(motion)
    offset = np.array((0.013, -0.004))
    reports = []
    for i in range(round(9.9 / PERIOD), round(13.1 / PERIOD)):
        now = sample(i * PERIOD, motion, 0.02)
        moved = JointSample(time=now.time, positions=now.positions + offset)
        reports += monitor.add(moved)
    report = only(reports)
    assert report.final_error[0] == pytest.approx(0.013, abs=1e-12)
    # A decaying swing leaves a mean of the order of its loss per period.
    assert report.final_error[1] == pytest.approx(-0.004, abs=5e-4)
    assert report.fit.bias == pytest.approx(-0.004, abs=1e-9)
    assert report.rms_effort == (None, None)
    assert 'effort of joint1, joint2' in report.message


def test_a_hole_in_the_efforts_forbids_their_rms(monitor):
    motion = planned()
    monitor.watch(motion)
    feed(monitor, motion, 9.9, 10.4)
    feed(monitor, motion, 10.4, 10.6, efforts=None)
    report = only(feed(monitor, motion, 10.6, 13.1))
    assert report.rms_effort == (None, None)
    assert report.fit.amplitude == pytest.approx(0.02, rel=1e-6)


def test_a_plan_received_again_does_not_restart(monitor):
    motion = planned()
    monitor.watch(motion)
    feed(monitor, motion, 9.9, 10.5)
    assert monitor.watch(planned()) == []
    assert monitor.motion is motion
    only(feed(monitor, motion, 10.5, 13.1))
    assert monitor.watch(planned()) == []
    assert feed(monitor, motion, 13.1, 16.0) == []
    assert monitor.phase is Phase.DONE
    # A different one does restart.
    monitor.watch(planned(start=16.5))
    only(feed(monitor, planned(start=16.5), 16.0, 20.0))


def test_a_waiting_plan_received_again_still_waits_and_a_new_one_replaces_it(monitor):
    feed(monitor, planned(), 9.0, 9.1)
    monitor.watch(planned(start=10.0))
    monitor.watch(planned(start=10.0))
    late = planned(start=11.0)
    monitor.watch(late)
    report = only(feed(monitor, late, 9.1, 14.5))
    assert report.start_time == 11.0


def test_a_plan_long_past_gives_no_report(monitor):
    motion = planned()
    feed(monitor, motion, 20.0, 20.1)
    assert monitor.watch(motion) == []
    assert monitor.phase is Phase.DONE
    assert feed(monitor, motion, 20.1, 25.0) == []
    assert monitor.tick(30.0) == []
    fresh = VibrationMonitor(SETTINGS)
    fresh.watch(motion)
    assert fresh.tick(20.0) == []
    assert fresh.tick(30.0) == []
    assert fresh.phase is Phase.DONE


def test_a_plan_seen_within_its_window_is_judged_from_then_on(monitor):
    motion = planned()
    feed(monitor, motion, 11.0, 11.5)
    monitor.watch(motion)
    assert monitor.phase is Phase.SETTLING
    report = only(feed(monitor, motion, 11.5, 13.1))
    assert report.fit.amplitude == pytest.approx(0.02, rel=1e-6)
    assert 'first sample 0.5 s after the motion' in report.message


def test_motions_one_after_another_are_reported_each(monitor):
    reports = []
    for start in (10.0, 13.5, 20.0):
        motion = planned(start=start)
        monitor.watch(motion)
        reports += feed(monitor, motion, start - 0.2, start + 3.1)
    assert [report.start_time for report in reports] == [10.0, 13.5, 20.0]
    assert all(report.fit.amplitude == pytest.approx(0.02, rel=1e-6) for report in reports)


def test_a_new_motion_cuts_the_window_short(monitor):
    motion = planned()
    monitor.watch(motion)
    assert feed(monitor, motion, 9.9, 12.5) == []
    report = only(monitor.watch(planned(start=12.45, goal=2.0)))
    assert report.fit.amplitude == pytest.approx(0.02, rel=1e-6)
    assert report.window == pytest.approx(1.45, abs=1.01 * PERIOD)
    assert 'cut short' in report.message
    assert monitor.phase is Phase.MOVING
    whole = VibrationMonitor(SETTINGS)
    whole.watch(motion)
    assert 'cut short' not in only(feed(whole, motion, 9.9, 13.1)).message


def test_a_future_motion_leaves_the_former_to_settle_until_its_start(monitor):
    former, following = planned(), planned(start=12.5, goal=2.0)
    monitor.watch(former)
    feed(monitor, former, 9.9, 11.5)
    assert monitor.watch(following) == []
    assert feed(monitor, former, 11.5, 12.5) == []
    assert monitor.phase is Phase.SETTLING
    report = only(monitor.add(sample(12.5, following)))
    assert report.start_time == 10.0
    assert report.window == pytest.approx(1.5 - PERIOD)
    assert 'cut short' in report.message
    assert monitor.phase is Phase.MOVING
    assert only(feed(monitor, following, 12.505, 16.0)).start_time == 12.5


def test_a_future_motion_after_the_window_cuts_nothing(monitor):
    former, following = planned(), planned(start=14.0)
    monitor.watch(former)
    feed(monitor, former, 9.9, 11.5)
    monitor.watch(following)
    first = only(feed(monitor, former, 11.5, 14.0))
    assert 'cut short' not in first.message
    assert only(feed(monitor, following, 14.0, 17.1)).start_time == 14.0


def test_a_motion_after_the_window_is_not_said_to_cut_it(monitor):
    former, following = planned(), planned(start=13.1)
    monitor.watch(former)
    feed(monitor, former, 9.9, 12.9)
    monitor.watch(following)
    # The sample that would have closed the window is missing.
    report = only(monitor.add(sample(13.2, following)))
    assert report.start_time == 10.0
    assert 'cut short' not in report.message


def test_a_sample_that_cuts_one_motion_and_ends_the_next_gives_both_reports():
    # The sample is exactly at the end of the following window, 2.1875 s; none came before.
    monitor = VibrationMonitor(replace(SETTINGS, window=0.25, timeout=1.0))
    former, following = planned(start=1.0, duration=0.5), planned(start=1.6875, duration=0.25)
    monitor.watch(former)
    assert feed(monitor, former, 0.9, 1.6) == []
    monitor.watch(following)
    reports = monitor.add(sample(following.end + 0.25, following))
    assert [report.start_time for report in reports] == [1.0, 1.6875]
    assert 'cut short' in reports[0].message
    assert [report.samples for report in reports] == [20, 1]
    assert feed(monitor, following, 2.2, 3.0) == []


def test_a_refused_sample_takes_no_report_along(monitor):
    former = planned()
    monitor.watch(former)
    feed(monitor, former, 9.9, 11.5)
    other = {'joint_names': ('a', 'b', 'c'), 'positions': np.zeros((51, 3)), 'velocities': None}
    monitor.watch(planned(start=11.6, **other))
    with pytest.raises(InvalidRequest, match='shape'):
        monitor.add(sample(11.7, former))
    assert only(monitor.tick(11.8)).start_time == 10.0


def test_a_motion_spliced_into_a_running_one_keeps_its_samples(monitor):
    former = planned()
    spliced = planned(duration=1.5, goal=2.0)
    monitor.watch(former)
    feed(monitor, former, 9.9, 10.6)
    assert monitor.watch(spliced) == []
    report = only(feed(monitor, spliced, 10.6, 14.0))
    assert report.end_time == 11.5
    expected = np.sin(2 * np.pi * np.linspace(0.0, 1.5, 3001)) ** 2
    assert report.rms_effort[0] == pytest.approx(np.sqrt(expected.mean()), rel=1e-3)


def test_silence_is_reported_once(monitor):
    motion = planned()
    monitor.watch(motion)
    feed(monitor, motion, 9.9, 10.5)
    assert monitor.tick(10.9) == []
    report = only(monitor.tick(11.1))
    assert report.level is Level.STALE
    assert 'no samples for' in report.message
    assert report.samples == 0
    assert report.fit.amplitude is None
    assert report.final_error == ()
    assert monitor.tick(12.0) == []
    assert feed(monitor, motion, 12.0, 14.0) == []


def test_silence_while_settling_keeps_what_was_seen(monitor):
    motion = planned()
    monitor.watch(motion)
    feed(monitor, motion, 9.9, 12.5)
    report = only(monitor.tick(13.2))
    assert report.level is Level.STALE
    assert report.fit.amplitude == pytest.approx(0.02, rel=1e-6)


def test_silence_is_noticed_without_ticks(monitor):
    motion = planned()
    monitor.watch(motion)
    feed(monitor, motion, 9.9, 11.2)
    assert only(monitor.add(sample(12.9, motion))).level is Level.STALE


def test_no_sample_at_all_is_silence_from_the_start_on(monitor):
    monitor.watch(planned())
    assert monitor.tick(9.0) == []
    assert monitor.tick(10.0) == []
    assert monitor.tick(10.4) == []
    assert only(monitor.tick(10.6)).level is Level.STALE


def test_silence_before_and_after_a_motion_is_nothing_to_report(monitor):
    motion = planned()
    monitor.watch(motion)
    assert monitor.tick(1.0) == []
    assert monitor.tick(9.0) == []
    only(feed(monitor, motion, 9.0, 13.1))
    assert monitor.tick(100.0) == []


def test_useless_samples_are_dropped_and_change_nothing(monitor):
    motion = planned()
    monitor.watch(motion)
    clean = VibrationMonitor(SETTINGS)
    clean.watch(motion)
    reports = []
    for i in range(round(9.9 / PERIOD), round(13.1 / PERIOD)):
        time = i * PERIOD
        reports += monitor.add(sample(time, motion)) + clean.add(sample(time, motion))
        for useless in (
            sample(time, motion, 0.7),
            sample(time - 10 * PERIOD, motion, 0.7),
            sample(time + PERIOD / 2, motion, positions=np.array((np.nan, 0.0))),
            sample(time + PERIOD / 2, motion, positions=np.array((0.0, np.inf))),
            JointSample(time=np.nan, positions=np.zeros(2)),
            JointSample(time=np.inf, positions=np.zeros(2)),
        ):
            assert monitor.add(useless) == []
    disturbed, undisturbed = reports
    assert disturbed.fit == undisturbed.fit
    assert clean.dropped == 0
    assert monitor.dropped == 6 * round(3.2 / PERIOD)


def test_undefined_positions_count_as_silence(monitor):
    motion = planned()
    monitor.watch(motion)
    feed(monitor, motion, 9.9, 10.5)
    assert feed(monitor, motion, 10.5, 12.0, positions=np.full(2, np.nan)) == []
    assert only(monitor.tick(12.0)).level is Level.STALE


def test_missing_samples_do_not_disturb(monitor):
    motion = planned()
    monitor.watch(motion)
    rng = np.random.default_rng(6)
    times = 9.9 + np.cumsum(rng.uniform(0.2, 4.0, 400) * PERIOD)
    report = only([report for t in times for report in monitor.add(sample(t, motion))])
    assert report.fit.amplitude == pytest.approx(0.02, rel=1e-6)
    assert report.fit.frequency == pytest.approx(FREQUENCY, rel=1e-6)


@pytest.mark.parametrize('by_tick', [False, True])
def test_a_clock_that_jumps_back_forgets_the_motion(monitor, by_tick):
    motion = planned()
    monitor.watch(motion)
    feed(monitor, motion, 9.9, 11.5)
    assert (monitor.tick(1.0) if by_tick else monitor.add(sample(1.0, motion))) == []
    assert monitor.phase is Phase.IDLE
    assert monitor.motion is None
    again = planned(start=2.0)
    monitor.watch(again)
    assert only(feed(monitor, again, 1.1, 5.1)).start_time == 2.0


@pytest.mark.parametrize(('stalled', 'levels'), [(9.7, ['warn']), (10.3, ['stale', 'warn'])])
def test_samples_that_were_held_up_are_no_clock_that_was_set_back(monitor, stalled, levels):
    motion, following = planned(), planned(start=13.2)
    monitor.watch(motion)
    reports = feed(monitor, motion, 9.5, stalled)
    for step in (0.1, 0.3, 0.5, 0.65):
        reports += monitor.tick(stalled + step)
    if reports:
        motion = following
        monitor.watch(motion)
    waiting = range(round(stalled / PERIOD), round((stalled + 0.65) / PERIOD))
    for time in (i * PERIOD for i in waiting):
        reports += monitor.add(sample(time, motion)) + monitor.tick(time)
    reports += feed(monitor, motion, stalled + 0.65, motion.end + WINDOW + 0.1)
    assert [report.level.value for report in reports] == levels
    assert reports[-1].fit.amplitude == pytest.approx(0.02, rel=1e-6)
    assert monitor.take_warnings() == []


def test_reset_forgets_so_that_the_same_plan_starts_anew(monitor):
    motion = planned()
    monitor.watch(motion)
    feed(monitor, motion, 9.9, 10.2)
    monitor.reset()
    assert monitor.phase is Phase.IDLE
    assert monitor.residual(sample(10.2, motion)) is None
    assert feed(monitor, motion, 10.2, 10.3) == []
    monitor.watch(motion)
    assert monitor.phase is Phase.MOVING


def test_residual_is_against_the_plan_during_and_the_final_pose_after(monitor):
    motion = planned(goal=2.0)
    assert monitor.residual(sample(10.0, motion)) is None
    monitor.watch(motion)
    feed(monitor, motion, 9.9, 10.3)
    shift = np.array((0.01, -0.02))
    for time, target, speed in (
        (10.37, 2.0 * 0.37**2 * (3 - 2 * 0.37), 12.0 * 0.37 * 0.63),
        (11.0, 2.0, 0.0),
        (12.3, 2.0, 0.0),
    ):
        wanted = np.array((target, 0.0)), np.array((speed, 0.0))
        found = monitor.residual(
            JointSample(time=time, positions=wanted[0] + shift, velocities=wanted[1] + 3 * shift)
        )
        assert found.positions == pytest.approx(shift, abs=1e-12)
        assert found.velocities == pytest.approx(3 * shift, abs=1e-11)
    assert monitor.residual(JointSample(time=10.5, positions=shift)).velocities is None


def test_reference_is_hermite_with_and_linear_without_velocities():
    motion, coarse = planned(), planned(velocities=None)
    for time in np.linspace(9.5, 11.5, 401):
        s = min(max(time - 10.0, 0.0), 1.0)
        position, velocity = motion.reference(time)
        assert position[0] == pytest.approx(s**2 * (3 - 2 * s), abs=1e-14)
        assert velocity[0] == pytest.approx(6 * s * (1 - s), abs=1e-12)
        chord = np.interp(s, coarse.times, coarse.positions[:, 0])
        assert coarse.reference(time)[0][0] == pytest.approx(chord, abs=1e-14)
    assert abs(coarse.reference(10.01)[0][0] - motion.reference(10.01)[0][0]) > 1e-5


def test_memory_is_bounded_and_a_thinned_record_still_serves():
    record = Record(1)
    count = 5 * RECORD_LIMIT
    for i in range(count):
        record.append(float(i), float(i))
    assert RECORD_LIMIT / 2 <= len(record) <= RECORD_LIMIT
    times, rows = record.between(0.0, np.inf)
    assert np.array_equal(times, rows[:, 0])
    assert np.ptp(np.diff(times)) == 0.0
    assert times[-1] >= count - 8
    assert record.between(10.0, 20.0)[0].min() >= 10.0


def test_a_long_motion_at_a_high_rate_is_still_judged():
    monitor = VibrationMonitor(SETTINGS)
    motion = planned(duration=20.0)
    monitor.watch(motion)
    times = 9.5 + 0.001 * np.arange(23000)
    report = only([report for t in times for report in monitor.add(sample(t, motion))])
    assert report.fit.amplitude == pytest.approx(0.02, rel=1e-6)
    assert report.rms_effort[0] == pytest.approx(np.sqrt(0.5), rel=1e-3)


def test_adding_a_sample_is_cheap():
    monitor = VibrationMonitor(SETTINGS)
    motion = planned(duration=100.0)
    monitor.watch(motion)
    samples = [sample(10.0 + 1e-3 * i, motion) for i in range(5000)]
    costs = []
    for chunk in range(0, len(samples), 500):
        begin = process_time()
        for now in samples[chunk : chunk + 500]:
            monitor.add(now)
        costs.append((process_time() - begin) / 500)
    # Ten times the 3 microseconds of a quiet machine.
    assert min(costs) < 30e-6


def test_select_orders_by_name_and_names_the_missing():
    order = joint_indices(['wheel', 'joint2', 'joint1'], NAMES)
    assert order.tolist() == [2, 1]
    with pytest.raises(InvalidRequest, match='no joint joint2'):
        joint_indices(['joint1', 'wheel'], NAMES)


def test_a_sample_of_other_joints_is_refused(monitor):
    motion = planned()
    monitor.watch(motion)
    feed(monitor, motion, 9.9, 10.1)
    with pytest.raises(InvalidRequest, match='shape'):
        monitor.add(JointSample(time=10.2, positions=np.zeros(3)))
    with pytest.raises(InvalidRequest, match='shape'):
        monitor.residual(JointSample(time=10.2, positions=np.zeros(3)))


@pytest.mark.parametrize(
    'changes',
    [
        {'joint_names': ()},
        {'joint_names': ('a', 'a')},
        {'start': np.nan},
        {'times': np.linspace(1.0, 0.0, 51)},
        {'times': np.linspace(-1.0, 0.0, 51)},
        {'times': np.zeros(51)},
        {'positions': np.zeros((51, 3))},
        {'positions': np.full((51, 2), np.nan)},
        {'positions': np.full((51, 2), 1.1e6)},
        {'velocities': np.zeros((50, 2))},
        {'velocities': np.full((51, 2), -1e308)},
        {'efforts': np.zeros(51)},
        {'efforts': np.full((51, 2), 1.1e6)},
    ],
)
def test_what_is_no_motion_is_refused(changes):
    with pytest.raises(InvalidRequest):
        planned(**changes)


def test_a_motion_cannot_be_changed():
    motion = planned()
    with pytest.raises(ValueError, match='read-only'):
        motion.positions[0, 0] = 1.0
    assert motion.is_same(planned())
    assert not motion.is_same(planned(velocities=None))
    assert not motion.is_same(planned(start=10.1))


@pytest.mark.parametrize(
    'changes',
    [
        {'window': 0.0},
        {'window': np.inf},
        {'amplitude_ok': -1.0},
        {'amplitude_ok': 0.2, 'amplitude_error': 0.1},
        {'settling_band': np.nan},
        {'timeout': 0.0},
        {'expected_frequency': 0.0},
        {'expected_damping_ratio': 1.0},
    ],
)
def test_senseless_settings_are_refused(changes):
    with pytest.raises(InvalidRequest):
        MonitorSettings(**changes)


def test_a_report_on_nothing_says_so_once(monitor):
    motion = planned()
    monitor.watch(motion)
    feed(monitor, motion, 9.9, 10.5)
    message = only(monitor.tick(11.1)).message
    assert message == 'amplitude unknown; no samples for 0.605 s'


def test_a_joint_that_jumps_ends_the_window_there(monitor):
    motion = planned()
    monitor.watch(motion)
    assert feed(monitor, motion, 9.9, 12.0) == []
    moved = sample(12.0, motion).positions - [0.5, 0.0]
    report = only(monitor.add(sample(12.0, motion, positions=moved)))
    assert 'joint1 jumped by -0.5 rad within 5 ms at 12.000 s' in report.message
    assert report.fit.amplitude == pytest.approx(0.02, rel=1e-3)
    assert report.window < 1.0
    assert feed(monitor, motion, 12.005, 14.0) == []


@pytest.mark.parametrize('velocities', [True, False])
@pytest.mark.parametrize('period', [0.005, 0.05, 0.2])
def test_motion_is_no_jump_however_fast_and_rarely_seen(monitor, velocities, period):
    motion = planned(duration=0.3, goal=9.0)
    monitor.watch(motion)
    times = np.arange(9.9, 10.3 + WINDOW + 0.4, period)
    changes = {} if velocities else {'velocities': None}
    reports = [monitor.add(sample(time, motion, **changes)) for time in times]
    report = only(sum(reports, []))
    assert 'jumped' not in report.message


def test_what_is_wrong_with_samples_is_told_once(monitor):
    motion = planned()
    monitor.watch(motion)
    feed(monitor, motion, 9.9, 10.5)
    assert monitor.take_warnings() == []
    for time, values in ((10.4, [0.0, 0.0]), (10.495, [0.0, 0.0]), (10.6, [np.nan, 0.0])):
        monitor.add(sample(time, motion, positions=np.array(values)))
    assert monitor.take_warnings() == ['3 joint states dropped: late, repeated or not finite']
    assert monitor.take_warnings() == []
    monitor.add(sample(5.0, motion))
    (trouble,) = monitor.take_warnings()
    assert trouble.startswith('the time of the joint states was set back by 5.495 s')
    monitor.tick(4.0)
    assert 'set back by 1.000 s' in monitor.take_warnings()[0]
