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
from dataclasses import dataclass
from functools import lru_cache
from math import ceil, log2
from typing import NamedTuple

from flat_planner_ros.core.arm import ComplexArray, FloatArray, locked
from flat_planner_ros.core.motion_law.basis import (
    ALTERNATING,
    block_of,
    combined,
    CONDITIONS,
    growth_of,
    SOLUTIONS,
    Solutions,
)
from flat_planner_ros.core.motion_law.roots import Spectrum
from flat_planner_ros.core.motion_law.terms import leibniz, Term
import numpy as np

BASES_KEPT = 256
"""Bases that are remembered: those of several paths of fifty via points."""

SPECTRA_KEPT = 64
"""Sets of roots that are remembered, one for each combination of arm and cost."""

TABLES_KEPT = 64
"""Tables of powers that are remembered."""

OCTAVES = 8.0
"""Range of units of time whose solutions follow from one of them, in powers of two [-]."""

PLACES = (-1.0, 0.0, 1.0)
"""Start, middle and end of a segment in normalised time."""

_MIRRORED = np.tile(ALTERNATING, 2)

_ALONE = np.array([[1.0 + 0.0j], [-1j]])
"""Series of one exponential: its real and its imaginary part."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SegmentBasis:
    """
    Solutions on a segment, in normalised time x from -1 to 1.

    Attributes
    ----------
    groups
        Blocks of solutions, each with whether its mirror image is meant; columns below follow
        this order.
    at_start, at_middle, at_end
        Derivatives 0 to 11 of every solution at x = -1, 0 and 1, shape (12, 12) [-].
    rates
        How fast solutions of one parity grow with the order of the derivative, ascending, at
        least 1, shape (6,) [-].

    """

    groups: tuple[tuple[Solutions, bool], ...]
    at_start: FloatArray
    at_middle: FloatArray
    at_end: FloatArray
    rates: FloatArray

    def combined(self, amplitudes: FloatArray) -> tuple[Term, ...]:
        """Return the terms of a combination of the solutions, amplitudes of shape (12,)."""
        terms = combined((block for block, _ in self.groups), amplitudes.tolist())
        return tuple(
            term.mirrored(1.0) if is_image else term
            for term, (_, is_image) in zip(terms, self.groups, strict=True)
        )


def segment_bases(keys: Sequence[bytes], reference: bytes) -> list[SegmentBasis]:
    """
    Return the solutions of an equation in several units of time.

    Parameters
    ----------
    keys
        The bytes of the coefficients a_0 ... a_6 in the normalised time of every segment.
    reference
        These coefficients in another unit of time, common to all segments of a path: in it the
        roots are found.

    """
    slots = [known_basis(key, reference) for key in keys]
    missing = {key: slot for key, slot in zip(keys, slots, strict=True) if not slot}
    spectrum = _spectrum(reference)
    groups: dict[tuple[bytes, int], list[tuple[float, list[SegmentBasis]]]] = {}
    for scale, slot in zip(_scales(list(missing), reference), missing.values(), strict=True):
        alike = spectrum.grouping(scale), ceil(log2(scale) / OCTAVES)
        groups.setdefault(alike, []).append((scale, slot))
    for group in groups.values():
        scales = np.array([scale for scale, _ in group])
        for (_, slot), basis in zip(group, _alike(spectrum, scales), strict=True):
            slot.append(basis)
    return [slot[0] for slot in slots]


@lru_cache(maxsize=BASES_KEPT)
def known_basis(key: bytes, reference: bytes) -> list[SegmentBasis]:
    """Return a list that holds a basis as soon as it is known, to be filled if it is empty."""
    del key, reference
    return []


@lru_cache(maxsize=SPECTRA_KEPT)
def _spectrum(reference: bytes) -> Spectrum:
    """Return the roots of an equation in its reference unit of time."""
    return Spectrum(np.frombuffer(reference))


def _scales(keys: Sequence[bytes], reference: bytes) -> list[float]:
    """Return the roots of each equation in units of those of the reference."""
    known = np.frombuffer(reference)
    # The lowest coefficient carries the highest power of the unit, and least of its rounding.
    lowest = int(np.flatnonzero(known)[0])
    if lowest == CONDITIONS:
        return [1.0] * len(keys)
    ratios = np.array([np.frombuffer(key)[lowest] for key in keys]) / known[lowest]
    scales: list[float] = (ratios ** (0.5 / (CONDITIONS - lowest))).tolist()
    return scales


def _alike(spectrum: Spectrum, scales: FloatArray) -> list[SegmentBasis]:
    """Return the bases of units of time in which the roots form the same clusters."""
    ratios = scales / scales[0]
    found = spectrum.clusters(float(scales[0]))
    found.sort(key=lambda cluster: abs(cluster.centre))
    blocks: list[tuple[_Family, bool]] = []
    tables: list[FloatArray] = []
    growths: list[float] = []
    for cluster in found:
        even = block_of(cluster, 1.0).solutions
        growths += [growth_of(cluster)] * even.size
        if even.origin == 0:
            for solutions in (even, block_of(cluster, -1.0).solutions):
                family = _Family.of(solutions, ratios)
                blocks.append((family, False))
                tables.append(family.at(PLACES))
            continue
        family = _Family.of(even, ratios)
        at_places = family.at(tuple(place - 1.0 for place in PLACES))
        # Each solution by itself, not odd and even ones: a boundary layer stays at its own end.
        blocks += [(family, False), (family, True)]
        tables += [at_places, _MIRRORED * at_places[::-1]]
    places = np.concatenate(tables, axis=2).swapaxes(2, 3)
    rates = np.maximum(1.0, np.multiply.outer(ratios, np.sort(growths)))
    return [
        SegmentBasis(
            groups=tuple([(family.solutions(index), is_image) for family, is_image in blocks]),
            at_start=places[0, index],
            at_middle=places[1, index],
            at_end=places[2, index],
            rates=rates[index],
        )
        for index in range(len(scales))
    ]


class _Family(NamedTuple):
    """
    The solutions of one cluster in several units of time.

    Attributes
    ----------
    rates
        Of their terms, shape (s,) [-].
    origin
        That of all terms.
    series
        Coefficients of ascending powers, shape (s, functions, powers).
    is_alone
        Whether they are the real and the imaginary part of one exponential.

    """

    rates: ComplexArray
    origin: int
    series: FloatArray | ComplexArray
    is_alone: bool

    @classmethod
    def of(cls, first: Solutions, ratios: FloatArray) -> '_Family':
        """Return the family whose first unit, divided by the ratios (s,), gives the others."""
        rates: ComplexArray = np.multiply(first.rate, ratios, dtype=np.complex128)
        if first.series is None:
            alone = np.broadcast_to(_ALONE[: first.size], (len(ratios), first.size, 1))
            return cls(rates, first.origin, alone, True)
        # The j-th unit solution has the power j, its first one, with the same factor in each unit.
        lowest = np.argmax(first.series != 0.0, axis=1)
        exponents = np.arange(float(first.series.shape[1])) - lowest[:, None]
        series = first.series * ratios[:, None, None] ** np.maximum(exponents, 0.0)
        return cls(rates, first.origin, series, False)

    def solutions(self, index: int) -> Solutions:
        """Return those in one of the units."""
        series = None if self.is_alone else self.series[index]
        return Solutions(complex(self.rates[index]), self.origin, series)

    def at(self, places: tuple[float, ...]) -> FloatArray:
        """Return derivatives 0 to 11 at distances from the origin, (places, s, functions, 12)."""
        plain = self.series @ _power_derivatives(self.series.shape[2], places)[:, None]
        if not self.rates.any():
            return np.real(plain)
        factors = leibniz(self.rates, SOLUTIONS - 1).swapaxes(1, 2)
        sizes = np.exp(np.multiply.outer(places, self.rates))[..., None, None]
        return np.real(sizes * (plain @ factors))


@lru_cache(maxsize=TABLES_KEPT)
def _power_derivatives(count: int, places: tuple[float, ...]) -> FloatArray:
    """Return derivatives 0 to 11 of ascending powers at places, shape (places, count, 12)."""
    table = np.zeros((len(places), count, SOLUTIONS))
    table[:, :, 0] = np.power.outer(places, np.arange(float(count)))
    for order in range(1, SOLUTIONS):
        # The derivative of u^k is k u^(k - 1).
        table[:, 1:, order] = np.arange(1.0, count) * table[:, :-1, order - 1]
    return locked(table)
