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

"""
Search for the frequency and decay that fit best, on samples scaled to unit time and size.

The signal is linear in bias, slope and the two phases of the oscillation, so only the two rates
(w, s) of exp(-s u) cos(w u) are searched and the linear unknowns are eliminated (variable
projection).
"""

from collections.abc import Callable
from math import pi
from typing import Any

from flat_planner_ros.core.arm import FloatArray
import numpy as np

ROUNDOFF = 4.0 * float(np.finfo(float).eps)
"""Size of rounding errors relative to the largest value [-]."""

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

CANDIDATES = 2
"""Number of the spectrum's peaks from which the fit is started [-]."""

FIT_TOLERANCE = 1e-13
"""Relative change of cost and unknowns at which the fit ends [-]."""

MAX_EVALUATIONS = 60
"""Most evaluations of one refinement [-]."""


def basis_columns(u: FloatArray, rates: FloatArray) -> FloatArray:
    """Return the linear unknowns' columns for rates (w, s) per unit of u: (m, 4)."""
    w, s = rates
    envelope = np.exp(-s * u)
    columns = (np.ones_like(u), u - 0.5, envelope * np.cos(w * u), envelope * np.sin(w * u))
    return np.stack(columns, axis=-1)


def rate_columns(u: FloatArray, basis: FloatArray, linear: FloatArray) -> FloatArray:
    """Return the derivatives of the fitted signal with respect to (w, s): (m, 2)."""
    cosine, sine = basis[:, 2], basis[:, 3]
    a, b = linear[2], linear[3]
    return np.stack((u * (b * cosine - a * sine), -u * (a * cosine + b * sine)), axis=-1)


def solve_linear(basis: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the orthonormal columns (m, 4) and the linear unknowns (4,) of least squares."""
    q, r = np.linalg.qr(basis)
    # A decay within one long gap leaves an empty column: any finite unknown will do for it.
    np.fill_diagonal(r, np.where(np.abs(np.diagonal(r)) < ROUNDOFF, 1.0, np.diagonal(r)))
    return q, np.linalg.solve(r, q.T @ y)


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


def best_rates(u: FloatArray, y: FloatArray) -> FloatArray:
    """
    Return the rates of the oscillation that fits best beside a straight line.

    Parameters
    ----------
    u
        Times scaled to 0 ... 1 [-], ascending, shape (m,).
    y
        Values of the order of one [-], shape (m,).

    Returns
    -------
    FloatArray
        Angular frequency and decay (w, s) per unit of u [-], shape (2,).

    """
    highest = max(NYQUIST_SHARE * pi / float(np.median(np.diff(u))), 2 * pi)
    lower = np.array((2 * pi * SEARCH_PERIODS, -GROWTH_LIMIT))
    upper = np.array((highest, DAMPING_LIMIT * highest))
    starts = np.clip(_starts(u, y), lower, upper)
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
