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
What unit motions of many equations have in common, however their laws are written down.

They are certified as `unit_motion` certifies each by itself, and their answer to an oscillation is
an integral over their velocity, which is smooth at both ends.
"""

from dataclasses import dataclass, fields
from math import comb
from typing import NamedTuple

from flat_planner_ros.core.arm import ComplexArray, FloatArray
from flat_planner_ros.core.motion_law.basis import CONDITIONS, SOLUTIONS
from flat_planner_ros.core.motion_law.certificate import quality
from flat_planner_ros.core.motion_law.law import JET_ORDER
from flat_planner_ros.core.motion_law.series_basis import speeds
import numpy as np
from numpy.typing import NDArray

IntArray = NDArray[np.int64]
"""Indices."""

FAR_POLE = 6.0
"""Oscillation from which the integral by parts has terms that do not cancel [-]."""

FASTER_POLE = 2.0
"""The same relative to the fastest root of the law [-]."""

FEWEST_INTERVALS = 16
"""Fewest parts of half a motion in a trapezoidal sum."""

EULER_MACLAURIN = (1.0 / 30240.0, -1.0 / 1209600.0, 1.0 / 47900160.0)
"""B_2k / (2 k)! for k = 3, 4, 5: the ends' share of a trapezoidal sum."""


class Nodes(NamedTuple):
    """
    Some motions at some nodes of a quadrature over half a motion.

    Attributes
    ----------
    rows
        Which motions, shape (q,).
    weights
        Of sum 1 for all nodes of a motion together, shape (m,) [-].
    halves
        Combinations of derivatives in the first half, and at the mirrored places, (q, r, m) each.

    """

    rows: IntArray
    weights: FloatArray
    halves: tuple[FloatArray, FloatArray]


@dataclass(frozen=True, kw_only=True, eq=False)
class Certificates:
    """
    Quality, cost and ends of unit motions in normalised time.

    Attributes
    ----------
    coefficients
        a_0 ... a_6 of their equations, shape (p, 7).
    boundary_residual, optimality_residual
        (31) and (32) of docs/derivation.md, shape (p,).
    costate
        (33) of docs/derivation.md, here also the cost, shape (p,).
    peaks
        Largest magnitudes of the derivatives 0 to 6 at the times of the certificate, (p, 7).
    ends
        Derivatives 6 to 11 at the end, shape (p, 6).

    """

    coefficients: FloatArray
    boundary_residual: FloatArray
    optimality_residual: FloatArray
    costate: FloatArray
    peaks: FloatArray
    ends: FloatArray

    @classmethod
    def of(cls, coefficients: FloatArray, jets: FloatArray) -> 'Certificates':
        """
        Return what derivatives tell of unit motions.

        Parameters
        ----------
        coefficients
            Of their equations, shape (p, 7).
        jets
            Derivatives 0 to 12 at `probes`, shape (p, 13, m).

        """
        return cls(
            coefficients=coefficients,
            **quality(coefficients, jets, jets[:, 2::2])._asdict(),
            costate=-np.einsum('pk,pk->p', coefficients[:, 1:], jets[:, 1:SOLUTIONS:2, -2]),
            ends=jets[:, CONDITIONS:SOLUTIONS, -1].copy(),
        )

    def chosen(self, rows: IntArray) -> 'Certificates':
        """Return those of some motions."""
        return Certificates(**{each.name: getattr(self, each.name)[rows] for each in fields(self)})


def transform_intervals(coefficients: FloatArray, poles: ComplexArray) -> IntArray:
    """
    Return into how many parts the trapezoidal sum of a transform divides half a motion.

    Parameters
    ----------
    coefficients
        Of the equations, shape (p, 7).
    poles
        z, shape (p, q) [-].

    Returns
    -------
    IntArray
        Powers of two, 0 where the integral by parts is exact for all poles, shape (p,).

    """
    sizes, fastest = np.abs(poles), speeds(coefficients)
    rates = fastest + sizes.max(axis=1)
    parts = 2 ** np.ceil(np.log2(np.maximum(rates, FEWEST_INTERVALS))).astype(np.int64)
    is_far = sizes.min(axis=1) >= np.maximum(FAR_POLE, FASTER_POLE * fastest)
    return np.where(is_far, 0, parts)


def by_parts(certificates: Certificates, poles: ComplexArray) -> ComplexArray:
    """
    Return the integral of w' exp(z (1 - x)) over motions, twelve times by parts.

    What is left of the integral then is a multiple of itself, by the Euler-Lagrange equation.

    Parameters
    ----------
    certificates
        Of the motions, p of them.
    poles
        z, larger than the roots of the equations, shape (p, q) [-].

    References
    ----------
    (44b) of docs/derivation.md.

    """
    inverse = 1.0 / poles
    square = inverse * inverse
    coefficients, ends = certificates.coefficients, certificates.ends
    # sum_k a_k z^(2k - 12), from the lowest that meets a boundary term on.
    sums = [np.ones_like(poles)]
    power = square
    for k in range(CONDITIONS - 1, 0, -1):
        column = coefficients[:, k : k + 1]
        sums.append(sums[-1] + column * power if column.any() else sums[-1])
        power = power * square
    # Of even order the terms of start and end add up, of odd order they are subtracted.
    even, odd = (sums[0] * ends[:, order, None] for order in (-2, -1))
    for order in range(CONDITIONS - 4, -1, -2):
        left = sums[CONDITIONS // 2 - 1 - order // 2]
        even = ends[:, order, None] * left + square * even
        odd = ends[:, order + 1, None] * left + square * odd
    odd = inverse * odd
    result: ComplexArray = even + odd + np.exp(2.0 * poles) * (even - odd)
    result *= -square * square * square / sums[-1]
    return result


def trapezoid(
    velocities: FloatArray, certificates: Certificates, poles: ComplexArray
) -> ComplexArray:
    """
    Return the integral of w' exp(z (1 - x)) over motions as a trapezoidal sum.

    Parameters
    ----------
    velocities
        w' at even x from 0 to 1, which is even in x, shape (p, m).
    certificates
        Of the motions, p of them.
    poles
        z, shape (p, q) [-].

    References
    ----------
    Euler-Maclaurin formula: w' begins and ends with w^(6), what lower derivatives would add is
    zero.

    """
    step = 1.0 / (velocities.shape[1] - 1)
    # sum_j w'_j cosh(j z h) by Clenshaw's recurrence.
    cosh = np.cosh(step * poles)
    double = 2.0 * cosh
    current, last, product = np.zeros_like(poles), np.zeros_like(poles), np.empty_like(poles)
    for column in velocities.T[:0:-1]:
        np.multiply(double, current, out=product)
        np.subtract(product, last, out=last)
        last += column[:, None]
        current, last = last, current
    inner = velocities[:, :1] + 2.0 * (cosh * current - last)
    result: ComplexArray = step * np.exp(poles) * inner
    start = np.exp(2.0 * poles)
    for k, factor in enumerate(EULER_MACLAURIN, start=CONDITIONS // 2):
        for j in range(2 * k - CONDITIONS + 1):
            order = 2 * k - j
            end = certificates.ends[:, order - CONDITIONS, None]
            left = comb(2 * k - 1, j) * (-poles) ** j * end * (1.0 + (-1.0) ** order * start)
            result -= factor * step ** (2 * k) * left
    return result


def mirrored_grid(
    odd: FloatArray, even: FloatArray, rows: FloatArray, certificates: Certificates, intervals: int
) -> FloatArray:
    """
    Return combinations of derivatives at even times, the ends as exact as they are certified.

    Parameters
    ----------
    odd, even
        Their odd and even parts at the first half of the times, shape (p, m, half).
    rows
        Factors of the derivatives 0 to 6, shape (p, m, 7).
    certificates
        Of the motions, p of them.
    intervals
        Parts of the motion.

    """
    half = odd.shape[2]
    table = np.empty((*odd.shape[:2], intervals + 1))
    np.subtract(even, odd, out=table[..., ::-1][..., :half])
    np.add(odd, even, out=table[..., :half])
    end = 0.5 * rows[..., 0] + rows[..., JET_ORDER] * certificates.ends[:, :1]
    table[..., 0], table[..., -1] = -end, end
    return table
