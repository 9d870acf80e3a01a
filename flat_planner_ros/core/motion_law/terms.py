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
Terms of a motion law, and their evaluation for all derivatives at once.

A term is an exponential (growing or decaying, perhaps oscillating) times a polynomial: the general
solution of a linear equation with constant coefficients ((24) of docs/derivation.md). Nearly all
are plain exponentials anchored at an end, so that one matrix product gives every derivative at
every time; the others are summed one by one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import pairwise
from math import comb
from typing import NamedTuple, TypeVar

from flat_planner_ros.core.arm import ComplexArray, FloatArray
import numpy as np
from numpy.typing import NDArray

Number = TypeVar('Number', np.float64, np.complex128)

TOP_ORDER = 12
"""Highest derivative of the Euler-Lagrange equation, hence of any table."""

NEGLIGIBLE = 1e-19
"""Share of the largest coefficient of a power series below which its tail is left out [-]."""

VANISHING = 100.0
"""Decay from which an exponential on an even grid is zero [-]."""

BLOCK = 64
"""Times of an even grid whose exponentials are multiples of one small table."""

CHUNK = 32 * BLOCK
"""Times of an even grid evaluated together, few enough for the cache of the processor."""

BLOCKS_KEPT = 4
"""Blocks of even grids that are remembered."""


class Term(NamedTuple):
    """
    Real part of exp(rate (x - origin)) * sum_k coefficients[k] (x - origin)^k.

    Normalised time x runs from -1 to 1. The origin is the end where the term is largest, so that
    no exponential overflows.

    Attributes
    ----------
    rate
        Characteristic root in units of 2 / duration [-].
    origin
        -1, 0 or 1 [-].
    coefficients
        Factors of ascending powers of x - origin [rad].

    """

    rate: complex
    origin: int
    coefficients: tuple[complex, ...]

    def mirrored(self, sign: float) -> 'Term':
        """Return sign times the term run backwards, x -> -x."""
        signs = (sign, -sign)
        coefficients = tuple([signs[k % 2] * c for k, c in enumerate(self.coefficients)])
        return Term(-self.rate, -self.origin, coefficients)

    def derivatives(self, order: int) -> ComplexArray:
        """Return the coefficients of the derivatives in x, shape (terms, order + 1)."""
        plain = series_derivatives(np.array(self.coefficients), order)
        return _trimmed(plain @ leibniz(self.rate, order).T, 2.0 if self.origin else 1.0)


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
        Terms with both an exponential and powers, with their `Term.derivatives`.

    """

    decays: ComplexArray
    factors: FloatArray
    others: tuple[tuple[Term, ComplexArray], ...]

    def at(self, distances: FloatArray, order: int) -> FloatArray:
        """
        Return the sum and its derivatives in x.

        Parameters
        ----------
        distances
            From the start and from the end, x + 1 and 1 - x, both exact, shape (2, m).
        order
            Highest derivative wanted.

        Returns
        -------
        FloatArray
            Row k holds the k-th derivative, shape (order + 1, m).

        """
        count = len(self.decays)
        places = distances.shape[1]
        basis = np.empty((self.factors.shape[1], places))
        # Far from its end an exponential vanishes: this underflow is the right answer.
        with np.errstate(under='ignore'):
            if count:
                fall = -self.decays[:, None, None] * distances
                np.exp(fall, out=fall)
                _split(fall, basis[: 4 * count].reshape(count, 2, 2, places))
            _fill_powers(basis[4 * count :], 0.5 * (distances[0] - distances[1]))
            result: FloatArray = self.factors[: order + 1] @ basis
            if self.others:
                self._add_others(result, distances)
        return result

    def fill_odd_grid(self, table: FloatArray, scales: FloatArray) -> None:
        """
        Write an odd sum and its derivatives in x at even times, both ends included.

        Parameters
        ----------
        table
            Its rows take the derivatives in ascending order, shape (orders, m), m > 1.
        scales
            Factors of the derivatives, shape (orders,).

        """
        orders = len(table)
        intervals = table.shape[1] - 1
        half = intervals // 2 + 1
        count = len(self.decays)
        size, places, x = grid_blocks(intervals)
        factors = scales[:, None] * self.factors[:orders]
        amplitudes = factors[:, None, : 4 * count].view(complex)
        signs = _odd_signs(orders)
        mirrored = table[:, ::-1]
        with np.errstate(under='ignore'):
            fine, coarse = self._grid_tables(size, places)
            for start in range(0, half, CHUNK):
                stop = min(start + CHUNK, half)
                blocks = coarse[start // size : -(-stop // size)]
                powers = np.empty((factors.shape[1] - 4 * count, stop - start))
                _fill_powers(powers, x[start:stop])
                part = factors[:, 4 * count :] @ powers
                if count:
                    scaled = (amplitudes * blocks).view(float)
                    product = scaled.reshape(orders * len(blocks), 4 * count) @ fine
                    part += product.reshape(orders, -1)[:, : stop - start]
                if self.others:
                    distances = np.array([1.0 + x[start:stop], 1.0 - x[start:stop]])
                    self._add_others(part, distances, scales)
                np.multiply(part, signs, out=mirrored[:, start:stop])
                table[:, start:stop] = part

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
        _split(fall[:, :size], fine[:, 0])
        fine[:, 1] = fine[:, 0, :, ::-1]
        blocks = (len(places) - size) // 2
        coarse = fall[:, size:].reshape(2 * len(fall), blocks).T.copy()
        return fine.reshape(4 * len(fall), size), coarse

    def _add_others(
        self, result: FloatArray, distances: FloatArray, scales: FloatArray | None = None
    ) -> None:
        """Add the terms that have both an exponential and powers."""
        after_start, before_end = distances
        for term, table in self.others:
            if term.origin == 0:
                u = 0.5 * (after_start - before_end)
            else:
                u = -before_end if term.origin > 0 else after_start
            powers = np.empty((len(table), len(u)))
            _fill_powers(powers, u)
            values = (table[:, : len(result)].T @ powers) * np.exp(term.rate * u)
            result += values.real if scales is None else scales[:, None] * values.real


def term_sum(terms: Sequence[Term], order: int = TOP_ORDER) -> TermSum:
    """Return the sum of terms, ready for derivatives up to an order."""
    series: list[tuple[complex, ...]] = []
    others: list[tuple[Term, ComplexArray]] = []
    ends: dict[complex, list[complex]] = {}  # decay: amplitudes at start and end
    for term in terms:
        rate, origin, coefficients = term
        if origin == 0 and rate == 0.0:
            series.append(coefficients)
        elif origin != 0 and len(coefficients) == 1:
            amplitudes = ends.setdefault(origin * rate, [0j, 0j])
            amplitudes[0 if origin < 0 else 1] += coefficients[0]
        else:
            others.append((term, term.derivatives(order)))
    decays = np.array(list(ends), dtype=complex)
    table = np.empty((order + 1, len(decays), 2), dtype=complex)
    if len(decays):
        table[0] = list(ends.values())
        # Counted from the start, an exponential that falls has the rate -d.
        table[1:, :, 0] = -decays
        table[1:, :, 1] = decays
        np.multiply.accumulate(table, out=table)
    factors = table.reshape(order + 1, 2 * len(decays)).view(float)
    if series:
        factors = np.concatenate([factors, _power_table(series, order)], axis=1)
    return TermSum(decays=decays, factors=factors, others=tuple(others))


def series_derivatives(series: NDArray[Number], order: int) -> NDArray[Number]:
    """
    Return the coefficients of the derivatives of power series.

    Parameters
    ----------
    series
        Ascending coefficients, shape (..., terms).
    order
        Highest derivative wanted.

    Returns
    -------
    NDArray
        Coefficients of every derivative, shape (..., terms, order + 1).

    """
    terms = series.shape[-1]
    index, falling = _falling(terms, order)
    padded = np.zeros((*series.shape[:-1], terms + order), dtype=series.dtype)
    padded[..., :terms] = series
    derivatives: NDArray[Number] = padded.T[index].T
    derivatives *= falling
    return derivatives


def _power_table(series: Sequence[tuple[complex, ...]], order: int) -> FloatArray:
    """Return the coefficients of the derivatives of a sum of power series, powers in columns."""
    total = np.zeros(max(map(len, series)))
    for coefficients in series:
        total[: len(coefficients)] += np.real(coefficients)
    return _trimmed(series_derivatives(total, order), 1.0).T


def leibniz(rates: complex | ComplexArray, order: int) -> ComplexArray:
    """Return the factors of f, f', ... in the derivatives of exp(rate u) f at exp(rate u) = 1."""
    powers = np.empty((*np.shape(rates), order + 2), dtype=complex)
    powers[..., 0] = 1.0
    powers[..., 1:-1] = np.expand_dims(rates, -1)
    powers[..., -1] = 0.0
    np.multiply.accumulate(powers, axis=-1, out=powers)
    binomials, index = _pascal(order)
    factors: ComplexArray = powers[..., index]
    factors *= binomials
    return factors


@cache
def _pascal(order: int) -> tuple[FloatArray, NDArray[np.int_]]:
    """Return binomial coefficients (k over j), and k - j or, above the diagonal, order + 1."""
    k = np.arange(order + 1)
    index = np.where(k[:, None] >= k, k[:, None] - k, order + 1)
    return np.array([[float(comb(n, j)) for j in k.tolist()] for n in k.tolist()]), index


def _trimmed(table: NDArray[Number], reach: float) -> NDArray[Number]:
    """Return a table of coefficients without the powers that no derivative needs up to a reach."""
    if len(table) <= TOP_ORDER:
        return table
    size = np.abs(table) * (reach ** np.arange(len(table)))[:, None]
    needed = np.flatnonzero((size > NEGLIGIBLE * size.max(axis=0)).any(axis=1))
    return table[: needed[-1] + 1] if len(needed) else table[:1]


@cache
def _falling(terms: int, order: int) -> tuple[NDArray[np.int_], FloatArray]:
    """Return the sums of derivative k and power t, (k, t), and factors (t + k)! / t!, (t, k)."""
    index = np.arange(order + 1)[:, None] + np.arange(terms)
    steps = index.astype(float)
    steps[0] = 1.0
    return index, np.multiply.accumulate(steps).T


@cache
def _odd_signs(orders: int) -> FloatArray:
    """Return the signs of the derivatives of an odd function at the mirrored place, (m, 1)."""
    signs = np.ones((orders, 1))
    signs[::2] = -1.0
    return signs


def _fill_powers(table: FloatArray, x: FloatArray) -> None:
    """Write 1, x, x^2, ... into rows."""
    table[:1] = 1.0
    for lower, higher in pairwise(table):
        np.multiply(lower, x, out=higher)


def _split(fall: ComplexArray, parts: FloatArray) -> None:
    """Write Re and -Im of exponentials, shape (..., m), into a table, shape (..., 2, m)."""
    parts[..., 0, :] = fall.real
    np.negative(fall.imag, out=parts[..., 1, :])


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
