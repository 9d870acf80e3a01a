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

from collections.abc import Callable, Iterator
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
from flat_planner_ros.core.model_fit.signals import Segment
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

WINDOW = 0.4
"""Length of a window relative to the free period of the passive joint [-]."""

OVERLAP = 8
"""Windows that share a sample."""

LARGEST_DELAY = 0.05
"""Longest delay that is tried [s]."""

AT_A_TIME = 1024
"""Windows whose signals are held together [-]."""

_LINK, _ABSOLUTE, _RATE, _SHARE, _PASSIVE, _PASSIVE_RATE, _ONE, _EFFORT = range(8)

POWER = 4
"""A window is (1 - x^2)^POWER: it and three derivatives vanish at its ends."""


class LinkSignals(NamedTuple):
    """
    What is measured of the last two links, or a piece of it.

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
        window = (-1) ** order * self._windows[order]
        if signal.size < window.size:
            return np.empty(0)
        found: FloatArray = sliding_window_view(signal, window.size)[:: self._stride] @ window
        return found

    def pieces(self, count: int) -> Iterator[Segment]:
        """Yield pieces of so many samples whose windows, one after the other, are those of all."""
        for first in range(0, max(count - self.samples, 0) + 1, AT_A_TIME * self._stride):
            last = first + (AT_A_TIME - 1) * self._stride + self.samples
            yield Segment(first, min(last, count))

    def gain(self, order: int) -> float:
        """Return the spread of such a mean for white noise of a standard deviation of one."""
        return float(np.linalg.norm(self._windows[order]))


def weak_guess(
    signals: Callable[[int, int], LinkSignals], count: int, period: float
) -> FloatArray:
    """
    Return parameters in the order of NAMES; those that make no sense are NaN.

    Parameters
    ----------
    signals
        Gives what was measured, of even samples from a first one to before a last one.
    count
        How many of them there are.
    period
        Rough period of the free passive joint [s].

    """
    times = signals(0, 2).times
    windows, sample = Windows(times, WINDOW * period), float(times[1] - times[0])
    most = round(LARGEST_DELAY / sample)
    triangle = _triangle(signals, count, windows, most)
    shift = min(range(most + 1), key=lambda shift: _momentum(triangle, shift)[1])
    (link, last, viscous, coulomb), _ = _momentum(triangle, shift)
    guess = np.full(len(NAMES), np.nan)
    if min(link, last) <= 0.0:
        return guess
    stiffness, damping, held = _spring(triangle, last)
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


def _triangle(
    signals: Callable[[int, int], LinkSignals], count: int, windows: Windows, most: int
) -> FloatArray:
    """
    Return the triangle of the rows of all windows, in which least squares are the same (QR).

    Columns are _LINK ... _ONE, and from _EFFORT on the effort 0 to `most` samples later.
    """
    triangle = np.empty((0, _EFFORT + most + 1))
    for first, last in windows.pieces(count):
        piece = signals(first, last)
        effort = signals(max(first - most, 0), last).effort
        held = np.full(max(most - first, 0), effort[0])
        rows = _rows(piece, windows, np.concatenate((held, effort)))
        triangle = np.linalg.qr(np.vstack((triangle, rows)))[1]
    return triangle


def _rows(signals: LinkSignals, windows: Windows, effort: FloatArray) -> FloatArray:
    """Return the rows of a piece; its effort begins as much earlier as it may be late."""
    count = signals.times.size
    late = effort.size - count
    columns = [
        windows(signals.link, 2),
        windows(signals.link + signals.passive, 2),
        windows(signals.rate),
        windows(coulomb_share(signals.rate)),
        windows(signals.passive),
        windows(signals.passive, 1),
        windows(np.ones(count)),
    ]
    columns += [windows(effort[late - shift :][:count]) for shift in range(late + 1)]
    return np.column_stack(columns)


def _momentum(triangle: FloatArray, shift: int) -> tuple[FloatArray, float]:
    """Fit the sum of both rows, free of the spring: effort changes the momentum of both links."""
    return _least_squares(triangle[:, _LINK : _SHARE + 1], triangle[:, _EFFORT + shift])


def _spring(triangle: FloatArray, last: float) -> tuple[float, float, float]:
    """Fit the row of the last link: stiffness, damping, and stiffness times offset."""
    columns = triangle[:, _PASSIVE : _ONE + 1] * (1.0, 1.0, -1.0)
    (stiffness, damping, held), _ = _least_squares(columns, -last * triangle[:, _ABSOLUTE])
    return float(stiffness), float(damping), float(held)


def _least_squares(columns: FloatArray, target: FloatArray) -> tuple[FloatArray, float]:
    """Return the solution for columns brought to one size, and what is left."""
    size = np.linalg.norm(columns, axis=0)
    size[size == 0.0] = 1.0
    solution = np.linalg.lstsq(columns / size, target, rcond=1e-6)[0]
    left = target - columns / size @ solution
    return solution / size, float(left @ left)
