"""
Modes: the terms of a motion law, and their evaluation for all derivatives at once.

A mode is an exponential (growing or decaying, perhaps oscillating) times a polynomial: the general
solution of a linear equation with constant coefficients ((24) of docs/derivation.md). Nearly all
are plain exponentials anchored at an end, so that one matrix product gives every derivative at
every time; the others are summed one by one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Number = TypeVar('Number', np.float64, np.complex128)

TOP_ORDER = 12
"""Highest derivative of the Euler-Lagrange equation, hence of any table."""

NEGLIGIBLE = 1e-19
"""Share of the largest coefficient of a power series below which its tail is left out [-]."""

VANISHING = 100.0
"""Decay from which an exponential on an even grid is zero [-]."""

BLOCK = 64
"""Times per row of an exponential on an even grid, which is an outer product of two tables."""

CHUNK = 64 * BLOCK
"""Times evaluated together: their exponentials stay in the cache of the processor."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Mode:
    """
    Real part of exp(rate (x - origin)) * sum_k coefficients[k] (x - origin)^k.

    Normalised time x runs from -1 to 1. The origin is the end where the mode is largest, so that
    no exponential overflows.

    Attributes
    ----------
    rate
        Characteristic root in units of 2 / duration [-].
    origin
        -1, 0 or 1 [-].
    coefficients
        Of ascending powers, shape (k,) [rad].

    """

    rate: complex
    origin: int
    coefficients: ComplexArray

    def __post_init__(self) -> None:
        """Lock the coefficients."""
        self.coefficients.setflags(write=False)

    def mirrored(self, sign: float) -> 'Mode':
        """Return sign times the mode run backwards, x -> -x."""
        coefficients = sign * self.coefficients
        coefficients[1::2] *= -1.0
        return Mode(rate=-self.rate, origin=-self.origin, coefficients=coefficients)

    def scaled(self, factor: float) -> 'Mode':
        """Return factor times the mode."""
        return Mode(rate=self.rate, origin=self.origin, coefficients=factor * self.coefficients)

    def derivatives(self, order: int) -> ComplexArray:
        """Return the coefficients of the derivatives in x, shape (k, order + 1)."""
        table = np.empty((len(self.coefficients), order + 1), dtype=complex)
        table[:, 0] = self.coefficients
        powers = np.arange(1, len(self.coefficients))
        for column in range(1, order + 1):
            table[:, column] = self.rate * table[:, column - 1]
            table[:-1, column] += powers * table[1:, column - 1]
        return table


@dataclass(frozen=True, kw_only=True, eq=False)
class ModeSum:
    """
    Sum of modes, sorted by the way they are evaluated; all tables are in normalised time x.

    Attributes
    ----------
    decays
        Rates d of the exponentials exp(-d u) that fall with the distance u from an end, shape
        (m,).
    from_start, from_end
        Real factors of Re and -Im of these exponentials, u = x + 1 and u = 1 - x, for every
        derivative, shape (orders, 2 m).
    powers
        Coefficients of ascending powers of x for every derivative, shape (orders, terms).
    others
        Modes with both an exponential and powers, with their `Mode.derivatives`.

    """

    decays: ComplexArray
    from_start: FloatArray
    from_end: FloatArray
    powers: FloatArray
    others: tuple[tuple[Mode, ComplexArray], ...]

    def at(self, after_start: FloatArray, before_end: FloatArray, order: int) -> FloatArray:
        """
        Return the sum and its derivatives in x.

        Parameters
        ----------
        after_start, before_end
            x + 1 and 1 - x, both exact, shape (m,).
        order
            Highest derivative wanted.

        Returns
        -------
        FloatArray
            Row k holds the k-th derivative, shape (order + 1, m).

        """
        result = np.zeros((order + 1, len(after_start)))
        # Far from its end an exponential vanishes: this underflow is the right answer.
        with np.errstate(under='ignore'):
            if len(self.decays):
                for factors, u in ((self.from_start, after_start), (self.from_end, before_end)):
                    fall = np.exp(np.multiply.outer(-self.decays, u))
                    result += factors[: order + 1] @ np.concatenate([fall.real, fall.imag])
            if self.powers.shape[1]:
                x = 0.5 * (after_start - before_end)
                result += self.powers[: order + 1] @ _powers(x, self.powers.shape[1])
            self._add_others(result, after_start, before_end)
        return result

    def on_even_grid(self, intervals: int, order: int) -> FloatArray:
        """Return the same as `at` on intervals + 1 even times, both ends included."""
        count = intervals + 1
        result = np.zeros((order + 1, count))
        mirrored = result[:, ::-1]
        factors = np.concatenate([self.from_start[: order + 1], self.from_end[: order + 1]])
        with np.errstate(under='ignore'):
            fine = _fall(self.decays, np.arange(BLOCK), intervals)
            for start in range(0, count, CHUNK):
                stop = min(start + CHUNK, count)
                if len(self.decays):
                    coarse = _fall(self.decays, np.arange(start, stop, BLOCK), intervals)
                    fall = coarse[:, :, None] * fine[:, None, :]
                    fall = fall.reshape(len(self.decays), -1)[:, : stop - start]
                    both = factors @ np.concatenate([fall.real, fall.imag])
                    # The same table serves both ends: counted from the end, grid is mirrored.
                    result[:, start:stop] += both[: order + 1]
                    mirrored[:, start:stop] += both[order + 1 :]
                # Exactly odd about the middle.
                x = np.arange(2.0 * start - intervals, 2.0 * stop - intervals, 2.0) / intervals
                if self.powers.shape[1]:
                    result[:, start:stop] += self.powers[: order + 1] @ _powers(
                        x, self.powers.shape[1]
                    )
                self._add_others(result[:, start:stop], 1.0 + x, 1.0 - x)
        return result

    def _add_others(
        self, result: FloatArray, after_start: FloatArray, before_end: FloatArray
    ) -> None:
        """Add the modes that have both an exponential and powers."""
        for mode, table in self.others:
            u = (0.5 * (after_start - before_end), -before_end, after_start)[mode.origin]
            values = table.T[: len(result)] @ _powers(u, len(table))
            result += np.real(values * np.exp(mode.rate * u))


def mode_sum(modes: Sequence[Mode], order: int = TOP_ORDER) -> ModeSum:
    """Return the sum of modes, ready for derivatives up to an order."""
    series: list[ComplexArray] = []
    others: list[tuple[Mode, ComplexArray]] = []
    ends: dict[complex, dict[int, complex]] = {}  # decay: {origin: amplitude}
    for mode in modes:
        if mode.origin == 0 and mode.rate == 0.0:
            series.append(mode.coefficients)
        elif mode.origin != 0 and len(mode.coefficients) == 1:
            at_ends = ends.setdefault(mode.origin * mode.rate, {-1: 0j, 1: 0j})
            at_ends[mode.origin] += complex(mode.coefficients[0])
        else:
            reach = 2.0 if mode.origin else 1.0
            others.append((mode, _trimmed(mode.derivatives(order), reach)))
    decays = np.array(list(ends), dtype=complex)
    amplitudes = np.array([[a[-1], a[1]] for a in ends.values()], dtype=complex).reshape(-1, 2)
    factors = np.empty((2, order + 1, len(decays)), dtype=complex)
    factors[:, 0] = amplitudes.T
    for k in range(1, order + 1):
        np.multiply(factors[:, k - 1], decays, out=factors[:, k])
    # Counted from the start, an exponential that falls has the rate -d.
    factors[0, 1::2] *= -1.0
    from_start, from_end = np.concatenate([factors.real, -factors.imag], axis=2)
    return ModeSum(
        decays=decays,
        from_start=from_start,
        from_end=from_end,
        powers=_power_table(series, order),
        others=tuple(others),
    )


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
    return np.multiply(padded[..., index], falling, dtype=series.dtype)


def _power_table(series: Sequence[ComplexArray], order: int) -> FloatArray:
    """Return the coefficients of the derivatives of a sum of power series, powers in columns."""
    total = np.zeros(max(map(len, series), default=0))
    for coefficients in series:
        total[: len(coefficients)] += coefficients.real
    if not len(total):
        return np.zeros((order + 1, 0))
    return np.ascontiguousarray(_trimmed(series_derivatives(total, order), 1.0).T)


def _trimmed(table: NDArray[Number], reach: float) -> NDArray[Number]:
    """Return a table of coefficients without the powers that no derivative needs up to a reach."""
    if len(table) <= TOP_ORDER:
        return table
    size = np.abs(table) * (reach ** np.arange(len(table)))[:, None]
    needed = np.flatnonzero((size > NEGLIGIBLE * size.max(axis=0)).any(axis=1))
    return table[: needed[-1] + 1] if len(needed) else table[:1]


@cache
def _falling(terms: int, order: int) -> tuple[NDArray[np.int_], FloatArray]:
    """Return the sums of power t and derivative k, and their factors (t + k)! / t!."""
    powers = np.arange(terms)[:, None]
    steps = np.concatenate([np.ones((terms, 1)), powers + np.arange(1.0, order + 1.0)], axis=1)
    return powers + np.arange(order + 1), np.multiply.accumulate(steps, axis=1)


def _powers(x: FloatArray, terms: int) -> FloatArray:
    """Return 1, x, x^2, ... in rows."""
    table = np.empty((terms, len(x)))
    table[0] = 1.0
    for k in range(1, terms):
        np.multiply(table[k - 1], x, out=table[k])
    return table


def _fall(decays: ComplexArray, index: NDArray[np.int_], intervals: int) -> ComplexArray:
    """Return exp(-d u) at some places u = 2 i / intervals of an even grid, shape (m, places)."""
    exponents = np.multiply.outer(-decays, 2.0 * index / intervals)
    fall: ComplexArray = np.exp(exponents)
    # Else the product of two tables, or a multiple of it, would leave the range of doubles.
    fall[exponents.real < -VANISHING] = 0.0
    return fall
