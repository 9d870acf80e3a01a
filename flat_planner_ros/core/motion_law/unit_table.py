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

"""Unit motions of many equations: each in the form that suits its roots, or left out."""

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple, Protocol

from flat_planner_ros.core.arm import ComplexArray, FloatArray
from flat_planner_ros.core.motion_law.extremal import Mean
from flat_planner_ros.core.motion_law.series_basis import speeds, TERMS
from flat_planner_ros.core.motion_law.simple_roots import simple_roots, SimpleRoots
from flat_planner_ros.core.motion_law.unit_exponentials import UnitExponentials
from flat_planner_ros.core.motion_law.unit_motions import Certificates, IntArray, Nodes
from flat_planner_ros.core.motion_law.unit_series import UnitSeries
import numpy as np

CHUNK = 512
"""Motions that are solved together, few enough for the caches of a processor."""

SORTED = 16 * CHUNK
"""Equations that are sorted together by the kinds of their roots."""


class UnitMotions(Protocol):
    """Unit motions of one form, p of them."""

    @property
    def certificates(self) -> Certificates:
        """Return their quality, cost and ends."""

    def chosen(self, rows: IntArray, /) -> 'UnitMotions':
        """Return some of them."""

    def means(self, rows: FloatArray, /) -> Mean:
        """Return mean squares and peaks of combinations of derivatives, rows (p, m, 7)."""

    def at_nodes(self, rows: FloatArray, /) -> Iterator[Nodes]:
        """Return combinations of derivatives at nodes of a quadrature, rows (p, m, 7)."""

    def on_even_grid(self, rows: FloatArray, intervals: int, /) -> FloatArray:
        """Return combinations of derivatives at even times, (p, m, intervals + 1)."""

    def transform(self, poles: ComplexArray, /) -> ComplexArray:
        """Return the integrals of w' exp(z (1 - x)) for each z, (p, q)."""


class UnitGroup(NamedTuple):
    """Motions of one form, and where their equations stand among those that were given."""

    rows: IntArray
    motions: UnitMotions


def unit_table(coefficients: FloatArray, tolerance: float) -> Iterator[UnitGroup]:
    """
    Return unit motions of equations; those that are in no group have to be found one by one.

    Parameters
    ----------
    coefficients
        a_0 ... a_6 of each in normalised time, finite, shape (p, 7) [-].
    tolerance
        Residuals above which a motion is in no group [-].

    """
    for form, rows in _forms(coefficients):
        found = _certified(form, coefficients, rows, tolerance)
        if found is not None:
            yield found


Form = Callable[[FloatArray], UnitMotions]
"""From equations to their motions."""


def _forms(coefficients: FloatArray) -> Iterator[tuple[Form, IntArray]]:
    """Return forms, and which equations are to be solved in each together."""
    fastest = speeds(coefficients)
    slower = -1.0
    for terms, limit in TERMS.items():
        some = np.flatnonzero((slower < fastest) & (fastest <= limit))
        for chunk in _chunks(some, CHUNK):
            yield _series(terms), chunk
        slower = limit
    for part in _chunks(np.flatnonzero(fastest > slower), SORTED):
        for roots in simple_roots(coefficients[part]):
            for chunk in _chunks(np.arange(len(roots.rows)), CHUNK):
                some_roots = roots.chosen(chunk)
                yield _exponentials(some_roots), part[some_roots.rows]


def _series(terms: int) -> Form:
    """Return the form of series with a number of terms."""
    return lambda coefficients: UnitSeries.of(coefficients, terms)


def _exponentials(roots: SimpleRoots) -> Form:
    """Return the form of exponentials with given roots."""
    return lambda coefficients: UnitExponentials.of(coefficients, roots)


def _chunks(rows: IntArray, most: int) -> Sequence[IntArray]:
    """Return indices in parts of limited size."""
    return np.array_split(rows, -(-len(rows) // most)) if len(rows) else []


def _certified(
    form: Form, coefficients: FloatArray, rows: IntArray, tolerance: float
) -> UnitGroup | None:
    """Return the motions of some equations that pass; None where none does."""
    try:
        motions = form(coefficients[rows])
    except np.linalg.LinAlgError:
        return None  # An equation is singular: all of them are left out.
    found = motions.certificates
    passes = np.maximum(found.boundary_residual, found.optimality_residual) <= tolerance
    if passes.all():
        return UnitGroup(rows, motions)
    if not passes.any():
        return None
    return UnitGroup(rows[passes], motions.chosen(np.flatnonzero(passes)))
