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

"""Free damped oscillation in measured samples: amplitude, frequency and decay."""

from dataclasses import dataclass, replace
from math import exp, hypot, log, pi, sqrt
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray, InvalidRequest
from flat_planner_ros.core.monitor.oscillation_search import (
    basis_columns,
    best_rates,
    DAMPING_LIMIT,
    rate_columns,
    ROUNDOFF,
    solve_linear,
)
import numpy as np
from numpy.typing import ArrayLike

UNKNOWNS = 6
"""Bias, slope, two amplitudes, frequency and decay [-]."""

MIN_SAMPLES = 2 * UNKNOWNS
"""Fewest samples for the unknowns and an idea of the noise [-]."""

MIN_PERIODS = 1.0
"""Fewest periods in the samples for which a frequency is claimed [-]."""

FALSE_ALARM = 1e-5
"""Probability with which white noise is taken for an oscillation [-]."""

LATE_LIMIT = 3.0
"""Largest decay between the end of the motion and the first sample, as exponent [-]."""


@dataclass(frozen=True, kw_only=True)
class OscillationFit:
    """
    Oscillation found in samples; a value that cannot be computed is ``None``.

    Attributes
    ----------
    amplitude
        Envelope of the oscillation at the end of the motion [rad]. Without a
        distinguishable oscillation the small value that fits best.
    frequency, natural_frequency
        Damped and undamped frequency [Hz].
    decay
        Rate of decay of the envelope [1/s].
    damping_ratio
        Decay relative to the natural angular frequency [-].
    bias
        Middle line of the oscillation at mid-time of the samples [rad].
    drift
        Slope of that line [rad/s].
    fit_rms
        Root mean square of what the fit leaves [rad].
    peak_to_peak
        Largest minus smallest sample [rad].
    amplitude_std, frequency_std, decay_std
        Standard errors [rad], [Hz], [1/s], for white noise of size `fit_rms`.
    samples
        Number of samples [-].
    reason
        Why a value is missing; empty if none is.

    """

    amplitude: float | None = None
    frequency: float | None = None
    natural_frequency: float | None = None
    decay: float | None = None
    damping_ratio: float | None = None
    bias: float | None = None
    drift: float | None = None
    fit_rms: float | None = None
    peak_to_peak: float | None = None
    amplitude_std: float | None = None
    frequency_std: float | None = None
    decay_std: float | None = None
    samples: int
    reason: str = ''


def fit_oscillation(times: ArrayLike, values: ArrayLike, end_time: float) -> OscillationFit:
    """
    Fit bias, drift and one free damped oscillation to samples.

    The model is bias + drift (t - middle) + exp(-s (t - T)) (a cos w (t - T) + b sin w (t - T)).
    Frequency and decay are searched over all that the samples can show; the linear unknowns are
    eliminated (variable projection). Accuracy is bounded by the resolution of the times: give
    them from a near origin, since seconds since 1970 are rounded to 0.2 microseconds.

    Parameters
    ----------
    times
        Sampling times [s], shape (m,), in any order and spacing.
    values
        Samples [rad], shape (m,).
    end_time
        End of the motion T, where the amplitude is taken [s].

    Returns
    -------
    OscillationFit
        What was found, with the reason for what was not.

    Raises
    ------
    InvalidRequest
        If the shapes differ or a number is not finite.

    References
    ----------
    Golub and Pereyra, "The differentiation of pseudo-inverses and nonlinear least squares
    problems whose variables separate", SIAM J. Numer. Anal. 10 (1973); Kaufman's Jacobian.

    """
    t, q = np.asarray(times, dtype=float), np.asarray(values, dtype=float)
    if t.ndim != 1 or t.shape != q.shape:
        raise InvalidRequest(f'{t.shape} times and {q.shape} values of an oscillation')
    if not (np.isfinite(t).all() and np.isfinite(q).all() and np.isfinite(end_time)):
        raise InvalidRequest('times and values of an oscillation must be finite')
    if t.size == 0:
        return OscillationFit(samples=0, reason='no samples')
    order = np.argsort(t, kind='stable')
    t, q = t[order] - end_time, q[order]
    span = float(t[-1] - t[0])
    if t.size < MIN_SAMPLES or not np.median(np.diff(t)) > 0.0:
        return OscillationFit(
            bias=float(q.mean()),
            peak_to_peak=float(np.ptp(q)),
            samples=t.size,
            reason=f'{t.size} samples in {span:.3g} s are too few for a fit',
        )
    offset = float(np.median(q))
    scale = float(np.abs(q - offset).max())
    rounding = ROUNDOFF * float(np.abs(q).max())
    still = OscillationFit(
        amplitude=float(np.ptp(q)) / 2,
        bias=float(q.mean()),
        drift=0.0,
        fit_rms=float(q.std()),
        peak_to_peak=float(np.ptp(q)),
        samples=t.size,
        reason='no oscillation above rounding errors',
    )
    if scale <= rounding:
        return still
    u, y = (t - t[0]) / span, (q - offset) / scale
    return _fit_scaled(_Scaled(u, y, float(t[0]), span, offset, scale, rounding / scale), still)


class _Scaled(NamedTuple):
    """Samples (u, y) scaled to unit time and size; first time from T, time unit, size, noise."""

    u: FloatArray
    y: FloatArray
    start: float
    span: float
    offset: float
    scale: float
    rounding: float


def _fit_scaled(samples: _Scaled, still: OscillationFit) -> OscillationFit:
    """Return the best oscillation, or the straight line and what speaks against more."""
    rates = best_rates(samples.u, samples.y)
    basis = basis_columns(samples.u, rates)
    linear, left = _least_squares(basis, samples.y)
    line, left_by_line = _least_squares(basis[:, :2], samples.y)
    # What exact samples leave vanishes; their rounding does not.
    noise = max(sqrt(float(left @ left) / (left.size - UNKNOWNS)), samples.rounding)
    straight = _with_line(still, samples, line, left_by_line)
    if left_by_line @ left_by_line - left @ left < 2 * noise**2 * log(left.size / FALSE_ALARM):
        return replace(
            straight,
            amplitude=min(samples.scale * hypot(linear[2], linear[3]), still.amplitude or 0.0),
            reason=f'no oscillation above noise of {samples.scale * noise:.2g} rad',
        )
    straight = replace(straight, amplitude=None)
    if rates[0] < 2 * pi * MIN_PERIODS or rates[1] > DAMPING_LIMIT * rates[0]:
        reason = f'no full period of an oscillation in {samples.span:.3g} s'
        return replace(straight, reason=reason)
    if rates[1] * samples.start > LATE_LIMIT * samples.span:
        reason = f'samples start {samples.start:.3g} s late, after the decay'
        return replace(straight, reason=reason)
    columns = np.column_stack((basis, rate_columns(samples.u, basis, linear)))  # (m, UNKNOWNS)
    inverse = np.linalg.pinv(columns.T @ columns, hermitian=True)
    covariance = np.asarray(noise**2 * inverse, dtype=float)
    fit = _with_line(straight, samples, linear, left)
    return _with_oscillation(fit, samples, rates, linear[2:], covariance[2:, 2:])


def _least_squares(columns: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the linear unknowns of least squares and what they leave."""
    _, linear = solve_linear(columns, y)
    return linear, y - columns @ linear


def _with_line(
    fit: OscillationFit, samples: _Scaled, linear: FloatArray, left: FloatArray
) -> OscillationFit:
    """Return the fit with bias and drift in SI units and what the fit leaves."""
    return replace(
        fit,
        bias=samples.offset + samples.scale * float(linear[0]),
        drift=samples.scale * float(linear[1]) / samples.span,
        fit_rms=samples.scale * sqrt(left @ left / left.size),
    )


def _with_oscillation(
    fit: OscillationFit,
    samples: _Scaled,
    rates: FloatArray,
    phases: FloatArray,
    covariance: FloatArray,
) -> OscillationFit:
    """Return the fit with envelope at T, rates and standard errors; covariance of (a, b, w, s)."""
    envelope = hypot(phases[0], phases[1])
    delay = samples.start / samples.span
    gradient = np.array((phases[0] / envelope, phases[1] / envelope, 0.0, envelope * delay))
    at_end = samples.scale * exp(rates[1] * delay)
    omega, decay = float(rates[0]) / samples.span, float(rates[1]) / samples.span
    natural = hypot(omega, decay)
    return replace(
        fit,
        amplitude=at_end * envelope,
        frequency=omega / (2 * pi),
        natural_frequency=natural / (2 * pi),
        decay=decay,
        damping_ratio=decay / natural,
        amplitude_std=at_end * sqrt(gradient @ covariance @ gradient),
        frequency_std=sqrt(covariance[2, 2]) / samples.span / (2 * pi),
        decay_std=sqrt(covariance[3, 3]) / samples.span,
        reason='',
    )
