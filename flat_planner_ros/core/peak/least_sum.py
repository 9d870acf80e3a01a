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
Simplex method for the least sum of magnitudes: the dual of the least peak.

It has as few unknowns as a motion has conditions, so a vertex is a handful of zeros of the
switching function, and one line search passes many of them ((B6c) of docs/derivation.md).
"""

from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray
import numpy as np

SLACK = 1e-11
"""Excess of a value over its bound that is taken for rounding [-]."""

MAX_STEPS = 150
"""Steps of a search; five to twenty are usual, and ties of many columns may go round for ever."""

FLAT = 1e-12
"""Slope, or rate of a value, that is taken for rounding, relative to the largest [-]."""


class LeastSum(NamedTuple):
    """
    Solution of both programmes.

    Attributes
    ----------
    multipliers
        p of least sum of |a_i p| with b p = 1, shape (r,).
    values
        v of largest y with A v = b y and |v| <= 1, shape (size,).
    gain
        y, which is also the sum.

    """

    multipliers: FloatArray
    values: FloatArray
    gain: float


def least_sum(rows: FloatArray, target: FloatArray) -> LeastSum | None:
    """
    Return the solution for orthonormal rows; None where the search does not end.

    Parameters
    ----------
    rows
        A, shape (r, size), with 1 < r < size.
    target
        b, not zero, shape (r,).

    References
    ----------
    Barrodale and Roberts, An improved algorithm for discrete l1 linear approximation, SIAM J.
    Numer. Anal. 10 (1973).

    """
    p = target / (target @ target)
    basis: list[int] = []
    while len(basis) < len(target) - 1:
        direction = _descent(rows, target, basis, _signs(p @ rows, basis))
        step = _step(p @ rows, direction @ rows, basis)
        if step is None:
            return None
        p = p + step.length * direction
        basis.append(step.entering)
    for _ in range(MAX_STEPS):
        vertex = np.column_stack([rows[:, basis], target])
        try:
            edges = np.linalg.inv(vertex)
        except np.linalg.LinAlgError:
            return None
        p = edges[-1]
        values = p @ rows
        signs = _signs(values, basis)
        slopes = edges @ (rows @ signs)
        leaving = int(np.argmax(np.abs(slopes[:-1])))
        if abs(slopes[leaving]) <= 1.0 + SLACK:
            signs[basis] = -slopes[:-1]
            return LeastSum(p, signs, float(slopes[-1]))
        direction = -np.sign(slopes[leaving]) * edges[leaving]
        step = _step(values, direction @ rows, basis, leaving)
        if step is None:
            return None
        basis[leaving] = step.entering
    return None


class _Step(NamedTuple):
    """Length of a step along a direction, and the index that becomes zero there."""

    length: float
    entering: int


def _signs(values: FloatArray, basis: list[int]) -> FloatArray:
    """Return the sign of each value, one for zero, and zero for those of the basis."""
    signs = np.where(values < 0.0, -1.0, 1.0)
    signs[basis] = 0.0
    return signs


def _descent(
    rows: FloatArray, target: FloatArray, basis: list[int], signs: FloatArray
) -> FloatArray:
    """Return a direction in which the sum falls, or any, that keeps the zeros of a basis."""
    kept = np.column_stack([target, rows[:, basis]])
    room = np.linalg.qr(kept, mode='complete')[0][:, kept.shape[1] :]
    slopes = room.T @ (rows @ signs)
    if np.abs(slopes).max() <= FLAT * np.abs(signs).sum():
        slopes[0] = 1.0
    return -(room @ slopes)


def _step(
    values: FloatArray, rates: FloatArray, basis: list[int], leaving: int | None = None
) -> '_Step | None':
    """Return the step to the least sum along a direction; None where it falls for ever."""
    magnitudes = np.abs(rates)
    signs = np.where(values < 0.0, -1.0, 1.0)
    signs[basis] = 0.0
    # A column that depends on those of the basis stays zero, but for rounding.
    approaches = signs * rates < -FLAT * magnitudes.max()
    slope = float(signs @ rates)
    if leaving is not None:
        slope += float(magnitudes[basis[leaving]])
    candidates = np.flatnonzero(approaches)
    lengths = -values[candidates] / rates[candidates]
    order = np.argsort(lengths, kind='stable')
    slopes = slope + 2.0 * np.cumsum(magnitudes[candidates[order]])
    beyond = np.flatnonzero(slopes >= 0.0)
    if not beyond.size:
        return None
    place = order[beyond[0]]
    return _Step(float(lengths[place]), int(candidates[place]))
