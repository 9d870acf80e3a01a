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
Response of the planned variable: how it follows a momentum angle, like the passive joint.

w + delta w' + w'' / omega^2 = sigma, in Legendre series of x from -1 to 1; fast natural
oscillations are a term of their own ((I6) and (I10) of docs/derivation.md).
"""

from dataclasses import dataclass
from functools import cache, lru_cache
from math import ceil
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray, locked
from flat_planner_ros.core.insensitive.oscillator import Oscillator
from flat_planner_ros.core.motion_law import (
    differentiation,
    integration,
    JET_ORDER,
    ScaledLaw,
)
import numpy as np
from numpy.polynomial import legendre

CONTACT = 3
"""
Derivatives of sigma that vanish at both ends.

Then the effort and its rate are zero there, and five derivatives of w at the start: with no
oscillation left, these are the twelve conditions of the other strategies.
"""

TOP = CONTACT + 1
"""Derivative of sigma in which laws are expanded."""

SPLIT_TURN = 1.5
"""
Half the turn of the natural oscillation per term of sigma^(4) from which it is a mode of its own.

Below, a polynomial resolves it to double precision; above, the series of the particular solution
in derivatives of sigma converges fast [rad].
"""

TERMS_PER_TURN = 1.4
"""Legendre terms that resolve one radian of half the turn, a little above e / 2 [1/rad]."""

PROBES = 65
"""Times at which a law is certified."""

SPARE_TERMS = 20
"""Terms beyond those, after which the coefficients have decayed below roundoff."""

BASES_KEPT = 8
"""Bases of different size that are remembered."""


class Normalised(NamedTuple):
    """w + delta w' + epsilon w'' = sigma, derivatives by x from -1 to 1."""

    delta: float
    epsilon: float

    @classmethod
    def of(cls, oscillator: Oscillator, duration: float) -> 'Normalised':
        """Return that of an arm and a duration [s]."""
        half = 0.5 * duration
        square = oscillator.frequency**2
        return cls(2.0 * oscillator.decay / square / half, 1.0 / (square * half**2))

    def momentum_angle(self, jet: FloatArray) -> FloatArray:
        """Return sigma and its derivatives, two fewer than those of w in the rows of a jet."""
        result: FloatArray = jet[:-2] + self.delta * jet[1:-1] + self.epsilon * jet[2:]
        return result

    def is_split(self, terms: int) -> bool:
        """Whether the natural oscillation is too fast for so many terms of sigma^(4)."""
        return bool(self.epsilon**-0.5 > SPLIT_TURN * terms)


@cache
def _probes() -> FloatArray:
    """Return the places x at which a law is certified."""
    return locked(np.linspace(-1.0, 1.0, PROBES))


@lru_cache(maxsize=BASES_KEPT)
def _at_probes(size: int) -> FloatArray:
    """Return Legendre polynomials there, shape (PROBES, size)."""
    return locked(np.asarray(legendre.legvander(_probes(), size - 1), dtype=float))


@dataclass(frozen=True, kw_only=True, eq=False)
class SeriesLaw(ScaledLaw):
    """
    A planned variable as Legendre series of its derivatives, plus one decaying oscillation.

    Attributes
    ----------
    table
        Row k holds the coefficients of the k-th derivative in x, shape (7, m).
    rate, amplitude
        Of the oscillation Re(amplitude exp(rate (x + 1))).

    """

    table: FloatArray
    rate: complex = 0j
    amplitude: complex = 0j

    def normalised_jet(self, distances: FloatArray, order: int) -> FloatArray:
        """Return the series and its derivatives, as `ScaledLaw.normalised_jet`."""
        x = np.clip(distances[0] - 1.0, -1.0, 1.0)
        table = self.table[: order + 1]
        if order > JET_ORDER:
            higher = np.zeros((order - JET_ORDER, table.shape[1]))
            for row in range(len(higher)):
                derivative = legendre.legder(self.table[-1], row + 1)
                higher[row, : len(derivative)] = derivative
            table = np.concatenate([table, higher])
        result: FloatArray = table @ legendre.legvander(x, table.shape[1] - 1).T
        return self._with_oscillation(result, x)

    def probed(self) -> FloatArray:
        """Return derivatives 0 to 6 in x at the times at which it is certified, shape (7, m)."""
        return self._with_oscillation(self.table @ _at_probes(self.table.shape[1]).T, _probes())

    def _with_oscillation(self, jet: FloatArray, x: FloatArray) -> FloatArray:
        """Return the derivatives of the series at some x with those of the oscillation added."""
        if self.amplitude:
            powers = self.amplitude * self.rate ** np.arange(len(jet))
            jet += np.multiply.outer(powers, np.exp(self.rate * (x + 1.0))).real
        return jet


def responses(
    fourths: FloatArray,
    seconds: FloatArray,
    equation: Normalised,
    duration: float,
    start: FloatArray,
) -> list[SeriesLaw]:
    """
    Return the planned variables that follow some sigmas.

    Parameters
    ----------
    fourths
        Legendre coefficients of sigma^(4) in x, in columns, shape (m, laws).
    seconds
        Those of sigma'', shape (m + 2, laws).
    equation
        That of the nominal arm.
    duration
        Length of the motion [s].
    start
        Derivatives 0 to 5 in x at the start, the same for all, shape (6,) [rad].

    References
    ----------
    (I6), (I10) and (I19) of docs/derivation.md.

    """
    if equation.is_split(len(fourths)):
        return [_split(second, equation, duration, start) for second in seconds.T]
    top = top_derivatives(fourths, equation, start)
    size = len(top) + JET_ORDER
    once = integration(size)
    tables = np.zeros((JET_ORDER + 1, size, top.shape[1]))
    tables[JET_ORDER, : len(top)] = top
    for k in range(JET_ORDER, 0, -1):
        tables[k - 1] = once @ tables[k]
        tables[k - 1, 0] += start[k - 1]
    return [
        SeriesLaw(duration=duration, table=locked(tables[..., law].copy()))
        for law in range(top.shape[1])
    ]


def top_derivatives(fourths: FloatArray, equation: Normalised, start: FloatArray) -> FloatArray:
    """Return Legendre coefficients of w^(6), laws in columns, as for `responses`."""
    size = len(fourths) + ceil(TERMS_PER_TURN * equation.epsilon**-0.5) + SPARE_TERMS
    once = integration(size)
    driving = np.zeros((size, fourths.shape[1]))
    driving[: len(fourths)] = fourths
    # w^(4) and w^(5) without what comes from w^(6); x + 1 has the coefficients 1 and 1.
    driving[0] -= start[TOP] + (1.0 + equation.delta) * start[TOP + 1]
    driving[1] -= start[TOP + 1]
    operator = equation.epsilon * np.eye(size) + equation.delta * once + once @ once
    return np.asarray(np.linalg.solve(operator, driving), dtype=float)


def _split(
    second: FloatArray, equation: Normalised, duration: float, start: FloatArray
) -> SeriesLaw:
    """Return a particular solution, a polynomial, plus the natural oscillation."""
    delta, epsilon = equation
    size = len(second) + 2
    once = integration(size)
    begin = equation.momentum_angle(start)
    sigma = np.zeros((JET_ORDER + 1, size))
    sigma[2, : len(second)] = second
    for k in (1, 0):
        sigma[k] = once @ sigma[k + 1]
        sigma[k, 0] += begin[k]
    slope = differentiation(size)
    for k in range(3, JET_ORDER + 1):
        sigma[k] = slope @ sigma[k - 1]
    operator = np.eye(size) + delta * slope + epsilon * slope @ slope
    table = np.asarray(np.linalg.solve(operator, sigma.T).T, dtype=float)
    locked(table)
    rate = (-delta + 1j * np.sqrt(4.0 * epsilon - delta**2)) / (2.0 * epsilon)
    # At the start, where the fourth derivative of the particular solution is smallest.
    signs = (-1.0) ** np.arange(size)
    value, growth = start[TOP : TOP + 2] - table[TOP : TOP + 2] @ signs
    amplitude = complex(value, (rate.real * value - growth) / rate.imag) / rate**TOP
    return SeriesLaw(duration=duration, table=table, rate=complex(rate), amplitude=amplitude)


def flat_outputs(law: SeriesLaw, equation: Normalised, places: FloatArray) -> FloatArray:
    """Return y1 = w + delta w' of a law at some x, shape (m,) [rad]."""
    value, slope = law.normalised_jet(np.array([1.0 + places, 1.0 - places]), 1)
    result: FloatArray = value + equation.delta * slope
    return result


@cache
def _ends_of_series() -> FloatArray:
    """Return derivatives 0 to 3 of eight Legendre polynomials at -1, then at 1, shape (8, 8)."""
    count = 2 * (CONTACT + 1)
    rows = [
        legendre.legval(end, legendre.legder(np.eye(count), order))
        for end in (-1.0, 1.0)
        for order in range(CONTACT + 1)
    ]
    return locked(np.array(rows))


def joining(begin: FloatArray, end: float) -> FloatArray:
    """
    Return Legendre coefficients of the polynomial of least degree to rest, shape (8,).

    Parameters
    ----------
    begin
        Derivatives 0 to 3 at x = -1, shape (4,) [rad].
    end
        Value at x = 1 [rad].

    """
    wanted = np.concatenate([begin, [end], np.zeros(CONTACT)])
    return np.asarray(np.linalg.solve(_ends_of_series(), wanted), dtype=float)


def largest_miss(
    law: SeriesLaw,
    second: FloatArray,
    equation: Normalised,
    start: FloatArray,
    end: float,
    *,
    rests_at_end: bool,
) -> float:
    """Return the largest miss at the ends, and of sigma'' in between, relative to peaks."""
    jet = law.probed()[:JET_ORDER]
    # Sigma may be far smaller than its terms: an arm that coasts has none.
    sizes = np.abs(jet).max(axis=1)
    terms = equation.momentum_angle(sizes)
    sigma = equation.momentum_angle(jet)
    rest = np.zeros(JET_ORDER)
    rest[0] = end
    misses = [
        _relative(np.abs(sigma[2] - _at_probes(len(second)) @ second).max(), terms[2]),
        _relative(jet[:, 0] - start, sizes),
        _relative(sigma[:, -1] - rest[: len(sigma)], terms),
    ]
    if rests_at_end:
        misses.append(_relative(jet[:, -1] - rest, sizes))
    return max(misses)


def _relative(missed: FloatArray, sizes: FloatArray) -> float:
    """Return the largest miss relative to a size; where nothing moves none is expected."""
    return float(np.max(np.abs(missed) / np.where(sizes > 0.0, sizes, 1.0)))
