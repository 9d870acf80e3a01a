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

"""A motion to rest that certifies itself, and its samples, each formed when asked for."""

from dataclasses import dataclass
from functools import cached_property
from math import ceil
from typing import NamedTuple

from flat_planner_ros.core.arm import apply_row, FloatArray, locked, UncertifiedPlan
from flat_planner_ros.core.planning.motion_problem import MotionProblem
from flat_planner_ros.core.planning.reference_trajectory import (
    even_times,
    ReferenceTrajectory,
    RestToRestTrajectory,
)
from flat_planner_ros.core.planning.request import MotionRequest, PlanningOptions
import numpy as np

BOUNDARY_TOLERANCE = 1e-9
"""Largest miss of an accepted law at its ends, relative to that derivative's peak [-]."""

OPTIMALITY_TOLERANCE = 1e-9
"""Largest Euler-Lagrange residual of an accepted law, relative to the sum of its terms [-]."""

SPACING_TOLERANCE = 1e-9
"""Excess of a grid's spacing over the period that is forgiven as roundoff [-]."""

FLAT_ORDERS = 6
"""Derivatives of the flat outputs in a plan, the values included."""

JOINT_ORDERS = 3
"""Position, velocity and acceleration."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanSamples:
    """
    A plan on a grid of times.

    Attributes
    ----------
    times
        From the start of the motion, shape (m,) [s].
    planned
        Derivatives 0 to 6 of the planned variables w, shape (n - 1, 7, m) [rad/s^k].
    driving_effort
        Effort of joint n-1, which drives the passive one, without friction, shape (m,) [N m].
    problem
        Arm and flat map by which joint motion and efforts follow from the planned variables.
    compensates_friction
        Whether the efforts include what friction takes.

    """

    times: FloatArray
    planned: FloatArray
    driving_effort: FloatArray
    problem: MotionProblem
    compensates_friction: bool = False

    def __post_init__(self) -> None:
        """Lock the tables."""
        locked(self.times)
        locked(self.planned)
        locked(self.driving_effort)

    @property
    def positions(self) -> FloatArray:
        """Angles of all joints, shape (m, n) [rad]."""
        positions: FloatArray = self.joint_motion[0]
        return positions

    @property
    def velocities(self) -> FloatArray:
        """First derivatives of the positions, shape (m, n) [rad/s]."""
        velocities: FloatArray = self.joint_motion[1]
        return velocities

    @property
    def accelerations(self) -> FloatArray:
        """Second derivatives of the positions, shape (m, n) [rad/s^2]."""
        accelerations: FloatArray = self.joint_motion[2]
        return accelerations

    @property
    def driving_velocity(self) -> FloatArray:
        """Velocity of link n-1 in absolute angle, which a servo gives it, shape (m,) [rad/s]."""
        driving: FloatArray = self.velocities[:, :-1].sum(axis=1)
        return driving

    @cached_property
    def efforts(self) -> FloatArray:
        """
        Feed-forward effort of all joints, zero for the passive one, shape (m, n) [N m].

        Joint n-1 follows from the flat map ((13) of docs/derivation.md), those before it from the
        inverse dynamics of the arm.
        """
        n = self.problem.arm.n
        efforts = np.zeros((len(self.times), n))
        efforts[:, n - 2] = self.driving_effort
        if n > 2:
            efforts[:, : n - 2] = self.problem.arm.rigid_effort(*self.joint_motion)[:, : n - 2]
        if self.compensates_friction:
            efforts[:, :-1] += self.problem.arm.friction(self.velocities)
        return locked(efforts)

    @cached_property
    def flat(self) -> FloatArray:
        """Return derivatives 0 to 5 of every flat output, shape (n - 1, 6, m) [rad/s^k]."""
        flat = _derivatives(self.problem.flat_map.output, self.planned[0], FLAT_ORDERS)[None]
        if len(self.planned) > 1:
            flat = np.concatenate([flat, self.planned[1:, :FLAT_ORDERS]])
        return locked(flat)

    @cached_property
    def joint_motion(self) -> FloatArray:
        """Positions, velocities and accelerations of all joints, shape (3, m, n) [rad/s^k]."""
        n, flat_map = self.problem.arm.n, self.problem.flat_map
        passive = _derivatives(flat_map.deflection, self.planned[0], JOINT_ORDERS)
        # y1 is the angle of the last link, the sum of all joints'.
        whole = _derivatives(flat_map.output, self.planned[0], JOINT_ORDERS)
        joints = np.empty((JOINT_ORDERS, len(self.times), n))
        inner = np.subtract(whole, passive, out=joints[:, :, n - 2])
        for i in range(n - 2):
            joints[:, :, i] = self.planned[1 + i, :JOINT_ORDERS]
            inner -= joints[:, :, i]
        joints[:, :, n - 1] = passive
        return locked(joints)


@dataclass(frozen=True, kw_only=True, eq=False)
class Plan:
    """
    A motion to rest and the proof of its quality.

    Attributes
    ----------
    request
        What was asked for.
    options
        How it was planned: as asked for, but with a quadratic cost in place of another strategy
        where that cannot be.
    problem
        What plans of the same arm, cost and duration share.
    trajectory
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
    problem: MotionProblem
    trajectory: ReferenceTrajectory
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
    def cost_value(self) -> float:
        """Integral of Y^T Q Y over the motion, summed over the planned variables."""
        return self.trajectory.cost_value

    @property
    def least_duration(self) -> float | None:
        """
        Return the duration below which no motion has as small a peak effort of joint n-1 [s].

        None where nothing proves one: for other strategies, and for starts in motion.
        """
        peak = self.trajectory.peak
        return None if peak is None or self.request.start_jets is not None else peak.least_duration

    def sample(self, period: float) -> PlanSamples:
        """
        Return the plan on an even grid that contains both ends.

        The grid also contains the corners of an effort that is linear in pieces, so that the
        samples, joined linearly, are that effort and nothing else.

        Parameters
        ----------
        period
            Largest spacing [s].

        """
        intervals = max(1, ceil(self.duration / period - SPACING_TOLERANCE))
        knots = self.trajectory.knots
        if knots is not None:
            pieces = len(knots) - 1
            intervals = pieces * ceil(intervals / pieces)
        planned, driving_effort = self.trajectory.on_even_grid(intervals)
        return PlanSamples(
            times=even_times(self.duration, intervals),
            planned=planned,
            driving_effort=driving_effort,
            problem=self.problem,
            compensates_friction=self.options.compensate_friction,
        )

    def at(self, times: FloatArray) -> PlanSamples:
        """
        Return the plan at given times.

        Parameters
        ----------
        times
            From the start of the motion, clipped to it, shape (m,) [s].

        """
        return self._samples(np.array(times), self.trajectory.jets(times))

    def _samples(self, times: FloatArray, planned: FloatArray) -> PlanSamples:
        """Return the plan at times (m,) [s] at which derivatives are known, (n - 1, 7, m)."""
        return PlanSamples(
            times=times,
            planned=planned,
            driving_effort=apply_row(self.problem.flat_map.effort, planned[0]),
            problem=self.problem,
            compensates_friction=self.options.compensate_friction,
        )

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
        trajectory = self.trajectory
        if (
            isinstance(trajectory, RestToRestTrajectory)
            and len(trajectory.distances) == 1
            and not self.options.compensate_friction
        ):
            # Linear in the unit motion, whose values at the nodes are known.
            mean = self.problem.unit.mean(trajectory.distances[0] * self.problem.rows)
            return _Figures(
                np.append(np.sqrt(mean.mean_square[0]), 0.0),
                np.append(mean.peak[0], 0.0),
                mean.peak[1:],
            )
        nodes = trajectory.nodes
        samples = self._samples(nodes.times, nodes.planned)
        return _Figures(
            np.sqrt(nodes.weights @ samples.efforts**2),
            np.abs(samples.efforts).max(axis=0),
            np.abs(samples.velocities).max(axis=0),
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


def _derivatives(row: FloatArray, jet: FloatArray, count: int) -> FloatArray:
    """Return the quantity of a row and its derivatives, shape (count, m)."""
    table = np.empty((count, jet.shape[1]))
    for order, values in enumerate(table):
        np.matmul(row, jet[order : order + len(row)], out=values)
    return table
