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
Where the segments of a recording start.

Friction stops a link within milliseconds, and then nothing shows how fast it was: a start whose
rate is taken from noisy angles can be so wrong that no small step mends it. So a start is looked
for from several places, for one model.
"""

from collections.abc import Sequence
from dataclasses import replace

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.model_fit.last_links import STATES
from flat_planner_ros.core.model_fit.simulation import (
    blocks,
    first_starts,
    Observed,
    seen_with_slopes,
)
import numpy as np

REST = 5
"""Samples whose mean is where a link may rest [-]."""

ROUNDS = 8
"""Most simulations from each place."""

LITTLE = 1e-3
"""Gain of a round, relative to what is left, with which it is the last one [-]."""

TIGHTER, LOOSER, FIRST = 10.0, 0.1, 1e-3
"""Factors of Marquardt's parameter after a bad and a good step, and its first value after one."""

TINY = 1e-9
"""Added to normal equations of states that nothing shows, relative to the largest [-]."""


@np.errstate(over='ignore', invalid='ignore')
def settled(
    observed: Observed, model: FloatArray, spread: FloatArray, *known: FloatArray
) -> FloatArray:
    """
    Return the starts from which a model comes nearest to what was measured, (segments, 4).

    Where it runs away from a start, that is not one of them.

    Parameters
    ----------
    observed
        What was measured.
    model
        Parameters in the order of `last_links.NAMES`.
    spread
        By which the misfits of either channel are divided, shape (2,) [rad].
    known
        Starts to try besides those measured, shape (segments, 4) each.

    """
    begin = np.stack((*places(observed), *known), axis=1)
    found = [_settled(observed, block, model, spread, begin[block]) for block in blocks(observed)]
    return np.concatenate(found)


def places(observed: Observed) -> Sequence[FloatArray]:
    """Return states as measured, and with joint n-1 at rest, shape (segments, 4) each."""
    moving = first_starts(observed)
    resting = moving.copy()
    firsts = [segment.first for segment in observed.segments]
    resting[:, :2] = [observed.angles[first : first + REST].mean(axis=0) for first in firsts]
    resting[:, 2] = observed.base[firsts]
    return moving, resting


def _settled(
    observed: Observed,
    block: slice,
    model: FloatArray,
    spread: FloatArray,
    begin: FloatArray,
) -> FloatArray:
    """Return the best starts of some segments from several places (segments, places, 4)."""
    best, trial = begin.copy(), begin.copy()
    costs, damping = np.full(best.shape[:2], np.inf), np.zeros(best.shape[:2])
    normal, gradient = np.empty((*best.shape, STATES)), np.empty_like(best)
    for _ in range(ROUNDS):
        cost, slopes, gradients = _around(observed, block, model, spread, trial)
        is_better = cost < costs
        damping = np.where(is_better, LOOSER * damping, np.maximum(TIGHTER * damping, FIRST))
        gain = np.where(is_better, (costs - cost) / cost, 0.0)
        for old, new in ((best, trial), (normal, slopes), (gradient, gradients), (costs, cost)):
            old[is_better] = new[is_better]
        if gain.max() < LITTLE:
            break
        own = np.diagonal(normal, axis1=-2, axis2=-1)
        ridge = damping[..., None] * own + TINY * own.max(axis=-1, keepdims=True)
        whole = normal + ridge[..., None] * np.eye(STATES)
        trial = best - np.linalg.solve(whole, gradient[..., None])[..., 0]
    found: FloatArray = best[np.arange(len(best)), costs.argmin(axis=1)]
    return found


def _around(
    observed: Observed,
    block: slice,
    model: FloatArray,
    spread: FloatArray,
    starts: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return sums of squares (segments, places), and normal equations of the starts."""
    count = starts.shape[1]
    segments = [segment for segment in observed.segments[block] for _ in range(count)]
    beside = replace(observed, segments=segments, base_errors=None)
    shown = seen_with_slopes(beside, slice(None), model[None], starts.reshape(-1, STATES))
    costs, slopes, gradients = [], [], []
    for segment, each in zip(segments, shown, strict=True):
        measured = observed.angles[segment.first : segment.last]
        misfit = ((each.angles - measured) / spread).ravel()
        columns = (each.by_start / spread[:, None]).reshape(-1, STATES)
        costs.append(misfit @ misfit)
        slopes.append(columns.T @ columns)
        gradients.append(columns.T @ misfit)
    normal = np.reshape(slopes, (*starts.shape, STATES))
    return np.reshape(costs, starts.shape[:2]), normal, np.reshape(gradients, starts.shape)
