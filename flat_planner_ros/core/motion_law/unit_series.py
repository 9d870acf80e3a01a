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
Unit motions of many equations at once, as Legendre series.

They are combinations of the laws of `series_basis`, whatever their roots have in common.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

from flat_planner_ros.core.arm import ComplexArray, FloatArray, locked
from flat_planner_ros.core.motion_law.basis import CONDITIONS
from flat_planner_ros.core.motion_law.certificate import quality
from flat_planner_ros.core.motion_law.extremal import Mean
from flat_planner_ros.core.motion_law.law import half_quadrature, JET_ORDER
from flat_planner_ros.core.motion_law.legendre_series import differentiation, legendre_values
from flat_planner_ros.core.motion_law.series_basis import (
    continued,
    LOW_DEGREES,
    probed,
    series_basis,
    solved,
    TERMS,
)
from flat_planner_ros.core.motion_law.unit_motions import (
    by_parts,
    Certificates,
    IntArray,
    mirrored_grid,
    Nodes,
    transform_intervals,
    trapezoid,
)
import numpy as np

TABLES_KEPT = 32
"""Tables of basis functions at certain places that are remembered."""


@lru_cache(maxsize=TABLES_KEPT)
def _halves(terms: int) -> tuple[FloatArray, FloatArray]:
    """Return derivatives 0, 2, 4, 6 and 1, 3, 5 of the basis, (terms + 1, orders size / 2)."""
    derivatives = series_basis(terms).derivatives[JET_ORDER:]
    # Those of even order are odd about the middle.
    odd, even = derivatives[::2, 1::2], derivatives[1::2, ::2]
    return _in_columns(odd), _in_columns(even)


def _in_columns(part: FloatArray) -> FloatArray:
    """Return a table whose last axis is the basis with this axis first and one other."""
    return locked(part.reshape(-1, part.shape[-1]).T.copy())


@lru_cache(maxsize=TABLES_KEPT)
def _at_end(terms: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """
    Return what the derivatives beyond the sixth of a basis follow from at the end.

    Returns
    -------
    tuple[FloatArray, FloatArray, FloatArray]
        Its orders -6 to 6 at x = 1, shape (terms + 1, 13); the Legendre coefficients of its even
        orders at `LOW_DEGREES`, shape (terms + 1, 7 * 3); derivatives 0 to 6 of these polynomials,
        shape (3, 7).

    """
    derivatives = series_basis(terms).derivatives
    low = derivatives[::2, LOW_DEGREES].transpose(2, 0, 1).reshape(terms + 1, -1)
    slope, jets = differentiation(CONDITIONS), [np.eye(CONDITIONS)[LOW_DEGREES]]
    for _ in range(JET_ORDER):
        jets.append(jets[-1] @ slope.T)
    # P_n(1) = 1.
    ends = np.array(jets).sum(axis=2).T
    return locked(derivatives.sum(axis=1).T.copy()), locked(low.copy()), locked(ends)


@lru_cache(maxsize=TABLES_KEPT)
def _at_nodes(terms: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return weights of a quadrature, odd and even Legendre polynomials there, (size / 2, m)."""
    times, weights = half_quadrature(np.array([complex(TERMS[terms])]))
    return locked(weights), *_parities(times - 1.0, _size(terms))


@lru_cache(maxsize=TABLES_KEPT)
def _on_grid(terms: int, intervals: int) -> tuple[FloatArray, FloatArray]:
    """Return the same at the first half of even times, the middle included."""
    places = 2.0 * np.arange(intervals // 2 + 1.0) / intervals - 1.0
    return _parities(places, _size(terms))


@lru_cache(maxsize=TABLES_KEPT)
def _velocities(terms: int, intervals: int) -> FloatArray:
    """Return w' of the basis at x = 0, h, ..., 1, shape (terms + 1, intervals + 1)."""
    values = legendre_values(np.linspace(0.0, 1.0, intervals + 1), _size(terms))
    return locked(series_basis(terms).derivatives[JET_ORDER + 1].T @ values)


def _size(terms: int) -> int:
    """Return how many Legendre polynomials a basis consists of."""
    return int(series_basis(terms).derivatives.shape[1])


def _parities(places: FloatArray, size: int) -> tuple[FloatArray, FloatArray]:
    """Return odd and even Legendre polynomials at some places."""
    values = legendre_values(places, size)
    return locked(values[1::2].copy()), locked(values[::2].copy())


@dataclass(frozen=True, kw_only=True, eq=False)
class UnitSeries:
    """
    Unit motions with equally many terms, as `unit_motion` finds them one by one.

    Attributes
    ----------
    amplitudes
        Of the changes and, last, of the law of least degree, which is 1, shape (p, terms + 1).
    certificates
        Their quality, cost and ends.

    """

    amplitudes: FloatArray
    certificates: Certificates

    @classmethod
    def of(cls, coefficients: FloatArray, terms: int) -> 'UnitSeries':
        """
        Return the unit motions of equations.

        Parameters
        ----------
        coefficients
            a_0 ... a_6 in normalised time, shape (p, 7) [-].
        terms
            How many terms a law has, one of `TERMS`.

        Raises
        ------
        numpy.linalg.LinAlgError
            An equation is singular in double precision.

        """
        amplitudes, cost = solved(coefficients, terms)
        certificates = Certificates(
            coefficients=coefficients,
            **quality(coefficients, *probed(amplitudes))._asdict(),
            costate=cost,
            ends=_ends(coefficients, amplitudes),
        )
        return cls(amplitudes=amplitudes, certificates=certificates)

    @property
    def terms(self) -> int:
        """Return the number of terms of each motion, without the law of least degree."""
        return int(self.amplitudes.shape[1]) - 1

    def chosen(self, rows: IntArray) -> 'UnitSeries':
        """Return some of the motions."""
        return UnitSeries(
            amplitudes=self.amplitudes[rows], certificates=self.certificates.chosen(rows)
        )

    def means(self, rows: FloatArray) -> Mean:
        """Return mean squares and peaks, as `UnitMotion.mean`, rows of shape (p, m, 7)."""
        odd, even = self._combined(rows)
        _, at_odd, at_even = _at_nodes(self.terms)
        degrees = np.arange(float(2 * odd.shape[2]))
        square = odd**2 @ (1.0 / (2.0 * degrees[1::2] + 1.0))
        square += even**2 @ (1.0 / (2.0 * degrees[::2] + 1.0))
        return Mean(
            square, (np.abs(_sums(odd, at_odd)) + np.abs(_sums(even, at_even))).max(axis=2)
        )

    def at_nodes(self, rows: FloatArray) -> Iterator[Nodes]:
        """Return combinations of derivatives at the nodes of a quadrature, rows (p, m, 7)."""
        odd, even = self._combined(rows)
        weights, at_odd, at_even = _at_nodes(self.terms)
        odd, even = _sums(odd, at_odd), _sums(even, at_even)
        yield Nodes(np.arange(len(rows)), weights, (even + odd, even - odd))

    def on_even_grid(self, rows: FloatArray, intervals: int) -> FloatArray:
        """
        Return combinations of derivatives at even times, both ends included.

        Parameters
        ----------
        rows
            Factors of the derivatives 0 to 6, shape (p, m, 7).
        intervals
            Parts of the motion.

        Returns
        -------
        FloatArray
            Shape (p, m, intervals + 1).

        """
        odd, even = self._combined(rows)
        at_odd, at_even = _on_grid(self.terms, intervals)
        return mirrored_grid(
            _sums(odd, at_odd), _sums(even, at_even), rows, self.certificates, intervals
        )

    def transform(self, poles: ComplexArray) -> ComplexArray:
        """
        Return the integral of w' exp(z (1 - x)) over the motion for each z.

        Parameters
        ----------
        poles
            z, none with a positive real part, shape (p, q) [-].

        """
        result = np.empty(poles.shape, dtype=complex)
        parts = transform_intervals(self.certificates.coefficients, poles)
        for intervals in np.unique(parts).tolist():
            rows = np.flatnonzero(parts == intervals)
            ends, chosen = self.certificates.chosen(rows), poles[rows]
            if intervals == 0:
                result[rows] = by_parts(ends, chosen)
            else:
                velocities = self.amplitudes[rows] @ _velocities(self.terms, intervals)
                result[rows] = trapezoid(velocities, ends, chosen)
        return result

    def _combined(self, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return odd and even Legendre coefficients of combinations, each (p, m, size / 2)."""
        parts = []
        for parity, table in enumerate(_halves(self.terms)):
            orders = rows[..., parity::2]
            coefficients = self.amplitudes @ table
            parts.append(orders @ coefficients.reshape(len(rows), orders.shape[2], -1))
        odd, even = parts
        return odd, even


def _sums(series: FloatArray, values: FloatArray) -> FloatArray:
    """Return sums of polynomials, (p, m, places), of coefficients (p, m, n), as one product."""
    sums: FloatArray = series.reshape(-1, series.shape[2]) @ values
    return sums.reshape(*series.shape[:2], -1)


def _ends(coefficients: FloatArray, amplitudes: FloatArray) -> FloatArray:
    """Return the derivatives 6 to 11 of laws at the end, shape (p, 6)."""
    at_end, low, ends = _at_end(amplitudes.shape[1] - 1)
    jets = amplitudes @ at_end
    parts = (amplitudes @ low).reshape(*coefficients.shape, -1)
    polynomial = np.einsum('pk,pkn->pn', coefficients, parts) @ ends
    more = continued(coefficients, jets[..., None], polynomial[..., None])[:, :-1, 0]
    return np.concatenate([jets[:, -1:], more], axis=1)
