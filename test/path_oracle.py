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
Optimal paths through via points in multiple precision: all exponentials, one dense system.

Every segment has the twelve functions of `oracle.solve`; continuity up to the tenth derivative and
the prescribed values couple them.
"""

from dataclasses import dataclass

import mpmath as mp
import numpy as np
from oracle import _derivatives, CONDITIONS, linear_solution, ReferenceLaw, Roots, solutions

ORDERS = 2 * CONDITIONS
"""Derivatives 0 to 11."""


@dataclass(frozen=True, kw_only=True)
class ReferencePath:
    """
    One law for each segment.

    Attributes
    ----------
    edges
        Start, via times and end [s].
    laws
        Of the segments, each in its own time.

    """

    edges: np.ndarray
    laws: list[ReferenceLaw]

    def jet(self, segment: int, times, order: int) -> np.ndarray:
        """Return the derivatives of a segment at times from its start, shape (order + 1, m)."""
        return self.laws[segment].jet(times, order)


def solve_path(
    roots: Roots, edges, values, start, relaxation: float, digits: int = 140
) -> ReferencePath:
    """
    Return the optimal path from a jet through values to rest.

    Parameters
    ----------
    roots
        Of the characteristic polynomial in z, with multiplicities.
    edges
        0, via times, duration, shape (p + 2,) [s].
    values
        w + relaxation w' at the via points and, last, the final value, shape (p + 1,).
    start
        Derivatives 0 to 5 at the start.
    relaxation
        [s].
    digits
        Working precision.

    """
    with mp.workdps(digits):
        delta = mp.mpf(float(relaxation))
        lengths = [mp.mpf(float(h)) for h in np.diff(edges)]
        functions = solutions(roots)
        unit = max(lengths)
        count = len(lengths)
        size = ORDERS * count
        matrix, target = mp.matrix(size, size), mp.matrix(size, 1)

        def table(h, at_end):
            columns = []
            for rate, power, from_end in functions:
                u = (h if at_end else mp.mpf(0)) - (h if from_end else 0)
                values = _derivatives(rate, power, u, ORDERS - 1)
                columns.append([v * unit ** (n - power) for n, v in enumerate(values)])
            return columns

        for i, column in enumerate(table(lengths[0], False)):
            for n in range(CONDITIONS):
                matrix[n, i] = column[n]
        for i, column in enumerate(table(lengths[-1], True)):
            for n in range(CONDITIONS):
                matrix[size - CONDITIONS + n, size - ORDERS + i] = column[n]
        for n in range(CONDITIONS):
            target[n] = mp.mpf(float(start[n])) * unit**n
        target[size - CONDITIONS] = mp.mpf(float(values[-1]))
        ratio = delta / unit
        for j in range(count - 1):
            row, first = CONDITIONS + ORDERS * j, ORDERS * j
            left, right = table(lengths[j], True), table(lengths[j + 1], False)
            target[row] = mp.mpf(float(values[j]))
            for i, column in enumerate(left):
                matrix[row, first + i] = column[0] + ratio * column[1]
                for n in range(10):
                    matrix[row + 1 + n, first + i] = column[n]
                matrix[row + 11, first + i] = column[10] + ratio * column[11]
            for i, column in enumerate(right):
                for n in range(10):
                    matrix[row + 1 + n, first + ORDERS + i] = -column[n]
                matrix[row + 11, first + ORDERS + i] = -(column[10] + ratio * column[11])
        weights = linear_solution(matrix, target)
        laws = []
        for j, h in enumerate(lengths):
            terms = [
                (*function, weights[ORDERS * j + i] * unit ** -function[1])
                for i, function in enumerate(functions)
            ]
            laws.append(ReferenceLaw(duration=h, terms=terms))
        return ReferencePath(edges=np.array(edges, dtype=float), laws=laws)
