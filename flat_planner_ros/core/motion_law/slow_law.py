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
The unit motion of one slow equation, whose roots need not be known.

Its system of (30a) of docs/derivation.md is small and well conditioned whatever the roots have in
common: clusters of them, which exponentials would have to be told of, make no difference.
"""

from functools import cache
from math import comb

from flat_planner_ros.core.arm import FloatArray, locked
from flat_planner_ros.core.motion_law.basis import CONDITIONS, SOLUTIONS
from flat_planner_ros.core.motion_law.series_basis import series_basis
from flat_planner_ros.core.motion_law.term_sum import TermSum
from flat_planner_ros.core.motion_law.terms import series_derivatives
import numpy as np

SLOW = 9.0
"""
Speed up to which a law is a power series, in units of 2 / duration [-].

Powers about the middle lose digits with the fastest root, four at most.
"""

TERMS = {0: 0.0, 10: 2.5, 16: SLOW}
"""Fastest speed for each number of odd terms of w^(12), which have then converged [-]."""

_EXPONENTS = 1.0 / (SOLUTIONS - 2.0 * np.arange(CONDITIONS))


def speeds(coefficients: FloatArray) -> FloatArray:
    """
    Return how fast the solutions of equations are, in units of 2 / duration.

    Parameters
    ----------
    coefficients
        a_0 ... a_6 of each, a_6 = 1, shape (..., 7).

    Returns
    -------
    FloatArray
        No root is larger than 2^(1/2) times this (Fujiwara's bound in z = beta^2), shape (...)
        [-].

    """
    largest: FloatArray = (np.abs(coefficients[..., :CONDITIONS]) ** _EXPONENTS).max(axis=-1)
    return largest


def slow_law(coefficients: FloatArray, speed: float) -> TermSum:
    """
    Return the stationary law from rest at -1/2 to rest at 1/2, a power series about the middle.

    Parameters
    ----------
    coefficients
        a_0 ... a_6 in normalised time, shape (7,) [-].
    speed
        How fast its solutions are, up to `SLOW` [-].

    Raises
    ------
    numpy.linalg.LinAlgError
        The equation is singular in double precision.

    """
    terms = next(terms for terms, fastest in TERMS.items() if speed <= fastest)
    equation, powers = _tables(terms)
    system = (coefficients @ equation).reshape(terms, terms + 1)
    amplitudes = np.ones(terms + 1)
    amplitudes[:terms] = np.linalg.solve(system[:, :terms], -system[:, terms])
    factors = (amplitudes @ powers).reshape(SOLUTIONS + 1, -1)
    return TermSum(decays=np.zeros(0, dtype=complex), factors=factors, others=())


@cache
def _tables(terms: int) -> tuple[FloatArray, FloatArray]:
    """
    Return what equations and power series of laws are made from.

    Returns
    -------
    tuple[FloatArray, FloatArray]
        Odd Legendre coefficients of the even derivatives, shape (7, terms * (terms + 1)), and
        coefficients of ascending powers of the derivatives 0 to 12, shape (terms + 1, 13 size);
        both for each change and, last, for the law of least degree.

    """
    basis = series_basis(terms)
    law = basis.derivatives[0]
    series = (_legendre_powers(len(law)).T @ law).T
    table = series_derivatives(series, SOLUTIONS).swapaxes(1, 2)
    equation = basis.equation.reshape(len(basis.equation), -1)
    return locked(equation), locked(table.reshape(len(table), -1))


def _legendre_powers(size: int) -> FloatArray:
    """Return the coefficients of ascending powers of the Legendre polynomials, (size, size)."""
    table = np.zeros((size, size))
    for n in range(size):
        for k in range(n // 2 + 1):
            table[n, n - 2 * k] = (-1) ** k * comb(n, k) * comb(2 * (n - k), n) / 2**n
    return table
