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

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import exp, hypot, log, pi, sqrt
from typing import Any, NamedTuple

from flat_planner_ros.core.arm import FloatArray, InvalidRequest
from flat_planner_ros.core.monitor.damped_columns import (
    basis_columns,
    rate_columns,
    ROUNDOFF,
    solve_linear,
)
import numpy as np
from numpy.typing import ArrayLike

SEARCH_PERIODS = 0.5
"""Lowest frequency searched, so that slower signals are seen to be slower [periods]."""

GROWTH_LIMIT = 2.0
"""Largest growth allowed to a fit, as exponent over the samples [-]."""

DAMPING_LIMIT = 2.0
"""Largest decay over damped angular frequency of a fit, damping ratio 0.89 [-]."""

NYQUIST_SHARE = 0.95
"""Highest frequency of a fit relative to half the median sampling rate [-]."""

SPECTRUM_SAMPLES = 2**15
"""Most samples of the resampled signal behind the spectrum [-]."""

SPECTRUM_PADDING = 4
"""Zero padding of the spectrum relative to the signal's length [-]."""

SCAN_STEP = pi / 4
"""Step of the search in a band, an eighth of a period over the samples [-]."""

CANDIDATES = 2
"""Number of the spectrum's peaks from which the fit is started [-]."""

FIT_TOLERANCE = 1e-13
"""Relative change of cost and unknowns at which the fit ends [-]."""

MAX_EVALUATIONS = 60
"""Most evaluations of one refinement [-]."""

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


def _starts(u: FloatArray, y: FloatArray) -> FloatArray:
    """Return undamped starts at the highest peaks of the resampled signal's spectrum: (c, 2)."""
    count = int(min(round(1.0 / float(np.median(np.diff(u)))) + 1, SPECTRUM_SAMPLES))
    grid = np.linspace(0.0, 1.0, count)
    signal = np.interp(grid, u, y)
    signal = signal - np.polyval(np.polyfit(grid, signal, 1), grid)
    # Here, not above: 0.3 s of import that a plant or a planner never needs.
    from scipy.fft import next_fast_len, rfft

    length = next_fast_len(SPECTRUM_PADDING * count, real=True)
    power = np.abs(rfft(signal, length))
    peaks = 1 + np.flatnonzero((power[1:-1] >= power[:-2]) & (power[1:-1] > power[2:]))
    peaks = peaks[np.argsort(-power[peaks])][:CANDIDATES]
    # One period besides: the trend may have taken the only peak.
    w = 2 * pi * np.append(peaks * (count - 1) / length, 1.0)
    return np.stack((w, np.zeros_like(w)), axis=-1)


def _scanned(u: FloatArray, y: FloatArray, lowest: float, highest: float) -> FloatArray:
    """Return undamped starts at the best angular frequencies of a band: (c, 2)."""
    w = np.arange(lowest, highest, SCAN_STEP)
    rates = np.stack((w, np.zeros_like(w)), axis=-1)
    residual, _ = _separable(u, y)
    order = np.argsort([float(left @ left) for left in map(residual, rates)])
    return rates[order[:CANDIDATES]]


def best_rates(
    u: FloatArray, y: FloatArray, band: tuple[float, float] | None = None
) -> FloatArray:
    """
    Return the rates of the oscillation that fits best beside a straight line.

    Parameters
    ----------
    u
        Times scaled to 0 ... 1 [-], ascending, shape (m,).
    y
        Values of the order of one [-], shape (m,).
    band
        Lowest and highest angular frequency per unit of u [-]; all that the samples can show
        without.

    Returns
    -------
    FloatArray
        Angular frequency and decay (w, s) per unit of u [-], shape (2,).

    """
    highest = max(NYQUIST_SHARE * pi / float(np.median(np.diff(u))), 2 * pi)
    lower = np.array((2 * pi * SEARCH_PERIODS, -GROWTH_LIMIT))
    upper = np.array((highest, DAMPING_LIMIT * highest))
    starts = _starts(u, y) if band is None else _scanned(u, y, *band)
    if band is not None:
        lower[0], upper[0] = band
    starts = np.clip(starts, lower, upper)
    results = [_descend(u, y, start, lower, upper) for start in starts]
    best = min(results, key=lambda result: float(result.cost))
    return np.asarray(best.x, dtype=float)


def _descend(
    u: FloatArray, y: FloatArray, start: FloatArray, lower: FloatArray, upper: FloatArray
) -> Any:
    """Return scipy's result of the separable least-squares problem from one start."""
    from scipy.optimize import least_squares  # here for the same reason

    residual, jacobian = _separable(u, y)
    return least_squares(
        residual,
        start,
        jac=jacobian,
        bounds=(lower, upper),
        ftol=FIT_TOLERANCE,
        xtol=FIT_TOLERANCE,
        gtol=None,
        max_nfev=MAX_EVALUATIONS,
    )


def _separable(
    u: FloatArray, y: FloatArray
) -> tuple[Callable[[FloatArray], FloatArray], Callable[[FloatArray], FloatArray]]:
    """Return residual (m,) and Kaufman's Jacobian (m, 2) as functions of the rates."""

    def residual(rates: FloatArray) -> FloatArray:
        q, _ = solve_linear(basis_columns(u, rates), y)
        return y - q @ (q.T @ y)

    def jacobian(rates: FloatArray) -> FloatArray:
        basis = basis_columns(u, rates)
        q, linear = solve_linear(basis, y)
        slopes = rate_columns(u, basis, linear)
        return q @ (q.T @ slopes) - slopes

    return residual, jacobian


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


def fit_oscillation(
    times: ArrayLike,
    values: ArrayLike,
    end_time: float,
    *,
    band: tuple[float, float] | None = None,
) -> OscillationFit:
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
    band
        Lowest and highest damped frequency to be looked for [Hz]; by default all up to half the
        sampling rate.

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
    return _fit_scaled(
        _Scaled(u, y, float(t[0]), span, offset, scale, rounding / scale), still, band
    )


class _Scaled(NamedTuple):
    """Samples (u, y) scaled to unit time and size; first time from T, time unit, size, noise."""

    u: FloatArray
    y: FloatArray
    start: float
    span: float
    offset: float
    scale: float
    rounding: float


def _fit_scaled(
    samples: _Scaled, still: OscillationFit, band: tuple[float, float] | None
) -> OscillationFit:
    """Return the best oscillation, or the straight line and what speaks against more."""
    turn = 2 * pi * samples.span
    scaled = None if band is None else (turn * band[0], turn * band[1])
    rates = best_rates(samples.u, samples.y, scaled)
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
