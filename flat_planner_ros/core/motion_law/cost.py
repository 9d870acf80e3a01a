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
Quadratic costs of a motion law; a strategy is nothing but a cost.

J = integral of Y^T Q Y over the motion, Y = (y', y'', ..., y^(6)) and Q66 = 1
((16) of docs/derivation.md).
"""

from collections.abc import Callable
from dataclasses import dataclass, InitVar
from enum import Enum
from functools import cache, cached_property
from typing import TYPE_CHECKING

from flat_planner_ros.core.arm import FlatMap, FloatArray, InvalidCost, locked
import numpy as np

if TYPE_CHECKING:
    from typing import Self  # Python 3.10 has none

ORDER = 6
"""Highest derivative in the cost; the motion law solves an equation of twice this order."""

WEIGHT_EXPONENT = 8
"""The paper raises r and p to this power, so that useful weights stay below 1000."""

MAX_FACTOR = 1e100
"""Largest factor of a derivative in a cost; its square and sums of squares still have room."""

MAX_ROOT = MAX_FACTOR ** (2.0 / WEIGHT_EXPONENT)
"""Largest r or p, whose fourth power is a factor: no arm asks for a millionth of it."""

MAX_ENTRY = MAX_FACTOR**2
"""Largest entry of a cost's Q; sums of several still have room."""

SEMIDEFINITE_TOLERANCE = 1e-10
"""Most negative eigenvalue of a positive-semidefinite Q scaled to unit diagonal [-]."""

SYMMETRY_TOLERANCE = 1e-12
"""Largest difference of Q_ij and Q_ji relative to sqrt(Q_ii Q_jj) [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class QuadraticCost:
    """
    Weights on products of the derivatives of the planned variable.

    Attributes
    ----------
    matrix
        Symmetric positive-semidefinite Q with Q66 = 1, shape (6, 6); Q_ij multiplies
        y^(i) y^(j), unit s^(i + j - 12).
    is_sum_of_squares
        Whether Q has been made as one, which spares the check.

    """

    matrix: FloatArray
    is_sum_of_squares: InitVar[bool] = False

    def __post_init__(self, is_sum_of_squares: bool) -> None:
        """Refuse what has no unique minimum."""
        matrix = np.array(self.matrix, dtype=float)
        object.__setattr__(self, 'matrix', matrix)
        locked(matrix)
        if is_sum_of_squares:
            return
        if matrix.shape != (ORDER, ORDER):
            raise InvalidCost(f'Q must be 6 x 6 (36 numbers), got shape {matrix.shape}')
        infinite = np.argwhere(~np.isfinite(matrix))
        if infinite.size:
            i, j = infinite[0]
            raise InvalidCost(f'Q{i + 1}{j + 1} = {matrix[i, j]:g} must be finite')
        if np.abs(matrix).max() > MAX_ENTRY:
            i, j = np.unravel_index(np.argmax(np.abs(matrix)), matrix.shape)
            raise InvalidCost(f'Q{i + 1}{j + 1} = {matrix[i, j]:g} is beyond {MAX_ENTRY:g}')
        if matrix[-1, -1] != 1.0:
            raise InvalidCost(f'Q66 must be 1, got {matrix[-1, -1]:g}')
        _check_semidefinite(matrix)

    def characteristic(self) -> FloatArray:
        """
        Return the characteristic polynomial of the Euler-Lagrange equation in z = beta^2.

        Returns
        -------
        FloatArray
            Coefficients a_0 ... a_6 of sum a_k z^k, ascending, a_0 = 0 and a_6 = 1, shape (7,),
            read-only; a_k multiplies y^(2k), unit s^(2k - 12).

        References
        ----------
        (21) of docs/derivation.md; `eq:ode` of the paper.

        """
        return self._characteristic

    @cached_property
    def _characteristic(self) -> FloatArray:
        """Sum the antidiagonals of Q once: plans of all durations ask for them."""
        coefficients: FloatArray = _antidiagonals() @ self.matrix.ravel()
        return locked(coefficients)


@cache
def _antidiagonals() -> FloatArray:
    """Return the matrix that takes Q row by row to the sums of (-1)^i Q_ij over i + j = 2k."""
    i, j = np.indices((ORDER, ORDER)) + 1
    sums = np.arange(ORDER + 1)[:, None, None]
    # Those with an odd sum of indices integrate to boundary terms and drop out.
    table: FloatArray = np.where(i + j == 2 * sums, (-1.0) ** i, 0.0)
    return table.reshape(ORDER + 1, ORDER * ORDER)


def _check_semidefinite(matrix: FloatArray) -> None:
    """Judge Q scaled to unit diagonal: its entries have different units and sizes."""
    diagonal = np.diag(matrix)
    if (diagonal < 0.0).any():
        order = int(np.argmin(diagonal)) + 1
        raise InvalidCost(f'Q{order}{order} = {diagonal[order - 1]:g} must not be negative')
    # A zero on the diagonal of a semidefinite matrix allows nothing else in its row.
    empty = diagonal == 0.0
    if matrix[empty].any() or matrix[:, empty].any():
        order = int(np.flatnonzero(empty & (matrix.any(0) | matrix.any(1)))[0]) + 1
        raise InvalidCost(f'Q is indefinite: Q{order}{order} = 0 but row {order} is not zero')
    root = np.sqrt(np.where(empty, 1.0, diagonal))
    with np.errstate(over='ignore'):
        scaled = matrix / root / root[:, None]
    if np.isinf(scaled).any():
        i, j = np.argwhere(np.isinf(scaled))[0]
        raise InvalidCost(
            f'Q is indefinite: Q{i + 1}{j + 1} = {matrix[i, j]:g} exceeds the root of '
            f'Q{i + 1}{i + 1} Q{j + 1}{j + 1}'
        )
    asymmetry = np.abs(scaled - scaled.T).max()
    if asymmetry > SYMMETRY_TOLERANCE:
        i, j = np.unravel_index(np.argmax(np.abs(scaled - scaled.T)), matrix.shape)
        raise InvalidCost(
            f'Q must be symmetric, but Q{i + 1}{j + 1} = {matrix[i, j]:g} '
            f'and Q{j + 1}{i + 1} = {matrix[j, i]:g}'
        )
    smallest = float(np.linalg.eigvalsh(scaled)[0])
    if smallest < -SEMIDEFINITE_TOLERANCE:
        raise InvalidCost(
            f'Q must be positive semidefinite, but scaled to unit diagonal it has '
            f'the eigenvalue {smallest:.3g}'
        )


def effort_square(flat_map: FlatMap, r: float, p: float) -> FloatArray:
    """Return Q of the squared effort, weighted with r^8, (18) of docs/derivation.md."""
    del p
    effort = flat_map.effort[1:]
    factor = r ** (WEIGHT_EXPONENT // 2)
    largest = factor * max(map(abs, effort.tolist()))
    if not largest < MAX_FACTOR:
        raise InvalidCost(
            f'effort weighted with r = {r:g} is up to {largest:.3g}, beyond {MAX_FACTOR:g}: '
            f'the model has numbers that no arm has'
        )
    weighted = factor * effort
    matrix = np.zeros((ORDER, ORDER))
    matrix[: len(effort), : len(effort)] = weighted[:, None] * weighted
    return matrix


def acceleration_square(flat_map: FlatMap, r: float, p: float) -> FloatArray:
    """Return Q of the squared acceleration, weighted with p^8, (19) of docs/derivation.md."""
    del flat_map, r
    matrix = np.zeros((ORDER, ORDER))
    matrix[1, 1] = p**WEIGHT_EXPONENT
    return matrix


Square = Callable[[FlatMap, float, float], FloatArray]


class Strategy(Enum):
    """
    Named costs of the paper, one's own, the trade of `insensitive`, and the least peak.

    The cost is the integral of the squared sixth derivative and of the squares in the row. A new
    strategy is a row here and a `Square`, a function as the ones above, for what is new in it; the
    parameter `strategy`, the programs and their texts find it by its name. One that is more than a
    cost is told of in core/planning/strategies.py.

    Attributes
    ----------
    squares
        What is minimised besides the sixth derivative.

    """

    POLYNOMIAL = 'polynomial'
    MIN_CONTROL_EFFORT = 'min_control_effort', effort_square
    MIN_POTENTIAL_ENERGY = 'min_potential_energy', acceleration_square
    MIXED = 'mixed', effort_square, acceleration_square
    # Takes Q from the request.
    CUSTOM = 'custom'
    # Shapes one joint's effort; the others, and starts in motion, have the polynomial law.
    INSENSITIVE = 'insensitive'
    # The same, of least peak; it has a law of its own from starts in motion too.
    MIN_PEAK_EFFORT = 'min_peak_effort'

    squares: tuple[Square, ...]

    def __new__(cls, name: str, *squares: Square) -> 'Self':
        """Return a member whose value is its name."""
        member = object.__new__(cls)
        member._value_ = name
        member.squares = squares
        return member


def strategy_cost(
    strategy: Strategy,
    flat_map: FlatMap,
    *,
    r: float = 0.0,
    p: float = 0.0,
    custom: FloatArray | None = None,
) -> QuadraticCost:
    """
    Return the cost of a strategy.

    Parameters
    ----------
    strategy
        Which of the named costs.
    flat_map
        Flat map of the arm, whose effort row is weighted by r.
    r
        Weight of the squared effort, raised to the power of 8 [(N m)^(-1/4) s^(-3/2) rad^(1/4)].
    p
        Weight of the squared acceleration, raised to the power of 8 [1/s].
    custom
        Q of the strategy `custom`, shape (6, 6).

    Raises
    ------
    InvalidCost
        A weight below 0 or too large for double precision, or an inadmissible Q.

    References
    ----------
    (17) to (19) of docs/derivation.md; `eq:mintau`, `eq:minpot` of the paper.

    """
    for name, weight in (('r', r), ('p', p)):
        if not 0.0 <= weight <= MAX_ROOT:
            raise InvalidCost(f'weight {name} = {weight:g} is outside [0, {MAX_ROOT:g}]')
    if not strategy.squares:
        return fixed_cost(strategy, custom)
    matrix = np.zeros((ORDER, ORDER))
    for square in strategy.squares:
        matrix += square(flat_map, r, p)
    matrix[-1, -1] = 1.0
    return QuadraticCost(matrix=matrix, is_sum_of_squares=True)


def fixed_cost(strategy: Strategy, custom: FloatArray | None = None) -> QuadraticCost:
    """
    Return the cost of a strategy without squares, which is the same for every arm.

    Raises
    ------
    InvalidCost
        An inadmissible Q, or none for the strategy `custom`.

    """
    if strategy is Strategy.CUSTOM:
        if custom is None:
            raise InvalidCost('strategy custom needs weights.Q, 36 numbers row by row')
        return QuadraticCost(matrix=custom)
    return QuadraticCost(matrix=np.diag(np.eye(ORDER)[-1]), is_sum_of_squares=True)
