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

"""What comes of seeing a recording in another way, and which way between two explains it best."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from math import sqrt
from typing import NamedTuple, TypeAlias

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.model_fit.judgement import correlation_lengths, covariance
from flat_planner_ros.core.model_fit.last_links import DELAY, NAMES
from flat_planner_ros.core.model_fit.parts import part_of
from flat_planner_ros.core.model_fit.refinement import left_in, Linearisation, linearised, Refined
from flat_planner_ros.core.model_fit.simulation import blocks, CHANNELS, Observed
import numpy as np

MIDDLE, SPREAD = 0.5, 12.0**-0.5
"""Mean and standard deviation of the straightness of efforts before a fit: even over [0, 1]."""

SECOND_ORDER, THIRD_ORDER = 4.0, 8.0
"""Growth with twice the spacing: of an effort with corners, and of a smooth one on cubics [-]."""

TINY = 1e-12
"""Added to the normal equations, in units of the scales [-]."""


class Change(NamedTuple):
    """
    What another way to see a recording changes around a fit.

    Attributes
    ----------
    shares
        Of the ways that were tried, shape (ways,) [-].
    products
        Sums of products of what each of them changes in the weighted residuals, the starts
        eliminated, and, of the first, of the residuals themselves, shape (2, ways, ways) [-].
    samples
        Of the recording.
    gradient, normal
        Of a sum of squares, change (2, free) and there (2, free, free), as in `Linearisation`.

    """

    shares: FloatArray
    products: FloatArray
    samples: int
    gradient: FloatArray
    normal: FloatArray

    @property
    def power(self) -> FloatArray:
        """Return the sum of squares of the residuals' change, shape (2,) [-]."""
        return self.along(self)

    @property
    def on_residuals(self) -> FloatArray:
        """Return the sums of products of the residuals and their change, shape (2,) [-]."""
        return self.products[:, 0] @ self.shares

    def along(self, other: 'Change') -> FloatArray:
        """Return the sums of products of two changes, shape (2,) [-]."""
        return self.products @ other.shares @ self.shares

    def besides(self, other: 'Change') -> 'Change':
        """Return the change without what is like another one (least squares)."""
        power, both = float(other.power.sum()), float(self.along(other).sum())
        return self.since(other, both / power if power > 0.0 else 0.0)

    def since(self, other: 'Change', share: float = 1.0) -> 'Change':
        """Return the change without a share of another one."""
        return self._replace(
            shares=self.shares - share * other.shares,
            gradient=self.gradient - share * other.gradient,
        )

    def growth_from(self, finer: 'Change') -> float:
        """Return how much larger it is than one of half the spacing, within what can be [-]."""
        power = float(finer.power.sum())
        growth = sqrt(float(self.power.sum()) / power) if power > 0.0 else 0.0
        return min(max(growth, SECOND_ORDER), THIRD_ORDER)

    def step(self, scales: FloatArray) -> FloatArray:
        """Return the change of the free parameters that answers it; `scales` are theirs."""
        normal = self.normal.sum(axis=0) * np.outer(scales, scales)
        normal += TINY * np.eye(scales.size)
        gradient = scales * self.gradient.sum(axis=0)
        found: FloatArray = -scales * np.linalg.solve(normal, gradient)
        return found

    def left(self, step: FloatArray) -> FloatArray:
        """Return the mean square change of the residuals that a step leaves, shape (2,) [-]."""
        by_step = 2.0 * self.gradient @ step + step @ self.normal @ step
        left: FloatArray = np.maximum(self.power + by_step, 0.0)
        return left / self.samples


class Doubt(NamedTuple):
    """
    A change that may be right.

    Attributes
    ----------
    weight
        Its share that counts as a standard deviation [-].
    change
        What it makes.
    cover
        Factor on what it may leave in the residuals [-].

    """

    weight: float
    change: Change
    cover: float = 1.0


View: TypeAlias = Callable[[Observed], Observed]
"""Makes of a recording, or a part of it, what else it may have been."""


class Way(NamedTuple):
    """How to see a recording, or a part of it; the fit's linearisation if that is there."""

    see: View
    around: Linearisation | None = None


def changes_by(
    ways: Sequence[Way], observed: Observed, found: Refined, free: list[int], scales: FloatArray
) -> list[Change]:
    """
    Return what ways to see a recording change from the first of them, which comes without.

    Parameters
    ----------
    ways
        Two or more.
    observed, found
        A recording, and a fit to it.
    free, scales
        Parameters of the fit, and the scales of all.

    """
    around = [_Around.of(way, len(free)) for way in ways]
    products, samples = np.zeros((CHANNELS, len(ways), len(ways))), 0
    # Of a long recording the residuals are held for one block at a time.
    for block in blocks(observed):
        part = part_of(observed, block, float(found.parameters[DELAY]))
        first, *others = [each.left_in(part, block, found, free, scales) for each in around]
        rows = np.stack([first, *(other - first for other in others)], axis=-1)
        rows /= found.spread[:, None]
        products += rows.transpose(1, 2, 0) @ rows.transpose(1, 0, 2)
        samples += len(first)
    shares = np.eye(len(ways))[1:]
    return [
        Change(share, products, samples, there.gradient - around[0].gradient, there.normal)
        for share, there in zip(shares, around[1:], strict=True)
    ]


class _Around(NamedTuple):
    """A way, and its gradient (2, free) and normal equations (2, free, free), part by part."""

    way: Way
    gradient: FloatArray
    normal: FloatArray

    @classmethod
    def of(cls, way: Way, free: int) -> '_Around':
        """Return those that are known, or none as yet."""
        if way.around is not None:
            return cls(way, way.around.gradient, way.around.normal)
        return cls(way, np.zeros((CHANNELS, free)), np.zeros((CHANNELS, free, free)))

    def left_in(
        self, part: Observed, block: slice, found: Refined, free: list[int], scales: FloatArray
    ) -> FloatArray:
        """Add up a block, and return what is left in it, (samples, 2) [rad]."""
        if self.way.around is not None:
            return np.concatenate(left_in(part, block, found), dtype=float)
        point = found.parameters, found.starts[block], free, scales, found.spread
        there = linearised(self.way.see(part), *point, keeps=True)
        self.gradient[...] += there.gradient
        self.normal[...] += there.normal
        return np.concatenate(there.residuals, dtype=float)


def straighter(observed: Observed) -> Observed:
    """Return a recording whose efforts go straighter from sample to sample, by 1."""
    return replace(observed, straightness=observed.straightness + 1.0)


def as_it_is(observed: Observed) -> Observed:
    """Return a recording as it is."""
    return observed


def straightness(
    observed: Observed, found: Refined, free: list[int], scales: FloatArray
) -> tuple[float, float]:
    """
    Return how straight efforts go from sample to sample, and the standard error of that.

    Parameters
    ----------
    observed, found
        A recording with some straightness, and a fit to it.
    free, scales
        Parameters of the fit, and the scales of all.

    Notes
    -----
    A parameter like the others, on which the motion depends linearly, with an even distribution
    over [0, 1] before: samples of a smooth effort lie on cubics, those of a command that goes
    straight from point to point on lines if each point is sampled, and between if some are.

    """
    ways = Way(as_it_is, found.around), Way(straighter)
    (change,) = changes_by(ways, observed, found, free, scales)
    step = change.step(scales[free])
    alike = max(correlation_lengths(found.around))
    told = float(change.left(step).sum()) * change.samples / alike
    along = change.on_residuals.sum() + found.around.gradient.sum(axis=0) @ step
    slope = float(along) / alike
    whole = told + SPREAD**-2
    pull = slope + (observed.straightness - MIDDLE) / SPREAD**2
    return observed.straightness - pull / whole, whole**-0.5


def errors_of(
    doubts: Iterable[Doubt], found: Refined, free: list[int], scales: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """
    Return the covariance (8, 8) of the parameters, of noise and of what is doubtful.

    Also what the doubts leave that no step of the parameters takes away, shape (2,) [rad].
    """
    own = scales[free]
    inside = covariance(found.around, own) * np.outer(own, own)
    left = np.zeros(CHANNELS)
    for doubt in doubts:
        step = doubt.change.step(own)
        inside += np.outer(doubt.weight * step, doubt.weight * step)
        left += (found.spread * doubt.cover * doubt.weight) ** 2 * doubt.change.left(step)
    whole = np.zeros((len(NAMES), len(NAMES)))
    whole[np.ix_(free, free)] = inside
    return whole, np.sqrt(left)
