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
from math import prod
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
    Steps,
)
from flat_planner_ros.core.model_fit.sensitivity import carried_on, step_slopes, StepLaw
from flat_planner_ros.core.model_fit.signals import between, Cubics, hermite, Segment
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


class Shown(NamedTuple):
    """
    What the sensors would show of a model in a segment, and its derivatives.

    Attributes
    ----------
    angles
        Shape (m, 2) [rad].
    by_start, by_errors
        By the state at its start and by the errors of the base at the nodes that the segment has,
        shapes (m, 2, 4) and (m, 2, nodes).
    by_model
        What models next to it change, to first order, shape (m, 2, models) [rad].

    """

    angles: FloatArray
    by_start: FloatArray
    by_errors: FloatArray
    by_model: FloatArray


def seen_with_slopes(
    observed: Observed, block: slice, models: FloatArray, unknowns: FloatArray
) -> Iterator[Shown]:
    """
    Yield for each segment what the sensors would show of the first model, and its derivatives.

    Parameters
    ----------
    observed
        What was measured.
    block
        The segments to simulate.
    models
        Parameters in the order of `last_links.NAMES` of the one that is simulated, and of any next
        to it, shape (1 + models, 8).
    unknowns
        Start of each segment, and what the base is off, shape (segments, `observed.unknowns`).

    """
    samples, own = _Samples.of(observed, block), observed.base_errors
    errors = BaseErrors.none(len(unknowns)) if own is None else own.of(block)
    has_friction = bool(models[:, COULOMB].any())
    step = step_for(models[0], has_friction) / observed.refinement
    every = Steps.of(models, step, has_friction=has_friction)
    law, first = StepLaw.of(every), every.of_first()
    by_errors = STATES + len(law.changes)
    seen = samples.empty(1)
    slopes = samples.empty(by_errors + errors.nodes.shape[1])
    starts = unknowns[:, :STATES].T[None]
    begun = [np.eye(STATES, by_errors + count) for count in errors.counts]
    off = (errors.roots @ unknowns[:, STATES:, None])[..., 0]
    for chunk in _chunks(observed, samples, models, step):
        near = errors.near(chunk.grid)
        base = chunk.forcing.base + near.between(off)[:, None, :]
        forcing = chunk.forcing._replace(base=base)
        motion = motions(first, starts, forcing._replace(variant=forcing.variant[:1]))
        by_step = step_slopes(law, motion[:, 0], forcing)
        carried = carried_on(by_step, near.shares)
        # A copy: what led to it need not stay.
        starts = motion[-1, :, :STATES].copy()
        chunk.reading.fill(seen, motion.transpose(0, 3, 2, 1)[:, :, :STATES])
        begun = chunk.reading.fill_from(slopes, carried, begun, near)
        del motion, by_step, carried
    seen[:, 1] += models[0, OFFSET]
    slopes[:, 1, STATES:by_errors] += models[1:, OFFSET] - models[0, OFFSET]
    shown = samples.split(seen), samples.split(slopes)
    for angles, by, root, count in zip(*shown, errors.roots, errors.counts, strict=True):
        yield Shown(
            angles=angles[..., 0],
            by_start=by[..., :STATES],
            by_errors=_product(by[..., by_errors : by_errors + count], root[:count, :count]),
            by_model=by[..., STATES:by_errors],
        )


def _product(rows: FloatArray, matrix: FloatArray) -> FloatArray:
    """Return rows (..., a) times a matrix (a, b), as one product."""
    *outer, inner = rows.shape
    found: FloatArray = rows.reshape(prod(outer), inner) @ matrix
    return found.reshape(*outer, matrix.shape[1])


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
        self, slopes: FloatArray, carried: FloatArray, begun: list[FloatArray], near: Near
    ) -> list[FloatArray]:
        """Fill in derivatives by all that acts; return those of the last state of each segment."""
        local, ends = self.between(carried), np.searchsorted(self.segment, range(len(begun) + 1))
        last = []
        for number, (before, own) in enumerate(zip(begun, carried[-1], strict=True)):
            place = slice(*ends[number : number + 2])
            columns = slice(before.shape[1])
            slopes[self.inside[place], :, columns] = _joined(local[place], before, number, near)
            last.append(_joined(own, before, number, near))
        return last


def _joined(carried: FloatArray, begun: FloatArray, segment: int, near: Near) -> FloatArray:
    """Return derivatives by all, of those by a state and by what acts since, and of that state."""
    found = _product(carried[..., :STATES], begun)
    since = carried.shape[-1] - near.shares.shape[-1]
    found[..., STATES:since] += carried[..., STATES:since]
    near.add(found[..., since:], carried[..., since:], segment)
    return found


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


def _chunks(
    observed: Observed, samples: _Samples, models: FloatArray, step: float
) -> Iterator[_Chunk]:
    """Yield the steps of a block of segments, so many at a time."""
    at = samples.elapsed / step
    steps = int(np.ceil(at.max())) + 1
    ends = float(samples.begins.min()), float(samples.begins.max()) + steps * step
    inputs = _Inputs.of(observed, models, *ends)
    for first in range(0, steps, CHUNK):
        last = min(first + CHUNK, steps)
        grid = samples.begins + np.arange(2 * first, 2 * last + 1)[:, None] * step / 2
        inside = np.flatnonzero((at >= first) & (at < last))
        node = at[inside].astype(int)
        reading = _Reading(inside, samples.segment[inside], node - first, at[inside] - node, step)
        yield _Chunk(grid, inputs.at(grid), reading)


class _Inputs(NamedTuple):
    """
    What moves models in a block of segments.

    Attributes
    ----------
    effort, base, turning
        Samples as of `Observed`, with their slopes; None and nothing for what is zero throughout.
    straightness
        Of the effort [-].
    delays, variant
        All different delays [s], and which of them each model has.

    """

    effort: Cubics
    base: Cubics | None
    turning: Sequence[Cubics]
    straightness: float
    delays: FloatArray
    variant: npt.NDArray[np.intp]

    @classmethod
    def of(cls, observed: Observed, models: FloatArray, begin: float, end: float) -> '_Inputs':
        """Return what moves models from one time to another [s]; efforts come by a delay later."""
        delays, variant = np.unique(models[:, DELAY], return_inverse=True)
        shifted = begin - float(delays[-1]), end - float(delays[0])
        times = observed.times
        turning = observed.turning if models.shape[1] > IMBALANCE else None
        return cls(
            effort=Cubics.of(times, observed.effort, *shifted),
            base=Cubics.of(times, observed.base, begin, end) if observed.base.any() else None,
            turning=[]
            if turning is None
            else [Cubics.of(times, column, begin, end) for column in turning.T],
            straightness=observed.straightness,
            delays=delays,
            variant=variant,
        )

    def at(self, grid: FloatArray) -> Forcing:
        """Return what moves them at times, shape (g, segments) [s]."""
        shifted = grid[:, None, :] - self.delays[:, None]
        base = 0.0 * grid if self.base is None else self.base(grid)
        turning = [column(grid) for column in self.turning]
        return Forcing(
            effort=between(self.effort, shifted, self.straightness),
            variant=self.variant,
            base=base[:, None, :],
            turning=np.stack(turning, axis=1) if turning else None,
        )
