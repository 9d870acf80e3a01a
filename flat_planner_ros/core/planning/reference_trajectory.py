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
Reference trajectory of a motion: the planned variables over time, however their laws were found.

From rest to rest all planned variables are multiples of one unit motion, which is cached with its
samples; any other trajectory is evaluated law by law.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

from flat_planner_ros.core.arm import apply_row, FloatArray
from flat_planner_ros.core.motion_law import CONDITIONS, JET_ORDER, Law, motion_quadrature
from flat_planner_ros.core.planning.problem import even_times, MotionProblem
import numpy as np


class Samples(NamedTuple):
    """Derivatives 0 to 6 of the planned variables, (n - 1, 7, m); driving effort (m,) [N m]."""

    planned: FloatArray
    driving_effort: FloatArray


class ReferenceTrajectory(Protocol):
    """The planned variables of a motion."""

    @property
    def laws(self) -> tuple[Law, ...]:
        """Return the law of each planned variable."""

    @property
    def edges(self) -> tuple[float, ...]:
        """Return the times from the start to the end between which the laws are smooth [s]."""

    @property
    def cost_value(self) -> float:
        """Return the sum of their costs."""

    def jets(self, times: FloatArray) -> FloatArray:
        """Return the derivatives 0 to 6 at times clipped to the motion, shape (n - 1, 7, m)."""

    def on_even_grid(self, intervals: int) -> Samples:
        """Return derivatives and driving effort at intervals + 1 even times."""

    def quadrature(self) -> tuple[FloatArray, FloatArray]:
        """Return times [s] and weights of sum 1 for means over the motion, shape (m,)."""


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
        return tuple(
            self.problem.unit.law_over(self.problem.duration, distance, 0.5 * (start + final))
            for distance, start, final in zip(self.distances, self.start, self.final, strict=True)
        )

    @property
    def edges(self) -> tuple[float, ...]:
        """Return start and end of the motion [s]."""
        return 0.0, self.problem.duration

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

    def on_even_grid(self, intervals: int) -> Samples:
        """Return derivatives and driving effort at intervals + 1 even times."""
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
        return Samples(table[:, :-1], table[0, -1])

    def quadrature(self) -> tuple[FloatArray, FloatArray]:
        """Return times [s] and weights of sum 1 for means over the motion, shape (m,)."""
        travel = sum(abs(distance) for distance in self.distances)
        return motion_quadrature(self.problem.unit.law.rates, travel, self.edges)


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
        Of laws that minimise something other than the problem's cost; None for the latter.

    """

    problem: MotionProblem
    laws: tuple[Law, ...]
    start: FloatArray
    final: FloatArray
    edges: tuple[float, ...]
    own_cost: float | None = None

    @cached_property
    def cost_value(self) -> float:
        """Return the sum of the costs, the integrals of Y^T Q Y, or the laws' own cost."""
        if self.own_cost is not None:
            return self.own_cost
        times, weights = self.quadrature()
        derivatives = self.jets(times)[:, 1:]
        density = np.einsum('vim,ij,vjm->m', derivatives, self.problem.cost.matrix, derivatives)
        return float(self.problem.duration * (weights @ density))

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

    def on_even_grid(self, intervals: int) -> Samples:
        """Return derivatives and driving effort at intervals + 1 even times."""
        planned = self.jets(even_times(self.problem.duration, intervals))
        return Samples(planned, apply_row(self.problem.flat_map.effort, planned[0]))

    def quadrature(self) -> tuple[FloatArray, FloatArray]:
        """Return times [s] and weights of sum 1 for means over the motion, shape (m,)."""
        places = np.array([law.jet(np.array(self.edges), 0)[0] for law in self.laws])
        travel = float(np.abs(np.diff(places)).sum())
        return motion_quadrature(self.problem.unit.law.rates, travel, self.edges)
