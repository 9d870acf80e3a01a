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
from flat_planner_ros.core.model_fit.base_errors import BaseErrors, Near
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
        Their smoothed velocities at the starts of the segments, shape (segments, 2) [rad/s].
    rate_spread
        Standard deviation of the velocity of joint n-1 [rad/s].
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
    before
        Samples of the recording before these.

    """

    times: FloatArray
    angles: FloatArray
    rates: FloatArray
    rate_spread: float
    effort: FloatArray
    base: FloatArray
    moves: npt.NDArray[np.bool_]
    rounding: FloatArray
    segments: Sequence[Segment]
    straightness: float = 0.0
    refinement: float = 1.0
    turning: SingleOrDouble | None = None
    base_errors: BaseErrors | None = None
    before: int = 0

    @property
    def unknowns(self) -> int:
        """Return how many unknowns a segment has of its own: its start, errors of the base."""
        return STATES + (0 if self.base_errors is None else self.base_errors.nodes.shape[1])


def first_starts(observed: Observed) -> FloatArray:
    """Return measured states at the starts of the segments, no error, (segments, unknowns)."""
    first = [segment.first for segment in observed.segments]
    measured = np.hstack((observed.angles[first], observed.rates))
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
    for chunk in _chunks(observed, samples, models):
        states = trajectories(models, starts, chunk.forcing)
        starts = states[-1]
        chunk.reading.fill(seen, states.transpose(0, 3, 2, 1))
    seen[:, 1] += models[:, OFFSET]
    return samples.split(seen)


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
    errors = None if own == STATES or not observed.base_errors else observed.base_errors.of(block)
    starts = np.broadcast_to(unknowns[:, :STATES].T, (len(models), STATES, len(unknowns)))
    begun = [np.eye(STATES, own)] * len(unknowns)
    off = None if errors is None else (errors.roots @ unknowns[:, STATES:, None])[..., 0]
    for chunk in _chunks(observed, samples, models):
        forcing, near = chunk.forcing, None
        if errors is not None and off is not None:
            near = errors.near(chunk.grid)
            forcing = forcing._replace(base=forcing.base + near.between(off)[:, None, :])
        motion = motions(models, starts, forcing)
        by_step = step_slopes(models[:1], motion[:, 0], forcing.step)
        carried = carried_on(by_step, None if near is None else near.shares)
        # A copy: what led to it need not stay.
        starts = motion[-1, :, :STATES].copy()
        chunk.reading.fill(seen, motion.transpose(0, 3, 2, 1)[:, :, :STATES])
        begun = chunk.reading.fill_from(slopes, carried, begun, near)
        del motion, by_step, carried
    seen[:, 1] += models[:, OFFSET]
    each = samples.split(slopes)
    if errors is not None:
        for by_own, root in zip(each, errors.roots, strict=True):
            by_own[..., STATES:] = by_own[..., STATES:] @ root
    return list(zip(samples.split(seen), each, strict=True))


class _Reading(NamedTuple):
    """
    Where samples lie between the states of a chunk.

    Attributes
    ----------
    inside
        Which samples do, segment by segment, shape (m,).
    segment, node, share
        Their segment, the state before them, and where they are in the step behind it, (m,).
    step
        Between the states [s].

    """

    inside: npt.NDArray[np.intp]
    segment: npt.NDArray[np.intp]
    node: npt.NDArray[np.intp]
    share: FloatArray
    step: float

    def between(self, states: FloatArray) -> FloatArray:
        """Return both angles between states (K + 1, segments, 4, c), shape (m, 2, c)."""
        here, there = states[self.node, self.segment], states[self.node + 1, self.segment]
        ends = here[:, :2], there[:, :2], here[:, 2:], there[:, 2:]
        return hermite(self.share[:, None, None], np.array(self.step), *ends)

    def fill(self, seen: FloatArray, states: FloatArray) -> None:
        """Fill in both angles, shape (samples, 2, c)."""
        seen[self.inside] = self.between(states)

    def fill_from(
        self, slopes: FloatArray, carried: FloatArray, begun: list[FloatArray], near: Near | None
    ) -> list[FloatArray]:
        """Fill in derivatives by all unknowns; return those of the last state of each segment."""
        local, ends = self.between(carried), np.searchsorted(self.segment, range(len(begun) + 1))
        last = []
        for number, (before, own) in enumerate(zip(begun, carried[-1], strict=True)):
            place = slice(*ends[number : number + 2])
            if near is None:
                slopes[self.inside[place]] = local[place] @ before
                last.append(own @ before)
            else:
                slopes[self.inside[place]] = near.added(local[place], before, number)
                last.append(near.added(own, before, number))
        return last


class _Chunk(NamedTuple):
    """Some steps, half of them on a grid (2 K + 1, segments) [s], what moves, and samples."""

    grid: FloatArray
    forcing: Forcing
    reading: _Reading


class _Samples(NamedTuple):
    """When each segment begins (segments,) [s], the segment of each sample, time since then."""

    begins: FloatArray
    segment: npt.NDArray[np.intp]
    elapsed: FloatArray

    @classmethod
    def of(cls, observed: Observed, block: slice) -> '_Samples':
        """Return those of a block of segments."""
        t, segments = observed.times, observed.segments[block]
        begins = t[[segment.first for segment in segments]]
        pairs = zip(segments, begins, strict=True)
        elapsed = np.concatenate([t[s.first : s.last] - begin for s, begin in pairs])
        sizes = [s.last - s.first for s in segments]
        return cls(begins, np.repeat(np.arange(len(sizes)), sizes), elapsed)

    def empty(self, count: int) -> FloatArray:
        """Return room for so many numbers at each sample of both channels, (m, 2, count)."""
        return np.empty((self.elapsed.size, CHANNELS, count))

    def split(self, seen: FloatArray) -> list[FloatArray]:
        """Return the parts of all segments."""
        return np.split(seen, np.searchsorted(self.segment, range(1, self.begins.size)))


def _chunks(observed: Observed, samples: _Samples, models: FloatArray) -> Iterator[_Chunk]:
    """Yield the steps of a block of segments, so many at a time."""
    step = step_for(models[0], bool(models[:, COULOMB].any())) / observed.refinement
    at = samples.elapsed / step
    steps = int(np.ceil(at.max())) + 1
    for first in range(0, steps, CHUNK):
        last = min(first + CHUNK, steps)
        grid = samples.begins + np.arange(2 * first, 2 * last + 1)[:, None] * step / 2
        inside = np.flatnonzero((at >= first) & (at < last))
        node = at[inside].astype(int)
        reading = _Reading(inside, samples.segment[inside], node - first, at[inside] - node, step)
        yield _Chunk(grid, _forcing(observed, models, grid, step), reading)


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
