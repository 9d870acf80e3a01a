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
Extremals in multiple precision: all characteristic roots, one 12 x 12 system, nothing clever.

The even equation sum_k a_k y^(2k) = 0 is given by the roots of sum_k a_k z^k with multiplicities:
roots beta = +-sqrt(z) contribute exp(beta t) times powers of t, those at zero powers alone. Nearly
equal roots cost digits, of which there are plenty.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import comb, perm

import mpmath as mp
import numpy as np

DIGITS = 140
"""Decimal digits; twelve roots that are equal to 1e-6 use up about seventy of them."""

CONDITIONS = 6
"""Conditions at either end: the value and five derivatives."""

MAX_SWEEPS = 400
"""Bound on the sweeps of the root finder."""

Roots = list[tuple[mp.mpc, int]]


def characteristic(
    *, both, last, stiffness, damping, r, p, is_damping_exact=False
) -> list[mp.mpf]:
    """Return a_0 ... a_6 of y6^2 + r^8 tau^2 + p^8 y2^2, tau the exact or the paper's effort."""
    with mp.workdps(DIGITS):
        both, last, k, c, r, p = map(mp.mpf, (both, last, stiffness, damping, r, p))
        compliant = last * (both - last) / k
        weight = r**8
        # Damping adds the third derivative to the exact effort, the fifth to the paper's.
        third, fifth = (both * c / k, 0) if is_damping_exact else (0, compliant * c / k)
        return [
            mp.mpf(0),
            mp.mpf(0),
            weight * both**2 + p**8,
            weight * (2 * both * compliant - third**2),
            weight * compliant**2,
            -weight * fifth**2,
            mp.mpf(1),
        ]


def polynomial(roots: Roots) -> list[mp.mpf]:
    """Return the ascending coefficients of the monic polynomial with the given roots."""
    with mp.workdps(DIGITS):
        ascending = [mp.mpc(1)]
        for root, multiplicity in roots:
            for _ in range(multiplicity):
                shifted = [mp.mpc(0), *ascending]
                scaled = [root * a for a in ascending] + [0]
                ascending = [a - b for a, b in zip(shifted, scaled, strict=True)]
        return [mp.re(a) for a in ascending]


def square_roots(ascending: Sequence[float]) -> Roots:
    """Return the roots z, zero with its exact multiplicity, all others taken as simple."""
    return list(_roots_of(tuple(ascending)))


@lru_cache
def _roots_of(ascending: tuple[float, ...]) -> Roots:
    """Return the roots of an equation; the same few come up again and again."""
    with mp.workdps(DIGITS):
        coefficients = [mp.mpf(a) for a in ascending]
        zeros = next(i for i, a in enumerate(coefficients) if a)
        found = _simple_roots(coefficients[zeros:])
        return ([(mp.mpc(0), zeros)] if zeros else []) + [(z, 1) for z in found]


def _simple_roots(ascending: list[mp.mpf]) -> list[mp.mpc]:
    """Return the roots by Aberth's iteration from the moduli of the Newton polygon."""
    degree = len(ascending) - 1
    points = [(k, mp.log(abs(a))) for k, a in enumerate(ascending) if a]
    roots, k = [], 0
    while k < degree:
        height = dict(points)[k]
        slope, reached = max(((h - height) / (j - k), j) for j, h in points if j > k)
        roots += [
            mp.exp(-slope) * mp.expjpi(2 * mp.mpf(i) / (reached - k) + mp.mpf('0.23') + k)
            for i in range(reached - k)
        ]
        k = reached
    for _ in range(MAX_SWEEPS):
        largest = mp.mpf(0)
        for i, z in enumerate(roots):
            value, slope = _value_and_slope(ascending, z)
            if value:
                newton = value / slope
                crowd = sum(1 / (z - other) for j, other in enumerate(roots) if j != i)
                step = newton / (1 - newton * crowd)
                roots[i] = z - step
                largest = max(largest, abs(step / z))
        # Cubic convergence: the step after this one would be below the last digit.
        if largest < mp.mpf(10) ** (-DIGITS // 2):
            return roots
    raise ArithmeticError(f'the roots of {ascending} have not converged')


def _value_and_slope(ascending: list[mp.mpf], z: mp.mpc) -> tuple[mp.mpc, mp.mpc]:
    """Return a polynomial and its derivative by Horner's rule."""
    value, slope = mp.mpc(0), mp.mpc(0)
    for a in reversed(ascending):
        slope = slope * z + value
        value = value * z + a
    return value, slope


@dataclass(frozen=True, kw_only=True)
class ReferenceLaw:
    """
    Solution of the equation with given ends, in exponentials anchored where they are largest.

    Attributes
    ----------
    duration
        Length of the motion [s].
    terms
        Rate [1/s], power, whether counted from the end, weight: weight * u^power * exp(rate u).

    """

    duration: mp.mpf
    terms: list[tuple[mp.mpc, int, bool, mp.mpc]]

    def jet(self, times, order: int) -> np.ndarray:
        """Return the derivatives 0 ... order in rows, shape (order + 1, m)."""
        with mp.workdps(DIGITS):
            columns = []
            for t in times:
                total = [mp.mpc(0)] * (order + 1)
                for rate, power, from_end, weight in self.terms:
                    u = mp.mpf(float(t)) - (self.duration if from_end else 0)
                    for n, value in enumerate(_derivatives(rate, power, u, order)):
                        total[n] += weight * value
                columns.append([float(mp.re(value)) for value in total])
            return np.array(columns).T


def solutions(roots: Roots) -> list[tuple[mp.mpc, int, bool]]:
    """Return rate, power of time and whether it counts from the end, of all exponentials."""
    functions = []
    for z, multiplicity in roots:
        if z == 0:
            functions += [(mp.mpc(0), power, False) for power in range(2 * multiplicity)]
            continue
        beta = mp.sqrt(mp.mpmathify(z))
        for power in range(multiplicity):
            functions += [(beta, power, True), (-beta, power, False)]
    return functions


def solve(roots: Roots, duration: float, start, end) -> ReferenceLaw:
    """Return the law whose derivatives 0 to 5 are start at 0 and end at the duration."""
    with mp.workdps(DIGITS):
        length = mp.mpf(duration)
        functions = solutions(roots)
        size = 2 * CONDITIONS
        matrix, target = mp.matrix(size, size), mp.matrix(size, 1)
        # Rows and columns in units of the duration, so that the solver's pivots are comparable.
        for j, (rate, power, from_end) in enumerate(functions):
            for side, t in enumerate((mp.mpf(0), length)):
                u = t - (length if from_end else 0)
                for n, value in enumerate(_derivatives(rate, power, u, CONDITIONS - 1)):
                    matrix[side * CONDITIONS + n, j] = value * length ** (n - power)
        for side, ends in enumerate((start, end)):
            for n, value in enumerate(ends):
                target[side * CONDITIONS + n] = mp.mpf(float(value)) * length**n
        weights = linear_solution(matrix, target)
        return ReferenceLaw(
            duration=length,
            terms=[
                (*function, weight * length ** -function[1])
                for function, weight in zip(functions, weights, strict=True)
            ],
        )


def linear_solution(matrix: mp.matrix, target: mp.matrix) -> list[mp.mpc]:
    """
    Return the solution of linear equations by elimination with scaled partial pivoting.

    As `mp.lu_solve`, but on lists, and without what is zero: a fifth of the time for a path.
    """
    size = matrix.rows
    rows = [[*(matrix[i, j] for j in range(size)), target[i]] for i in range(size)]
    scales = [1 / sum(map(abs, row[:size])) for row in rows]
    for k in range(size):
        _, best = max((scales[i] * abs(rows[i][k]), i) for i in range(k, size))
        rows[k], rows[best] = rows[best], rows[k]
        scales[k], scales[best] = scales[best], scales[k]
        pivot = rows[k]
        occupied = [j for j in range(k + 1, size + 1) if pivot[j]]
        for row in rows[k + 1 :]:
            if row[k]:
                factor = row[k] / pivot[k]
                for j in occupied:
                    row[j] -= factor * pivot[j]
    found: list[mp.mpc] = [mp.mpf(0)] * size
    for k in reversed(range(size)):
        known = sum((rows[k][j] * found[j] for j in range(k + 1, size) if rows[k][j]), mp.mpf(0))
        found[k] = (rows[k][size] - known) / rows[k][k]
    return found


def _derivatives(rate: mp.mpc, power: int, u: mp.mpf, order: int) -> list[mp.mpc]:
    """Return the derivatives 0 ... order of u^power exp(rate u), by Leibniz's rule."""
    powers = [perm(power, n) * u ** max(power - n, 0) for n in range(min(order, power) + 1)]
    if not rate:
        return powers + [mp.mpf(0)] * (order + 1 - len(powers))
    exponentials = [mp.exp(rate * u)]
    for _ in range(order):
        exponentials.append(exponentials[-1] * rate)
    if power == 0:
        return exponentials
    return [
        sum(comb(n, i) * p * exponentials[n - i] for i, p in enumerate(powers[: n + 1]))
        for n in range(order + 1)
    ]
