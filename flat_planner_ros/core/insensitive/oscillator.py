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
Oscillator: the passive joint under either drive, on all arms of a box.

Its poles are all that a residual depends on, besides what drives it; those of a box fill a region
whose boundary holds the worst arm ((I1) and I.1 of docs/derivation.md).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import accumulate
from math import ceil
from typing import TypeVar

from flat_planner_ros.core.arm import (
    ComplexArray,
    Drive,
    FloatArray,
    InvalidRequest,
    locked,
    PlanarArm,
)
from flat_planner_ros.core.insensitive.insensitivity import UncertaintyBox
import numpy as np
from numpy.polynomial import legendre

TURN_PER_POINT = 0.1
"""
Largest turn of the residual's phase between neighbouring points of an edge [rad].

A maximum between two points exceeds both by less than 0.1^2 / 8 of itself, and a parabola through
three points removes nearly all of that.
"""

MIN_POINTS = 5
"""Fewest points of an edge, ends included."""

MAX_POINTS = 257
"""Most points of an edge."""

MEAN_NODES = 4
"""Gauss-Legendre nodes over either side of the box, plus one per radian of turn."""

MAX_MEAN_NODES = (24, 24, 8)
"""Most of them over stiffness, damping and inertia, which acts like both others together."""

RULES_KEPT = 128
"""Quadratures, and points of an edge, that are remembered."""

Value = TypeVar('Value', float, FloatArray)


@lru_cache(maxsize=RULES_KEPT)
def gauss_legendre(count: int) -> tuple[FloatArray, FloatArray]:
    """Return nodes and weights of a quadrature from -1 to 1."""
    nodes, weights = legendre.leggauss(count)
    return locked(nodes), locked(weights)


@lru_cache(maxsize=RULES_KEPT)
def _spread(count: int) -> FloatArray:
    """Return Chebyshev points from 0 to 1: extremes near ends are seen as well as those inside."""
    return locked(0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, count)))


def stiffening(
    drive: Drive, inertia_ratio: Value, inertia: FloatArray, inner: FloatArray | float = 1.0
) -> FloatArray:
    """
    Return the factor on stiffness and damping that acts like factors on inertias.

    Parameters
    ----------
    drive
        What moves joint n-1.
    inertia_ratio
        I*_(n-1) / I*_n [-].
    inertia, inner
        Factors on the inertia of link n and on that of link n-1 without it [-].

    """
    if drive is Drive.POSITION:
        return 1.0 / inertia
    # Rotors n-1 and n in series.
    factor: FloatArray = (1.0 / inner + (inertia_ratio - 1.0) / inertia) / inertia_ratio
    return factor


def pole_parts(
    frequency: Value, decay: Value, stiffness: FloatArray, damping: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the rate of decay and the square of the damped frequency under factors [-]."""
    rate: FloatArray = damping * decay
    return rate, stiffness * frequency**2 - rate**2


def corners_of(box: UncertaintyBox) -> FloatArray:
    """Return factors at the corners of the region of poles of a box, in order, shape (6, 3)."""
    k, c, i = box.ranges
    # Poles depend on (k, c) times what falls with i: rectangles that grow from one corner's
    # ray to the other's, a hexagon in all.
    return np.array(
        [
            [k.low, c.low, i.high],
            [k.high, c.low, i.high],
            [k.high, c.low, i.low],
            [k.high, c.high, i.low],
            [k.low, c.high, i.low],
            [k.low, c.high, i.high],
        ]
    )


def edges_between(
    corners: FloatArray, turns: FloatArray, most: int = MAX_POINTS
) -> list[FloatArray]:
    """
    Return factors along the edges between corners.

    Parameters
    ----------
    corners
        Factors, in order, shape (6, 3) [-].
    turns
        How far oscillations drift apart from each corner to the following one, shape (6,) [rad].
    most
        Largest number of points of an edge.

    Returns
    -------
    list[FloatArray]
        As by `Oscillator.edges`.

    """
    ends = np.roll(corners, -1, axis=0)
    counts = [
        min(max(ceil(turn / TURN_PER_POINT) + 1, MIN_POINTS), most) if is_long else 0
        for turn, is_long in zip(turns.tolist(), (corners != ends).any(axis=1), strict=True)
    ]
    if not any(counts):
        return [corners[:1]]
    # All edges at once, as they have few points each.
    share = np.concatenate([_spread(count) for count in counts])
    begin, end = np.repeat(corners, counts, axis=0), np.repeat(ends, counts, axis=0)
    factors = begin + share[:, None] * (end - begin)
    # Frequencies go with the root of 1 / inertia, over which points are spread evenly.
    begin, end = 1.0 / begin[:, 2], 1.0 / end[:, 2]
    factors[:, 2] = 1.0 / (begin + share * (end - begin))
    lasts = accumulate(counts)
    return [
        factors[last - count : last] for last, count in zip(lasts, counts, strict=True) if count
    ]


@dataclass(frozen=True, kw_only=True)
class Oscillator:
    """
    Oscillation of the passive joint, on whose arm joint n-1 is driven in one way or the other.

    It answers to the angular acceleration of link n-1: one that an effort would give to that link
    alone, or the one that a servo gives to it. The inertia of the last link counts like a common
    factor on stiffness and damping.

    Attributes
    ----------
    frequency
        Undamped angular frequency of the nominal arm [rad/s].
    decay
        Rate of decay of the nominal arm [1/s].
    inertia_ratio
        I*_(n-1) / I*_n [-].
    gain
        Acceleration of link n-1 for each unit of effort, 1 / (I*_(n-1) - I*_n) [1/(kg m^2)], or of
        what a servo gives to it, 1 [-].
    drive
        Which of the two.

    """

    frequency: float
    decay: float
    inertia_ratio: float
    gain: float
    drive: Drive

    @classmethod
    def of(cls, arm: PlanarArm, drive: Drive = Drive.EFFORT) -> 'Oscillator':
        """Return that of a flat arm; raise NotFlat for another."""
        mode = arm.natural_mode(held=drive is Drive.POSITION)
        both, last = arm.inertia_star
        return cls(
            frequency=mode.frequency,
            decay=mode.decay_rate,
            inertia_ratio=both / last,
            gain=1.0 / (both - last) if drive is Drive.EFFORT else 1.0,
            drive=drive,
        )

    @property
    def gain_of_sigma(self) -> float:
        """Return the same for each unit of sigma'', I*_(n-1) sigma'' being an effort [-]."""
        if self.drive is Drive.POSITION:
            return 1.0
        return self.inertia_ratio / (self.inertia_ratio - 1.0)

    def stiffening(self, inertia: FloatArray) -> FloatArray:
        """Return the factor on stiffness and damping that acts like one on I*_n, shape (m,)."""
        return stiffening(self.drive, self.inertia_ratio, inertia)

    def poles(self, factors: FloatArray) -> ComplexArray:
        """
        Return the poles -zeta omega + i omega_d of other arms.

        Parameters
        ----------
        factors
            On stiffness, damping and, if it differs, the inertia of the last link, shape (m, 2)
            or (m, 3) [-].

        Raises
        ------
        InvalidRequest
            One of the arms does not oscillate.

        """
        common = self.stiffening(factors[:, 2]) if factors.shape[1] > 2 else 1.0
        decay, square = pole_parts(
            self.frequency, self.decay, factors[:, 0] * common, factors[:, 1] * common
        )
        if (square <= 0.0).any():
            k, c = factors[int(np.argmin(square))][:2]
            raise InvalidRequest(
                f'with {k:.3g} times the stiffness and {c:.3g} times the damping the passive '
                f'joint does not oscillate: there is no residual to plan against'
            )
        poles: ComplexArray = -decay + 1j * np.sqrt(square)
        return poles

    def edges(
        self, box: UncertaintyBox, duration: float, most: int = MAX_POINTS
    ) -> list[FloatArray]:
        """
        Return factors along the edges of a box that surround its poles.

        Parameters
        ----------
        box
            What may differ.
        duration
            Time over which different arms drift apart [s].
        most
            Largest number of points of an edge.

        Returns
        -------
        list[FloatArray]
            Points from corner to corner, factors on stiffness, damping and inertia of the last
            link, each of shape (m, 3) [-]; edges of no length are left out.

        """
        corners = corners_of(box)
        poles = self.poles(corners)
        return edges_between(corners, duration * np.abs(np.roll(poles, -1) - poles), most)

    def nodes(self, box: UncertaintyBox, duration: float) -> tuple[FloatArray, FloatArray]:
        """Return points inside a box, shape (p, 3), and weights of a mean over it, shape (p,)."""
        middle = np.array([0.5 * (low + high) for low, high in box.ranges])
        points, weights = middle[None], np.ones(1)
        for axis, (low, high) in enumerate(box.ranges):
            begin, end = middle.copy(), middle.copy()
            begin[axis] = low
            end[axis] = high
            count = MEAN_NODES + ceil(self._turn(begin, end, duration)) if low < high else 1
            places, shares = gauss_legendre(min(count, MAX_MEAN_NODES[axis]))
            points = np.repeat(points, len(places), axis=0)
            points[:, axis] += np.tile(0.5 * (high - low) * places, len(weights))
            weights = np.multiply.outer(weights, 0.5 * shares).ravel()
        return points, weights

    def _turn(self, begin: FloatArray, end: FloatArray, duration: float) -> float:
        """Return how far two arms' oscillations drift apart [rad]."""
        first, second = self.poles(np.array([begin, end]))
        return float(duration * abs(second - first))


def largest(edges: Sequence[FloatArray], values: FloatArray) -> tuple[float, FloatArray]:
    """Return the largest of the values along all edges, and its factors, shape (3,)."""
    worst, place, first = -1.0, edges[0][0], 0
    listed = values.tolist()
    for edge in edges:
        value, at = _peak(edge, listed[first : first + len(edge)])
        first += len(edge)
        if value > worst:
            worst, place = value, at
    return worst, place


def _peak(edge: FloatArray, values: list[float]) -> tuple[float, FloatArray]:
    """Return the largest value along an edge, from a parabola through its neighbours."""
    last, peak = len(values) - 1, max(values)
    i = values.index(peak)
    if not 0 < i < last:
        return peak, edge[i]
    span = edge[i + 1] - edge[i - 1]
    share = float(np.abs(edge[i] - edge[i - 1]).sum() / np.abs(span).sum())
    a, b, c = values[i - 1 : i + 2]
    # Newton's form a + s u + q u (u - share) over u in [0, 1].
    slope = (b - a) / share
    bend = (c - a - slope) / (1.0 - share)
    if bend >= 0.0:
        return b, edge[i]
    at = min(max(0.5 * (share - slope / bend), 0.0), 1.0)
    top = a + slope * at + bend * at * (at - share)
    return max(b, top), edge[i - 1] + at * span
