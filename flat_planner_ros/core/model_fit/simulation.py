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
The last two links as measured, and what the sensors would show of a model.

Pieces of a recording are simulated side by side, and a bounded number of steps at a time: memory
grows with neither.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.model_fit.base_errors import BaseErrors
from flat_planner_ros.core.model_fit.last_links import (
    COULOMB,
    DELAY,
    Forcing,
    IMBALANCE,
    OFFSET,
    STATES,
    step_for,
    trajectories,
)
from flat_planner_ros.core.model_fit.signals import between, hermite, interpolated, Segment
import numpy as np
import numpy.typing as npt

BLOCK = 20
"""Segments that are simulated side by side: a minute of motion."""

CHUNK = 256
"""Steps whose states are held at a time: memory does not grow with the recording."""

CHANNELS = 2
"""Angle of link n-1 and of the passive joint."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Observed:
    """
    The last two links as measured.

    Attributes
    ----------
    times
        Shape (m,) [s].
    angles
        Of link n-1 and of the passive joint, shape (m, 2) [rad].
    rates
        Their smoothed velocities, shape (m, 2) [rad/s], for the first guess of the starts.
    effort
        Of joint n-1, shape (m,) [N m].
    base
        Smoothed angular velocity of link n-2, shape (m,) [rad/s].
    moves
        Whether either angle has left the place where its encoder stood, shape (m, 2).
    rounding
        Standard deviation of the encoders' rounding in either angle, shape (2,) [rad].
    segments
        Pieces to simulate.
    straightness
        How far efforts go straight from sample to sample: 0 on cubics, 1 on lines, or between [-].
    refinement
        By which the steps of the integration are divided [-].
    turning
        What a coupling of both links takes from either for each unit, as measured, shape (m, 2)
        [rad/s^2]; None where none is looked for.
    base_errors
        What `base` may be off where friction turns; None for nothing.

    """

    times: FloatArray
    angles: FloatArray
    rates: FloatArray
    effort: FloatArray
    base: FloatArray
    moves: npt.NDArray[np.bool_]
    rounding: FloatArray
    segments: Sequence[Segment]
    straightness: float = 0.0
    refinement: float = 1.0
    turning: FloatArray | None = None
    base_errors: BaseErrors | None = None

    @property
    def unknowns(self) -> int:
        """Return how many unknowns a segment has of its own: its start, errors of the base."""
        return STATES + (0 if self.base_errors is None else self.base_errors.nodes.shape[1])


def first_starts(observed: Observed) -> FloatArray:
    """Return measured states at the starts of the segments, no error, (segments, unknowns)."""
    first = [segment.first for segment in observed.segments]
    measured = np.hstack((observed.angles[first], observed.rates[first]))
    return with_unknowns(observed, measured)


def with_unknowns(observed: Observed, starts: FloatArray) -> FloatArray:
    """Return starts (segments, 4 or more) with no error of the base, (segments, unknowns)."""
    found = np.zeros((len(starts), observed.unknowns))
    found[:, :STATES] = starts[:, :STATES]
    return found


def blocks(observed: Observed) -> Iterator[slice]:
    """Yield the segments that are simulated side by side."""
    for first in range(0, len(observed.segments), BLOCK):
        yield slice(first, first + BLOCK)


def seen_of(
    observed: Observed, block: slice, models: FloatArray, unknowns: FloatArray
) -> list[FloatArray]:
    """
    Return for each segment what the sensors would show of every model, (m, models, 2) [rad].

    Parameters
    ----------
    observed
        What was measured.
    block
        The segments to simulate.
    models
        Parameters in the order of `last_links.NAMES`, shape (models, 8).
    unknowns
        Starts, and what the base is off, shape (models, 4 or `observed.unknowns`, segments).

    """
    t, segments = observed.times, observed.segments[block]
    begins = t[[segment.first for segment in segments]]
    longest = max(float(t[s.last - 1] - t[s.first]) for s in segments)
    step = step_for(models[0], bool(models[:, COULOMB].any())) / observed.refinement
    steps = int(np.ceil(longest / step)) + 1
    elapsed = [t[s.first : s.last] - begin for s, begin in zip(segments, begins, strict=True)]
    seen = [np.empty((each.size, len(models), CHANNELS)) for each in elapsed]
    starts = unknowns[:, :STATES]
    for first in range(0, steps, CHUNK):
        last = min(first + CHUNK, steps)
        grid = begins + np.arange(2 * first, 2 * last + 1)[:, None] * step / 2
        forcing = _forcing(observed, models, grid, step)
        if observed.base_errors is not None and unknowns.shape[1] > STATES:
            errors = observed.base_errors.of(block).at(grid, unknowns[:, STATES:])
            forcing = forcing._replace(base=forcing.base + errors)
        states = trajectories(models, starts, forcing)
        starts = states[-1]
        for number, angles in enumerate(seen):
            inside = slice(*np.searchsorted(elapsed[number] / step, (first, last)))
            share = elapsed[number][inside] / step - first
            angles[inside] = _between_states(states[..., number], share, step)
    for angles in seen:
        angles[..., 1] += models[:, OFFSET]
    return seen


def _between_states(states: FloatArray, at: FloatArray, step: float) -> FloatArray:
    """Return both angles between states (K + 1, models, 4) at times [steps], (m, models, 2)."""
    node = at.astype(int)
    share = (at - node)[:, None, None]
    here, there = states[node], states[node + 1]
    ends = here[..., :2], there[..., :2], here[..., 2:], there[..., 2:]
    return hermite(share, np.array(step), *ends)


def _forcing(observed: Observed, models: FloatArray, grid: FloatArray, step: float) -> Forcing:
    """Return what moves the models; efforts come later by the delay."""
    delays, variant = np.unique(models[:, DELAY], return_inverse=True)
    shifted = grid[:, None, :] - delays[:, None]
    effort = interpolated(observed.times, observed.effort, shifted, observed.straightness)
    base = between(observed.times, observed.base, grid) if observed.base.any() else 0.0 * grid
    turning = None
    if observed.turning is not None and models.shape[1] > IMBALANCE:
        each = [between(observed.times, column, grid) for column in observed.turning.T]
        turning = np.stack(each, axis=1)
    return Forcing(step, effort, variant, base[:, None, :], turning)
