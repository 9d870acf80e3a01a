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
Continuity of segments at via points: one banded linear system for a whole path.

Unknown are the amplitudes of every segment's twelve solutions; equations are the conditions at the
start, at each knot (a via point) and at the end ((V5) of docs/derivation.md). Amplitudes rather
than the jets at the knots, because two knots close to each other fix the jets between them far
more stiffly than their neighbours do: in the jets' normal equations the neighbours drown, here
each condition keeps its own scale.
"""

from math import inf
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray, UncertifiedPlan
from flat_planner_ros.core.motion_law.basis import CONDITIONS, row_factors, SOLUTIONS
import numpy as np
from numpy.typing import NDArray

IntArray = NDArray[np.int_]

RESIDUAL_STEPS = 3
"""Corrections of the solved amplitudes by the residual of the conditions."""

BAND = SOLUTIONS + CONDITIONS - 1
"""Diagonals on either side of the main one that are occupied."""


class Amplitudes(NamedTuple):
    """
    Amplitudes of all solutions, and how far they are settled.

    Attributes
    ----------
    values
        Amplitudes on every segment, whose value at its start counts as 0, shape (p, 12, m).
    correction
        What the last correction still changed: largest derivatives 0 to 6 at the segments' ends,
        shape (7, m). Each correction is smaller than the one before by about the same factor, so
        it bounds the error even where the conditions are nearly dependent, and their residuals
        small whatever the amplitudes.

    """

    values: FloatArray
    correction: FloatArray


class ContinuitySystem:
    """
    The conditions on p segments, as blocks of one matrix.

    At every knot they are the values of the segments before and after it, continuity of the
    derivatives 1 to 9, and that of w^(10) + relaxation w^(11); at both ends, derivatives 0 to 5.

    Parameters
    ----------
    places
        Derivatives 0 to 11 of every solution at the start, in the middle and at the end of every
        segment, shape (3, p, 12, 12) [1/s^k].
    rates
        How fast the solutions grow, as those of `SegmentBases`, shape (p, 6) [1/s].
    relaxation
        Via points prescribe w + relaxation w' [s].

    Raises
    ------
    UncertifiedPlan
        The conditions are singular in double precision.

    """

    def __init__(self, places: FloatArray, rates: FloatArray, relaxation: float) -> None:
        """Fill the blocks and scale their rows, then their columns, to the same size."""
        at_start, _, at_end = places
        self._start_factors = row_factors(rates[0].tolist())
        self._end_factors = row_factors(rates[-1].tolist())
        # The faster segment's rates: only it can fulfil the conditions on high derivatives.
        self._knot_factors = _knot_factors(np.maximum(rates[:-1], rates[1:]))
        start = at_start[0, :CONDITIONS] * self._start_factors[:, None]
        end = at_end[-1, :CONDITIONS] * self._end_factors[:, None]
        knots = np.zeros((len(rates) - 1, SOLUTIONS, 2 * SOLUTIONS))
        _fill_knots(knots[:, :, :SOLUTIONS], at_end[:-1], relaxation, 0)
        _fill_knots(knots[:, :, SOLUTIONS:], -at_start[1:], relaxation, 1)
        knots *= self._knot_factors[:, :, None]
        columns = 1.0 / _largest(start, knots, end)
        knots[:, :, :SOLUTIONS] *= columns[:-1, None]
        knots[:, :, SOLUTIONS:] *= columns[1:, None]
        self._column_factors = columns  # (p, 12)
        self._start = start * columns[0]  # (6, 12)
        self._knots = knots  # (p - 1, 12, 24)
        self._end = end * columns[-1]  # (6, 12)
        # Derivatives 0 to 6 of every solution at its segment's start and end, (p, 2, 7, 12).
        self._at_ends = np.stack([at_start, at_end], axis=1)[:, :, : CONDITIONS + 1]
        self._factor()

    def _factor(self) -> None:
        """Factor the matrix."""
        from scipy.linalg.lapack import dgbtrf  # here: slow to import, for paths only

        self._factors, self._pivots, failure = dgbtrf(self._banded(), BAND, BAND)
        if failure:
            raise UncertifiedPlan('boundary residual', inf, 0.0)

    def solve(self, start: FloatArray, steps: FloatArray) -> Amplitudes:
        """
        Return the amplitudes of all solutions.

        Parameters
        ----------
        start
            Derivatives 1 to 5 at the start, shape (5, m).
        steps
            Value at the end of every segment less that at its start, shape (p, m).

        """
        target = self._target(start, steps)
        amplitudes = self._solved(target)
        for _ in range(RESIDUAL_STEPS):
            change = self._solved(target - self._applied(amplitudes))
            amplitudes += change
        at_ends = self._at_ends @ self._unscaled(change)[:, None]
        return Amplitudes(self._unscaled(amplitudes), np.abs(at_ends).max(axis=(0, 1)))

    def shifts(self, speeds: FloatArray, jumps: FloatArray) -> FloatArray:
        """
        Return how the amplitudes change with the time of each knot, the laws kept in place.

        Parameters
        ----------
        speeds
            Derivative of w + relaxation w' at the knots, shape (p - 1,).
        jumps
            After each knot less before it, of w^(10) and w^(11) + relaxation w^(12), shape
            (2, p - 1).

        Returns
        -------
        FloatArray
            For every segment, solution and knot, shape (p, 12, p - 1).

        References
        ----------
        (V10) of docs/derivation.md.

        """
        count = len(speeds)
        target = np.zeros((count, SOLUTIONS, count))
        each = np.arange(count)
        rows = [(0, -speeds), (1, speeds), (SOLUTIONS - 2, jumps[0]), (SOLUTIONS - 1, jumps[1])]
        for row, values in rows:
            target[each, row, each] = values * self._knot_factors[:, row]
        ends = np.zeros((CONDITIONS, count))
        inner = target.reshape(-1, count)
        return self._unscaled(self._solved(np.concatenate([ends, inner, ends])))

    def _solved(self, target: FloatArray) -> FloatArray:
        """Return the scaled amplitudes that meet scaled conditions, shape (12 p, m)."""
        from scipy.linalg.lapack import dgbtrs

        solution: FloatArray = dgbtrs(self._factors, BAND, BAND, target, self._pivots)[0]
        return solution

    def _unscaled(self, amplitudes: FloatArray) -> FloatArray:
        """Return amplitudes of the solutions themselves, shape (p, 12, m)."""
        columns = amplitudes.reshape(*self._column_factors.shape, -1)
        unscaled: FloatArray = columns * self._column_factors[:, :, None]
        return unscaled

    def _target(self, start: FloatArray, steps: FloatArray) -> FloatArray:
        """Return the right-hand side, shape (12 p, m)."""
        target = np.zeros((SOLUTIONS * len(steps), steps.shape[1]))
        target[1:CONDITIONS] = start * self._start_factors[1:, None]
        target[CONDITIONS:-CONDITIONS:SOLUTIONS] = steps[:-1] * self._knot_factors[:, :1]
        target[-CONDITIONS] = steps[-1] * self._end_factors[0]
        return target

    def _banded(self) -> FloatArray:
        """Return the matrix by diagonals, with room for the rows that pivoting exchanges."""
        size = self._column_factors.size
        banded = np.zeros((3 * BAND + 1, size), order='F')

        def put(block: FloatArray, row: int | IntArray, column: int | IntArray) -> None:
            rows = row + np.arange(block.shape[-2])[:, None]
            columns = column + np.arange(block.shape[-1])
            banded[2 * BAND + rows - columns, columns] = block

        put(self._start, 0, 0)
        first = SOLUTIONS * np.arange(len(self._knots))[:, None, None]
        put(self._knots, CONDITIONS + first, first)
        put(self._end, size - CONDITIONS, size - SOLUTIONS)
        return banded

    def _applied(self, amplitudes: FloatArray) -> FloatArray:
        """Return the matrix times some columns, shape (12 p, m)."""
        columns = amplitudes.reshape(-1, SOLUTIONS, amplitudes.shape[1])
        knots = self._knots[:, :, :SOLUTIONS] @ columns[:-1]
        knots += self._knots[:, :, SOLUTIONS:] @ columns[1:]
        inner = knots.reshape(-1, amplitudes.shape[1])
        return np.concatenate([self._start @ columns[0], inner, self._end @ columns[-1]])


def _largest(start: FloatArray, knots: FloatArray, end: FloatArray) -> FloatArray:
    """Return the largest entry of every column of the conditions, shape (p, 12)."""
    sizes = np.abs(knots).max(axis=1)
    largest = np.zeros((len(knots) + 1, SOLUTIONS))
    largest[:-1] = sizes[:, :SOLUTIONS]
    np.maximum(largest[1:], sizes[:, SOLUTIONS:], out=largest[1:])
    np.maximum(largest[0], np.abs(start).max(axis=0), out=largest[0])
    np.maximum(largest[-1], np.abs(end).max(axis=0), out=largest[-1])
    return largest


def _fill_knots(half: FloatArray, table: FloatArray, relaxation: float, row: int) -> None:
    """Write the conditions on one side of every knot; its value stands in the given row."""
    half[:, row] = table[:, 0] + relaxation * table[:, 1]
    half[:, 2:-1] = table[:, 1:-2]
    half[:, -1] = table[:, -2] + relaxation * table[:, -1]


def _knot_factors(rates: FloatArray) -> FloatArray:
    """
    Return factors of the conditions at knots, as `row_factors` for two solutions of each rate.

    Slow solutions of the two segments meet the values, and the pair of the i-th rate the
    derivatives 2 i - 3 and 2 i - 2 ((V6) of docs/derivation.md).
    """
    steps = np.ones((len(rates), SOLUTIONS))
    steps[:, 2::2] = 1.0 / np.sqrt(rates[:, :-1] * rates[:, 1:])
    steps[:, 3::2] = 1.0 / rates[:, 1:]
    return np.asarray(np.cumprod(steps, axis=1), dtype=np.float64)
