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

"""Plan: a motion to rest that certifies itself."""

from dataclasses import dataclass
from functools import cached_property
from math import ceil
from typing import NamedTuple

from flat_planner_ros.core.arm import apply_row, FlatMap, FloatArray, UncertifiedPlan
from flat_planner_ros.core.motion_law import QuadraticCost
from flat_planner_ros.core.planning.course import Course, Law, RestToRest
from flat_planner_ros.core.planning.plan_samples import PlanSamples
from flat_planner_ros.core.planning.request import MotionRequest, PlanningOptions
from flat_planner_ros.core.planning.task import even_times, Task
import numpy as np

BOUNDARY_TOLERANCE = 1e-9
"""Largest miss of an accepted law at its ends, relative to that derivative's peak [-]."""

OPTIMALITY_TOLERANCE = 1e-9
"""Largest Euler-Lagrange residual of an accepted law, relative to the sum of its terms [-]."""

SPACING_TOLERANCE = 1e-9
"""Excess of a grid's spacing over the period that is forgiven as roundoff [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Plan:
    """
    A motion to rest and the proof of its quality.

    Attributes
    ----------
    request
        What was asked for.
    options
        How it was planned: as asked for, but with the strategy polynomial in place of insensitive
        where the start is in motion.
    task
        What plans of the same arm, cost and duration share.
    course
        The planned variables over time.
    boundary_residual
        Largest miss at the ends, relative to each derivative's peak [-].
    optimality_residual
        Largest Euler-Lagrange residual relative to its terms [-].

    Raises
    ------
    UncertifiedPlan
        A residual is above its tolerance.

    """

    request: MotionRequest
    options: PlanningOptions
    task: Task
    course: Course
    boundary_residual: float
    optimality_residual: float

    def __post_init__(self) -> None:
        """Refuse what is not good to the promised accuracy."""
        _certify('boundary residual', self.boundary_residual, BOUNDARY_TOLERANCE)
        _certify('optimality residual', self.optimality_residual, OPTIMALITY_TOLERANCE)

    @property
    def duration(self) -> float:
        """Return the length of the motion [s]."""
        return self.request.duration

    @property
    def cost(self) -> QuadraticCost:
        """Return what was minimised."""
        return self.task.cost

    @property
    def cost_value(self) -> float:
        """Integral of Y^T Q Y over the motion, summed over the planned variables."""
        return self.course.cost_value

    @property
    def flat_map(self) -> FlatMap:
        """From the first planned variable to the last two joints."""
        return self.task.flat_map

    @property
    def laws(self) -> tuple[Law, ...]:
        """Return the planned variables over time, n - 1 of them."""
        return self.course.laws

    def jets(self, times: FloatArray) -> FloatArray:
        """
        Return the derivatives 0 to 6 of the planned variables.

        Parameters
        ----------
        times
            From the start of the motion, clipped to it, shape (m,) [s].

        Returns
        -------
        FloatArray
            Shape (n - 1, 7, m) [rad/s^k].

        """
        return self.course.jets(times)

    def sample(self, period: float) -> PlanSamples:
        """
        Return the plan on an even grid that contains both ends.

        Parameters
        ----------
        period
            Largest spacing [s].

        """
        intervals = max(1, ceil(self.duration / period - SPACING_TOLERANCE))
        planned, torque = self.course.on_even_grid(intervals)
        return self._samples(even_times(self.duration, intervals), planned, torque)

    def at(self, times: FloatArray) -> PlanSamples:
        """
        Return the plan at given times.

        Parameters
        ----------
        times
            From the start of the motion, clipped to it, shape (m,) [s].

        """
        planned = self.jets(times)
        torque = apply_row(self.flat_map.effort, planned[0])
        return self._samples(np.array(times), planned, torque)

    @property
    def rms_effort(self) -> FloatArray:
        """Root mean square of every joint's effort over the motion, shape (n,) [N m]."""
        return self._figures.rms_effort.copy()

    @property
    def peak_effort(self) -> FloatArray:
        """Largest magnitude of every joint's effort, shape (n,) [N m]."""
        return self._figures.peak_effort.copy()

    @property
    def peak_velocity(self) -> FloatArray:
        """Largest magnitude of every joint's velocity, shape (n,) [rad/s]."""
        return self._figures.peak_velocity.copy()

    @cached_property
    def _figures(self) -> '_Figures':
        """
        Return RMS values and peaks.

        The nodes of the quadrature resolve every mode: RMS values are good to 1e-9 of themselves,
        with Coulomb friction to 1e-4; peaks are those at the nodes, within 2e-3 of the true ones
        from below.
        """
        course = self.course
        if (
            isinstance(course, RestToRest)
            and len(course.distances) == 1
            and not self.options.compensate_friction
        ):
            # Linear in the unit motion, whose values at the nodes are known.
            mean = self.task.unit.mean(course.distances[0] * self.task.rows)
            return _Figures(
                np.append(np.sqrt(mean.mean_square[0]), 0.0),
                np.append(mean.peak[0], 0.0),
                mean.peak[1:],
            )
        times, weights = course.quadrature()
        samples = self.at(times)
        return _Figures(
            np.sqrt(weights @ samples.efforts**2),
            np.abs(samples.efforts).max(axis=0),
            np.abs(samples.velocities).max(axis=0),
        )

    def _samples(self, times: FloatArray, planned: FloatArray, torque: FloatArray) -> PlanSamples:
        """Return samples of this plan."""
        return PlanSamples(
            times=times,
            planned=planned,
            torque=torque,
            arm=self.task.arm,
            flat_map=self.task.flat_map,
            compensates_friction=self.options.compensate_friction,
        )


class _Figures(NamedTuple):
    """RMS and peak of every joint's effort [N m], peak of its velocity [rad/s], shape (n,)."""

    rms_effort: FloatArray
    peak_effort: FloatArray
    peak_velocity: FloatArray


def _certify(quantity: str, residual: float, tolerance: float) -> None:
    """Refuse a residual above its tolerance, or none at all (NaN)."""
    if not residual <= tolerance:
        raise UncertifiedPlan(quantity, residual, tolerance)
