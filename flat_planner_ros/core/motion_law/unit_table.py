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

from collections.abc import Iterator, Sequence
from typing import NamedTuple, Protocol

from flat_planner_ros.core.arm import ComplexArray, FloatArray
from flat_planner_ros.core.motion_law.extremal import Mean
from flat_planner_ros.core.motion_law.unit_motions import Certificates, IntArray, speeds
from flat_planner_ros.core.motion_law.unit_series import FASTEST, UnitSeries
import numpy as np

CHUNK = 512
"""Motions that are solved together, few enough for the caches of a processor."""


class UnitMotions(Protocol):
    """Unit motions of one form, p of them."""

    @property
    def certificates(self) -> Certificates:
        """Return their quality, cost and ends."""

    def chosen(self, rows: IntArray, /) -> 'UnitMotions':
        """Return some of them."""

    def means(self, rows: FloatArray, /) -> Mean:
        """Return mean squares and peaks of combinations of derivatives, rows (p, m, 7)."""

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
    fastest = speeds(coefficients)
    slower = 0.0
    for terms, limit in FASTEST.items():
        rows = np.flatnonzero((slower <= fastest) & (fastest < limit))
        for chunk in chunks(rows):
            yield from _certified(coefficients, chunk, terms, tolerance)
        slower = limit


def chunks(rows: IntArray) -> Sequence[IntArray]:
    """Return indices in parts of at most `CHUNK`."""
    return np.array_split(rows, -(-len(rows) // CHUNK)) if len(rows) else []


def _certified(
    coefficients: FloatArray, rows: IntArray, terms: int, tolerance: float
) -> Iterator[UnitGroup]:
    """Return the motions of some equations that pass; none where an equation is singular."""
    try:
        motions = UnitSeries.of(coefficients[rows], terms)
    except np.linalg.LinAlgError:
        return
    found = motions.certificates
    passes = np.maximum(found.boundary_residual, found.optimality_residual) <= tolerance
    if passes.all():
        yield UnitGroup(rows, motions)
    elif passes.any():
        yield UnitGroup(rows[passes], motions.chosen(np.flatnonzero(passes)))
