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
Motion problems: what plans of the same arm, cost and duration share.

From rest to rest all planned variables are multiples of one unit motion, which is solved once for
an arm, a cost and a duration, and kept with its samples.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import sqrt
from typing import NamedTuple

from flat_planner_ros.core.arm import (
    ComplexArray,
    flat_map,
    FlatMap,
    FloatArray,
    locked,
    PlanarArm,
    strict_arithmetic,
)
from flat_planner_ros.core.motion_law import (
    characteristic_roots,
    Cluster,
    CONDITIONS,
    JET_ORDER,
    known_spectrum,
    QuadraticCost,
    unit_motion,
    UnitMotion,
)
from flat_planner_ros.core.planning.request import PlanningOptions
import numpy as np

MAX_NUMBER = 1e300
"""Largest number in a plan; products with weights of order one still have room."""

PROBLEMS_KEPT = 64
"""Combinations of arm, options and duration whose unit motion is remembered."""

EQUATIONS_KEPT = 16
"""Combinations of arm and options whose equation is remembered, for other durations."""

GRIDS_KEPT = 32
"""Sampled unit motions in the cache."""

MAX_KEPT_INTERVALS = 10_000
"""Longest grid that is kept; with `GRIDS_KEPT` it bounds the caches to 24 MB."""

_ORDERS = np.arange(JET_ORDER + 1.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionProblem:
    """
    What a plan is made from, besides its ends.

    The motion over 1 rad, of which motions from rest to rest are multiples, is solved when it is
    first asked for, which may raise ArithmeticError or UncertifiedPlan.

    Attributes
    ----------
    arm
        What moves.
    duration
        Length of the motion [s].
    cost
        What is minimised.
    flat_map
        From the planned variable to the joints.
    equation
        a_0 ... a_6 of its Euler-Lagrange equation in normalised time, shape (7,) [-].
    rates
        Factors of the derivatives 0 to 6 in physical time, shape (7,) [1/s^k].

    """

    arm: PlanarArm
    duration: float
    cost: QuadraticCost
    flat_map: FlatMap
    equation: FloatArray
    rates: FloatArray

    @property
    def unit(self) -> UnitMotion:
        """Law over 1 rad in normalised time."""
        return self._over_one.unit

    @property
    def cost_value(self) -> float:
        """Cost of 1 rad."""
        return self._over_one.cost_value

    @property
    def reach(self) -> float:
        """Distance from which numbers overflow [rad]."""
        return self._over_one.reach

    @cached_property
    def _over_one(self) -> '_OverOne':
        """Solve the motion over 1 rad."""
        with strict_arithmetic():
            unit = unit_motion(self.equation, self._clusters)
            largest = float((self.rates * unit.peaks).max())
        # (35) with every derivative in units of the half duration.
        scale: float = (0.5 * float(self.duration)) ** (1.0 - 2.0 * CONDITIONS)
        cost = unit.costate * scale
        # A law that is no minimum, which its certificate refuses, might have a negative cost.
        # Roots first: a cost of less than 1e-8 would take the quotient out of range.
        reach = min(MAX_NUMBER / largest, sqrt(MAX_NUMBER) / sqrt(cost)) if cost > 0.0 else 0.0
        return _OverOne(unit, cost, reach)

    def _clusters(self) -> list[Cluster]:
        """Return the clusters of the equation's roots, which are found once for all durations."""
        spectrum = known_spectrum(self.cost.characteristic().tobytes())
        return spectrum.clusters(0.5 * float(self.duration))

    @cached_property
    def roots(self) -> ComplexArray:
        """Characteristic roots in units of 2 / duration, one of each +-beta, shape (6,) [-]."""
        return characteristic_roots(self.equation)

    @cached_property
    def rows(self) -> FloatArray:
        """Torque and velocities of the last two joints from the unit motion's jet, (3, 7)."""
        return joint_rows(self.flat_map) * self.rates

    def grid(self, intervals: int) -> FloatArray:
        """Return derivatives 0 to 6 and driving effort at even times, read-only, shape (8, m)."""
        if intervals > MAX_KEPT_INTERVALS:
            return _grid(self, intervals)
        return _kept_grid(self, intervals)

    def fill_grid(self, table: FloatArray, distance: float) -> None:
        """Write derivatives 0 to 6 and driving effort over a distance at even times, (8, m)."""
        intervals = table.shape[1] - 1
        if intervals <= MAX_KEPT_INTERVALS:
            np.multiply(_kept_grid(self, intervals), distance, out=table)
        else:
            _fill(self, table, distance)


class _OverOne(NamedTuple):
    """The motion over 1 rad, its cost, and the distance from which numbers overflow [rad]."""

    unit: UnitMotion
    cost_value: float
    reach: float


def joint_rows(mapping: FlatMap) -> FloatArray:
    """
    Return effort of joint n-1, velocity of link n-1 and of joint n from the planned variable.

    Returns
    -------
    FloatArray
        Factors of its derivatives 0 to 6, shape (3, 7) [N m s^k / rad] and [s^(k - 1)].

    """
    rows = np.zeros((3, JET_ORDER + 1))
    rows[0, : len(mapping.effort)] = mapping.effort
    rows[1, 1 : len(mapping.output) + 1] = mapping.output
    rows[2, 1 : len(mapping.deflection) + 1] = mapping.deflection
    rows[1] -= rows[2]
    return rows


@lru_cache(maxsize=PROBLEMS_KEPT)
def problem_of(arm: PlanarArm, options: PlanningOptions, duration: float) -> MotionProblem:
    """
    Return what plans of an arm have in common; arms and options count as equal if identical.

    Raises
    ------
    ArithmeticError
        The numbers leave double precision.
    FlatPlannerError
        The arm or the weights allow no plan.

    """
    mapping, cost = _equation(arm, options)
    half = 0.5 * float(duration)
    powers = half**_ORDERS
    with strict_arithmetic():
        return MotionProblem(
            arm=arm,
            duration=duration,
            cost=cost,
            flat_map=mapping,
            equation=locked(cost.characteristic() * powers[::-1] ** 2),
            rates=locked(1.0 / powers),
        )


@lru_cache(maxsize=EQUATIONS_KEPT)
def _equation(arm: PlanarArm, options: PlanningOptions) -> tuple[FlatMap, QuadraticCost]:
    """Return what no duration changes: flat map and cost."""
    mapping = flat_map(arm, options.flat_model)
    return mapping, options.cost(arm, mapping)


def _grid(problem: MotionProblem, intervals: int) -> FloatArray:
    """Return the motion over 1 rad at even times."""
    table = np.empty((len(problem.rates) + 1, intervals + 1))
    _fill(problem, table, 1.0)
    return locked(table)


def _fill(problem: MotionProblem, table: FloatArray, distance: float) -> None:
    """Write the motion over a distance at even times."""
    problem.unit.fill_grid(table[:-1], distance * problem.rates)
    row = problem.flat_map.effort
    np.matmul(row, table[: len(row)], out=table[-1])


_kept_grid = lru_cache(maxsize=GRIDS_KEPT)(_grid)
