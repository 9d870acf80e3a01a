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
Motion laws: the planned function of time, every derivative of it, and integrals over it.

A law is fixed in normalised time; it is stretched to its duration, scaled and shifted, so that one
function serves any distance and any place. Integrals take Gauss-Legendre nodes that resolve the
boundary layers and oscillations of exponentials.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from itertools import pairwise
from math import ceil, log2
from typing import Protocol, TYPE_CHECKING

from flat_planner_ros.core.arm import ComplexArray, FloatArray, locked
import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from typing import Self  # Python 3.10 has none

JET_ORDER = 6
"""Highest derivative of the planned variable that joint motions and the flat plan need."""

MAX_DERIVATIVE = 1e150
"""Largest derivative of a planned variable; its square, as in a cost, has room [rad/s^k]."""

NODES_PER_PANEL = 16
"""Gauss-Legendre nodes on each panel."""

MIN_PANELS = 8
"""Panels over half a motion whose law is slow throughout."""

RADIANS_PER_PANEL = 8.0
"""Most that a term turns or decays on one panel; sixteen nodes then miss 1e-11 of its square."""

NEGLIGIBLE_DECAY = 18.0
"""Natural logarithm of the decay from which the square of a term adds nothing to an integral."""

QUADRATURES_KEPT = 16
"""Sets of nodes that are remembered: goals alike share one, whatever their distance."""

MAX_PANELS = 2048
"""Bound on the panels, reached by some thousand oscillations within one motion."""


class Law(Protocol):
    """A planned variable as a smooth function of time on [0, duration]."""

    @property
    def duration(self) -> float:
        """Length of the motion [s]."""

    def jet(self, t: ArrayLike, order: int, /) -> FloatArray:
        """
        Return the value and its derivatives up to an order.

        Parameters
        ----------
        t
            Times from the start of the motion, in any order, shape (m,) [s].
        order
            Highest derivative wanted.

        Returns
        -------
        FloatArray
            Row k holds the k-th derivative, shape (order + 1, m) [rad/s^k].

        """


@dataclass(frozen=True, kw_only=True, eq=False)
class ScaledLaw(ABC):
    """
    A `Law` made of a function of normalised time x from -1 to 1.

    Attributes
    ----------
    duration
        Length of the motion [s].
    factor
        Multiplies the function [-].
    offset
        Is added to the value [rad].

    """

    duration: float
    factor: float = 1.0
    offset: float = 0.0

    def jet(self, t: ArrayLike, order: int, /) -> FloatArray:
        """Return the value and its derivatives up to an order, as `Law.jet`."""
        times = np.atleast_1d(np.asarray(t, dtype=float))
        rate = 2.0 / self.duration
        # Both distances are formed from t: a boundary layer may be far thinner than the spacing
        # of floating-point numbers near x = 1.
        table = self.normalised_jet(rate * np.array([times, self.duration - times]), order)
        table *= (self.factor * rate ** np.arange(order + 1.0))[:, None]
        table[0] += self.offset
        return table

    @abstractmethod
    def normalised_jet(self, distances: FloatArray, order: int) -> FloatArray:
        """
        Return the function and its derivatives in x, neither scaled nor shifted.

        Parameters
        ----------
        distances
            From the start and from the end, x + 1 and 1 - x, both exact, shape (2, m).
        order
            Highest derivative wanted.

        Returns
        -------
        FloatArray
            A new array whose row k holds the k-th derivative, shape (order + 1, m).

        """

    def transformed(self, factor: float, offset: float) -> 'Self':
        """Return offset + factor times this law."""
        return replace(self, factor=factor * self.factor, offset=offset + factor * self.offset)


class Sum(Protocol):
    """A function of normalised time that is a sum: of terms with roots, or of a series."""

    def at(self, distances: FloatArray, order: int, /) -> FloatArray:
        """Return the sum and its derivatives in x, as `ScaledLaw.normalised_jet`."""

    def fill_odd_grid(self, table: FloatArray, scales: FloatArray, /) -> None:
        """
        Write an odd sum and its derivatives in x at even times, both ends included.

        Parameters
        ----------
        table
            Its rows take the derivatives in ascending order, shape (orders, m), m > 1.
        scales
            Factors of the derivatives, shape (orders,).

        """


@dataclass(frozen=True, kw_only=True, eq=False)
class SummedLaw(ScaledLaw):
    """
    A solution of the Euler-Lagrange equation, infinitely smooth; up to the order `TOP_ORDER`.

    Attributes
    ----------
    total
        In normalised time; scaled and shifted, it is the value [rad].

    """

    total: Sum

    def normalised_jet(self, distances: FloatArray, order: int) -> FloatArray:
        """Return the sum of the terms and its derivatives, as `ScaledLaw.normalised_jet`."""
        return self.total.at(distances, order)


@dataclass(frozen=True, kw_only=True, eq=False)
class PiecewiseLaw:
    """
    A `Law` made of one law for each segment.

    Attributes
    ----------
    edges
        Start, knots between the segments and end, ascending from 0, shape (p + 1,) [s].
    laws
        One for each segment, in its own time from 0.

    """

    edges: FloatArray
    laws: tuple[SummedLaw, ...]

    def __post_init__(self) -> None:
        """Lock the edges."""
        locked(self.edges)

    @property
    def duration(self) -> float:
        """Length of the motion [s]."""
        return float(self.edges[-1])

    def jet(self, t: ArrayLike, order: int, /) -> FloatArray:
        """Return the value and its derivatives, as `Law.jet`; a knot belongs to what follows."""
        times = np.atleast_1d(np.asarray(t, dtype=float))
        segments = np.searchsorted(self.edges[1:-1], times, side='right')
        result = np.empty((order + 1, len(times)))
        # Stable: times that are sorted already, as nearly always, stay slices of the result.
        by_segment = np.argsort(segments, kind='stable')
        bounds = np.searchsorted(segments[by_segment], np.arange(len(self.laws) + 1))
        for index in np.flatnonzero(np.diff(bounds)):
            chosen = by_segment[bounds[index] : bounds[index + 1]]
            local = times[chosen] - self.edges[index]
            result[:, chosen] = self.laws[index].jet(local, order)
        return result


def half_quadrature(rates: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """
    Return Gauss-Legendre nodes and weights over the first half of a motion.

    Parameters
    ----------
    rates
        Characteristic roots of its laws, in units of 2 / duration, shape (m,) [-].

    Returns
    -------
    tuple[FloatArray, FloatArray]
        Normalised times x + 1 in (0, 1), and weights whose sum is 1, shape (m,) [-].

    """
    return _split_panels(*_division(rates, 0.0))


def _division(rates: ComplexArray, turning: float) -> tuple[int, tuple[int, ...]]:
    """Return the depth of panels that resolve rates, and another all along; parts of each."""
    depth = ceil(log2(float(np.abs(rates).max(initial=turning)) + 1.0)) + 1
    widths, alive = _speeds(rates.tobytes(), depth)
    parts = 1.0 + np.floor(widths * np.maximum(alive, turning) / RADIANS_PER_PANEL)
    counts = np.ceil(parts * min(1.0, MAX_PANELS / parts.sum())).astype(int)
    return depth, tuple(counts.tolist())


@lru_cache(maxsize=QUADRATURES_KEPT)
def _speeds(rates: bytes, depth: int) -> tuple[FloatArray, FloatArray]:
    """Return the widths of panels, and the fastest of some rates that is alive on each."""
    roots, edges = np.frombuffer(rates, dtype=complex), _panels(depth)
    # A term may oscillate many times within its layer: split panels that it still reaches.
    is_alive = np.multiply.outer(edges[:-1], np.abs(roots.real)) < NEGLIGIBLE_DECAY
    alive = np.where(is_alive, np.abs(roots), 0.0).max(axis=1, initial=0.0)
    return locked(np.diff(edges)), locked(alive)


@lru_cache(maxsize=QUADRATURES_KEPT)
def _split_panels(depth: int, parts: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
    """Return nodes and weights of panels that are split into a number of equal parts each."""
    counts = np.array(parts)
    widths = np.repeat(np.diff(_panels(depth)) / counts, counts)
    starts = np.cumsum(widths) - widths
    nodes, weights = gauss_panel()
    times = starts[:, None] + np.multiply.outer(widths, nodes)
    return locked(times.ravel()), locked(np.multiply.outer(widths, weights).ravel())


def motion_quadrature(
    rates: ComplexArray, travel: float, edges: Sequence[float]
) -> tuple[FloatArray, FloatArray]:
    """
    Return Gauss-Legendre nodes and weights over a motion of several pieces.

    Parameters
    ----------
    rates
        Characteristic roots of its laws, in units of 2 / duration, shape (m,) [-].
    travel
        Distance that the joints cover: dynamics turn with it [rad].
    edges
        Times from start to end between which the laws are smooth [s].

    Returns
    -------
    tuple[FloatArray, FloatArray]
        Times [s], and weights whose sum is 1, shape (m,).

    """
    begin = edges[0]
    duration = edges[-1] - begin
    pieces = []
    for start, end in pairwise(edges):
        share = (end - start) / duration
        # A motion's peak velocity is about twice the mean one.
        division = _division(share * rates, share * 2.0 * travel)
        pieces.append(_piece(*division, start - begin, end - begin, share))
    if len(pieces) == 1:
        return pieces[0]
    times, weights = zip(*pieces, strict=True)
    return np.concatenate(times), np.concatenate(weights)


@lru_cache(maxsize=QUADRATURES_KEPT)
def _piece(
    depth: int, parts: tuple[int, ...], start: float, end: float, share: float
) -> tuple[FloatArray, FloatArray]:
    """Return nodes between two times [s], and weights whose sum is their share of a motion."""
    nodes, halves = _split_panels(depth, parts)
    reach = 0.5 * (end - start) * nodes
    times = np.concatenate([start + reach, end - reach])
    return locked(times), locked(np.tile(0.5 * share * halves, 2))


@cache
def _panels(depth: int) -> FloatArray:
    """Return edges of panels, halved towards the start as deep as layers go."""
    layers = 0.5 ** np.arange(depth, 0.0, -1.0)
    # Some there are even where the law is slow.
    return locked(np.union1d(layers, np.linspace(0.0, 1.0, MIN_PANELS + 1)))


@cache
def gauss_panel() -> tuple[FloatArray, FloatArray]:
    """Return the nodes and weights of one panel from 0 to 1."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES_PER_PANEL)
    return 0.5 * (nodes + 1.0), 0.5 * weights
