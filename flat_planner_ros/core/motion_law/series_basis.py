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
Laws from rest to rest as Legendre series.

The sixth derivative of a law from rest to rest lacks the polynomials below the sixth, but for
those of the law of least degree; sixfold integrals of all others vanish at both ends, with five
derivatives. In this basis the Euler-Lagrange equation is one small linear system, well conditioned
whatever its roots have in common ((30a) of docs/derivation.md).
"""

from functools import lru_cache
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray, locked
from flat_planner_ros.core.motion_law.basis import CONDITIONS, SOLUTIONS
from flat_planner_ros.core.motion_law.legendre_series import differentiation, integration
import numpy as np

BASES_KEPT = 8
"""Bases of different size that are remembered."""


class SeriesBasis(NamedTuple):
    """
    Laws of unit distance: the one of least degree, plus any combination of changes.

    Attributes
    ----------
    derivatives
        Legendre coefficients of the derivatives 0 to 12 of each change and, last, of the law of
        least degree, shape (13, size, terms + 1).
    equation
        Odd coefficients, as many as there are terms, of the even derivatives 0, 2, ..., 12, shape
        (7, terms, terms + 1).

    """

    derivatives: FloatArray
    equation: FloatArray


@lru_cache(maxsize=BASES_KEPT)
def series_basis(terms: int) -> SeriesBasis:
    """Return the basis whose changes have an odd Legendre polynomial each as w^(12)."""
    size = 2 * terms + SOLUTIONS
    once, slope = integration(size), differentiation(size)
    table = np.zeros((SOLUTIONS + 1, size, terms + 1))
    table[SOLUTIONS, 1 : 2 * terms : 2, :terms] = np.eye(terms)
    for order in range(SOLUTIONS - 1, CONDITIONS - 1, -1):
        table[order] = once @ table[order + 1]
        if order % 2 == 0:
            table[order, 0] = 0.0  # odd about the middle, wherever the integral began
    # Only without these polynomials do the next six integrals vanish at both ends.
    low = np.zeros((size, terms + 1))
    low[:CONDITIONS] = table[CONDITIONS, :CONDITIONS]
    for order in range(CONDITIONS, SOLUTIONS):
        table[order] -= low
        low = slope @ low
    for order in range(CONDITIONS - 1, -1, -1):
        table[order] = once @ table[order + 1]
        table[order, order % 2 :: 2] = 0.0
    table[..., terms] = _least_degree(size)
    return SeriesBasis(locked(table), locked(table[::2, 1 : 2 * terms : 2].copy()))


def _least_degree(size: int) -> FloatArray:
    """Return Legendre coefficients of the polynomial law and its derivatives, (13, size)."""
    power = np.polynomial.polynomial.polypow([1.0, 0.0, -1.0], CONDITIONS - 1)
    speed = np.polynomial.legendre.poly2leg(power)
    table = np.zeros((SOLUTIONS + 1, size))
    table[1, : len(speed)] = speed / (2.0 * speed[0])
    for order in range(2, SOLUTIONS + 1):
        table[order] = differentiation(size) @ table[order - 1]
    table[0] = integration(size) @ table[1]
    table[0, 0] = 0.0  # from -1/2
    return table
