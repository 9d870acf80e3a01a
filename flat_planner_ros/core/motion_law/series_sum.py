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

"""Laws from rest to rest as Chebyshev series, evaluated for all derivatives at once."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

from flat_planner_ros.core.arm import FloatArray, locked
from flat_planner_ros.core.motion_law.chebyshev_series import chebyshev_values, from_legendre
from flat_planner_ros.core.motion_law.law import JET_ORDER
from flat_planner_ros.core.motion_law.legendre_series import differentiation
from flat_planner_ros.core.motion_law.series_basis import (
    continued,
    LOW_DEGREES,
    series_basis,
    TERMS,
)
from flat_planner_ros.core.motion_law.term_sum import CHUNK, FEW, grid_blocks, write_mirrored
import numpy as np

GRIDS_KEPT = 4
"""Tables of Chebyshev polynomials on even grids that are remembered."""

PLACES_KEPT = 16
"""Tables at other places that are remembered: the nodes of a quadrature suit many laws."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SeriesSum:
    """
    An odd law from rest to rest; all tables are in normalised time x.

    Attributes
    ----------
    coefficients
        a_0 ... a_6 of its Euler-Lagrange equation, shape (7,).
    amplitudes
        Of the changes of `series_basis` and, last, of its law of least degree, shape (terms + 1,).

    """

    coefficients: FloatArray
    amplitudes: FloatArray

    def at(self, distances: FloatArray, order: int) -> FloatArray:
        """Return the law and its derivatives in x, up to the twelfth, as `Sum.at`."""
        series = self.series if order <= JET_ORDER else self._all
        x = 0.5 * (distances[0] - distances[1])
        size = series.shape[1]
        if FEW <= len(x) <= CHUNK:
            sums: FloatArray = series[: order + 1] @ _kept_values(x.tobytes(), size)
            return sums
        result = np.empty((order + 1, len(x)))
        for start in range(0, len(x), CHUNK):
            part = slice(start, start + CHUNK)
            np.matmul(series[: order + 1], chebyshev_values(x[part], size), out=result[:, part])
        return result

    def fill_odd_grid(self, table: FloatArray, scales: FloatArray) -> None:
        """Write derivatives at even times, both ends included, as `Sum.fill_odd_grid`."""
        intervals = table.shape[1] - 1
        half = intervals // 2 + 1
        series = scales[:, None] * self.series[: len(table)]
        # Derivatives of even order are odd about the middle.
        odd, even = series[::2, 1::2], series[1::2, ::2]
        for start in range(0, half, CHUNK):
            at_odd, at_even = _grid_values(series.shape[1], intervals, start)
            part = np.empty((len(table), min(CHUNK, half - start)))
            part[::2], part[1::2] = odd @ at_odd, even @ at_even
            write_mirrored(table, part, start)

    @cached_property
    def series(self) -> FloatArray:
        """Return Chebyshev coefficients of the derivatives 0 to 6, shape (7, size)."""
        table = _chebyshev(len(self.amplitudes) - 1)
        result: FloatArray = (self.amplitudes @ table).reshape(JET_ORDER + 1, -1)
        return result

    @cached_property
    def _all(self) -> FloatArray:
        """Return Chebyshev coefficients of the derivatives 0 to 12, shape (13, size)."""
        table = series_basis(len(self.amplitudes) - 1).derivatives @ self.amplitudes
        size = table.shape[1]
        polynomial = np.zeros((JET_ORDER + 1, size))
        polynomial[0, LOW_DEGREES] = self.coefficients @ table[::2, LOW_DEGREES]
        slope = differentiation(size)
        for order in range(JET_ORDER):
            polynomial[order + 1] = slope @ polynomial[order]
        more = continued(self.coefficients, table, polynomial)
        return np.concatenate([table[JET_ORDER:], more]) @ from_legendre(size).T


@lru_cache(maxsize=len(TERMS))
def _chebyshev(terms: int) -> FloatArray:
    """Return Chebyshev coefficients of the derivatives 0 to 6 of a basis, (terms + 1, 7 size)."""
    table = series_basis(terms).derivatives[JET_ORDER:]
    size = int(np.flatnonzero(table.any(axis=(0, 2)))[-1]) + 1
    series = np.einsum('cs,kst->tkc', from_legendre(size), table[:, :size])
    return locked(series.reshape(terms + 1, -1))


@lru_cache(maxsize=PLACES_KEPT)
def _kept_values(places: bytes, size: int) -> FloatArray:
    """Return Chebyshev polynomials by the bytes of the places."""
    return locked(chebyshev_values(np.frombuffer(places), size))


@lru_cache(maxsize=GRIDS_KEPT)
def _grid_values(size: int, intervals: int, start: int) -> tuple[FloatArray, FloatArray]:
    """Return odd and even polynomials on the part of an even grid that is evaluated together."""
    x = grid_blocks(intervals)[2][start : start + CHUNK]
    values = chebyshev_values(x, size)
    return locked(values[1::2].copy()), locked(values[::2].copy())
