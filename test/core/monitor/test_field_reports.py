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

"""Joint states as drivers have been reported to send them: docs/field_reports.md lists whose."""

from driven_arm import driven, sampled, START
from flat_planner_ros.core.arm import JointSample, PlanarArm
from flat_planner_ros.core.monitor import Level, MonitorSettings, VibrationMonitor
import numpy as np
import pytest

RATE = 100.0
"""Joint states per second [Hz]."""

SETTINGS = MonitorSettings(window=3.0, expected_frequency=1.557)


@pytest.fixture(scope='module')
def motion_and_samples():
    """Return a motion that leaves 0.07 rad, and the samples of it."""
    believed, true = (
        PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=k, damping=2e-5)
        for k in (3e-3, 3.3e-3)
    )
    motion, times, positions = driven(true, believed, after=5.0)
    at = np.arange(START - 0.3, times[-1], 1.0 / RATE)
    rows = sampled(times, positions, at)
    samples = [
        JointSample(time=time, positions=row) for time, row in zip(at.tolist(), rows, strict=True)
    ]
    return motion, samples


def heard(motion, samples):
    """Return the reports on the samples and the warnings about them."""
    monitor = VibrationMonitor(SETTINGS)
    reports = list(monitor.watch(motion))
    for sample in samples:
        reports += monitor.add(sample)
    reports += monitor.tick(motion.end + SETTINGS.window + 2.0)
    return reports, monitor.take_warnings()


def with_positions(sample, *positions):
    """Return a sample with other positions [rad]."""
    return JointSample(time=sample.time, positions=np.array(positions))


@pytest.fixture(scope='module')
def true_report(motion_and_samples):
    """Return the report on the samples as they should be."""
    motion, samples = motion_and_samples
    (report,), warnings = heard(motion, samples)
    assert warnings == []
    assert report.fit.amplitude > 0.05
    return report


def test_numbers_from_a_misread_packet_are_dropped(motion_and_samples, true_report):
    motion, samples = motion_and_samples
    spoilt = list(samples)
    for place in (100, 200, 300):
        spoilt[place] = with_positions(samples[place], 8.8e-4, -4.737910152973887e226)
    (report,), warnings = heard(motion, spoilt)
    assert report.fit.amplitude == pytest.approx(true_report.fit.amplitude, rel=1e-3)
    assert warnings == ['3 joint states dropped: late, repeated or not finite']


def test_a_stamp_that_stands_still_is_silence(motion_and_samples):
    motion, samples = motion_and_samples
    stuck = [
        JointSample(time=min(sample.time, START + 0.5), positions=sample.positions)
        for sample in samples
    ]
    (report,), warnings = heard(motion, stuck)
    assert report.level is Level.STALE
    assert report.fit.amplitude is None
    assert 'dropped: late, repeated' in warnings[0]


def test_zeros_while_a_joint_is_locked_end_the_report(motion_and_samples):
    motion, samples = motion_and_samples
    locked = [
        with_positions(sample, 0.0, sample.positions[1])
        if START + 2.0 < sample.time < START + 2.5
        else sample
        for sample in samples
    ]
    (report,), _ = heard(motion, locked)
    assert 'joint1 jumped by -3.14 rad' in report.message
    assert report.window < 1.1


def test_zeros_of_a_second_publisher_are_no_measurement(motion_and_samples, true_report):
    """It stamps as the driver does: of two joint states with one stamp the first counts."""
    motion, samples = motion_and_samples
    both = [each for sample in samples for each in (sample, with_positions(sample, 0.0, 0.0))]
    (report,), warnings = heard(motion, both)
    assert report.fit.amplitude == pytest.approx(true_report.fit.amplitude)
    assert 'joint states dropped' in warnings[0]


def test_zeros_of_a_second_publisher_with_stamps_of_its_own_are_said(motion_and_samples):
    motion, samples = motion_and_samples
    both = []
    for sample in samples:
        zeros = JointSample(time=sample.time + 3e-3, positions=np.zeros(2))
        both += [sample, zeros]
    (report,), _ = heard(motion, both)
    assert 'joint1 jumped' in report.message
    assert report.level is not Level.OK


def test_a_velocity_that_is_only_a_setting_is_not_believed(motion_and_samples, true_report):
    motion, samples = motion_and_samples
    told = [
        JointSample(time=sample.time, positions=sample.positions, velocities=np.array((2.0, 2.0)))
        for sample in samples
    ]
    (report,), _ = heard(motion, told)
    assert report.fit.amplitude == pytest.approx(true_report.fit.amplitude)


@pytest.mark.parametrize('ahead', [250.0 - START - 1.7e9, 1.7e9])
def test_simulated_time_beside_the_time_of_day_is_another_clock(
    motion_and_samples, true_report, ahead
):
    motion, samples = motion_and_samples
    monitor = VibrationMonitor(SETTINGS)
    reports = list(monitor.watch(motion, START - 0.4))
    for sample in samples:
        stamp = sample.time + ahead
        monitor.hear(stamp, sample.time)
        reports += monitor.add(JointSample(time=stamp, positions=sample.positions))
    (report,) = reports
    assert report.clock_offset == pytest.approx(ahead, abs=2e-3)
    assert report.fit.amplitude == pytest.approx(true_report.fit.amplitude, rel=0.02)
