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

"""The fit finds what an oscillation was made of, and says so when there is none."""

from flat_planner_ros.core.arm.errors import InvalidRequest
from flat_planner_ros.core.monitor.oscillation import fit_oscillation
import numpy as np
import pytest
from random_cases import cases
from scipy.integrate import solve_ivp

EXACT = 1e-6
"""Largest relative error without noise [-]."""

NOISE = 1e-4
"""Standard deviation of noise [rad]."""


def rates(frequency, ratio):
    """Return damped angular frequency [rad/s] and decay [1/s]."""
    omega = 2 * np.pi * frequency
    return omega, omega * ratio / np.sqrt(1.0 - ratio**2)


def oscillation(elapsed, amplitude, frequency, ratio, phase):
    """Return a free damped oscillation [rad]."""
    omega, decay = rates(frequency, ratio)
    return amplitude * np.exp(-decay * elapsed) * np.cos(omega * elapsed + phase)


def sampling(frequency):
    """Return the sampling rate that goes with a frequency [Hz]."""
    return 1000.0 if frequency > 20.0 else 200.0


def grid(duration, rate):
    """Return equidistant sampling times from 0 [s]."""
    return np.arange(0.0, duration * (1.0 + 1e-12), 1.0 / rate)


def worst_error(fit, amplitude, frequency, ratio):
    """Return the largest error: of the damping ratio itself, of the others relative."""
    return max(
        abs(fit.amplitude / amplitude - 1.0),
        abs(fit.frequency / frequency - 1.0),
        abs(fit.natural_frequency * np.sqrt(1.0 - ratio**2) / frequency - 1.0),
        abs(fit.damping_ratio - ratio),
    )


@pytest.mark.parametrize('is_irregular', [False, True])
def test_exact_samples_give_back_the_oscillation(is_irregular):
    rng = np.random.default_rng(1)
    errors = []
    for _ in range(cases(150)):
        frequency = 10 ** rng.uniform(-1.0, np.log10(50.0))
        ratio = rng.choice((0.0, rng.uniform(0.0, 0.02), rng.uniform(0.0, 0.3)))
        amplitude = 10 ** rng.uniform(-9.0, 0.0)
        end = rng.uniform(0.0, 10.0)
        elapsed = grid(rng.uniform(2.0, 6.0) / frequency, sampling(frequency))
        if is_irregular:
            elapsed += rng.uniform(0.0, 0.3, elapsed.size) / sampling(frequency)
            elapsed = elapsed[rng.random(elapsed.size) > 0.3]
            rng.shuffle(elapsed)
        line = amplitude * (rng.uniform(-1.0, 1.0) + rng.uniform(-1.0, 1.0) * elapsed * frequency)
        phase = rng.uniform(0.0, 2 * np.pi)
        values = line + oscillation(elapsed, amplitude, frequency, ratio, phase)
        fit = fit_oscillation(end + elapsed, values, end)
        assert fit.reason == ''
        errors.append(worst_error(fit, amplitude, frequency, ratio))
    assert len(errors) == cases(150)
    assert max(errors) < EXACT


@pytest.mark.parametrize('frequency', [0.1, 50.0])
@pytest.mark.parametrize('ratio', [0.0, 0.3])
@pytest.mark.parametrize('amplitude', [1e-9, 1.0])
@pytest.mark.parametrize('phase', [0.0, 1.0, np.pi / 2, 4.0])
def test_corners_of_the_range_are_exact(frequency, ratio, amplitude, phase):
    elapsed = grid(2.0 / frequency, sampling(frequency))
    values = oscillation(elapsed, amplitude, frequency, ratio, phase)
    fit = fit_oscillation(elapsed, values, 0.0)
    assert worst_error(fit, amplitude, frequency, ratio) < EXACT


@pytest.mark.parametrize(
    ('frequency', 'ratio', 'amplitude', 'duration'),
    [
        (1.6, 0.03, 0.03, 2.0),
        (1.6, 0.03, 1e-3, 2.0),
        (0.5, 0.2, 0.01, 10.0),
        (40.0, 0.05, 0.01, 0.2),
        (3.0, 0.3, 0.01, 0.7),
        (3.0, 0.0, 1e-3, 2.0),
    ],
)
def test_noise_adds_no_bias_and_the_standard_errors_are_true(
    frequency, ratio, amplitude, duration
):
    rng = np.random.default_rng(2)
    runs = cases(100, 2)
    truth = np.array((amplitude, frequency, rates(frequency, ratio)[1]))
    deviations = []
    elapsed = grid(duration, sampling(frequency))
    for _ in range(runs):
        values = oscillation(elapsed, amplitude, frequency, ratio, rng.uniform(0.0, 2 * np.pi))
        values += 0.01 - 0.002 * elapsed + NOISE * rng.standard_normal(elapsed.size)
        fit = fit_oscillation(elapsed, values, 0.0)
        found = np.array((fit.amplitude, fit.frequency, fit.decay))
        errors = np.array((fit.amplitude_std, fit.frequency_std, fit.decay_std))
        deviations.append((found - truth) / errors)
        assert fit.fit_rms == pytest.approx(NOISE, rel=0.5)
    assert len(deviations) == runs
    # Mean within four of its standard errors; spread as claimed.
    assert np.abs(np.mean(deviations, axis=0)).max() < 4.0 / np.sqrt(runs)
    assert np.std(deviations, axis=0) == pytest.approx(np.ones(3), abs=0.3)


def test_noise_alone_is_not_taken_for_an_oscillation():
    rng = np.random.default_rng(3)
    for _ in range(cases(150)):
        times = np.arange(rng.integers(12, 400)) / 200.0
        fit = fit_oscillation(times, 0.3 + NOISE * rng.standard_normal(times.size), 0.0)
        assert fit.frequency is None
        assert fit.damping_ratio is None
        assert fit.amplitude <= fit.peak_to_peak / 2
        assert 'noise' in fit.reason


def test_an_oscillation_of_the_size_of_the_noise_is_still_found():
    times = grid(5.0, 200.0)
    noise = NOISE * np.random.default_rng(4).standard_normal(times.size)
    fit = fit_oscillation(times, oscillation(times, NOISE, 2.0, 0.0, 1.0) + noise, 0.0)
    assert fit.frequency == pytest.approx(2.0, abs=4 * fit.frequency_std)
    assert fit.amplitude == pytest.approx(NOISE, abs=4 * fit.amplitude_std)


@pytest.mark.parametrize('line', [(0.0, 0.0), (0.1, 0.0), (-3.0, 0.0), (0.1, 0.2), (1.0, 1e-6)])
def test_rounding_errors_are_no_oscillation(line):
    times = np.arange(300) / 200.0
    fit = fit_oscillation(times, line[0] + line[1] * times, 0.0)
    assert fit.frequency is None
    assert fit.amplitude < 1e-11
    assert fit.drift == pytest.approx(line[1], abs=1e-12)
    assert fit.reason


def test_less_than_a_period_gives_no_frequency():
    times = np.arange(300) / 200.0
    short = fit_oscillation(times, oscillation(times, 0.1, 0.4, 0.0, 1.0), 0.0)
    assert short.frequency is None
    assert short.amplitude is None
    assert 'period' in short.reason
    assert short.peak_to_peak > 0.05
    enough = fit_oscillation(times, oscillation(times, 0.1, 1.4, 0.0, 1.0), 0.0)
    assert worst_error(enough, 0.1, 1.4, 0.0) < EXACT


def test_exponential_creep_is_no_oscillation():
    times = grid(3.0, 200.0)
    fit = fit_oscillation(times, np.exp(-2.0 * times), 0.0)
    assert fit.frequency is None
    assert fit.reason


@pytest.mark.parametrize('count', [0, 1, 2, 11])
def test_too_few_samples_are_said_to_be_too_few(count):
    times = np.arange(count) / 200.0
    fit = fit_oscillation(times, np.cos(times), 0.0)
    assert fit.samples == count
    assert fit.amplitude is None
    assert 'samples' in fit.reason
    assert (fit.peak_to_peak is None) == (count == 0)


def test_repeated_times_are_too_few():
    fit = fit_oscillation(np.zeros(50), np.arange(50.0), 0.0)
    assert fit.frequency is None
    assert 'too few' in fit.reason


def test_any_number_of_samples_and_periods_is_answered():
    rng = np.random.default_rng(7)
    found = 0
    for _ in range(cases(200)):
        times = np.sort(rng.uniform(0.0, 1.0, rng.integers(12, 60)))
        fit = fit_oscillation(times, np.cos(2 * np.pi * rng.uniform(0.1, 9.0) * times), 0.0)
        assert (fit.frequency is None) == bool(fit.reason)
        found += fit.frequency is not None
    assert found > cases(200) / 2


def test_a_spike_without_a_peak_in_its_spectrum_is_answered():
    rng = np.random.default_rng(8)
    for _ in range(cases(300)):
        times = np.sort(rng.random(14))
        values = np.where(np.arange(14) == rng.integers(14), 1.0, 0.0)
        fit = fit_oscillation(times, values, 0.0)
        assert (fit.frequency is None) == bool(fit.reason)


def test_a_gap_and_a_late_start_leave_the_amplitude_at_the_end_of_the_motion():
    elapsed = grid(4.0, 200.0)
    seen = elapsed[(elapsed > 0.4) & ((elapsed < 1.2) | (elapsed > 2.5))]
    fit = fit_oscillation(7.0 + seen, oscillation(seen, 0.02, 1.7, 0.05, 2.0), 7.0)
    assert worst_error(fit, 0.02, 1.7, 0.05) < EXACT


def test_samples_after_the_decay_give_no_amplitude():
    elapsed = 5.0 + grid(4.0, 200.0)
    fit = fit_oscillation(elapsed, oscillation(elapsed, 1.0, 1.7, 0.1, 2.0), 0.0)
    assert fit.amplitude is None
    assert 'late' in fit.reason


def test_amplitude_is_the_envelope_of_the_state():
    """Compare with sqrt(q^2 + ((dq + zeta w q)/w_d)^2), the measure of the paper."""
    rng = np.random.default_rng(5)
    elapsed = grid(3.0, 200.0)
    for _ in range(20):
        frequency, ratio, phase = rng.uniform(1.0, 5.0), rng.uniform(0.0, 0.3), rng.uniform(0, 6)
        omega, decay = rates(frequency, ratio)
        position = 0.3 * np.cos(phase)
        velocity = -0.3 * (decay * np.cos(phase) + omega * np.sin(phase))
        state = np.hypot(position, (velocity + decay * position) / omega)
        fit = fit_oscillation(elapsed, oscillation(elapsed, 0.3, frequency, ratio, phase), 0.0)
        assert fit.amplitude == pytest.approx(state, rel=EXACT)


@pytest.mark.parametrize('bias', [0.0, 0.02])
def test_the_simulated_arm_of_the_paper_shows_its_poles(bias):
    inertia = np.array(((6.4e-4, 3.3e-5), (3.3e-5, 3.3e-5)))
    stiffness, damping = 3e-3, 2e-5
    inverse = np.linalg.inv(inertia)

    def motion(_, state):
        return np.concatenate(
            (state[2:], inverse @ (0.0, -stiffness * state[1] - damping * state[3]))
        )

    start = np.array((0.3, 0.05, -0.02, 0.4))
    times = grid(3.0, 200.0)
    q = solve_ivp(
        motion, (0.0, 3.0), start, t_eval=times, method='DOP853', rtol=1e-12, atol=1e-14
    ).y[1]
    determinant = inertia[0, 0] * inertia[1, 1] - inertia[0, 1] ** 2
    natural = np.sqrt(stiffness * inertia[0, 0] / determinant)
    decay = damping * inertia[0, 0] / (2 * determinant)
    damped = np.sqrt(natural**2 - decay**2)
    amplitude = np.hypot(start[1], (start[3] + decay * start[1]) / damped)
    fit = fit_oscillation(times, q + bias, 0.0)
    assert fit.amplitude == pytest.approx(amplitude, rel=EXACT)
    assert 2 * np.pi * fit.natural_frequency == pytest.approx(natural, rel=EXACT)
    assert fit.decay == pytest.approx(decay, rel=EXACT)
    assert fit.bias == pytest.approx(bias, abs=EXACT * amplitude)


def test_a_drift_beside_the_oscillation_changes_nothing():
    times = grid(3.0, 200.0)
    values = oscillation(times, 0.01, 1.6, 0.03, 0.5)
    still, drifting = (fit_oscillation(times, values + slope * times, 0.0) for slope in (0.0, 0.1))
    assert drifting.amplitude == pytest.approx(still.amplitude, rel=EXACT)
    assert drifting.drift == pytest.approx(0.1, rel=EXACT)
    assert still.drift == pytest.approx(0.0, abs=1e-9)


def test_senseless_input_is_refused():
    for times, values in (([0.0, 1.0], [0.0]), ([0.0, np.nan], [0.0, 1.0]), ([[0.0]], [[1.0]])):
        with pytest.raises(InvalidRequest):
            fit_oscillation(times, values, 0.0)
