"""Plan: a goal turned into a certified motion law, joint motion and feed-forward effort."""

from dataclasses import dataclass
from functools import cached_property
from math import ceil, inf

from flat_planner_ros.core.arm import PlanarArm
from flat_planner_ros.core.cost import QuadraticCost
from flat_planner_ros.core.errors import InvalidRequest, UncertifiedPlan
from flat_planner_ros.core.flatness import apply_row, FlatMap
from flat_planner_ros.core.motion_law import MotionLaw
from flat_planner_ros.core.plan_samples import PlanSamples
from flat_planner_ros.core.request import MotionRequest, PlanningOptions
from flat_planner_ros.core.solutions import CONDITIONS
from flat_planner_ros.core.task import fractions, Task, task_of
from flat_planner_ros.core.unit_motion import Mean
import numpy as np
from numpy.typing import NDArray

__all__ = ['MotionRequest', 'Plan', 'plan', 'PlanningOptions', 'PlanSamples']

FloatArray = NDArray[np.float64]

BOUNDARY_TOLERANCE = 1e-9
"""Largest miss of an accepted law at its ends, relative to that derivative's peak [-]."""

OPTIMALITY_TOLERANCE = 1e-9
"""Largest Euler-Lagrange residual of an accepted law, relative to the sum of its terms [-]."""

SPACING_TOLERANCE = 1e-9
"""Excess of a grid's spacing over the period that is forgiven as roundoff [-]."""

NO_DISTANCE = 1e-100
"""Distance below which a motion rests: its derivatives would leave double precision [rad]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Plan:
    """
    A motion from rest to rest and the proof of its quality.

    Attributes
    ----------
    request, options
        What was asked for.
    task
        The same motion over 1 rad.
    distance
        From start to end [rad].
    boundary_residual
        Largest miss at the ends, relative to each derivative's peak [-].
    optimality_residual
        Largest Euler-Lagrange residual relative to its terms [-].

    """

    request: MotionRequest
    options: PlanningOptions
    task: Task
    distance: float
    boundary_residual: float
    optimality_residual: float

    @property
    def cost(self) -> QuadraticCost:
        """What was minimised."""
        return self.task.cost

    @property
    def cost_value(self) -> float:
        """Integral of Y^T Q Y over the motion."""
        return self.distance**2 * self.task.cost_value

    @property
    def flat_map(self) -> FlatMap:
        """From the planned variable to the joints."""
        return self.task.flat_map

    def sample(self, period: float) -> PlanSamples:
        """
        Return the plan on an even grid that contains both ends.

        Parameters
        ----------
        period
            Largest spacing [s].

        """
        duration = self.request.duration
        intervals = max(1, ceil(duration / period - SPACING_TOLERANCE))
        table = self.distance * self.task.grid(intervals)
        start, end = self._ends
        table[0] += 0.5 * (start + end)
        table[0, 0], table[0, -1] = start, end
        times = duration * fractions(intervals)
        return PlanSamples(
            times=times, planned=table[:-1], torque=table[-1], flat_map=self.task.flat_map
        )

    def at(self, times: FloatArray) -> PlanSamples:
        """
        Return the plan at given times.

        Parameters
        ----------
        times
            From the start of the motion, clipped to it, shape (m,) [s].

        """
        duration = self.request.duration
        clipped = np.clip(times, 0.0, duration)
        rate = 2.0 / duration
        planned = self.task.unit.jet(rate * clipped, rate * (duration - clipped))
        planned *= (self.distance * self.task.rates)[:, None]
        planned[0] += 0.5 * sum(self._ends)
        # The certified ends take their exact values: an executor compares them with zero.
        for reached, end in zip((clipped <= 0.0, clipped >= duration), self._ends, strict=True):
            planned[:CONDITIONS, reached] = 0.0
            planned[0, reached] = end
        return PlanSamples(
            times=np.array(times),
            planned=planned,
            torque=apply_row(self.flat_map.effort, planned),
            flat_map=self.flat_map,
        )

    @cached_property
    def law(self) -> MotionLaw:
        """The planned variable w over time."""
        return MotionLaw(
            duration=self.request.duration,
            modes=self.task.unit.law.modes,
            factor=self.distance,
            offset=0.5 * sum(self._ends),
        )

    @property
    def rms_effort(self) -> FloatArray:
        """Root mean square of every joint's effort over the motion, shape (n,) [N m]."""
        return np.append(np.sqrt(self._means[0][0]), 0.0)

    @property
    def peak_effort(self) -> FloatArray:
        """Largest magnitude of every joint's effort, shape (n,) [N m]."""
        return np.append(self._means[1][0], 0.0)

    @property
    def peak_velocity(self) -> FloatArray:
        """Largest magnitude of every joint's velocity, shape (n,) [rad/s]."""
        return self._means[1][1:].copy()

    @cached_property
    def _means(self) -> Mean:
        """Return mean squares and peaks of the torque and of the velocities of both joints."""
        return self.task.unit.mean(self.distance * self.task.rows)

    @cached_property
    def _ends(self) -> tuple[float, float]:
        """Return the planned variable at start and end."""
        return _planned(self.request.start), _planned(self.request.final)


def plan(request: MotionRequest, arm: PlanarArm, options: PlanningOptions) -> Plan:
    """
    Return the optimal motion from rest to rest.

    Parameters
    ----------
    request
        Where from, where to, how long.
    arm
        Nominal model; must be flat and have two joints.
    options
        Strategy, weights and flat model.

    Raises
    ------
    InvalidRequest
        The request does not fit the arm.
    InvalidCost
        The weights define no admissible cost.
    NotFlat
        The arm does not meet the flatness condition.
    UncertifiedPlan
        The law cannot be computed to the promised accuracy in double precision.

    """
    _check_fit(request, arm)
    distance = _planned(request.final) - _planned(request.start)
    if abs(distance) < NO_DISTANCE:
        distance = 0.0
    try:
        task = task_of(arm, options, request.duration)
    except ArithmeticError as error:
        raise UncertifiedPlan('boundary residual', inf, BOUNDARY_TOLERANCE) from error
    if not abs(distance) < task.reach:
        raise UncertifiedPlan('boundary residual', inf, BOUNDARY_TOLERANCE)
    boundary = task.unit.boundary_residual if distance else 0.0
    optimality = task.unit.optimality_residual if distance else 0.0
    _certify('boundary residual', boundary, BOUNDARY_TOLERANCE)
    _certify('optimality residual', optimality, OPTIMALITY_TOLERANCE)
    return Plan(
        request=request,
        options=options,
        task=task,
        distance=distance,
        boundary_residual=boundary,
        optimality_residual=optimality,
    )


def _check_fit(request: MotionRequest, arm: PlanarArm) -> None:
    """Refuse a request that the arm cannot answer."""
    if arm.n != 2 or len(request.start) != arm.n:
        raise InvalidRequest(
            f'planning needs two joints, the arm has {arm.n} and the request {len(request.start)}'
        )
    for name, angles in (('start', request.start), ('final', request.final)):
        if angles[-1] != 0.0:
            raise InvalidRequest(f'{name} angle of the elastic joint is {angles[-1]:g} rad, not 0')


def _planned(angles: FloatArray) -> float:
    """Return the planned variable of an arm at rest: the absolute angle of its last link."""
    return float(sum(angles.tolist()))


def _certify(quantity: str, residual: float, tolerance: float) -> None:
    """Refuse a residual above its tolerance, or none at all (NaN)."""
    if not residual <= tolerance:
        raise UncertifiedPlan(quantity, residual, tolerance)
