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
Errors of the velocity of link n-2, where they turn the friction of joint n-1.

That velocity comes from noisy angles of n-2 encoders. Where joint n-1 turns back, its error
changes when friction does so, and link n-1 goes on faster or slower from there. So the errors are
unknowns beside the starts of the segments, of as much covariance as the noise gives them ((N8a) of
docs/derivation.md).
"""

from collections.abc import Sequence
from math import sqrt
from typing import NamedTuple

from flat_planner_ros.core.arm import COULOMB_VELOCITY, FloatArray
from flat_planner_ros.core.model_fit.signals import derivative, Segment
import numpy as np
import numpy.typing as npt

NODES = 4
"""Nodes over the time that smoothing polynomials span: as fast as their errors change [-]."""

TURNING = 4.0
"""Velocity of joint n-1 up to which friction may turn, in those of Coulomb friction [-]."""

SEEN = 2.0
"""Standard deviations by which a velocity may be seen off [-]."""

BIASED = 2.0
"""Change with a longer span that noise does not explain, in its own standard deviations [-]."""


class BaseErrors(NamedTuple):
    """
    Errors of a velocity between nodes, straight, and nothing far from them.

    Attributes
    ----------
    nodes
        Times for each segment, infinite beyond those that it has, shape (segments, K) [s].
    roots
        Their covariance is that times its transpose, zero beyond the nodes that a segment has,
        shape (segments, K, K) [rad/s].
    spacing
        Of neighbouring nodes [s].

    """

    nodes: FloatArray
    roots: FloatArray
    spacing: float

    @classmethod
    def none(cls, segments: int) -> 'BaseErrors':
        """Return those of a velocity that is known, in so many segments."""
        return cls(np.empty((segments, 0)), np.empty((segments, 0, 0)), 1.0)

    @property
    def counts(self) -> list[int]:
        """Return how many nodes each segment has."""
        found: list[int] = np.isfinite(self.nodes).sum(axis=1).tolist()
        return found

    def of(self, block: slice) -> 'BaseErrors':
        """Return those of some of the segments."""
        return BaseErrors(self.nodes[block], self.roots[block], self.spacing)

    def near(self, grid: FloatArray) -> 'Near':
        """Return the nodes that act at rising times, shape (g, segments) [s]."""
        begins, ends = grid[0, :, None], grid[-1, :, None]
        first = np.count_nonzero(self.nodes <= begins - self.spacing, axis=1)
        last = np.count_nonzero(self.nodes < ends + self.spacing, axis=1)
        places = first[:, None] + np.arange(int((last - first).max()))
        beyond = np.pad(self.nodes, ((0, 0), (0, places.shape[1])), constant_values=np.inf)
        away = np.abs(grid[:, :, None] - np.take_along_axis(beyond, places, axis=1))
        return Near(first, np.maximum(1.0 - away / self.spacing, 0.0))


class Near(NamedTuple):
    """
    The nodes that act at some times.

    Attributes
    ----------
    first
        Of each segment, shape (segments,).
    shares
        Of the values at these nodes, shape (g, segments, nodes) [-].

    """

    first: npt.NDArray[np.intp]
    shares: FloatArray

    def between(self, values: FloatArray) -> FloatArray:
        """Return values at all nodes, (segments, K), between them, shape (g, segments)."""
        count = self.shares.shape[-1]
        padded = np.pad(values, ((0, 0), (0, count)))
        own = np.take_along_axis(padded, self.first[:, None] + np.arange(count), axis=1)
        found: FloatArray = np.einsum('gsn,sn->gs', self.shares, own)
        return found

    def add(self, found: FloatArray, carried: FloatArray, segment: int) -> None:
        """
        Add to derivatives by the values at all nodes, shape (..., K), those at these nodes.

        Parameters
        ----------
        found
            To which is added.
        carried
            Derivatives by the values at these nodes, shape (..., n).
        segment
            Whose nodes they are.

        """
        first = int(self.first[segment])
        room = found[..., first : first + carried.shape[-1]]
        room += carried[..., : room.shape[-1]]


class Smoothing(NamedTuple):
    """How a velocity was smoothed: noise of the angle [rad], and the polynomials' span [s]."""

    noise: float
    span: float


def base_errors_of(
    times: FloatArray,
    turning: FloatArray,
    change: FloatArray,
    segments: Sequence[Segment],
    smoothing: tuple[Smoothing, Smoothing],
) -> BaseErrors | None:
    """
    Return what is to be expected of the velocity's errors; None if friction never turns.

    Parameters
    ----------
    times
        Shape (m,) [s].
    turning
        Velocity of joint n-1, shape (m,) [rad/s].
    change
        Of the velocity of link n-2 with the longer span, shape (m,) [rad/s].
    segments
        Pieces with errors of their own.
    smoothing
        Of the velocity, and the one with a longer span.

    """
    period = float(np.median(np.diff(times)))
    spacing = smoothing[0].span / NODES
    lags, covariance, changing = _covariances(period, *smoothing)
    # What is measured of joint n-1 errs as much.
    bound = TURNING * COULOMB_VELOCITY + SEEN * sqrt(float(covariance.max()))
    slow = np.abs(turning) < bound
    nodes = [_nodes(times[slice(*each)], slow[slice(*each)], spacing) for each in segments]
    most = max(each.size for each in nodes)
    if not most:
        return None
    places, roots = np.full((len(nodes), most), np.inf), np.zeros((len(nodes), most, most))
    for own, place, root in zip(nodes, places, roots, strict=True):
        bias = np.maximum(np.interp(own, times, change) ** 2 - BIASED**2 * changing, 0.0)
        longer = smoothing[1].span / smoothing[0].span - 1.0
        of_noise = np.interp(own[:, None] - own, lags, covariance)
        place[: own.size] = own
        root[: own.size, : own.size] = root_of(of_noise + np.diag(bias / longer**2))
    return BaseErrors(places, roots, spacing)


def _nodes(times: FloatArray, is_slow: npt.NDArray[np.bool_], spacing: float) -> FloatArray:
    """Return nodes around all samples at which friction may turn [s]."""
    slow = times[is_slow]
    nodes = np.arange(times[0], times[-1] + spacing, spacing)
    if not slow.size:
        return nodes[:0]
    after = np.clip(np.searchsorted(slow, nodes), 0, slow.size - 1)
    around = np.stack((slow[after], slow[np.maximum(after - 1, 0)]))
    near: FloatArray = nodes[np.abs(around - nodes).min(axis=0) <= spacing]
    return near


def _covariances(
    period: float, smoothing: Smoothing, longer: Smoothing
) -> tuple[FloatArray, FloatArray, float]:
    """Return lags [s], a velocity's autocovariance, and the variance of its change by a span."""
    half = round(longer.span / period) + NODES
    impulse = np.zeros((2 * half + 1, 1))
    impulse[half] = smoothing.noise
    times = np.linspace(0.0, 2 * half * period, impulse.size)
    own, other = (derivative(times, impulse, s.span, 1)[:, 0] for s in (smoothing, longer))
    lags = np.linspace(-times[-1], times[-1], 2 * own.size - 1)
    return lags, np.correlate(own, own, mode='full'), float(np.sum((other - own) ** 2))


def root_of(covariance: FloatArray) -> FloatArray:
    """Return a square root of a covariance that may be singular."""
    variances, directions = np.linalg.eigh(covariance)
    root: FloatArray = directions * np.sqrt(np.maximum(variances, 0.0))
    return root
