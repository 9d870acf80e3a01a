"""Plan: a goal turned into certified motion laws, joint motion and feed-forward effort."""

from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil, inf
from typing import NamedTuple

from flat_planner_ros.core.arm import PlanarArm
from flat_planner_ros.core.cost import QuadraticCost, Strategy
from flat_planner_ros.core.course import Course, FreeCourse, Law, RestToRest
from flat_planner_ros.core.errors import InvalidRequest, UncertifiedPlan
from flat_planner_ros.core.flatness import apply_row, FlatMap, FlatModel
from flat_planner_ros.core.moving_start import laws_to_rest
from flat_planner_ros.core.plan_samples import PlanSamples
from flat_planner_ros.core.request import (
    MotionRequest,
    planned_at_rest,
    PlanningOptions,
    ViaPoint,
)
from flat_planner_ros.core.shaped_course import shaped_course
from flat_planner_ros.core.task import even_times, Task, task_of
from flat_planner_ros.core.via_points import optimal_path
from flat_planner_ros.core.via_times import path_of
import numpy as np
from numpy.typing import NDArray

__all__ = ['Law', 'MotionRequest', 'Plan', 'plan', 'PlanningOptions', 'PlanSamples', 'ViaPoint']

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

    """

    request: MotionRequest
    options: PlanningOptions
    task: Task
    course: Course
    boundary_residual: float
    optimality_residual: float

    @property
    def duration(self) -> float:
        """Return the length of the motion [s]."""
        return self.request.duration

    @property
    def cost(self) -> QuadraticCost:
        """What was minimised."""
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
        """The planned variables over time, n - 1 of them."""
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


def plan(request: MotionRequest, arm: PlanarArm, options: PlanningOptions) -> Plan:
    """
    Return the optimal motion to rest.

    Parameters
    ----------
    request
        Where from, where to, how long.
    arm
        Nominal model; must be flat.
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
    OutOfReach
        No motion meets a bound of the strategy `insensitive`.

    """
    _check_fit(request, arm)
    try:
        task = task_of(arm, options, request.duration)
        if request.via:
            return _through_points(request, options, task)
        if request.start_jets is not None:
            return _from_motion(request, options, task, request.start_jets)
    except ArithmeticError as error:
        raise UncertifiedPlan('boundary residual', inf, BOUNDARY_TOLERANCE) from error
    return _from_rest(request, options, task)


def _from_rest(request: MotionRequest, options: PlanningOptions, task: Task) -> Plan:
    """Return a plan whose planned variables are multiples of the unit motion."""
    start, final = planned_at_rest(request.start), planned_at_rest(request.final)
    distances = tuple(
        [0.0 if abs(b - a) < NO_DISTANCE else b - a for a, b in zip(start, final, strict=True)]
    )
    if not all([abs(distance) < task.reach for distance in distances]):
        raise UncertifiedPlan('boundary residual', inf, BOUNDARY_TOLERANCE)
    course: Course = RestToRest(task=task, start=start, final=final, distances=distances)
    moves = any(distances)
    boundary = task.unit.boundary_residual if moves else 0.0
    optimality = task.unit.optimality_residual if moves else 0.0
    if options.strategy is Strategy.INSENSITIVE and distances[0]:
        if options.flat_model is not FlatModel.EXACT:
            raise InvalidRequest('strategy insensitive needs flat_model exact')
        course, boundary, optimality = shaped_course(task, options.insensitivity, start, final)
    _certify('boundary residual', boundary, BOUNDARY_TOLERANCE)
    _certify('optimality residual', optimality, OPTIMALITY_TOLERANCE)
    return Plan(
        request=request,
        options=options,
        task=task,
        course=course,
        boundary_residual=boundary,
        optimality_residual=optimality,
    )


def _from_motion(
    request: MotionRequest, options: PlanningOptions, task: Task, start: FloatArray
) -> Plan:
    """Return a plan whose planned variables have given derivatives at the start."""
    if options.strategy is Strategy.INSENSITIVE:
        # It has no law from a start in motion; the task's cost is the polynomial one.
        options = replace(options, strategy=Strategy.POLYNOMIAL)
    final = np.array(planned_at_rest(request.final))
    with np.errstate(over='raise', invalid='raise', divide='raise', under='ignore'):
        found = laws_to_rest(task, start, final)
    _certify('boundary residual', found.boundary_residual, BOUNDARY_TOLERANCE)
    _certify('optimality residual', found.optimality_residual, OPTIMALITY_TOLERANCE)
    return Plan(
        request=request,
        options=options,
        task=task,
        course=FreeCourse(
            task=task, laws=found.laws, start=start, final=final, edges=(0.0, task.duration)
        ),
        boundary_residual=found.boundary_residual,
        optimality_residual=found.optimality_residual,
    )


def _through_points(request: MotionRequest, options: PlanningOptions, task: Task) -> Plan:
    """Return a plan whose flat outputs pass given values on the way."""
    if options.strategy is Strategy.INSENSITIVE:
        raise InvalidRequest('strategy insensitive has no via points; another strategy has')
    path = path_of(request, task)
    found = optimal_path(task.cost, path)
    _certify('boundary residual', found.boundary_residual, BOUNDARY_TOLERANCE)
    _certify('optimality residual', found.optimality_residual, OPTIMALITY_TOLERANCE)
    return Plan(
        request=request,
        options=options,
        task=task,
        course=FreeCourse(
            task=task,
            laws=found.laws,
            start=path.start,
            final=path.values[:, -1],
            edges=tuple(path.edges.tolist()),
        ),
        boundary_residual=found.boundary_residual,
        optimality_residual=found.optimality_residual,
    )


def _check_fit(request: MotionRequest, arm: PlanarArm) -> None:
    """Refuse a request that the arm cannot answer."""
    if len(request.start) != arm.n:
        raise InvalidRequest(
            f'the arm has {arm.n} joints, the request {len(request.start)} angles'
        )
    ends = [('final', request.final)]
    if request.start_jets is None:
        ends.insert(0, ('start', request.start))
    for name, angles in ends:
        if angles[-1] != 0.0:
            raise InvalidRequest(f'{name} angle of the elastic joint is {angles[-1]:g} rad, not 0')


def _certify(quantity: str, residual: float, tolerance: float) -> None:
    """Refuse a residual above its tolerance, or none at all (NaN)."""
    if not residual <= tolerance:
        raise UncertifiedPlan(quantity, residual, tolerance)
