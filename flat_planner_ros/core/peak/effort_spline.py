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
Spline of the effort: few coefficients, sampled so finely that straight lines follow it.

Quadratic, on even intervals, its end coefficients the values at both ends. Coefficients bound it:
where none exceeds the peak, no sample does.
"""

from dataclasses import dataclass
from functools import cached_property

from flat_planner_ros.core.arm import FloatArray
import numpy as np

SPAN = 3
"""Coefficients that a sample depends on."""


@dataclass(frozen=True, kw_only=True)
class EffortSpline:
    """
    Quadratic spline and its even samples.

    Attributes
    ----------
    intervals
        Number of its even intervals, two or more.
    pieces
        Pieces per interval between samples.

    """

    intervals: int
    pieces: int

    @property
    def size(self) -> int:
        """Return the number of coefficients."""
        return self.intervals + SPAN - 1

    @cached_property
    def weights(self) -> FloatArray:
        """Weight of each coefficient in each sample, shape (intervals, pieces, 3)."""
        x = np.arange(self.pieces) / self.pieces
        low, high = 0.5 * (1.0 - x) ** 2, 0.5 * x**2
        weights = np.empty((self.intervals, self.pieces, SPAN))
        weights[..., 0], weights[..., 2] = low, high
        # Threefold knots at both ends: there the spline has the value of its coefficient.
        weights[0, :, 0] = 2.0 * low
        weights[-1, :, 2] = 2.0 * high
        weights[..., 1] = 1.0 - weights[..., 0] - weights[..., 2]
        return weights

    @property
    def spans(self) -> FloatArray:
        """Intervals that each difference of neighbours takes, shape (size - 1,) [-]."""
        spans = np.ones(self.size - 1)
        spans[[0, -1]] = 0.5
        return spans

    def samples(self, coefficients: FloatArray) -> FloatArray:
        """Return the samples, both ends included, shape (intervals * pieces + 1,)."""
        parts = np.lib.stride_tricks.sliding_window_view(coefficients, SPAN)
        inner = np.matmul(self.weights, parts[..., None])[..., 0]
        return np.append(inner.ravel(), coefficients[-1])

    def interval_rows(
        self, rows: FloatArray, index: int, first: int = 0, last: int | None = None
    ) -> FloatArray:
        """
        Return functionals of some samples of one interval as such of its coefficients.

        Parameters
        ----------
        rows
            Functionals of these samples, shape (r, last - first + 1).
        index
            Which interval, not the last one.
        first, last
            Pieces of the interval at whose starts the samples are; None for those up to its end.

        """
        weights = np.concatenate([self.weights[index], [[0.0, 0.5, 0.5]]])
        stop = self.pieces if last is None else last
        part: FloatArray = rows @ weights[first : stop + 1]
        return part

    def gathered(self, rows: FloatArray) -> FloatArray:
        """Return functionals of the samples, (r, m), as such of the coefficients, (r, size)."""
        inner = rows[:, :-1].reshape(len(rows), self.intervals, self.pieces)
        shares = np.einsum('rip,ips->rsi', inner, self.weights)
        gathered = np.zeros((len(rows), self.size))
        for offset in range(SPAN):
            gathered[:, offset : offset + self.intervals] += shares[:, offset]
        gathered[:, -1] += rows[:, -1]
        return gathered
