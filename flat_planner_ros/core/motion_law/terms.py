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
Terms of a motion law, and coefficients of their derivatives.

A term is an exponential (growing or decaying, perhaps oscillating) times a polynomial: the general
solution of a linear equation with constant coefficients ((24) of docs/derivation.md).
"""

from functools import cache
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
        return trimmed(plain @ leibniz(self.rate, order).T, 2.0 if self.origin else 1.0)


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


def trimmed(table: NDArray[Number], reach: float) -> NDArray[Number]:
    """
    Return coefficients of derivatives without the powers that none of them needs.

    Parameters
    ----------
    table
        Of one or several functions, shape (..., terms, orders).
    reach
        Largest argument of the powers.

    """
    if table.shape[-2] <= TOP_ORDER:
        return table
    size = np.abs(table) * (reach ** np.arange(table.shape[-2]))[:, None]
    is_needed = size > NEGLIGIBLE * size.max(axis=-2, keepdims=True)
    powers = np.flatnonzero(is_needed.any(axis=-1).reshape(-1, table.shape[-2]).any(axis=0))
    return table[..., : powers[-1] + 1 if len(powers) else 1, :]


@cache
def _falling(terms: int, order: int) -> tuple[NDArray[np.int_], FloatArray]:
    """Return the sums of derivative k and power t, (k, t), and factors (t + k)! / t!, (t, k)."""
    index = np.arange(order + 1)[:, None] + np.arange(terms)
    steps = index.astype(float)
    steps[0] = 1.0
    return index, np.multiply.accumulate(steps).T
