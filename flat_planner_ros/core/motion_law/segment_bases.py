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
Bases of segments between via points: all twelve solutions, on every segment of a path.

A segment needs derivatives up to the eleventh at both ends, since neighbours share the conditions
there ((V4) of docs/derivation.md). In normalised time segments of one path differ in the unit of
time alone: where roots form the same clusters, one segment's solutions are those of another with
powers of a ratio as factors, so that all are evaluated at once.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

from flat_planner_ros.core.arm import ComplexArray, FloatArray, locked
from flat_planner_ros.core.motion_law.basis import (
    ALTERNATING,
    block_of,
    growth_of,
    SOLUTIONS,
    Solutions,
)
from flat_planner_ros.core.motion_law.roots import Spectrum
from flat_planner_ros.core.motion_law.spectra import known_spectrum
from flat_planner_ros.core.motion_law.term_sum import Mixed, plain_factors, power_factors, TermSums
from flat_planner_ros.core.motion_law.terms import leibniz, series_derivatives, TOP_ORDER, trimmed
import numpy as np
from numpy.typing import NDArray

IntArray = NDArray[np.int_]

KINDS_KEPT = 256
"""Sets of solutions that are remembered: a few for each set of roots."""

TABLES_KEPT = 64
"""Tables of powers that are remembered."""

OCTAVES = 8.0
"""Range of units of time whose solutions follow from one of them, in powers of two [-]."""

PLACES = (-1.0, 0.0, 1.0)
"""Start, middle and end of a segment in normalised time."""

_MIRRORED = np.tile(ALTERNATING, 2)


class BasisGroup(NamedTuple):
    """
    Segments whose roots form the same clusters.

    Attributes
    ----------
    kind
        Their solutions in one unit of time.
    segments
        Which ones, ascending, shape (s,).
    ratios
        Their roots in terms of those of the kind, shape (s,) [-].

    """

    kind: '_Kind'
    segments: IntArray
    ratios: FloatArray

    def sums(self, amplitudes: FloatArray) -> TermSums:
        """Return combinations of the solutions on these segments, amplitudes (s, 12)."""
        return self.kind.sums(self.ratios, amplitudes)


class SegmentBases(NamedTuple):
    """
    Solutions on all segments of a path, each in normalised time x from -1 to 1.

    Attributes
    ----------
    groups
        Segments with the same clusters.
    places
        Derivatives 0 to 11 of every solution at x = -1, 0 and 1, shape (3, p, 12, 12) [-].
    rates
        How fast solutions of one parity grow with the order of the derivative, ascending, at
        least 1, shape (p, 6) [-].

    """

    groups: tuple[BasisGroup, ...]
    places: FloatArray
    rates: FloatArray


def segment_bases(coefficients: FloatArray, scales: FloatArray) -> SegmentBases:
    """
    Return the solutions of an equation in several units of time.

    Parameters
    ----------
    coefficients
        a_0 ... a_6 in a unit of time in which its roots are of size one, shape (7,).
    scales
        Half the length of every segment in this unit, shape (p,) [-].

    """
    reference = coefficients.tobytes()
    # Without a root but zero all units are the same.
    scales = scales if coefficients[:-1].any() else np.ones_like(scales)
    octaves = np.rint(np.log2(scales) / OCTAVES).tolist()
    members: dict[tuple[bytes, float], list[int]] = {}
    for index, alike in enumerate(
        zip(known_spectrum(reference).groupings(scales), octaves, strict=True)
    ):
        members.setdefault(alike, []).append(index)
    places = np.empty((len(PLACES), len(scales), SOLUTIONS, SOLUTIONS))
    rates = np.empty((len(scales), SOLUTIONS // 2))
    groups = []
    for (grouping, octave), indices in members.items():
        kind, segments = known_kind(reference, grouping, octave), np.array(indices)
        ratios = scales[segments] / kind.unit
        places[:, segments] = kind.at_places(ratios)
        rates[segments] = np.maximum(1.0, np.multiply.outer(ratios, kind.growths))
        groups.append(BasisGroup(kind, segments, ratios))
    return SegmentBases(tuple(groups), places, rates)


class _Kind:
    """
    Solutions of one grouping of the roots, in a unit of time.

    Parameters
    ----------
    spectrum, grouping
        The roots, and which of them share a cluster.
    unit
        All roots are multiplied by it [-].

    """

    def __init__(self, spectrum: Spectrum, grouping: bytes, unit: float) -> None:
        """Sort the clusters by what their solutions are made of."""
        self.unit = unit
        self._mixed: list[tuple[Solutions, bool]] = []
        alone: list[complex] = []
        growths: list[float] = []
        parts: list[tuple[str, int]] = []
        # The solutions of slow roots come first.
        clusters = sorted(spectrum.grouped(grouping, unit), key=lambda each: abs(each.centre))
        for cluster in clusters:
            even = block_of(cluster, 1.0).solutions
            growths += [growth_of(cluster)] * even.size
            if even.series is None:
                # Each solution by itself, not odd and even ones: a boundary layer stays at its
                # own end.
                parts += [('alone', even.size), ('alone', even.size)]
                alone.append(even.rate)
                continue
            twin = even if even.origin else block_of(cluster, -1.0).solutions
            parts += [
                ('mixed' if cluster.centre else 'powers', each.size) for each in (even, twin)
            ]
            if cluster.centre:
                self._mixed += [(even, False), (twin, bool(even.origin))]
            else:
                self._powers = _Powers(even, twin)
        self.growths: FloatArray = np.sort(growths)
        self._alone = np.array(alone, dtype=complex)
        self._order = self._positions(parts)

    def _positions(self, parts: Sequence[tuple[str, int]]) -> IntArray:
        """Return the columns of solutions in the order in which they are evaluated."""
        powers, widest = len(self._powers.series), 2
        nexts = {'powers': 0, 'alone': powers, 'mixed': powers + 2 * widest * len(self._alone)}
        positions: list[int] = []
        for name, size in parts:
            positions += range(nexts[name], nexts[name] + size)
            nexts[name] += widest if name == 'alone' else size
        return np.array(positions)

    def at_places(self, ratios: FloatArray) -> FloatArray:
        """
        Return derivatives of all solutions at the start, in the middle and at the end.

        Parameters
        ----------
        ratios
            Of segments' units to that of the kind, shape (s,).

        Returns
        -------
        FloatArray
            Orders 0 to 11, shape (3, s, 12, 12).

        """
        tables = [self._powers.at_places(ratios)]
        if len(self._alone):
            tables.append(_exponentials(np.multiply.outer(ratios, self._alone)))
        for solutions, is_image in self._mixed:
            scaled, rates = _scaled(solutions, ratios), _rates(solutions, ratios)
            shifted = tuple(place - solutions.origin for place in PLACES)
            plain = scaled @ _power_derivatives(scaled.shape[-1], shifted)[:, None]
            factors = leibniz(rates, SOLUTIONS - 1).swapaxes(1, 2)
            sizes = np.exp(np.multiply.outer(shifted, rates))[..., None, None]
            table = np.real(sizes * (plain @ factors))
            tables.append(_MIRRORED * table[::-1] if is_image else table)
        return np.concatenate(tables, axis=2)[:, :, self._order].swapaxes(2, 3)

    def sums(self, ratios: FloatArray, amplitudes: FloatArray) -> TermSums:
        """
        Return combinations of the solutions.

        Parameters
        ----------
        ratios
            As for `at_places`.
        amplitudes
            Of all solutions, shape (s, 12).

        """
        powers, count = len(self._powers.series), len(self._alone)
        sizes = [solutions.size for solutions, _ in self._mixed]
        placed = np.zeros((len(ratios), powers + 4 * count + sum(sizes)))
        placed[:, self._order] = amplitudes
        at_ends = placed[:, powers : powers + 4 * count].reshape(len(ratios), count, 2, 2)
        decays = np.multiply.outer(ratios, self._alone)
        series = self._powers.combined(ratios, placed[:, :powers])
        others = []
        first = powers + 4 * count
        for (solutions, is_image), size in zip(self._mixed, sizes, strict=True):
            part = placed[:, None, first : first + size]
            coefficients = (part @ _scaled(solutions, ratios))[:, 0]
            others.append(_terms(solutions, ratios, coefficients, is_image))
            first += size
        return TermSums(
            decays=decays,
            # Real part, and minus the imaginary one; those of images count from the start.
            factors=plain_factors(
                decays,
                (at_ends[..., 0] - 1j * at_ends[..., 1])[..., ::-1],
                power_factors(series),
            ),
            others=tuple(zip(*others, strict=True)) if others else ((),) * len(ratios),
        )


@lru_cache(maxsize=KINDS_KEPT)
def known_kind(reference: bytes, grouping: bytes, octave: float) -> _Kind:
    """Return the solutions of an equation in the middle of some octaves of units of time."""
    return _Kind(known_spectrum(reference), grouping, 2.0 ** (OCTAVES * octave))


class _Powers:
    """Power series about the middle: the even solutions around zero, then the odd ones."""

    def __init__(self, even: Solutions, odd: Solutions) -> None:
        """Put both in one table, and see whether they are mere powers."""
        parts = [np.real(each.series) for each in (even, odd) if each.series is not None]
        terms = max(part.shape[1] for part in parts)
        padded = [np.pad(part, ((0, 0), (0, terms - part.shape[1]))) for part in parts]
        self.series: FloatArray = np.concatenate(padded)
        self._exponents = _exponents(self.series)
        self._is_fixed = not self.series[self._exponents > 0.0].any()
        self._fixed = self.series @ _power_derivatives(terms, PLACES)

    def at_places(self, ratios: FloatArray) -> FloatArray:
        """Return derivatives 0 to 11 at `PLACES`, shape (3, s, functions, 12)."""
        if self._is_fixed:
            shape = (len(PLACES), len(ratios), *self._fixed.shape[1:])
            return np.broadcast_to(self._fixed[:, None], shape)
        scaled = self._scaled(ratios)
        table: FloatArray = scaled @ _power_derivatives(scaled.shape[-1], PLACES)[:, None]
        return table

    def combined(self, ratios: FloatArray, amplitudes: FloatArray) -> FloatArray:
        """Return the coefficients of combinations, amplitudes (s, functions), shape (s, terms)."""
        if self._is_fixed:
            return amplitudes @ self.series
        series: FloatArray = (amplitudes[:, None] @ self._scaled(ratios))[:, 0]
        return series

    def _scaled(self, ratios: FloatArray) -> FloatArray:
        """Return the series in other units of time, shape (s, functions, terms)."""
        scaled: FloatArray = self.series * ratios[:, None, None] ** self._exponents
        return scaled


def _exponents(series: FloatArray | ComplexArray) -> FloatArray:
    """Return how coefficients of unit solutions grow with the unit of time."""
    # The j-th unit solution has the power j, its first one, with the same factor in each unit.
    lowest = np.argmax(series != 0.0, axis=1)
    exponents: FloatArray = np.maximum(np.arange(float(series.shape[1])) - lowest[:, None], 0.0)
    return exponents


def _scaled(solutions: Solutions, ratios: FloatArray) -> ComplexArray:
    """Return the series of solutions in other units of time, shape (s, functions, terms)."""
    series: ComplexArray = np.array(solutions.series, dtype=np.complex128)
    scaled: ComplexArray = series * ratios[:, None, None] ** _exponents(series)
    return scaled


def _rates(solutions: Solutions, ratios: FloatArray) -> ComplexArray:
    """Return the rates of solutions in other units of time, shape (s,)."""
    rates: ComplexArray = np.multiply(solutions.rate, ratios, dtype=np.complex128)
    return rates


def _exponentials(rates: ComplexArray) -> FloatArray:
    """
    Return derivatives 0 to 11 of single exponentials at `PLACES`.

    Real and imaginary part of each as it grows towards the end, then of its mirror image, for
    rates of shape (s, r): shape (3, s, 4 r, 12).
    """
    powers = np.empty((*rates.shape, SOLUTIONS), dtype=complex)
    powers[..., 0] = 1.0
    powers[..., 1:] = rates[..., None]
    np.multiply.accumulate(powers, axis=-1, out=powers)
    sizes = np.exp(np.multiply.outer(np.array(PLACES) - 1.0, rates))
    growing = sizes[..., None] * powers
    table = np.empty((len(PLACES), *rates.shape, 2, 2, SOLUTIONS))
    table[..., 0, 0, :], table[..., 0, 1, :] = growing.real, growing.imag
    table[..., 1, :, :] = _MIRRORED * table[::-1, ..., 0, :, :]
    return table.reshape(len(PLACES), len(rates), -1, SOLUTIONS)


def _terms(
    solutions: Solutions, ratios: FloatArray, coefficients: ComplexArray, is_image: bool
) -> list[Mixed]:
    """Return the terms of given coefficients, (s, terms), mirrored for images."""
    sign = -1 if is_image else 1
    rates, origin = _rates(solutions, float(sign) * ratios), sign * solutions.origin
    signed = coefficients * float(sign) ** np.arange(coefficients.shape[1])
    table = series_derivatives(signed, TOP_ORDER) @ leibniz(rates, TOP_ORDER).swapaxes(1, 2)
    tables = trimmed(table, 2.0 if origin else 1.0)
    return [Mixed(complex(r), origin, table) for r, table in zip(rates, tables, strict=True)]


@lru_cache(maxsize=TABLES_KEPT)
def _power_derivatives(count: int, places: tuple[float, ...]) -> FloatArray:
    """Return derivatives 0 to 11 of ascending powers at places, shape (places, count, 12)."""
    table = np.zeros((len(places), count, SOLUTIONS))
    table[:, :, 0] = np.power.outer(places, np.arange(float(count)))
    for order in range(1, SOLUTIONS):
        # The derivative of u^k is k u^(k - 1).
        table[:, 1:, order] = np.arange(1.0, count) * table[:, :-1, order - 1]
    return locked(table)
