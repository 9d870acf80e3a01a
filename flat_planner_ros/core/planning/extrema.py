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
Extrema of a plan between its samples: how far every joint's motion and effort go.

The law is cut into segments on which a Chebyshev series of fixed degree holds every quantity to
`RESOLUTION`, whatever the quantity is made of; its extrema are then those of polynomials, and the
values reported are those of the law itself at the times found (docs/derivation.md, section L).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from math import ceil, log2
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.motion_law import CONDITIONS
from flat_planner_ros.core.planning.certified_plan import Plan, PlanSamples
from flat_planner_ros.core.planning.reference_trajectory import ReferenceTrajectory
import numpy as np
from numpy.typing import NDArray

BoolArray = NDArray[np.bool_]

DEGREE = 16
"""Degree of the series on each segment."""

TAIL = 3
"""Last coefficients of a series, whose size is taken for its error."""

RESOLUTION = 1e-8
"""Error of a series that is accepted, relative to the range of the quantity [-]."""

LAYER_RESOLUTION = 1e-2
"""
The same for derivatives 1 to 5 of the planned variables, relative to their peaks [-].

A boundary layer is what carries one of them from its value at the end of a segment to another one:
resolving all five, however roughly, leaves no layer unseen between two nodes.
"""

NOISE = 1e-12
"""Changes below this share of a quantity's peak over all joints are taken for rounding [-]."""

FIRST_LAYER = 0.125
"""Part of a smooth piece that its first and last segment take, without boundary layers [-]."""

SECOND_CUT = 0.3125
"""Where the next one ends: at once, as most laws would be cut there after a look [-]."""

SEEN_RATE = 17.0
"""Rate of a boundary layer that such a segment resolves, in 2 / length of the piece [-]."""

MAX_ROUNDS = 40
"""Halvings of a segment; what is left then is a jump, whose two sides are both nodes."""

DENSITY = 4
"""Places of the search for extrema per node of a segment."""

NEWTON_STEPS = 4
"""Steps that square the spacing of the search down to rounding."""

TINY = 1e-300
"""Keeps quantities that are zero throughout from a division by zero."""

NEAR_PEAK = 0.1
"""Share of the range below the highest place within which every local extremum is refined [-]."""


class Quantity(Enum):
    """Limited quantities."""

    POSITION = 'position'
    VELOCITY = 'velocity'
    EFFORT = 'effort'

    @property
    def unit(self) -> str:
        """Return its SI unit."""
        return {'position': 'rad', 'velocity': 'rad/s', 'effort': 'N m'}[self.value]

    def of(self, samples: PlanSamples) -> FloatArray:
        """Return its samples, shape (m, n)."""
        if self is Quantity.POSITION:
            return samples.positions
        return samples.velocities if self is Quantity.VELOCITY else samples.efforts


class Extrema(NamedTuple):
    """
    Smallest and largest value of every joint over a motion, and their times.

    Attributes
    ----------
    lowest, highest
        Shape (n,) [rad, rad/s or N m].
    lowest_at, highest_at
        From the start of the motion, shape (n,) [s].

    """

    lowest: FloatArray
    lowest_at: FloatArray
    highest: FloatArray
    highest_at: FloatArray

    @classmethod
    def of_samples(cls, times: FloatArray, values: FloatArray) -> 'Extrema':
        """Return the extrema among samples, given times (m,) and values (m, n)."""
        low, high = values.argmin(axis=0), values.argmax(axis=0)
        return cls(values.min(axis=0), times[low], values.max(axis=0), times[high])

    @property
    def peak(self) -> FloatArray:
        """Return the largest magnitude of every joint, shape (n,)."""
        return np.maximum(-self.lowest, self.highest)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Mesh:
    """
    Series on segments.

    Attributes
    ----------
    starts, lengths
        Start and length of each segment, shape (s,) [s].
    values
        Values at the nodes, shape (joint quantities, s, DEGREE + 1).
    resolved
        Which segments hold their accuracy, shape (s,).

    """

    starts: FloatArray
    lengths: FloatArray
    values: FloatArray
    resolved: BoolArray


def extrema_of(plan: Plan, quantities: Sequence[Quantity] = tuple(Quantity)) -> list[Extrema]:
    """
    Return the extrema of every joint over the continuous motion.

    Parameters
    ----------
    plan
        Any plan.
    quantities
        Which ones.

    Returns
    -------
    list of Extrema
        In the order of the quantities. No value is beyond what the law attains, and none is short
        of its extremum by more than 1e-6 of the range that the quantity covers.

    """
    mesh = _resolved(plan, quantities)
    times = _top_times(mesh).reshape(2, len(quantities), -1)
    samples = plan.at(times.ravel())
    joints = np.arange(times.shape[-1])
    found = []
    for index, quantity in enumerate(quantities):
        values = quantity.of(samples).reshape(*times.shape, -1)[:, index, joints, joints]
        low, high = times[:, index]
        found.append(Extrema(values[0], low, values[1], high))
    return found


def _resolved(plan: Plan, quantities: Sequence[Quantity]) -> _Mesh:
    """Return series of all joints' quantities, in the order of quantities and joints."""
    bounds, orders = _first_bounds(plan.trajectory)
    starts, lengths = bounds[:-1], np.diff(bounds)
    scale, layer_scale = _Range(), _Range()
    done: list[tuple[FloatArray, FloatArray, FloatArray, BoolArray]] = []
    for halvings in range(MAX_ROUNDS + 1):
        times = starts[:, None] + lengths[:, None] * _FRACTIONS
        # The last node of a segment is the first of the next one, to the last bit.
        samples = plan.at(times.ravel())
        shape = (-1, len(starts), DEGREE + 1)
        values = np.stack([quantity.of(samples).T for quantity in quantities])
        layers = samples.planned[:, 1:orders]
        noise = NOISE * np.abs(values).max(axis=(1, 2), keepdims=True)
        noise = np.broadcast_to(noise[..., 0], values.shape[:2]).reshape(-1, 1)
        values, layers = values.reshape(shape), layers.reshape(shape)
        tolerance = np.maximum(RESOLUTION * scale.update(values), noise)
        rough = LAYER_RESOLUTION * layer_scale.update(layers)
        resolved = (_tail(values) <= tolerance).all(axis=0) & (_tail(layers) <= rough).all(axis=0)
        stays = resolved if halvings < MAX_ROUNDS else np.ones_like(resolved)
        done.append((starts[stays], lengths[stays], values[:, stays], resolved[stays]))
        if stays.all():
            break
        half = 0.5 * lengths[~stays]
        starts = np.concatenate([starts[~stays], starts[~stays] + half])
        lengths = np.concatenate([half, half])
    starts, lengths, values, resolved = (
        np.concatenate(parts, axis=axis)
        for parts, axis in zip(zip(*done, strict=True), (0, 0, 1, 0), strict=True)
    )
    return _Mesh(starts=starts, lengths=lengths, values=values, resolved=resolved)


def _first_bounds(trajectory: ReferenceTrajectory) -> tuple[FloatArray, int]:
    """
    Return times between which laws are smooth, and the number of continuous derivatives.

    Boundary layers are cut as finely as the rates, in 2 / duration, will ask for.
    """
    if trajectory.knots is not None:
        # The fifth derivative jumps where an effort has a corner.
        return trajectory.knots, CONDITIONS - 1
    edges = np.array(trajectory.edges)
    lengths = np.diff(edges)
    share = lengths.max() / (edges[-1] - edges[0])
    rate = share * np.abs(trajectory.roots.real).max(initial=SEEN_RATE)
    depth = ceil(log2(max(rate / SEEN_RATE, 1.0)))
    layers = FIRST_LAYER * 0.5 ** np.arange(depth, -1.0, -1.0)
    cuts = np.append(layers, SECOND_CUT)
    fractions = np.concatenate([[0.0], cuts, [0.5], 1.0 - cuts[::-1]])
    inner = edges[:-1, None] + lengths[:, None] * fractions
    return np.append(inner.ravel(), edges[-1]), CONDITIONS


class _Range:
    """Range of quantities over all that has been seen of them."""

    def __init__(self) -> None:
        """Start with nothing."""
        self._low: FloatArray | float = np.inf
        self._high: FloatArray | float = -np.inf

    def update(self, values: FloatArray) -> FloatArray:
        """Return the range with more values, shape (quantities, 1)."""
        self._low = np.minimum(self._low, values.min(axis=(1, 2)))
        self._high = np.maximum(self._high, values.max(axis=(1, 2)))
        return np.asarray(self._high - self._low)[:, None]


def _tail(values: FloatArray) -> FloatArray:
    """Return the size of the last coefficients of series, shape (quantities, segments)."""
    tail: FloatArray = np.abs(values @ _TO_TAIL).max(axis=-1)
    return tail


def _top_times(mesh: _Mesh) -> FloatArray:
    """Return when the negatives of all quantities, then the quantities, are largest [s]."""
    series = mesh.values @ _TO_SERIES
    places = series @ _TO_SEARCH
    if not mesh.resolved.all():
        # Between the nodes of a jump a series overshoots; each side is a node.
        nodes = np.repeat(mesh.values, DENSITY, axis=-1)[..., : places.shape[-1]]
        places = np.where(mesh.resolved[:, None], places, nodes)
    series, places = np.concatenate([-series, series]), np.concatenate([-places, places])
    highest, lowest = places.max(axis=(1, 2)), places.min(axis=(1, 2))
    # In steps of what is rounding, so that a plateau has few tops.
    grain = NOISE * np.maximum(np.abs(highest), np.abs(lowest)) + TINY
    places = np.rint(places / grain[:, None, None]) * grain[:, None, None]
    tops = places >= (highest - NEAR_PEAK * (highest - lowest))[:, None, None]
    # A plateau has one top, its first place.
    tops[..., 1:] &= places[..., 1:] > places[..., :-1]
    tops[..., :-1] &= places[..., :-1] >= places[..., 1:]
    quantity, segment, place = np.nonzero(tops)
    x, heights = _refined(series[quantity, segment], place)
    x = np.where(mesh.resolved[segment], x, _SEARCH[place])
    heights = np.where(mesh.resolved[segment], heights, places[tops])
    times = mesh.starts[segment] + mesh.lengths[segment] * (0.5 * (x + 1.0))
    # Sorted by quantity, then height: the last of each is the highest.
    order = np.lexsort((heights, quantity))
    last = np.searchsorted(quantity[order], np.arange(len(places)), side='right') - 1
    highest_at: FloatArray = times[order[last]]
    return highest_at


def _refined(series: FloatArray, place: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
    """Return the maxima of series near places of the search, by Newton's method, and values."""
    search = _SEARCH
    low = search[np.maximum(place - 1, 0)]
    high = search[np.minimum(place + 1, len(search) - 1)]
    x = search[place]
    slopes = series @ _DIFFERENTIATION
    bends = slopes @ _DIFFERENTIATION
    for _ in range(NEWTON_STEPS):
        basis = _basis(x)
        slope, bend = (slopes * basis).sum(axis=-1), (bends * basis).sum(axis=-1)
        # Downhill of an inflection Newton's method would look for a minimum.
        step = np.divide(slope, -bend, out=np.zeros_like(x), where=bend < 0.0)
        x = np.clip(x + step, low, high)
    values = (series * _basis(x)).sum(axis=-1)
    there = (series * _basis(search[place])).sum(axis=-1)
    return np.where(values > there, x, search[place]), np.maximum(values, there)


def _basis(x: FloatArray) -> FloatArray:
    """Return the Chebyshev polynomials T_0 ... T_DEGREE, shape x + (DEGREE + 1,)."""
    basis: FloatArray = np.cos(np.multiply.outer(np.arccos(x), np.arange(DEGREE + 1.0)))
    return basis


_NODES = -np.cos(np.pi * np.arange(DEGREE + 1.0) / DEGREE)
"""Nodes of a segment -1 <= x <= 1, ascending."""

_FRACTIONS = 0.5 * (_NODES + 1.0)
"""The nodes as fractions of the segment."""

_SEARCH = -np.cos(np.pi * np.arange(DENSITY * DEGREE + 1.0) / (DENSITY * DEGREE))
"""Places x of the search, every `DENSITY`-th one a node."""

# Matrices, applied from the right.
_TO_SERIES = np.linalg.inv(_basis(_NODES)).T.astype(np.float64)
"""From values at the nodes to Chebyshev coefficients."""

_TO_TAIL = _TO_SERIES[:, -TAIL:].copy()
"""From values at the nodes to the last coefficients."""

_TO_SEARCH = _basis(_SEARCH).T
"""From coefficients to the values at the places of the search."""

_DIFFERENTIATION = np.pad(
    np.polynomial.chebyshev.chebder(np.eye(DEGREE + 1), axis=1), ((0, 0), (0, 1))
)
"""From coefficients to those of the derivative in x."""
