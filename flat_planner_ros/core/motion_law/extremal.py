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
Extremals of a quadratic cost: the Euler-Lagrange equation solved for given ends.

The equation has constant coefficients and only even derivatives, sum_k a_k y^(2k) = 0, so its
solutions split into odd and even ones about the middle of the motion and its roots come as +-beta
(docs/derivation.md, section 5). Roots that crowd together would make separate exponentials nearly
dependent; such a cluster is spanned by the solutions of its own small equation with unit initial
values: an exponential times a power series. One root alone gives the paper's exponential, a
multiple root an exponential times a polynomial, and twelve roots near zero the polynomial law: one
mechanism without a special case.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from flat_planner_ros.core.arm import FloatArray, UncertifiedPlan
from flat_planner_ros.core.motion_law.basis import ALTERNATING, Block, block_of, CONDITIONS
from flat_planner_ros.core.motion_law.law import ExponentialLaw
from flat_planner_ros.core.motion_law.modes import Mode
from flat_planner_ros.core.motion_law.roots import Cluster, clusters
import numpy as np

_ORDERS = np.arange(CONDITIONS + 1.0)

_UNIT_END = 0.5 * np.eye(CONDITIONS)[0]

RESIDUAL_STEPS = 1
"""Corrections of the solved boundary conditions by their own residual."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BoundaryConditions:
    """
    Value and five derivatives at both ends.

    Attributes
    ----------
    start, end
        Derivatives of orders 0 to 5, shape (6,) [rad/s^k].

    """

    start: FloatArray
    end: FloatArray


def extremal(
    coefficients: FloatArray, duration: float, jets: BoundaryConditions
) -> ExponentialLaw:
    """
    Return the stationary motion law with given ends.

    Parameters
    ----------
    coefficients
        a_0 ... a_6 of the Euler-Lagrange equation in physical time, as given by
        `QuadraticCost.characteristic`, shape (7,) [s^(2k - 12)].
    duration
        Length of the motion [s].
    jets
        What the law must meet.

    Raises
    ------
    UncertifiedPlan
        The boundary conditions are singular in double precision.

    """
    return extremals(coefficients, duration, [jets])[0]


def extremals(
    coefficients: FloatArray, duration: float, jets: Sequence[BoundaryConditions]
) -> list[ExponentialLaw]:
    """Return the stationary laws of one equation for several pairs of ends, as `extremal`."""
    half = 0.5 * duration
    powers = half**_ORDERS
    found = clusters(coefficients * powers[::-1] ** 2)
    solvers: dict[float, _BoundarySolver] = {}
    laws = []
    for ends in jets:
        start, end = ends.start * powers[:CONDITIONS], ends.end * powers[:CONDITIONS]
        middle = 0.5 * (ends.start[0] + ends.end[0])
        modes = []
        if middle:
            modes.append(Mode(rate=0j, origin=0, coefficients=(complex(middle),)))
        mirrored = ALTERNATING * start
        for parity in (-1.0, 1.0):
            # Right-hand side of the law's odd or even part about the middle, at the end x = 1.
            target = 0.5 * (end + parity * mirrored)
            target[0] -= middle if parity > 0.0 else 0.0
            if target.any():
                if parity not in solvers:
                    solvers[parity] = _BoundarySolver(found, parity)
                modes.extend(solvers[parity].modes(target))
        laws.append(ExponentialLaw(duration=duration, modes=tuple(modes)))
    return laws


def unit_modes(coefficients: FloatArray) -> tuple[Mode, ...]:
    """
    Return the stationary law from rest at -1/2 to rest at 1/2 in normalised time; it is odd.

    Parameters
    ----------
    coefficients
        a_0 ... a_6 in normalised time, shape (7,) [-].

    Raises
    ------
    UncertifiedPlan
        The boundary conditions are singular in double precision.

    """
    return tuple(_BoundarySolver(clusters(coefficients), -1.0).modes(_UNIT_END))


def stationarity_residual(coefficients: FloatArray, jet: FloatArray) -> float:
    """
    Return how far derivatives are from fulfilling the Euler-Lagrange equation.

    Parameters
    ----------
    coefficients
        a_0 ... a_6, shape (7,).
    jet
        Derivatives 0 to 12 at some times, shape (13, m).

    Returns
    -------
    float
        Largest |sum_k a_k y^(2k)| over the times, relative to the largest sum of the terms'
        magnitudes [-].

    """
    weights, even = coefficients[1:], jet[2::2]
    size = float((np.abs(weights) @ np.abs(even)).max())
    return float(np.abs(weights @ even).max()) / size if size > 0.0 else 0.0


def costate(coefficients: FloatArray, jet: FloatArray) -> FloatArray:
    """
    Return half the costate of the value, -sum_k a_k y^(2k - 1), which an extremal conserves.

    Times the distance it is the cost of a rest-to-rest motion ((33) and (35) of
    docs/derivation.md).

    Parameters
    ----------
    coefficients
        a_0 ... a_6, shape (7,).
    jet
        Derivatives 0 to 11 at some times, shape (12, m) or more rows.

    Returns
    -------
    FloatArray
        Its value at each of the times, shape (m,) [rad s^-11].

    """
    value: FloatArray = -coefficients[1:] @ jet[1::2]
    return value


class _BoundarySolver:
    """Fits the solutions of one parity to jets at x = 1; the matrix is inverted once."""

    def __init__(self, found: Sequence[Cluster], parity: float) -> None:
        """Scale the conditions' matrix and invert it."""
        ordered = sorted(found, key=lambda cluster: abs(cluster.centre))
        self._parity = parity
        self._blocks = [block_of(cluster, parity) for cluster in ordered]
        columns = [column for block in self._blocks for column in block.columns]
        self._rows = _row_factors([b.growth for b in self._blocks for _ in b.columns])
        self._matrix = (self._rows * np.array(columns)).T
        try:
            self._inverse = np.linalg.inv(self._matrix)
        except np.linalg.LinAlgError as error:
            raise UncertifiedPlan('boundary residual', np.inf, 0.0) from error

    def modes(self, target: FloatArray) -> list[Mode]:
        """Return the modes of the combination of solutions that meets a jet."""
        target = self._rows * target
        weights = self._inverse @ target
        for _ in range(RESIDUAL_STEPS):
            weights += self._inverse @ (target - self._matrix @ weights)
        return _combined(self._blocks, weights.tolist(), self._parity)


def _combined(blocks: Sequence[Block], weights: list[float], parity: float) -> list[Mode]:
    """Return one mode for each block, with its mirror image unless it is symmetric by itself."""
    modes, first = [], 0
    for block in blocks:
        last = first + len(block.columns)
        mode = Mode(block.rate, block.origin, block.combined(weights[first:last]))
        modes.append(mode)
        if block.origin != 0:
            modes.append(mode.mirrored(parity))
        first = last
    return modes


def _row_factors(rates: Sequence[float]) -> FloatArray:
    """
    Return factors of the conditions after which each solution is largest in its own one.

    The k-th derivative of a solution grows like its rate to the power k. With rates b in ascending
    order and factors e_k / e_(k-1) = 1 / sqrt(b_(k-1) b_k), entry e_k b_i^k is largest at k = i:
    fast solutions meet the high derivatives and slow ones the low, whatever their rates.
    """
    factors = [1.0]
    for slow, fast in pairwise(rates):
        factors.append(factors[-1] / (slow * fast) ** 0.5)
    return np.array(factors)
