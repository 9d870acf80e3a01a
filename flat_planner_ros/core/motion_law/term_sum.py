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
Sums of terms, evaluated for all derivatives at once.

Nearly all terms are plain exponentials anchored at an end, or powers about the middle, so that one
matrix product gives every derivative at every time; the others are summed one by one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

from flat_planner_ros.core.arm import ComplexArray, FloatArray, locked
from flat_planner_ros.core.motion_law.terms import series_derivatives, Term, TOP_ORDER, trimmed
import numpy as np

VANISHING = 100.0
"""Decay from which an exponential on an even grid is zero [-]."""

BLOCK = 64
"""Times of an even grid whose exponentials are multiples of one small table."""

CHUNK = 32 * BLOCK
"""Times of an even grid evaluated together, few enough for the cache of the processor."""

BLOCKS_KEPT = 4
"""Blocks of even grids, and tables of powers there, that are remembered."""

BASES_KEPT = 8
"""Tables of exponentials and powers that are remembered: goals of one duration share them."""

FEW = 16
"""Number of times below which such a table is formed sooner than found."""


class Mixed(NamedTuple):
    """
    A term with both an exponential and powers.

    Attributes
    ----------
    rate, origin
        As those of a `Term`.
    table
        Coefficients of its derivatives, as `Term.derivatives`, shape (terms, orders).

    """

    rate: complex
    origin: int
    table: ComplexArray


@dataclass(frozen=True, kw_only=True, eq=False)
class TermSum:
    """
    Sum of terms, sorted by the way they are evaluated; all tables are in normalised time x.

    Attributes
    ----------
    decays
        Rates d of the exponentials exp(-d u) that fall with the distance u from an end, shape
        (m,).
    factors
        For every derivative: of Re and -Im of each of these exponentials, with u = x + 1 and with
        u = 1 - x, and of ascending powers of x, shape (orders, 4 m + terms).
    others
        The terms that are neither.

    """

    decays: ComplexArray
    factors: FloatArray
    others: tuple[Mixed, ...]

    def at(
        self, distances: FloatArray, order: int, powers: FloatArray | None = None
    ) -> FloatArray:
        """
        Return the sum and its derivatives in x.

        Parameters
        ----------
        distances
            From the start and from the end, x + 1 and 1 - x, both exact, shape (2, m).
        order
            Highest derivative wanted.
        powers
            `ascending_powers` of x, as many as the sum has terms or more; formed if not given.

        Returns
        -------
        FloatArray
            Row k holds the k-th derivative, shape (order + 1, m).

        """
        result = plain_sums(self.decays, self.factors[: order + 1], distances, powers)
        if self.others:
            self.add_others(result, distances)
        return result

    def fill_odd_grid(self, table: FloatArray, scales: FloatArray) -> None:
        """Write an odd sum and its derivatives in x at even times, as `Sum.fill_odd_grid`."""
        orders = len(table)
        intervals = table.shape[1] - 1
        half = intervals // 2 + 1
        count = len(self.decays)
        size, places, x = grid_blocks(intervals)
        factors = scales[:, None] * self.factors[:orders]
        amplitudes = factors[:, None, : 4 * count].view(complex)
        with np.errstate(under='ignore'):
            tables = self._grid_tables(size, places) if count else None
            for start in range(0, half, CHUNK):
                stop = min(start + CHUNK, half)
                powers = _grid_powers(factors.shape[1] - 4 * count, intervals, start)
                part = factors[:, 4 * count :] @ powers
                if tables is not None:
                    fine, coarse = tables
                    blocks = coarse[start // size : -(-stop // size)]
                    scaled = np.multiply(amplitudes, blocks, order='C').view(float)
                    product = scaled.reshape(orders * len(blocks), 4 * count) @ fine
                    part += product.reshape(orders, -1)[:, : stop - start]
                if self.others:
                    distances = np.array([1.0 + x[start:stop], 1.0 - x[start:stop]])
                    self.add_others(part, distances, scales)
                write_mirrored(table, part, start)

    def _grid_tables(self, size: int, places: FloatArray) -> tuple[FloatArray, ComplexArray]:
        """
        Return the exponentials of an even grid in two tables, whose product they are.

        Returns
        -------
        tuple[FloatArray, ComplexArray]
            Re and -Im within a block, shape (4 m, size), and those of the blocks, shape
            (blocks, 2 m).

        """
        exponents = -self.decays[:, None] * places
        fall = np.exp(exponents)
        # Else the product of the tables, or a multiple of it, would leave the range of doubles.
        fall[exponents.real < -VANISHING] = 0.0
        fine = np.empty((len(fall), 2, 2, size))
        split_parts(fall[:, :size], fine[:, 0])
        fine[:, 1] = fine[:, 0, :, ::-1]
        blocks = (len(places) - size) // 2
        coarse = fall[:, size:].reshape(2 * len(fall), blocks).T
        return fine.reshape(4 * len(fall), size), coarse

    @np.errstate(under='ignore')
    def add_others(
        self, result: FloatArray, distances: FloatArray, scales: FloatArray | None = None
    ) -> None:
        """
        Add the terms that have both an exponential and powers.

        Parameters
        ----------
        result
            What they are added to, derivatives in ascending order, shape (orders, m).
        distances
            From the start and from the end, as in `at`.
        scales
            Factors of the derivatives, shape (orders,).

        """
        after_start, before_end = distances
        for rate, origin, table in self.others:
            if origin == 0:
                u = 0.5 * (after_start - before_end)
            else:
                u = -before_end if origin > 0 else after_start
            powers = np.empty((len(table), len(u)))
            _fill_powers(powers, u)
            values = (table[:, : len(result)].T @ powers) * np.exp(rate * u)
            result += values.real if scales is None else scales[:, None] * values.real


@dataclass(frozen=True, kw_only=True, eq=False)
class TermSums:
    """
    Several sums of as many terms each.

    Attributes
    ----------
    decays
        As those of a `TermSum`, of each sum, shape (s, m).
    factors
        Shape (s, orders, 4 m + terms).
    others
        Those of each sum, s of them.

    """

    decays: ComplexArray
    factors: FloatArray
    others: Sequence[tuple[Mixed, ...]]

    def at(self, distances: FloatArray) -> FloatArray:
        """Return all sums and all their derivatives, as `TermSum.at`, shape (s, orders, m)."""
        result = plain_sums(self.decays, self.factors, distances)
        if any(self.others):
            for values, single in zip(result, self.singles(), strict=True):
                single.add_others(values, distances)
        return result

    def singles(self) -> list[TermSum]:
        """Return the sums one by one."""
        parts = zip(self.decays, self.factors, self.others, strict=True)
        return [TermSum(decays=d, factors=f, others=others) for d, f, others in parts]


def plain_sums(
    decays: ComplexArray,
    factors: FloatArray,
    distances: FloatArray,
    powers: FloatArray | None = None,
) -> FloatArray:
    """
    Return sums of terms, and their derivatives in x, without those that are neither.

    Parameters
    ----------
    decays, factors
        As those of a `TermSum`, of one or several sums, shape (..., m) and
        (..., orders, 4 m + terms).
    distances
        From the start and from the end, x + 1 and 1 - x, both exact, shape (2, places).
    powers
        As `TermSum.at` takes them.

    Returns
    -------
    FloatArray
        Shape (..., orders, places).

    """
    terms = factors.shape[-1]
    if powers is None and decays.ndim == 1 and FEW <= distances.shape[1] <= CHUNK:
        basis = _kept_basis(decays.tobytes(), distances.tobytes(), terms)
    else:
        basis = _basis(decays, distances, terms, powers)
    sums: FloatArray = factors @ basis
    return sums


@lru_cache(maxsize=BASES_KEPT)
def _kept_basis(decays: bytes, distances: bytes, terms: int) -> FloatArray:
    """Return a basis by the bytes of what it depends on."""
    places = np.frombuffer(distances).reshape(2, -1)
    return locked(_basis(np.frombuffer(decays, dtype=complex), places, terms))


def _basis(
    decays: ComplexArray, distances: FloatArray, terms: int, powers: FloatArray | None = None
) -> FloatArray:
    """Return what the factors of plain sums multiply, as `plain_sums`, (..., terms, places)."""
    count, places = decays.shape[-1], distances.shape[1]
    if count == 0 and powers is not None:
        return powers[:terms]
    basis = np.empty((*decays.shape[:-1], terms, places))
    # Far from its end an exponential vanishes: this underflow is the right answer.
    with np.errstate(under='ignore'):
        if count:
            fall = -decays[..., None, None] * distances
            np.exp(fall, out=fall)
            split_parts(fall, basis[..., : 4 * count, :].reshape(*decays.shape, 2, 2, places))
        rows = basis.swapaxes(-2, 0)[4 * count :]
        if powers is None:
            _fill_powers(rows, 0.5 * (distances[0] - distances[1]))
        else:
            rows[:] = powers[: len(rows)]
    return basis


def term_sum(terms: Sequence[Term], order: int = TOP_ORDER) -> TermSum:
    """Return the sum of terms, ready for derivatives up to an order."""
    series: list[tuple[complex, ...]] = []
    others: list[Mixed] = []
    ends: dict[complex, list[complex]] = {}  # decay: amplitudes at start and end
    for term in terms:
        rate, origin, coefficients = term
        if origin == 0 and rate == 0.0:
            series.append(coefficients)
        elif origin != 0 and len(coefficients) == 1:
            amplitudes = ends.setdefault(origin * rate, [0j, 0j])
            amplitudes[0 if origin < 0 else 1] += coefficients[0]
        else:
            others.append(Mixed(rate, origin, term.derivatives(order)))
    total = np.zeros(max(map(len, series), default=0))
    for coefficients in series:
        total[: len(coefficients)] += np.real(coefficients)
    decays = np.array(list(ends), dtype=complex)
    at_ends = np.array(list(ends.values()), dtype=complex).reshape(-1, 2)
    factors = plain_factors(decays, at_ends, power_factors(total, order))
    return TermSum(decays=decays, factors=factors, others=tuple(others))


def power_factors(series: FloatArray, order: int = TOP_ORDER) -> FloatArray:
    """
    Return the factors of powers in the derivatives of power series.

    Parameters
    ----------
    series
        Coefficients of ascending powers, shape (..., terms).
    order
        Highest derivative.

    Returns
    -------
    FloatArray
        Shape (..., order + 1, terms), without the powers that no derivative needs.

    """
    return trimmed(series_derivatives(series, order), 1.0).swapaxes(-1, -2)


def plain_factors(
    decays: ComplexArray, amplitudes: ComplexArray, powers: FloatArray
) -> FloatArray:
    """
    Return the factors of a `TermSum`, of one or several sums.

    Parameters
    ----------
    decays
        As those of a `TermSum`, shape (..., m).
    amplitudes
        Of the exponentials counted from the start and from the end, shape (..., m, 2).
    powers
        Factors of ascending powers of x in every derivative, shape (..., orders, terms).

    Returns
    -------
    FloatArray
        Shape (..., orders, 4 m + terms).

    """
    count = decays.shape[-1]
    factors = np.empty((*powers.shape[:-1], 4 * count + powers.shape[-1]))
    factors[..., 4 * count :] = powers
    if count:
        ends = factors[..., : 4 * count].view(complex).reshape(*powers.shape[:-1], count, 2)
        ends[..., 0, :, :] = amplitudes
        # Counted from the start, an exponential that falls has the rate -d.
        ends[..., 1:, :, 0] = -decays[..., None, :]
        ends[..., 1:, :, 1] = decays[..., None, :]
        np.multiply.accumulate(ends, axis=-3, out=ends)
    return factors


def ascending_powers(distances: FloatArray, count: int) -> FloatArray:
    """Return 1, x, x^2, ... at distances from the start and from the end, shape (count, m)."""
    powers = np.empty((count, distances.shape[1]))
    _fill_powers(powers, 0.5 * (distances[0] - distances[1]))
    return powers


def _fill_powers(table: FloatArray, x: FloatArray) -> None:
    """Write 1, x, x^2, ... into rows."""
    table[:1] = 1.0
    table[1:2] = x
    known = 2
    while known < len(table):
        more = min(known - 1, len(table) - known)
        np.multiply(table[1 : 1 + more], table[known - 1], out=table[known : known + more])
        known += more


def split_parts(fall: ComplexArray, parts: FloatArray) -> None:
    """Write Re and -Im of exponentials, shape (..., m), into a table, shape (..., 2, m)."""
    parts[..., 0, :] = fall.real
    np.negative(fall.imag, out=parts[..., 1, :])


def write_mirrored(table: FloatArray, part: FloatArray, start: int) -> None:
    """Write derivatives of an odd sum, (orders, m), from one of the first times on, and again."""
    times = slice(start, start + part.shape[1])
    mirrored = table[:, ::-1]
    # Derivatives of even order are odd about the middle.
    np.negative(part[::2], out=mirrored[::2, times])
    mirrored[1::2, times] = part[1::2]
    table[:, times] = part


@lru_cache(maxsize=BLOCKS_KEPT)
def grid_blocks(intervals: int) -> tuple[int, FloatArray, FloatArray]:
    """
    Return the first half of an even grid, the middle included, in blocks.

    Returns
    -------
    tuple[int, FloatArray, FloatArray]
        Times in a block; distances of the first block's times from the start, then of the blocks'
        first times from the start, then of their last ones from the end, shape
        (size + 2 blocks,); normalised times, exactly odd about the middle, shape (half,).

    """
    half = intervals // 2 + 1
    size = min(BLOCK, half)
    first = np.arange(0, half, size)
    index = np.concatenate([np.arange(size), first, intervals - size + 1 - first])
    x = np.arange(-float(intervals), 2.0 * half - intervals, 2.0) / intervals
    return (size, index * (2.0 / intervals), x)


@lru_cache(maxsize=BLOCKS_KEPT)
def _grid_powers(terms: int, intervals: int, start: int) -> FloatArray:
    """Return 1, x, x^2, ... on the part of an even grid that is evaluated together."""
    x = grid_blocks(intervals)[2][start : start + CHUNK]
    powers = np.empty((terms, len(x)))
    _fill_powers(powers, x)
    return locked(powers)
