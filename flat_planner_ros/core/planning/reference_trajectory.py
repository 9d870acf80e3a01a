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

From rest to rest they are multiples of the unit motion of their problem; any other trajectory is
evaluated law by law.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple, Protocol

from flat_planner_ros.core.arm import apply_row, ComplexArray, FloatArray, locked
from flat_planner_ros.core.motion_law import CONDITIONS, JET_ORDER, Law, motion_quadrature
from flat_planner_ros.core.peak import PeakMotion
from flat_planner_ros.core.planning.motion_problem import MotionProblem
import numpy as np

NODES_PER_PIECE = 8
"""Gauss-Legendre nodes between two knots of an effort that is linear there."""

GRIDS_KEPT = 2
"""Even grids that are remembered: goals of one duration share one."""


@lru_cache(maxsize=GRIDS_KEPT)
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

    @property
    def roots(self) -> ComplexArray:
        """Return how fast the laws may be: roots in units of 2 / duration, shape (m,) [-]."""


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
        times, weights = motion_quadrature(self.roots, travel, self.edges)
        return MotionNodes(times, weights, self.jets(times))

    @property
    def roots(self) -> ComplexArray:
        """Return how fast the unit motion is: rates in units of 2 / duration, shape (m,) [-]."""
        return self.problem.unit.rates


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
        clipped = np.minimum(np.maximum(times, 0.0), duration)
        tables = [law.jet(clipped, JET_ORDER) for law in self.laws]
        planned = tables[0][None] if len(tables) == 1 else np.array(tables)
        # The certified ends take their exact values, as those of a motion from rest do.
        is_first, is_last = clipped <= 0.0, clipped >= duration
        if is_first.any():
            planned[:, :CONDITIONS, is_first] = self.start[..., None]
        if is_last.any():
            planned[:, :CONDITIONS, is_last] = 0.0
            planned[:, 0, is_last] = self.final[:, None]
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
        return motion_quadrature(self.roots, travel, self.edges)

    @property
    def roots(self) -> ComplexArray:
        """Return the roots of the laws' equation in units of 2 / duration, shape (6,) [-]."""
        return self.problem.roots
