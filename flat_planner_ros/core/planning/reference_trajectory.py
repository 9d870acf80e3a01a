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
Reference trajectories: the planned variables over time, however their laws were found.

From rest to rest all planned variables are multiples of one unit motion, which is solved once for
an arm, a cost and a duration, and kept with its samples; any other trajectory is evaluated law by
law.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple, Protocol

from flat_planner_ros.core.arm import (
    apply_row,
    flat_map,
    FlatMap,
    FloatArray,
    locked,
    PlanarArm,
    strict_arithmetic,
)
from flat_planner_ros.core.motion_law import (
    CONDITIONS,
    JET_ORDER,
    Law,
    motion_quadrature,
    QuadraticCost,
    strategy_cost,
    unit_motion,
    UnitMotion,
)
from flat_planner_ros.core.peak import PeakMotion
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

NODES_PER_PIECE = 8
"""Gauss-Legendre nodes between two knots of an effort that is linear there."""

_ORDERS = np.arange(JET_ORDER + 1.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionProblem:
    """
    What a plan is made from, besides its ends: the motion over 1 rad.

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
    unit
        The law in normalised time.
    rates
        Factors of its derivatives 0 to 6 in physical time, shape (7,) [1/s^k].
    cost_value
        Cost of 1 rad.
    reach
        Distance from which numbers overflow [rad].

    """

    arm: PlanarArm
    duration: float
    cost: QuadraticCost
    flat_map: FlatMap
    unit: UnitMotion
    rates: FloatArray
    cost_value: float
    reach: float

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
        The arm, the weights or the equation allow no plan.

    """
    mapping, cost, characteristic = _equation(arm, options)
    half = 0.5 * float(duration)
    powers = half**_ORDERS
    with strict_arithmetic():
        unit = unit_motion(characteristic * powers[::-1] ** 2)
        rates = 1.0 / powers
        largest = float((rates * unit.peaks).max())
    # (35) with every derivative in units of the half duration.
    cost_value = unit.costate * half ** (1.0 - 2.0 * CONDITIONS)
    # A law that is no minimum, which its certificate refuses, might have a negative cost.
    # Roots first: a cost of less than 1e-8 would take the quotient out of range.
    reach = min(MAX_NUMBER / largest, MAX_NUMBER**0.5 / cost_value**0.5) if cost_value > 0 else 0.0
    return MotionProblem(
        arm=arm,
        duration=duration,
        cost=cost,
        flat_map=mapping,
        unit=unit,
        rates=rates,
        cost_value=cost_value,
        reach=reach,
    )


@lru_cache(maxsize=EQUATIONS_KEPT)
def _equation(
    arm: PlanarArm, options: PlanningOptions
) -> tuple[FlatMap, QuadraticCost, FloatArray]:
    """Return what no duration changes: flat map, cost and characteristic polynomial."""
    mapping = flat_map(arm, options.flat_model)
    r, p = options.weights(arm)
    cost = strategy_cost(options.strategy, mapping, r=r, p=p, custom=options.custom)
    return mapping, cost, locked(cost.characteristic())


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


def even_times(duration: float, intervals: int) -> FloatArray:
    """Return even times of a motion, both ends exact, read-only, shape (m,) [s]."""
    times = np.arange(intervals + 1.0)
    times /= intervals
    times *= duration
    return locked(times)


class ReferenceTrajectory(Protocol):
    """The planned variables of a motion."""

    @property
    def laws(self) -> tuple[Law, ...]:
        """Return the law of each planned variable."""

    @property
    def edges(self) -> tuple[float, ...]:
        """Return the times from the start to the end between which the laws are smooth [s]."""

    @property
    def peak(self) -> PeakMotion | None:
        """Return what the first law is, if it has the least peak."""

    @property
    def knots(self) -> FloatArray | None:
        """Return the even times between which the laws are smooth, ends included; else None."""

    @property
    def cost_value(self) -> float:
        """Return the sum of their costs."""

    def jets(self, times: FloatArray) -> FloatArray:
        """Return the derivatives 0 to 6 at times clipped to the motion, shape (n - 1, 7, m)."""

    def on_even_grid(self, intervals: int) -> tuple[FloatArray, FloatArray]:
        """Return derivatives 0 to 6, (n - 1, 7, m), and driving effort, (m,), at even times."""

    @property
    def nodes(self) -> 'MotionNodes':
        """Return the motion at the nodes of a quadrature that resolves it."""


class MotionNodes(NamedTuple):
    """
    A motion at the nodes of a quadrature.

    Attributes
    ----------
    times, weights
        Of the nodes, from the start [s], and for means over the motion, of sum 1 [-]; shape (m,).
    planned
        Derivatives 0 to 6 there, shape (n - 1, 7, m).

    """

    times: FloatArray
    weights: FloatArray
    planned: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class RestToRestTrajectory:
    """
    Multiples of a unit motion.

    Attributes
    ----------
    problem
        The motion over 1 rad.
    start, final
        Planned variables at both ends, n - 1 of them [rad].
    distances
        From one to the other, zero where too small for a motion [rad].

    """

    problem: MotionProblem
    start: tuple[float, ...]
    final: tuple[float, ...]
    distances: tuple[float, ...]

    @cached_property
    def laws(self) -> tuple[Law, ...]:
        """Return the law of each planned variable."""
        ends = zip(self.distances, self.start, self.final, strict=True)
        return tuple(
            self.problem.unit.law_over(self.problem.duration, distance, 0.5 * (start + final))
            for distance, start, final in ends
        )

    @property
    def edges(self) -> tuple[float, ...]:
        """Return start and end of the motion [s]."""
        return 0.0, self.problem.duration

    @property
    def peak(self) -> None:
        """Return that no law has the least peak."""

    @property
    def knots(self) -> None:
        """Return that the laws are smooth throughout."""

    @property
    def cost_value(self) -> float:
        """Return the sum of the costs."""
        return sum(distance**2 for distance in self.distances) * self.problem.cost_value

    def jets(self, times: FloatArray) -> FloatArray:
        """Return the derivatives 0 to 6 at times clipped to the motion, shape (n - 1, 7, m)."""
        problem, duration = self.problem, self.problem.duration
        clipped = np.clip(times, 0.0, duration)
        rate = 2.0 / duration
        unit = problem.unit.jet(rate * clipped, rate * (duration - clipped))
        planned: FloatArray = unit * np.multiply.outer(self.distances, problem.rates)[..., None]
        planned[:, 0] += 0.5 * (np.array(self.start) + np.array(self.final))[:, None]
        # The certified ends take their exact values: an executor compares them with zero.
        for reached, end in ((clipped <= 0.0, self.start), (clipped >= duration, self.final)):
            planned[:, :CONDITIONS, reached] = 0.0
            planned[:, 0, reached] = np.array(end)[:, None]
        return planned

    def on_even_grid(self, intervals: int) -> tuple[FloatArray, FloatArray]:
        """Return derivatives 0 to 6, (n - 1, 7, m), and driving effort, (m,), at even times."""
        problem, distances = self.problem, self.distances
        table = np.empty((len(distances), len(problem.rates) + 1, intervals + 1))
        unit = problem.grid(intervals) if len(distances) > 1 else None
        for i, distance in enumerate(distances):
            part, start, final = table[i], self.start[i], self.final[i]
            if unit is None:
                problem.fill_grid(part, distance)
            else:
                np.multiply(unit, distance, out=part)
            values = part[0]
            values += 0.5 * (start + final)
            values[0], values[-1] = start, final
        return table[:, :-1], table[0, -1]

    @cached_property
    def nodes(self) -> MotionNodes:
        """Return the motion at the nodes of a quadrature that resolves it."""
        travel = sum(abs(distance) for distance in self.distances)
        times, weights = motion_quadrature(self.problem.unit.rates, travel, self.edges)
        return MotionNodes(times, weights, self.jets(times))


@dataclass(frozen=True, kw_only=True, eq=False)
class LawTrajectory:
    """
    Laws of any kind that solve the problem's equation between given times.

    Attributes
    ----------
    problem
        Cost and equation that they share.
    laws
        One for each planned variable, n - 1 of them.
    start
        Derivatives 0 to 5 at the start, shape (n - 1, 6) [rad/s^k].
    final
        Planned variables at rest at the end, shape (n - 1,) [rad].
    edges
        Times from the start to the end between which the laws are smooth [s].
    own_cost
        Cost of laws that minimise something other than the problem's; None where they do not.
    peak
        Motion whose law is the first one, if its effort has the least peak.

    """

    problem: MotionProblem
    laws: tuple[Law, ...]
    start: FloatArray
    final: FloatArray
    edges: tuple[float, ...]
    own_cost: float | None = None
    peak: PeakMotion | None = None

    @property
    def knots(self) -> FloatArray | None:
        """Return the even times between which the laws are smooth, ends included; else None."""
        return None if self.peak is None else self.peak.law.knots

    @cached_property
    def cost_value(self) -> float:
        """Return the sum of the costs, the integrals of Y^T Q Y, or the laws' own cost."""
        if self.own_cost is not None:
            return self.own_cost
        nodes = self.nodes
        derivatives = nodes.planned[:, 1:]
        density = np.einsum('vim,ij,vjm->m', derivatives, self.problem.cost.matrix, derivatives)
        return float(self.problem.duration * (nodes.weights @ density))

    def jets(self, times: FloatArray) -> FloatArray:
        """Return the derivatives 0 to 6 at times clipped to the motion, shape (n - 1, 7, m)."""
        duration = self.problem.duration
        clipped = np.clip(times, 0.0, duration)
        planned = np.array([law.jet(clipped, JET_ORDER) for law in self.laws])
        # The certified ends take their exact values, as those of a motion from rest do.
        ends = np.zeros_like(self.start)
        ends[:, 0] = self.final
        for reached, end in ((clipped <= 0.0, self.start), (clipped >= duration, ends)):
            planned[:, :CONDITIONS, reached] = end[..., None]
        return planned

    def on_even_grid(self, intervals: int) -> tuple[FloatArray, FloatArray]:
        """Return derivatives 0 to 6, (n - 1, 7, m), and driving effort, (m,), at even times."""
        planned = self.jets(even_times(self.problem.duration, intervals))
        return planned, apply_row(self.problem.flat_map.effort, planned[0])

    @cached_property
    def nodes(self) -> MotionNodes:
        """Return the motion at the nodes of a quadrature that resolves it."""
        times, weights = self._quadrature()
        return MotionNodes(times, weights, self.jets(times))

    def _quadrature(self) -> tuple[FloatArray, FloatArray]:
        """Return times [s] and weights of sum 1 for means over the motion, shape (m,)."""
        knots = self.knots
        if knots is not None:
            nodes, shares = np.polynomial.legendre.leggauss(NODES_PER_PIECE)
            lengths = np.diff(knots)
            times = knots[:-1, None] + 0.5 * np.multiply.outer(lengths, nodes + 1.0)
            weights = np.multiply.outer(lengths, shares) / (2.0 * self.problem.duration)
            return times.ravel(), weights.ravel()
        places = np.column_stack([self.start[:, 0], self.final])
        if len(self.edges) > 2:
            places = np.array([law.jet(np.array(self.edges), 0)[0] for law in self.laws])
        travel = float(np.abs(np.diff(places)).sum())
        return motion_quadrature(self.problem.unit.rates, travel, self.edges)
