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
Paths through via points as a quadratic programme that knows no Euler-Lagrange equation.

Unknown are the Legendre coefficients of w^(6) on every segment; lower derivatives follow by
integration from the start, so that five derivatives are continuous by construction. Prescribed
values and rest at the end are linear equations. Natural conditions are not imposed: they must come
out.
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre

ORDER = 6
"""Highest derivative in the cost."""


@dataclass(frozen=True, kw_only=True)
class ProgrammedPath:
    """
    The optimum of the programme.

    Attributes
    ----------
    edges
        Start, via times and end, shape (p + 1,) [s].
    series
        Legendre coefficients of the derivatives 0 to 6 on every segment, shape (p, 7, terms).
    cost_value
        Integral of Y^T Q Y.

    """

    edges: np.ndarray
    series: np.ndarray
    cost_value: float

    def jet(self, segment: int, fractions) -> np.ndarray:
        """Return derivatives 0 to 6 at fractions of a segment, shape (7, m)."""
        basis = legendre.legvander(2.0 * np.asarray(fractions) - 1.0, self.series.shape[2] - 1)
        return self.series[segment] @ basis.T


def programmed_path(matrix, edges, values, start, relaxation, modes=40) -> ProgrammedPath:
    """
    Return the least cost over piecewise polynomials, of degree `modes` + 5.

    Parameters
    ----------
    matrix
        Q, shape (6, 6).
    edges
        0, via times, duration, shape (p + 1,) [s].
    values
        w + relaxation w' at the via points and, last, the final value, shape (p,).
    start
        Derivatives 0 to 5 at the start, shape (6,).
    relaxation
        [s].
    modes
        Coefficients of w^(6) on every segment.

    """
    halves = 0.5 * np.diff(edges)
    count = len(halves) * modes
    terms = modes + ORDER
    # Time in units of a segment, so that the derivatives are of one size.
    unit = halves.mean()
    scale = unit ** np.arange(ORDER + 1.0)
    # Affine maps of the unknowns, the constant in the last column: jet at the segment's start.
    jet = np.zeros((ORDER, count + 1))
    jet[:, -1] = start * scale[:ORDER]
    tables, passed = [], []
    for segment, half in enumerate(halves / unit):
        table = np.zeros((ORDER + 1, terms, count + 1))
        table[ORDER, :modes, segment * modes : (segment + 1) * modes] = np.eye(modes)
        for order in reversed(range(ORDER)):
            integral = half * legendre.legint(table[order + 1, :-1], lbnd=-1.0)
            table[order, : len(integral)] = integral
            table[order, 0] += jet[order]
        tables.append(table)
        jet = table[:ORDER].sum(axis=1)
        passed.append(jet[0] + relaxation / unit * jet[1])
    conditions = np.array([*passed[:-1], *jet])
    targets = np.array([*values, *np.zeros(ORDER - 1)])
    norms = 2.0 / (2.0 * np.arange(terms) + 1.0)
    weights = matrix * np.multiply.outer(scale[:-1], scale[:-1])[::-1, ::-1]
    hessian = sum(
        half * np.einsum('iax,a,ij,jay->xy', table[1:], norms, weights, table[1:], optimize=True)
        for half, table in zip(halves / unit, tables, strict=True)
    )
    unknowns = _minimum(hessian, conditions, targets)
    full = np.append(unknowns, 1.0)
    series = np.array([table @ full for table in tables]) / scale[:, None]
    return ProgrammedPath(
        edges=np.asarray(edges, dtype=float),
        series=series,
        cost_value=float(full @ hessian @ full) * unit ** (1 - 2 * ORDER),
    )


def _minimum(hessian, conditions, targets) -> np.ndarray:
    """Return the x of least (x, 1)^T H (x, 1) with C (x, 1) = targets, by the null space of C."""
    count = len(hessian) - 1
    rows = conditions[:, :count]
    sizes = np.abs(rows).max(axis=1)
    orthogonal, triangle = np.linalg.qr((rows / sizes[:, None]).T, mode='complete')
    fixed = len(rows)
    particular = orthogonal[:, :fixed] @ np.linalg.solve(
        triangle[:fixed].T, (targets - conditions[:, count]) / sizes
    )
    free = orthogonal[:, fixed:]
    inner = free.T @ hessian[:count, :count] @ free
    slope = free.T @ (hessian[:count, :count] @ particular + hessian[:count, count])
    size = 1.0 / np.sqrt(np.diag(inner))
    step = size * np.linalg.solve(inner * np.multiply.outer(size, size), size * slope)
    return particular - free @ step
