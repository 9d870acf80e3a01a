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
Course of a motion: the planned variables over time, however their laws were found.

From rest to rest all planned variables are multiples of one unit motion, which is cached with its
samples; any other course is evaluated law by law.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

from flat_planner_ros.core.arm import apply_row, FloatArray
from flat_planner_ros.core.motion_law import (
    CONDITIONS,
    ExponentialLaw,
    JET_ORDER,
    motion_quadrature,
)
from flat_planner_ros.core.planning.task import even_times, Task
import numpy as np
from numpy.typing import ArrayLike


class Law(Protocol):
    """A planned variable as a function of time."""

    @property
    def duration(self) -> float:
        """Return the length of the motion [s]."""

    def jet(self, t: ArrayLike, order: int, /) -> FloatArray:
        """Return the value and its derivatives up to an order, shape (order + 1, m)."""


class Samples(NamedTuple):
    """Derivatives 0 to 6 of the planned variables, (n - 1, 7, m), and torque (m,) [N m]."""

    planned: FloatArray
    torque: FloatArray


class Course(Protocol):
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
        """Return derivatives and torque at intervals + 1 even times."""

    def quadrature(self) -> tuple[FloatArray, FloatArray]:
        """Return times [s] and weights of sum 1 for means over the motion, shape (m,)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RestToRest:
    """
    Multiples of a unit motion.

    Attributes
    ----------
    task
        The motion over 1 rad.
    start, final
        Planned variables at both ends, n - 1 of them [rad].
    distances
        From one to the other, zero where too small for a motion [rad].

    """

    task: Task
    start: tuple[float, ...]
    final: tuple[float, ...]
    distances: tuple[float, ...]

    @cached_property
    def laws(self) -> tuple[Law, ...]:
        """Return the law of each planned variable."""
        return tuple(
            ExponentialLaw(
                duration=self.task.duration,
                modes=self.task.unit.law.modes,
                factor=distance,
                offset=0.5 * (start + final),
            )
            for distance, start, final in zip(self.distances, self.start, self.final, strict=True)
        )

    @property
    def edges(self) -> tuple[float, ...]:
        """Return start and end of the motion [s]."""
        return 0.0, self.task.duration

    @property
    def cost_value(self) -> float:
        """Return the sum of the costs."""
        return sum(distance**2 for distance in self.distances) * self.task.cost_value

    def jets(self, times: FloatArray) -> FloatArray:
        """Return the derivatives 0 to 6 at times clipped to the motion, shape (n - 1, 7, m)."""
        task, duration = self.task, self.task.duration
        clipped = np.clip(times, 0.0, duration)
        rate = 2.0 / duration
        unit = task.unit.jet(rate * clipped, rate * (duration - clipped))
        planned: FloatArray = unit * np.multiply.outer(self.distances, task.rates)[..., None]
        planned[:, 0] += 0.5 * (np.array(self.start) + np.array(self.final))[:, None]
        # The certified ends take their exact values: an executor compares them with zero.
        for reached, end in ((clipped <= 0.0, self.start), (clipped >= duration, self.final)):
            planned[:, :CONDITIONS, reached] = 0.0
            planned[:, 0, reached] = np.array(end)[:, None]
        return planned

    def on_even_grid(self, intervals: int) -> Samples:
        """Return derivatives and torque at intervals + 1 even times."""
        task, distances = self.task, self.distances
        table = np.empty((len(distances), len(task.rates) + 1, intervals + 1))
        unit = task.grid(intervals) if len(distances) > 1 else None
        for i, distance in enumerate(distances):
            part, start, final = table[i], self.start[i], self.final[i]
            if unit is None:
                task.fill_grid(part, distance)
            else:
                np.multiply(unit, distance, out=part)
            values = part[0]
            values += 0.5 * (start + final)
            values[0], values[-1] = start, final
        return Samples(table[:, :-1], table[0, -1])

    def quadrature(self) -> tuple[FloatArray, FloatArray]:
        """Return times [s] and weights of sum 1 for means over the motion, shape (m,)."""
        travel = sum(abs(distance) for distance in self.distances)
        return motion_quadrature(self.task.rates_of_modes, travel, self.edges)


@dataclass(frozen=True, kw_only=True, eq=False)
class FreeCourse:
    """
    Laws of any kind that solve the task's equation between given times.

    Attributes
    ----------
    task
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
        Of laws that minimise something other than the task's cost; None for the latter.

    """

    task: Task
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
        density = np.einsum('vim,ij,vjm->m', derivatives, self.task.cost.matrix, derivatives)
        return float(self.task.duration * (weights @ density))

    def jets(self, times: FloatArray) -> FloatArray:
        """Return the derivatives 0 to 6 at times clipped to the motion, shape (n - 1, 7, m)."""
        duration = self.task.duration
        clipped = np.clip(times, 0.0, duration)
        planned = np.array([law.jet(clipped, JET_ORDER) for law in self.laws])
        # The certified ends take their exact values, as those of a motion from rest do.
        ends = np.zeros_like(self.start)
        ends[:, 0] = self.final
        for reached, end in ((clipped <= 0.0, self.start), (clipped >= duration, ends)):
            planned[:, :CONDITIONS, reached] = end[..., None]
        return planned

    def on_even_grid(self, intervals: int) -> Samples:
        """Return derivatives and torque at intervals + 1 even times."""
        planned = self.jets(even_times(self.task.duration, intervals))
        return Samples(planned, apply_row(self.task.flat_map.effort, planned[0]))

    def quadrature(self) -> tuple[FloatArray, FloatArray]:
        """Return times [s] and weights of sum 1 for means over the motion, shape (m,)."""
        places = np.array([law.jet(np.array(self.edges), 0)[0] for law in self.laws])
        travel = float(np.abs(np.diff(places)).sum())
        return motion_quadrature(self.task.rates_of_modes, travel, self.edges)
