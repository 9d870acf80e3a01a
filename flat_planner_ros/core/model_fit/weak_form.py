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
A first guess at the last two links, by linear least squares.

The rows are multiplied by smooth windows and integrated by parts, so that no noise is
differentiated: the derivatives fall on the windows (weak form, Shinbrot 1957).
"""

from math import inf
from typing import NamedTuple

from flat_planner_ros.core.arm import coulomb_share, FloatArray, PlanarArm
from flat_planner_ros.core.model_fit.last_links import (
    BOTH,
    COULOMB,
    DAMPING,
    DELAY,
    LAST,
    NAMES,
    OFFSET,
    STIFFNESS,
    VISCOUS,
)
import numpy as np

WINDOW = 0.4
"""Length of a window relative to the free period of the passive joint [-]."""

OVERLAP = 8
"""Windows that share a sample."""

LARGEST_DELAY = 0.05
"""Longest delay that is tried [s]."""

POWER = 4
"""A window is (1 - x^2)^POWER: it and three derivatives vanish at its ends."""


class LinkSignals(NamedTuple):
    """
    What is measured of the last two links.

    Attributes
    ----------
    times
        Evenly spaced, shape (m,) [s].
    link, passive
        Angle of link n-1 and of the passive joint, shape (m,) [rad].
    rate
        Smoothed velocity of joint n-1, shape (m,) [rad/s].
    effort
        Of joint n-1, shape (m,) [N m].

    """

    times: FloatArray
    link: FloatArray
    passive: FloatArray
    rate: FloatArray
    effort: FloatArray


class Windows:
    """
    Weighted means of signals over windows, and of their derivatives without differentiating.

    Parameters
    ----------
    times
        Of the signals, evenly spaced, shape (m,) [s].
    length
        Of a window [s].
    power
        A window is (1 - x^2)^power.

    """

    def __init__(self, times: FloatArray, length: float, power: int = POWER) -> None:
        period = float(times[1] - times[0])
        half = max(power, round(length / period / 2))
        polynomial = np.polynomial.Polynomial([1.0, 0.0, -1.0]) ** power
        x = np.arange(-half, half + 1) / half
        scale = half * period
        total = float(polynomial(x).sum())
        derivatives = polynomial, polynomial.deriv(1), polynomial.deriv(2)
        self._windows = [values(x) / scale**k / total for k, values in enumerate(derivatives)]
        self._stride = max(1, 2 * half // OVERLAP)

    @property
    def samples(self) -> int:
        """Return the number of samples of a window."""
        return self._windows[0].size

    def __call__(self, signal: FloatArray, order: int = 0) -> FloatArray:
        """Return the means of a signal's derivative of some order, 0 to 2; shape (windows,)."""
        weights = (-1) ** order * self._windows[order]
        # A copy: what is between need not stay.
        return np.correlate(signal, weights, mode='valid')[:: self._stride].copy()

    def gain(self, order: int) -> float:
        """Return the spread of such a mean for white noise of a standard deviation of one."""
        return float(np.linalg.norm(self._windows[order]))


def weak_guess(signals: LinkSignals, period: float) -> FloatArray:
    """
    Return parameters in the order of NAMES; those that make no sense are NaN.

    Parameters
    ----------
    signals
        What was measured.
    period
        Rough period of the free passive joint [s].

    """
    windows = Windows(signals.times, WINDOW * period)
    sample = float(signals.times[1] - signals.times[0])
    shifts = range(round(LARGEST_DELAY / sample) + 1)
    shift = min(shifts, key=lambda count: _momentum(signals, windows, count)[1])
    (link, last, viscous, coulomb), _ = _momentum(signals, windows, shift)
    guess = np.full(len(NAMES), np.nan)
    if min(link, last) <= 0.0:
        return guess
    stiffness, damping, held = _spring(signals, windows, last)
    if stiffness <= 0.0:
        return guess
    guess[[BOTH, LAST, STIFFNESS, DAMPING]] = link + last, last, stiffness, damping
    guess[[VISCOUS, COULOMB]] = viscous, coulomb
    guess[[OFFSET, DELAY]] = held / stiffness, shift * sample
    return guess


def seen_stiffness(
    times: FloatArray, last: FloatArray, passive: FloatArray, arm: PlanarArm, period: float
) -> tuple[float, float]:
    """
    Return the passive joint's stiffness and its standard error, as shares of a model's [-].

    By the row of the last link alone, whatever moves the other joints. The error is infinite where
    the samples are too few.

    Parameters
    ----------
    times
        Ascending, shape (m,) [s].
    last, passive
        Absolute angle of the last link and angle of the passive joint, shape (m,) [rad].
    arm
        The model; its inertias count as true.
    period
        Rough period of the free passive joint [s].

    """
    even = np.linspace(times[0], times[-1], len(times))
    windows = Windows(even, WINDOW * period)
    if len(windows(even)) <= 2:
        return 1.0, inf
    columns = np.column_stack([windows(np.interp(even, times, passive), k) for k in (0, 1)])
    target = -arm.inertia_star.last * windows(np.interp(even, times, last), 2)
    (stiffness, _), left = _least_squares(columns, target)
    # Windows that overlap err alike.
    spread = OVERLAP * left / (len(target) - 2) * np.linalg.pinv(columns.T @ columns)[0, 0]
    return float(stiffness / arm.stiffness), float(np.sqrt(spread) / arm.stiffness)


def _momentum(signals: LinkSignals, windows: Windows, shift: int) -> tuple[FloatArray, float]:
    """Fit the sum of both rows, free of the spring: effort changes the momentum of both links."""
    effort = np.concatenate((np.full(shift, signals.effort[0]), signals.effort))
    columns = np.column_stack(
        [
            windows(signals.link, 2),
            windows(signals.link + signals.passive, 2),
            windows(signals.rate),
            windows(coulomb_share(signals.rate)),
        ]
    )
    return _least_squares(columns, windows(effort[: signals.effort.size]))


def _spring(signals: LinkSignals, windows: Windows, last: float) -> tuple[float, float, float]:
    """Fit the row of the last link: stiffness, damping, and stiffness times offset."""
    columns = np.column_stack(
        [
            windows(signals.passive),
            windows(signals.passive, 1),
            -windows(np.ones_like(signals.passive)),
        ]
    )
    absolute = signals.link + signals.passive
    (stiffness, damping, held), _ = _least_squares(columns, -last * windows(absolute, 2))
    return float(stiffness), float(damping), float(held)


def _least_squares(columns: FloatArray, target: FloatArray) -> tuple[FloatArray, float]:
    """Return the solution for columns brought to one size, and what is left."""
    size = np.linalg.norm(columns, axis=0)
    size[size == 0.0] = 1.0
    solution = np.linalg.lstsq(columns / size, target, rcond=1e-6)[0]
    left = target - columns / size @ solution
    return solution / size, float(left @ left)
