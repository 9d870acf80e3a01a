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

"""Samples that show something else than the arm's swing: nothing false is stated of them."""

from math import exp, pi

from flat_planner_ros.core.arm import JointSample, PlanarArm
from flat_planner_ros.core.monitor import Level, MonitorSettings, PlannedMotion, VibrationMonitor
import numpy as np
import pytest

LAST = 3.3e-5
"""Inertia that swings where joint 1 is held [kg m^2]."""

START, DURATION, WINDOW = 10.0, 1.0, 3.0
DAMPING = 0.02
"""Damping ratio of the swing [-]."""

CASES = [(10.0, 5.5, 5.77), (20.0, 11.0, 11.6), (25.0, 13.0, 13.6), (50.0, 26.0, 27.3)]
"""Joint states per second, expected and true frequency, all in hertz."""


def angle(time):
    """Return the planned angle of joint 1 [rad]."""
    s = np.clip((time - START) / DURATION, 0.0, 1.0)
    return s**3 * (10 - 15 * s + 6 * s**2)


def settings_for(expected):
    """Return settings with a model that swings at a frequency while joint 1 is held [Hz]."""
    stiffness = LAST * (2 * pi * expected) ** 2
    damping = 2 * DAMPING * LAST * 2 * pi * expected
    arm = PlanarArm.reduced(inertia_star=(1.0, LAST), stiffness=stiffness, damping=damping)
    return MonitorSettings(
        window=WINDOW, expected_frequency=expected, expected_damping_ratio=DAMPING, arm=arm
    )


def report_on(times, settings, swing, *, stamps=None):
    """Return the report on a motion of joint 1 after which joint 2 swings."""
    grid = np.linspace(0.0, DURATION, 101)
    positions = np.stack((angle(START + grid), 0.0 * grid), axis=-1)
    motion = PlannedMotion(
        joint_names=('joint1', 'joint2'), start=START, times=grid, positions=positions
    )
    monitor = VibrationMonitor(settings)
    reports = list(monitor.watch(motion))
    for time, stamp in zip(times.tolist(), (times if stamps is None else stamps), strict=True):
        row = np.array((float(angle(time)), swing(time - START - DURATION)))
        reports += monitor.add(JointSample(time=float(stamp), positions=row))
    (report,) = reports
    return report


def swing_of(frequency, amplitude=0.05):
    """Return the angle of joint 2 as a function of the time after the motion [s]."""
    decay = DAMPING * 2 * pi * frequency

    def swing(after):
        phase = 2 * pi * frequency * after
        return amplitude * exp(-decay * after) * np.cos(phase) if after >= 0.0 else 0.0

    return swing


def sampled(rate, jitter=0.0, seed=0):
    """Return sampling times, each off by up to a share of the period [s]."""
    count = round((DURATION + WINDOW + 1.0) * rate)
    random = np.random.default_rng(seed).uniform(-jitter, jitter, count)
    return START - 0.5 + (np.arange(count) + random) / rate


@pytest.mark.parametrize(('rate', 'expected', 'true'), CASES)
def test_a_folded_frequency_is_named_and_nothing_estimated_from_it(rate, expected, true):
    report = report_on(sampled(rate), settings_for(expected), swing_of(true))
    assert report.fit.frequency is None
    assert report.fit.damping_ratio is None
    assert not report.estimate.is_trustworthy
    assert f'frequency {rate - true:.4g} Hz or {true:.4g} Hz' in report.message
    # The envelope is the same for both.
    assert report.fit.amplitude == pytest.approx(0.05, rel=1e-3)


@pytest.mark.parametrize(('rate', 'expected', 'true'), CASES)
def test_irregular_sampling_tells_the_true_frequency(rate, expected, true):
    report = report_on(sampled(rate, 0.2), settings_for(expected), swing_of(true))
    assert report.fit.frequency == pytest.approx(true, rel=1e-3)
    stiffness = LAST * (2 * pi * true) ** 2 * (1.0 + DAMPING**2)
    assert report.estimate.stiffness == pytest.approx(stiffness, rel=1e-3)


@pytest.mark.parametrize(('rate', 'expected', 'true'), CASES)
def test_a_frequency_below_half_the_rate_is_known_from_irregular_samples(rate, expected, true):
    lower = rate - true
    report = report_on(sampled(rate, 0.2, seed=1), settings_for(expected), swing_of(lower))
    assert report.fit.frequency == pytest.approx(lower, rel=1e-3)


@pytest.mark.parametrize(('rate', 'expected', 'true'), CASES)
def test_stamps_that_are_off_by_chance_prove_nothing(rate, expected, true):
    times = sampled(rate)
    stamps = times + np.random.default_rng(2).normal(0.0, 0.02 / rate, times.size)
    report = report_on(times, settings_for(expected), swing_of(true), stamps=stamps)
    assert report.fit.frequency is None or report.fit.frequency == pytest.approx(true, rel=1e-2)


@pytest.mark.parametrize('rate', [4.0, 10.0, 100.0])
def test_enough_samples_state_the_frequency_as_before(rate):
    expected = rate / 2.6
    report = report_on(sampled(rate), settings_for(expected), swing_of(1.04 * expected))
    assert report.fit.frequency == pytest.approx(1.04 * expected, rel=1e-3)


@pytest.mark.parametrize('own', [0.0, 0.02])
def test_a_fan_is_not_what_the_motion_left(own):
    left = swing_of(1.6, own)

    def swing(after):
        return left(after) + 0.03 * np.sin(2 * pi * 11.3 * after)

    report = report_on(sampled(200.0), settings_for(1.557), swing)
    assert report.level is Level.WARN
    assert 'rad at 11.3 Hz is foreign: the arm swings at 1.557 Hz' in report.message
    assert report.fit.amplitude == pytest.approx(own, abs=2e-4)
    assert report.fit.frequency == (pytest.approx(1.6, rel=1e-3) if own else None)


def test_a_much_stiffer_arm_is_not_foreign_while_it_decays():
    report = report_on(sampled(200.0), settings_for(1.557), swing_of(11.3))
    assert 'foreign' not in report.message
    assert report.fit.frequency == pytest.approx(11.3, rel=1e-3)


def test_bursts_are_recognised():
    times = sampled(100.0)
    number = np.arange(times.size)
    # A driver that reads 16 at once and stamps them then.
    last = times[np.minimum(number // 16 * 16 + 15, times.size - 1)]
    report = report_on(
        times, settings_for(1.557), swing_of(1.6), stamps=last + 1e-4 * (number % 16)
    )
    assert report.fit.amplitude is None
    assert report.fit.frequency is None
    assert report.level is Level.WARN
    assert 'in bursts of 16 with stamps 0.1 ms apart' in report.message


@pytest.mark.parametrize('spacing', [1e-4, 3e-3])
def test_two_publishers_are_no_bursts(spacing):
    one = sampled(100.0)
    both = np.sort(np.concatenate((one, one + spacing)))
    report = report_on(both, settings_for(1.557), swing_of(1.6))
    assert report.fit.frequency == pytest.approx(1.6, rel=1e-3)
    assert 'burst' not in report.message


def test_lost_samples_are_no_bursts():
    times = sampled(100.0)
    kept = np.random.default_rng(3).uniform(size=times.size) < 0.4
    report = report_on(times[kept], settings_for(1.557), swing_of(1.6))
    assert report.fit.frequency == pytest.approx(1.6, rel=1e-3)
    assert 'burst' not in report.message
