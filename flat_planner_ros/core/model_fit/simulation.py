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
from typing import NamedTuple, TypeAlias

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.model_fit.base_errors import BaseErrors
from flat_planner_ros.core.model_fit.last_links import (
    COULOMB,
    DELAY,
    Forcing,
    IMBALANCE,
    motions,
    OFFSET,
    STATES,
    step_for,
    trajectories,
)
from flat_planner_ros.core.model_fit.sensitivity import carried_on, step_slopes
from flat_planner_ros.core.model_fit.signals import between, hermite, interpolated, Segment
import numpy as np
import numpy.typing as npt

BLOCK = 20
"""Segments that are simulated side by side: a minute of motion."""

CHUNK = 128
"""Steps whose states are held at a time: memory does not grow with the recording."""

SHORTEST_CHUNK, MOST_SLOPES = 32, 80_000
"""Steps that are worth their overhead, and derivatives of states that are held at a time [-]."""

CHANNELS = 2
"""Angle of link n-1 and of the passive joint."""


SingleOrDouble: TypeAlias = npt.NDArray[np.float32] | FloatArray
"""Array of floats in single precision, for half the memory, or in double."""


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
        Their smoothed velocities, shape (m, 2) [rad/s], for the first guess of the starts: single
        precision does.
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
        [rad/s^2]; None where none is looked for. Single precision does: it is off by 1e-7 of a
        coupling that is small itself.
    base_errors
        What `base` may be off where friction turns; None for nothing.

    """

    times: FloatArray
    angles: FloatArray
    rates: SingleOrDouble
    effort: FloatArray
    base: FloatArray
    moves: npt.NDArray[np.bool_]
    rounding: FloatArray
    segments: Sequence[Segment]
    straightness: float = 0.0
    refinement: float = 1.0
    turning: SingleOrDouble | None = None
    base_errors: BaseErrors | None = None

    @property
    def unknowns(self) -> int:
        """Return how many unknowns a segment has of its own: its start, errors of the base."""
        return STATES + (0 if self.base_errors is None else self.base_errors.nodes.shape[1])


def first_starts(observed: Observed) -> FloatArray:
    """Return measured states at the starts of the segments, no error, (segments, unknowns)."""
    first = [segment.first for segment in observed.segments]
    measured = np.hstack((observed.angles[first], observed.rates[first].astype(float)))
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
    observed: Observed, block: slice, models: FloatArray, starts: FloatArray
) -> list[FloatArray]:
    """
    Return for each segment what the sensors would show of every model, (m, 2, models) [rad].

    Parameters
    ----------
    observed
        What was measured; the velocity of its base counts as true.
    block
        The segments to simulate.
    models
        Parameters in the order of `last_links.NAMES`, shape (models, 8).
    starts
        Shape (models, 4, segments).

    """
    samples = _Samples.of(observed, block)
    seen = samples.empty(len(models))
    for chunk in _chunks(observed, samples, models, CHUNK):
        states = trajectories(models, starts, chunk.forcing)
        starts = states[-1]
        samples.read(seen, chunk, states.transpose(3, 0, 2, 1))
    for angles in seen:
        angles[:, 1] += models[:, OFFSET]
    return seen


def seen_with_slopes(
    observed: Observed, block: slice, models: FloatArray, unknowns: FloatArray
) -> list[tuple[FloatArray, FloatArray]]:
    """
    Return the same, from one start, and the derivatives of the first model's by the unknowns.

    Parameters
    ----------
    observed, block, models
        As for `seen_of`.
    unknowns
        Start of each segment, and what the base is off, shape (segments, 4 or
        `observed.unknowns`).

    Returns
    -------
    list[tuple[FloatArray, FloatArray]]
        Of each segment, shapes (m, 2, models) and (m, 2, unknowns).

    """
    samples = _Samples.of(observed, block)
    own = unknowns.shape[1]
    seen, slopes = samples.empty(len(models)), samples.empty(own)
    errors = None if observed.base_errors is None else observed.base_errors.of(block)
    starts = np.broadcast_to(unknowns[:, :STATES].T, (len(models), STATES, len(unknowns)))
    begun = np.broadcast_to(np.eye(STATES, own), (len(unknowns), STATES, own))
    length = min(CHUNK, max(SHORTEST_CHUNK, MOST_SLOPES // (own * len(unknowns))))
    for chunk in _chunks(observed, samples, models, length):
        motion, by_unknown = _carried_on(chunk, errors, models, unknowns, starts, begun)
        # Copies: what led to them need not stay.
        starts, begun = motion[-1].copy(), by_unknown[-1].copy()
        samples.read(seen, chunk, motion.transpose(3, 0, 2, 1))
        samples.read(slopes, chunk, by_unknown.swapaxes(0, 1))
        del motion, by_unknown
    for angles in seen:
        angles[:, 1] += models[:, OFFSET]
    return list(zip(seen, slopes, strict=True))


def _carried_on(
    chunk: '_Chunk',
    errors: BaseErrors | None,
    models: FloatArray,
    unknowns: FloatArray,
    starts: FloatArray,
    begun: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the states of a chunk and their derivatives by the unknowns, from its first ones."""
    forcing, by_base = chunk.forcing, None
    if errors is not None and unknowns.shape[1] > STATES:
        off = errors.at(chunk.grid, unknowns.T[None, STATES:])
        forcing = forcing._replace(base=forcing.base + off)
        by_base = errors.slopes(chunk.grid)
    motion = motions(models, starts, forcing)
    by_step = step_slopes(models[:1], motion[:, 0], forcing.step)
    return motion[:, :, :STATES], carried_on(by_step, begun, by_base)


class _Chunk(NamedTuple):
    """Steps first ... last-1, half of them on a grid (2 K + 1, segments) [s], and what moves."""

    first: int
    last: int
    grid: FloatArray
    forcing: Forcing


class _Samples(NamedTuple):
    """When each segment of a block begins (segments,) [s], and its samples since then (m,) [s]."""

    begins: FloatArray
    elapsed: list[FloatArray]

    @classmethod
    def of(cls, observed: Observed, block: slice) -> '_Samples':
        """Return those of a block of segments."""
        t, segments = observed.times, observed.segments[block]
        begins = t[[segment.first for segment in segments]]
        pairs = zip(segments, begins, strict=True)
        return cls(begins, [t[s.first : s.last] - begin for s, begin in pairs])

    def empty(self, count: int) -> list[FloatArray]:
        """Return room for so many numbers at each sample of both channels, (m, 2, count)."""
        return [np.empty((each.size, CHANNELS, count)) for each in self.elapsed]

    def read(self, seen: list[FloatArray], chunk: _Chunk, states: FloatArray) -> None:
        """Fill in both angles of the samples in a chunk, from states (segments, K + 1, 4, ...)."""
        step = chunk.forcing.step
        for angles, each, own in zip(seen, self.elapsed, states, strict=True):
            inside = slice(*np.searchsorted(each / step, (chunk.first, chunk.last)))
            angles[inside] = _between_states(own, each[inside] / step - chunk.first, step)


def _chunks(
    observed: Observed, samples: _Samples, models: FloatArray, length: int
) -> Iterator[_Chunk]:
    """Yield the steps of a block of segments, so many at a time."""
    longest = max(float(each[-1]) for each in samples.elapsed)
    step = step_for(models[0], bool(models[:, COULOMB].any())) / observed.refinement
    steps = int(np.ceil(longest / step)) + 1
    for first in range(0, steps, length):
        last = min(first + length, steps)
        grid = samples.begins + np.arange(2 * first, 2 * last + 1)[:, None] * step / 2
        yield _Chunk(first, last, grid, _forcing(observed, models, grid, step))


def _between_states(states: FloatArray, at: FloatArray, step: float) -> FloatArray:
    """Return both angles between states (K + 1, 4, ...) at times [steps], shape (m, 2, ...)."""
    node = at.astype(int)
    share = (at - node)[:, None, None]
    here, there = states[node], states[node + 1]
    ends = here[:, :2], there[:, :2], here[:, 2:], there[:, 2:]
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
