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
Output-error refinement: the simulated motion is brought to the measured one.

Every segment of the recording starts from four unknowns of its own, which are eliminated in each
step of Gauss and Newton (variable projection, Golub and Pereyra 1973), and with them the errors of
the base's velocity: what errors add up to over a long recording stays out, and the work and memory
grow with nothing but the number of segments.
"""

from collections.abc import Iterator, Sequence
from math import sqrt
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray, InvalidRequest
from flat_planner_ros.core.model_fit.correlation import lags_for, products
from flat_planner_ros.core.model_fit.last_links import BOTH, LAST, STATES, step_for, STIFFNESS
from flat_planner_ros.core.model_fit.simulation import (
    blocks,
    CHANNELS,
    first_starts,
    Observed,
    seen_with_slopes,
    SingleOrDouble,
)
import numpy as np
import numpy.typing as npt

DIFFERENCE = 1e-6
"""Step of the difference quotients, relative to the parameters' scales [-]."""

MOST_STEPS = 40
"""Largest number of linearisations."""

CONVERGED = 5e-3
"""Largest last step, relative to the standard errors of white noise [-]."""

IN_VAIN = 0.05
"""Step that, refused, is the last one, relative to them: next to nothing would be gained [-]."""

NEAR = 3.0
"""Step that, refused, may fail for the segments' own unknowns alone, relative to them [-]."""

SMALLEST = 1e-7
"""Last step that is always small enough, relative to the scales [-]."""

SHORTEST_STEP = 5e-4
"""Step of the integration that a model may need if the one before it does not [s]."""

MOST_DAMPING = 1e8
"""Marquardt's parameter from which nothing better is expected [-]."""

NULL = 1e-10
"""Curvature below which a direction is not told at all, relative to the largest [-]."""

KEPT = 50_000
"""Samples up to which residuals are kept; those of longer recordings are found again: 0.4 MB."""

NEIGHBOURS = 1 / 6
"""Distance up to which residuals may err alike, relative to a segment [-]: a free period."""


class Linearisation(NamedTuple):
    """
    The misfit around one set of parameters, the unknowns of the segments eliminated.

    Attributes
    ----------
    cost
        Weighted sum of squares that is left with the best of them [-].
    gradient
        By either channel, shape (2, free).
    normal
        Normal equations of either channel, shape (2, free, free).
    scatter
        Sums of products of neighbouring scores, with the kernel of Bartlett, shape (free, free).
    rounding
        The same for the rounding of encoders, which err alike as long as they stand still.
    samples
        Of all segments.
    products
        Sums of products of what is left of either channel 0, 1, ... samples apart in a segment,
        not weighted, shape (2, lags) [rad^2].
    residuals
        What is left of either channel in each segment, not weighted, (samples, 2) [rad]; empty if
        there are more than `KEPT` samples. Single precision does: rounding is 1e-7 of what is
        itself an error.
    corrections
        For each segment the step of its own unknowns without a step of the parameters (own,), and
        the change of that with them (own, free).

    """

    cost: float
    gradient: FloatArray
    normal: FloatArray
    scatter: FloatArray
    rounding: FloatArray
    samples: int
    products: FloatArray
    residuals: Sequence[SingleOrDouble]
    corrections: list[tuple[FloatArray, FloatArray]]

    @property
    def power(self) -> FloatArray:
        """Return the sum of squares of either channel, shape (2,) [rad^2]."""
        return self.products[:, 0]


class Refined(NamedTuple):
    """Parameters (8,), starts (segments, own), spread (2,) [rad], and the last linearisation."""

    parameters: FloatArray
    starts: FloatArray
    spread: FloatArray
    around: Linearisation


@np.errstate(over='ignore', invalid='ignore')
def linearised(
    observed: Observed,
    model: FloatArray,
    starts: FloatArray,
    free: Sequence[int],
    scales: FloatArray,
    spread: FloatArray,
    *,
    keeps: bool = False,
) -> Linearisation:
    """
    Return misfit and sensitivities; those of a model that runs away are not finite.

    Parameters
    ----------
    observed
        What was measured.
    model
        Parameters in the order of `last_links.NAMES`, shape (8,).
    starts
        States at the starts of the segments, and what the base is off in units of what is expected
        of it, shape (segments, 4 or `observed.unknowns`).
    free
        Which parameters may change.
    scales
        Sizes of the parameters, for difference quotients, shape (8,).
    spread
        By which the residuals of either channel are divided, shape (2,) [rad].
    keeps
        Whether to keep what is left however long the recording is.

    """
    count = len(free)
    cost, gradient = 0.0, np.zeros((CHANNELS, count))
    normal = np.zeros((CHANNELS, count, count))
    scatter, rounding = np.zeros((count, count)), np.zeros((count, count))
    lags = lags_for(segment.last - segment.first for segment in observed.segments)
    samples = sum(segment.last - segment.first for segment in observed.segments)
    sums, residuals, corrections = np.zeros((CHANNELS, lags)), [], []
    pieces = _segments(observed, model, starts, free, scales)
    for segment, start, piece in zip(observed.segments, starts, pieces, strict=True):
        whole, whole_columns, correction = _projected(piece, start[STATES:], spread)
        cost += float(whole @ whole)
        shown = piece.misfit.size
        left, left_columns = whole[:shown], whole_columns[:shown]
        expected, by_expected = whole[shown:], whole_columns[shown:]
        # The base acts on link n-1.
        gradient[0] += by_expected.T @ expected
        normal[0] += by_expected.T @ by_expected
        scatter += (by_expected.T * expected**2) @ by_expected
        for channel in range(CHANNELS):
            own = left_columns[channel::CHANNELS]
            gradient[channel] += own.T @ left[channel::CHANNELS]
            normal[channel] += own.T @ own
            moves = observed.moves[segment.first : segment.last, channel]
            share = observed.rounding[channel] / spread[channel]
            rounding += share**2 * _alike(own, moves)
        scored = left[:, None] * left_columns
        scores = scored[::CHANNELS] + scored[1::CHANNELS]
        scatter += neighbours(scores, max(1, round(NEIGHBOURS * len(scores))))
        each = (left.reshape(-1, CHANNELS) * spread).astype(np.float32)
        sums += products(each.astype(float), lags)
        if keeps or samples <= KEPT:
            residuals.append(each)
        corrections.append(correction)
    sensitivities = gradient, normal, scatter, rounding
    return Linearisation(cost, *sensitivities, samples, sums, residuals, corrections)


def left_in(part: Observed, block: slice, found: Refined) -> Sequence[SingleOrDouble]:
    """Return what a fit leaves in each segment of a block, which is a recording of its own."""
    if found.around.residuals:
        return found.around.residuals[block]
    point = found.parameters, found.starts[block], (), found.parameters, found.spread
    return linearised(part, *point, keeps=True).residuals


class _Piece(NamedTuple):
    """Misfit of a segment (m, 2) [rad], and its derivatives as of `Shown`, by parameters."""

    misfit: FloatArray
    by_start: FloatArray
    by_errors: FloatArray
    by_parameter: FloatArray

    def weighted(self, spread: FloatArray) -> Iterator[FloatArray]:
        """Yield each in units of the spread, shape (2 m, columns)."""
        for part in (self.misfit[..., None], *self[1:]):
            yield (part / spread[:, None]).reshape(self.misfit.size, part.shape[-1])


def _projected(
    piece: _Piece, errors: FloatArray, spread: FloatArray
) -> tuple[FloatArray, FloatArray, tuple[FloatArray, FloatArray]]:
    """Return weighted misfit and slopes without a segment's own unknowns, and their correction."""
    misfit, by_start, by_errors, by_parameter = piece.weighted(spread)
    whole = np.hstack((misfit, by_parameter))
    basis, triangle = np.linalg.qr(by_start)
    inside, crossed = basis.T @ whole, basis.T @ by_errors
    whole -= basis @ inside
    by_errors = by_errors - basis @ crossed
    # What is expected of the base's errors counts as if each had been measured to be zero.
    nodes = by_errors.shape[1]
    expected = np.zeros((nodes, whole.shape[1]))
    expected[:, 0] = errors[:nodes]
    normal = by_errors.T @ by_errors + np.eye(nodes)
    moved = -np.linalg.solve(normal, by_errors.T @ whole + expected)
    started = -np.linalg.solve(triangle, inside + crossed @ moved)
    left = np.vstack((whole + by_errors @ moved, expected + moved))
    correction = np.zeros((STATES + len(errors), whole.shape[1]))
    correction[: STATES + nodes] = np.vstack((started, moved))
    return left[:, 0], left[:, 1:], (correction[:, 0], correction[:, 1:])


def _alike(columns: FloatArray, moves: npt.NDArray[np.bool_]) -> FloatArray:
    """Return the sum of products of rows that have one error until the encoder moves."""
    begins = np.flatnonzero(np.append(True, moves[1:]))
    sums = np.add.reduceat(columns, begins, axis=0)
    product: FloatArray = sums.T @ sums
    return product


def neighbours(scores: FloatArray, window: int) -> FloatArray:
    """Return the sum of products of rows, the weight falling to zero within a window of them."""
    padded = np.zeros((len(scores) + window, scores.shape[1]))
    padded[: len(scores)] = scores
    total = np.cumsum(padded, axis=0)
    total[window:] -= total[:-window].copy()
    product: FloatArray = total.T @ total / window
    return product


def refine(
    observed: Observed,
    parameters: FloatArray,
    free: Sequence[int],
    scales: FloatArray,
    spread: FloatArray,
    starts: FloatArray | None = None,
    converged: float = CONVERGED,
) -> Refined:
    """
    Return the parameters with the least sum of squares (Levenberg and Marquardt).

    Parameters are as for `linearised`; without starts those measured are taken. The last step is
    at most `converged` standard errors of white noise. Damping shortens the step of the parameters
    alone: where a short step is refused, and that of the segments' own unknowns by itself, too,
    none between the two is better. A first model that runs away is an `InvalidRequest`.
    """
    point = parameters.copy(), first_starts(observed) if starts is None else starts
    best = linearised(observed, *point, free, scales, spread)
    damping = 0.0
    for _ in range(MOST_STEPS):
        step = _step(best, damping, scales[list(free)])
        length = _in_errors(step, best)
        is_small = length < converged or float(np.abs(step / scales[list(free)]).max()) < SMALLEST
        if is_small or damping > MOST_DAMPING:
            break
        trial, there = _tried(observed, point, best, step, free, scales, spread)
        if _is_better(there, best):
            point, best, damping = trial, there, damping / 10 if damping > 1e-6 else 0.0
            continue
        if length < IN_VAIN:
            break
        damping = max(10 * damping, 1e-4)
        if length < NEAR:
            trial, there = _tried(observed, point, best, 0.0 * step, free, scales, spread)
            if not _is_better(there, best):
                break
            point, best = trial, there
    return Refined(*point, spread_of(best, len(free)), best)


def spread_of(around: Linearisation, free: int) -> FloatArray:
    """Return the standard deviation of what so many free parameters leave, shape (2,) [rad]."""
    unknowns = STATES * len(around.corrections) + free
    found: FloatArray = np.sqrt(around.power / max(around.samples - unknowns / CHANNELS, 1.0))
    return found


def _tried(
    observed: Observed,
    point: tuple[FloatArray, FloatArray],
    around: Linearisation,
    step: FloatArray,
    free: Sequence[int],
    scales: FloatArray,
    spread: FloatArray,
) -> tuple[tuple[FloatArray, FloatArray], Linearisation]:
    """Return where a step leads, and the misfit there."""
    trial = _stepped(point, around, step, free)
    return trial, linearised(observed, *trial, free, scales, spread)


def _is_better(there: Linearisation, here: Linearisation) -> bool:
    """Return whether a misfit is no larger than another but for rounding."""
    return there.cost <= here.cost * (1.0 + 1e-12)


def _step(around: Linearisation, damping: float, scales: FloatArray) -> FloatArray:
    """Return the step of the free parameters, damped by Marquardt's parameter."""
    if not (np.isfinite(around.normal).all() and np.isfinite(around.gradient).all()):
        raise InvalidRequest(
            'the fit runs away: no model near the one believed explains what was measured; are '
            'units and signs of angles and efforts right, and the inertias roughly?'
        )
    normal = around.normal.sum(axis=0) * np.outer(scales, scales)
    normal += damping * np.diag(np.diag(normal))
    gradient = scales * around.gradient.sum(axis=0)
    step: FloatArray = -scales * np.linalg.lstsq(normal, gradient, rcond=NULL)[0]
    return step


def _stepped(
    point: tuple[FloatArray, FloatArray],
    around: Linearisation,
    step: FloatArray,
    free: Sequence[int],
) -> tuple[FloatArray, FloatArray]:
    """Return parameters and starts after a step, shortened until the model has a meaning."""
    share = 1.0
    shortest = min(SHORTEST_STEP, step_for(point[0], has_friction=True))
    while True:
        parameters = point[0].copy()
        parameters[list(free)] += share * step
        has_meaning = parameters[BOTH] > parameters[LAST] > 0.0 < parameters[STIFFNESS]
        if has_meaning and step_for(parameters, has_friction=True) >= shortest:
            break
        share /= 2
    moved = np.array([own + by @ (share * step) for own, by in around.corrections])
    return parameters, point[1] + moved


def _in_errors(step: FloatArray, around: Linearisation) -> float:
    """Return the length of a step in standard errors of white noise [-]."""
    gain = float(step @ around.normal.sum(axis=0) @ step)
    return sqrt(gain / (around.cost / (CHANNELS * around.samples) + 1e-300))


def _segments(
    observed: Observed,
    parameters: FloatArray,
    starts: FloatArray,
    free: Sequence[int],
    scales: FloatArray,
) -> Iterator[_Piece]:
    """Yield the misfit of each segment."""
    nudges = DIFFERENCE * scales[list(free)]
    models = np.tile(parameters, (1 + len(free), 1))
    models[1 + np.arange(len(free)), list(free)] += nudges
    for block in blocks(observed):
        yield from _of_block(observed, block, models, starts[block], nudges)


def _of_block(
    observed: Observed, block: slice, models: FloatArray, starts: FloatArray, nudges: FloatArray
) -> Iterator[_Piece]:
    """Yield the same for the segments of a block, of which nothing stays behind."""
    seen = seen_with_slopes(observed, block, models, starts)
    for segment, shown in zip(observed.segments[block], seen, strict=True):
        measured = observed.angles[segment.first : segment.last]
        by_parameter = shown.by_model / nudges
        yield _Piece(shown.angles - measured, shown.by_start, shown.by_errors, by_parameter)
