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

from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from math import sqrt
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.model_fit.judgement import correlation_lengths, covariance
from flat_planner_ros.core.model_fit.last_links import NAMES
from flat_planner_ros.core.model_fit.refinement import Linearisation, linearised, Refined
from flat_planner_ros.core.model_fit.simulation import CHANNELS, Observed, SingleOrDouble
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
    residuals
        Weighted change of the residuals, the starts eliminated, shape (m, 2) [-].
    gradient, normal
        Of a sum of squares, change (2, free) and there (2, free, free), as in `Linearisation`.

    """

    residuals: SingleOrDouble
    gradient: FloatArray
    normal: FloatArray

    @property
    def power(self) -> FloatArray:
        """Return the sum of squares of the residuals' change, shape (2,) [-]."""
        power: FloatArray = (self.residuals**2).sum(axis=0, dtype=float)
        return power

    def besides(self, other: 'Change') -> 'Change':
        """Return the change without what is like another one (least squares)."""
        power = float(other.power.sum())
        both = float((self.residuals * other.residuals).sum(dtype=float))
        share = both / power if power > 0.0 else 0.0
        return Change(
            self.residuals - share * other.residuals,
            self.gradient - share * other.gradient,
            self.normal,
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
        return left / len(self.residuals)


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


def change_between(here: Linearisation, there: Linearisation, spread: FloatArray) -> Change:
    """Return what another way to see the recording changes; `spread` is that of both."""
    pairs = zip(there.residuals, here.residuals, strict=True)
    residuals = np.concatenate([((new - old) / spread).astype(np.float32) for new, old in pairs])
    return Change(residuals, there.gradient - here.gradient, there.normal)


def straighter(observed: Observed) -> Observed:
    """Return a recording whose efforts go straighter from sample to sample, by 1."""
    return replace(observed, straightness=observed.straightness + 1.0)


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
    point = found.parameters, found.starts, free, scales, found.spread
    there = linearised(straighter(observed), *point)
    change = change_between(found.around, there, found.spread)
    step = change.step(scales[free])
    alike = max(correlation_lengths(found.around))
    told = float(change.left(step).sum()) * len(change.residuals) / alike
    left = np.concatenate(found.around.residuals)
    along = (left * change.residuals).sum(axis=0, dtype=float) / found.spread
    slope = float(along.sum() + found.around.gradient.sum(axis=0) @ step) / alike
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
    # By `map` no change outlives its numbers: a recording may be long.
    for step, remains in map(partial(_answered, scales=own), doubts):
        inside += np.outer(step, step)
        left += found.spread**2 * remains
    whole = np.zeros((len(NAMES), len(NAMES)))
    whole[np.ix_(free, free)] = inside
    return whole, np.sqrt(left)


def _answered(doubt: Doubt, scales: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a doubt's error of the parameters, and the mean square that it leaves (2,) [-]."""
    step = doubt.change.step(scales)
    return doubt.weight * step, (doubt.cover * doubt.weight) ** 2 * doubt.change.left(step)
