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
Laws from rest to rest as Legendre series of their sixth derivative.

Sixfold integrals of the Legendre polynomials from the sixth degree on vanish at both ends, with
five derivatives; that of the fifth degree is the law of least degree. In this basis, which is
orthogonal where only w^(6) costs, the optimum of any quadratic cost is one small symmetric
system, well conditioned whatever its roots have in common ((30a) of docs/derivation.md).
"""

from functools import lru_cache
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray, locked
from flat_planner_ros.core.motion_law.basis import CONDITIONS, SOLUTIONS
from flat_planner_ros.core.motion_law.certificate import probes
from flat_planner_ros.core.motion_law.law import JET_ORDER
from flat_planner_ros.core.motion_law.legendre_series import integration, legendre_values
import numpy as np

TERMS = {0: 0.0, 6: 1.0, 10: 4.5, 16: 11.0, 22: 20.0, 28: 30.0, 36: 42.0, 44: 56.0}
"""Fastest speed, in units of 2 / duration, for each number of terms, which then suffice [-]."""

FASTEST = max(TERMS.values())
"""Speed up to which a law is a series, in units of 2 / duration [-]."""

PROBE_DEPTH = 8
"""Halvings of the distance to the start at which a series is certified: it has no thin layers."""

_EXPONENTS = 1.0 / (SOLUTIONS - 2.0 * np.arange(CONDITIONS))

LOW_DEGREES = np.arange(1, CONDITIONS, 2)
"""Of odd polynomials that six derivatives take away."""


class SeriesBasis(NamedTuple):
    """
    Laws of unit distance: the one of least degree, plus any combination of changes.

    Attributes
    ----------
    derivatives
        Legendre coefficients of the integrals and derivatives of orders -6 to 6 of each change
        and, last, of the law of least degree, shape (13, size, terms + 1). The constants of the
        integrals are of no account.
    energy
        (-1)^k times the integrals over products of their k-th derivatives, which a_k multiplies
        in the cost, shape (7, terms + 1, terms + 1).

    """

    derivatives: FloatArray
    energy: FloatArray


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


def terms_for(speed: float) -> int:
    """Return how many terms a law has, by its speed up to `FASTEST`."""
    return next(terms for terms, fastest in TERMS.items() if speed <= fastest)


@lru_cache(maxsize=len(TERMS))
def series_basis(terms: int) -> SeriesBasis:
    """Return the basis whose changes have an odd Legendre polynomial each as w^(6)."""
    degrees = np.array([*range(CONDITIONS + 1, CONDITIONS + 1 + 2 * terms, 2), CONDITIONS - 1])
    size = int(degrees.max()) + SOLUTIONS + 1
    once = integration(size)
    table = np.zeros((2 * JET_ORDER + 1, size, terms + 1))
    table[-1, degrees, np.arange(terms + 1)] = np.sqrt(degrees + 0.5)
    for order in range(2 * JET_ORDER - 1, -1, -1):
        table[order] = once @ table[order + 1]
        if order % 2 == 0:
            table[order, 0] = 0.0  # odd about the middle, wherever the integral began
    # Of the law of least degree; P_n(1) = 1.
    table[..., terms] *= 0.5 / table[JET_ORDER, :, terms].sum()
    weighted = table[JET_ORDER:] / np.sqrt(np.arange(size) + 0.5)[:, None]
    energy = np.einsum('kni,knj->kij', weighted, weighted)
    energy[1::2] *= -1.0
    return SeriesBasis(locked(table), locked(energy))


class Solution(NamedTuple):
    """
    Optima of some equations, or of one.

    Attributes
    ----------
    amplitudes
        Of the changes and, last, of the law of least degree, which is 1, shape (..., terms + 1).
    cost
        Of one unit of distance, shape (...).

    """

    amplitudes: FloatArray
    cost: FloatArray


def solved(coefficients: FloatArray, terms: int) -> Solution:
    """
    Return the laws of least cost, by the method of Ritz.

    Parameters
    ----------
    coefficients
        a_0 ... a_6 in normalised time, shape (..., 7) [-].
    terms
        How many changes a law has.

    Raises
    ------
    numpy.linalg.LinAlgError
        An equation is singular in double precision.

    """
    energy = series_basis(terms).energy
    system = (coefficients @ energy.reshape(len(energy), -1)).reshape(
        *coefficients.shape[:-1], terms + 1, terms + 1
    )
    amplitudes = np.ones((*coefficients.shape[:-1], terms + 1))
    changes = np.linalg.solve(system[..., :terms, :terms], -system[..., :terms, terms:])
    amplitudes[..., :terms] = changes[..., 0]
    # Stationary in all changes, the cost is what the law of least degree has of it.
    return Solution(amplitudes, (system[..., terms, :] * amplitudes).sum(axis=-1))


class Probed(NamedTuple):
    """
    Laws at the times of the certificate, m of them.

    Attributes
    ----------
    jets
        Derivatives 0 to 6, shape (..., 7, m).
    parts
        w^(2k - 6), k = 1 ... 6, without its share of polynomials below the sixth degree, shape
        (..., 6, m): of a stationary law they add up to zero with the factors a_k.

    """

    jets: FloatArray
    parts: FloatArray


def probed(amplitudes: FloatArray) -> Probed:
    """Return what certifies laws by their amplitudes, shape (..., terms + 1)."""
    values = amplitudes @ _at_probes(amplitudes.shape[-1] - 1)
    table = values.reshape(*amplitudes.shape[:-1], 2 * JET_ORDER + 1, -1)
    return Probed(table[..., : JET_ORDER + 1, :], table[..., JET_ORDER + 1 :, :])


@lru_cache(maxsize=len(TERMS))
def _at_probes(terms: int) -> FloatArray:
    """Return both tables of `Probed` for a basis, shape (terms + 1, 13 m)."""
    after_start, before_end = probes(PROBE_DEPTH)
    places = np.where(after_start < 1.0, after_start - 1.0, 1.0 - before_end)
    derivatives = series_basis(terms).derivatives
    values = legendre_values(places, derivatives.shape[1])
    jets = np.einsum('kst,sm->tkm', derivatives[JET_ORDER:], values)
    parts = np.einsum('kst,sm->tkm', derivatives[2::2, CONDITIONS:], values[CONDITIONS:])
    return locked(np.concatenate([jets, parts], axis=1).reshape(terms + 1, -1))


def continued(coefficients: FloatArray, jets: FloatArray, polynomial: FloatArray) -> FloatArray:
    """
    Return the derivatives 7 to 12, which follow from the lower ones by the equation.

    Parameters
    ----------
    coefficients
        a_0 ... a_6, shape (..., 7).
    jets
        Integrals and derivatives of orders -6 to 6, or coefficients of them, shape (..., 13, m).
    polynomial
        What sum_k a_k w^(2k - 6) is, of degree 5, and its derivatives 1 to 6 there, or
        coefficients of them, shape (..., 7, m).

    Returns
    -------
    FloatArray
        Shape (..., 6, m).

    """
    orders = jets.shape[-2]
    table = np.concatenate([jets, polynomial[..., 1:, :]], axis=-2)
    lower = coefficients[..., None, :JET_ORDER]
    for order in range(1, JET_ORDER + 1):
        known = table[..., order : order + 2 * JET_ORDER : 2, :]
        table[..., orders + order - 1, :] -= (lower @ known)[..., 0, :]
    return table[..., orders:, :]
