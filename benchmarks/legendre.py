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
The paper's problem as a quadratic programme: the Legendre coefficients of y^(6) are the unknowns.

Lower derivatives follow by integration, from rest at the start; rest at the end are six equations.
This is the formulation in which general solvers do best: sixty unknowns, well conditioned.
"""

from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
import problem

FloatArray = NDArray[np.float64]

MODES = 64
"""Number of unknowns; the error stops falling there."""


class Programme(NamedTuple):
    """
    Minimise c^T H c with A c = b.

    Attributes
    ----------
    hessian, conditions, values
        H, A and b.
    sampler
        From c to the seven derivatives at the times, shape (7 * 1001, modes).

    """

    hessian: FloatArray
    conditions: FloatArray
    values: FloatArray
    sampler: FloatArray

    def answer(self, coefficients: FloatArray) -> problem.Answer:
        """Return the law of a solution."""
        jet = (self.sampler @ coefficients).reshape(problem.ORDERS, -1)
        return problem.Answer(jet, problem.effort(jet))


def programme() -> Programme:
    """Return the paper's problem on x in [-1, 1], all of it divided by the weight of y^(6)."""
    rate = 2.0 / problem.DURATION
    levels = [np.eye(MODES)]
    while len(levels) < problem.ORDERS:
        levels.append(legendre.legint(levels[-1], lbnd=-1.0))
    size = len(levels[-1])
    # Row k holds the Legendre coefficients of the k-th derivative in time, from those of y^(6)(x).
    tables = [
        rate**k * np.vstack([level, np.zeros((size - len(level), MODES))])
        for k, level in enumerate(reversed(levels))
    ]
    row = problem.EFFORT_ROW
    torque = sum(factor * table for factor, table in zip(row, tables, strict=False))
    norms = 2.0 / (2.0 * np.arange(size) + 1.0)

    def square(table: FloatArray) -> FloatArray:
        return table.T @ (norms[:, None] * table)

    cost = square(tables[-1]) + problem.WEIGHT**8 * square(torque)
    basis = legendre.legvander(rate * problem.TIMES - 1.0, size - 1)
    return Programme(
        hessian=cost / rate ** (2 * (problem.ORDERS - 1)),
        conditions=np.array([levels[-1 - k].sum(axis=0) for k in range(problem.ORDERS - 1)]),
        values=np.array([problem.DISTANCE, *np.zeros(problem.ORDERS - 2)]),
        sampler=np.vstack([basis @ table for table in tables]),
    )
