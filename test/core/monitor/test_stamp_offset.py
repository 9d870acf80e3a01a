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

"""Joint states of another clock: a report is right or withheld, and says how far it is off."""

from dataclasses import replace

from driven_arm import driven, reports_on, sampled, START
from flat_planner_ros.core.arm import JointSample, PlanarArm
from flat_planner_ros.core.arm.clock_offset import KEPT, OffsetFilter
from flat_planner_ros.core.monitor import Level, MonitorSettings, VibrationMonitor
import numpy as np
import pytest

SETTINGS = MonitorSettings(window=3.0, expected_frequency=1.557)
RATE = 100.0
"""Joint states per second of the test [Hz]."""

OFFSETS = (0.2, -0.2, 5.0, -5.0, 0.05, -0.05)
"""By how much the stamps are ahead [s]."""


@pytest.fixture(scope='module')
def stiff():
    """Return a motion that leaves 0.07 rad, and what the arm did, by the plan's clock."""
    believed, true = (
        PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=k, damping=2e-5)
        for k in (3e-3, 3.3e-3)
    )
    motion, times, positions = driven(true, believed)
    at = np.arange(times[0], times[-1], 1.0 / RATE)
    return motion, at, sampled(times, positions, at)


def delays(count, seed=0, typical=0.004):
    """Return how long each message takes: some take far longer [s]."""
    return np.random.default_rng(seed).exponential(typical, count)


def report_on(motion, times, positions, ahead, delay, settings=SETTINGS):
    """Return the one report where stamps are ahead of the time by so much [s]."""
    stamps, arrivals = times + ahead, times + delay
    order = np.argsort(arrivals)
    (report,) = reports_on(
        VibrationMonitor(settings), motion, stamps[order], positions[order], arrivals[order]
    )
    return report


def test_the_filter_keeps_the_fastest_message():
    heard = OffsetFilter()
    assert heard.offset is None
    for k, delay in enumerate((0.03, 0.001, 0.2)):
        heard.hear(100.0 + k + 0.3, 100.0 + k + delay)
    assert heard.offset == pytest.approx(0.299)


@pytest.mark.parametrize('step', [0.5, -0.5])
def test_the_filter_follows_a_clock_that_is_set(step):
    heard = OffsetFilter()
    times = np.arange(100.0, 100.0 + 6 * KEPT, 0.1)
    for time in times.tolist():
        heard.hear(time + (step if time > 100.0 + 2 * KEPT else 0.0), time)
    assert heard.offset == pytest.approx(step)


@pytest.mark.parametrize('ahead', OFFSETS)
def test_the_amplitude_is_right_whatever_the_clock(stiff, ahead):
    motion, times, positions = stiff
    true = report_on(motion, times, positions, 0.0, delays(times.size))
    report = report_on(motion, times, positions, ahead, delays(times.size))
    assert true.clock_offset is None
    assert true.fit.amplitude == pytest.approx(0.0729, abs=1e-3)
    assert report.fit.amplitude == pytest.approx(true.fit.amplitude, rel=0.02)
    assert report.fit.damping_ratio == pytest.approx(true.fit.damping_ratio, rel=0.02)
    assert report.clock_offset == pytest.approx(ahead, abs=2e-3)
    order = 'ahead of' if ahead > 0.0 else 'behind'
    assert f"s {order} the plan's clock" in report.message
    assert 'later than planned' not in report.message


def test_a_slow_transport_is_no_other_clock(stiff):
    motion, times, positions = stiff
    report = report_on(motion, times, positions, 0.0, 0.015 + delays(times.size))
    assert report.clock_offset is None
    assert 'clock' not in report.message


@pytest.mark.parametrize('slow', [0.1, 1.0, 4.0])
def test_a_very_slow_transport_is_told_from_another_clock(stiff, slow):
    motion, times, positions = stiff
    true = report_on(motion, times, positions, 0.0, delays(times.size))
    report = report_on(motion, times, positions, 0.0, slow + delays(times.size))
    assert report.clock_offset is None
    assert f'joint states arrive {slow:g} s after their stamps' in report.message
    assert report.fit.amplitude == pytest.approx(true.fit.amplitude, rel=1e-3)


def test_the_first_message_may_be_the_slowest(stiff):
    motion, times, positions = stiff
    true = report_on(motion, times, positions, 0.0, delays(times.size))
    delay = np.where(times < START + 0.1, 0.3, 0.0) + delays(times.size)
    # All that came before the motion came late; what came in it did not.
    kept = times > START - 0.2
    report = report_on(motion, times[kept], positions[kept], 0.0, delay[kept])
    assert report.clock_offset is None
    assert report.fit.amplitude == pytest.approx(true.fit.amplitude, rel=1e-3)


def test_without_a_motion_to_go_by_the_amplitude_is_withheld(stiff):
    motion, times, positions = stiff
    still = replace(motion, positions=motion.positions * (0.0, 1.0), velocities=None)
    swing = positions * (0.0, 1.0)
    known = report_on(still, times, swing, 0.0, delays(times.size))
    report = report_on(still, times, swing, 0.2, delays(times.size))
    assert known.fit.amplitude is not None
    assert report.fit.amplitude is None
    assert report.fit.frequency is None
    assert report.level is not Level.OK
    assert 'does not show when it ended by the clock of the joint states' in report.message


def test_every_motion_of_a_sequence_is_reported(stiff):
    motion, times, positions = stiff
    monitor = VibrationMonitor(SETTINGS)
    reports = []
    for k in range(3):
        later = 12.0 * k
        reports += monitor.watch(motion.shifted(later), START - 0.2 + later)
        for time, row in zip((times + later).tolist(), positions, strict=True):
            monitor.hear(time - 5.0, time + 1e-3)
            reports += monitor.add(JointSample(time=time - 5.0, positions=row))
    assert [report.start_time for report in reports] == [START, START + 12.0, START + 24.0]
    amplitudes = [report.fit.amplitude for report in reports]
    assert amplitudes == pytest.approx([amplitudes[0]] * 3)


def test_a_recording_that_is_played_later_is_no_other_clock(stiff):
    motion, times, positions = stiff
    monitor = VibrationMonitor(SETTINGS)
    reports = list(monitor.watch(motion, START + 1e6))
    for time, row in zip(times.tolist(), positions, strict=True):
        monitor.hear(time, time + 1e6)
        reports += monitor.add(JointSample(time=time, positions=row))
    (report,) = reports
    assert report.clock_offset is None
    assert report.fit.amplitude == pytest.approx(0.0729, abs=1e-3)
