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

"""Planning: a request turned into a certified plan, whatever kind of motion it asks for."""

from math import inf
from typing import NamedTuple

from flat_planner_ros.core.arm import (
    FlatModel,
    FloatArray,
    InvalidRequest,
    PlanarArm,
    strict_arithmetic,
    UncertifiedPlan,
)
from flat_planner_ros.core.motion_law import (
    BoundaryConditions,
    CONDITIONS,
    extremals,
    Law,
    MAX_DERIVATIVE,
    optimal_path,
    PathConditions,
    probes,
    stationarity_residual,
    SummedLaw,
)
from flat_planner_ros.core.planning.certified_plan import BOUNDARY_TOLERANCE, Plan
from flat_planner_ros.core.planning.motion_problem import MotionProblem, problem_of
from flat_planner_ros.core.planning.reference_trajectory import (
    LawTrajectory,
    ReferenceTrajectory,
    RestToRestTrajectory,
)
from flat_planner_ros.core.planning.request import MotionRequest, planned_at_rest, PlanningOptions
from flat_planner_ros.core.planning.strategies import OWN_LAWS, OwnMotion, with_quadratic_cost
import numpy as np

NO_DISTANCE = 1e-100
"""Distance below which a motion rests: its derivatives would leave double precision [rad]."""


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
        problem = problem_of(arm, options, request.duration)
        if request.start_jets is not None:
            options = _options_in_motion(options)
        if request.via:
            found = _through_points(request, options, problem)
        elif request.start_jets is not None:
            found = _from_motion(request, options, problem, request.start_jets)
        else:
            found = _from_rest(request, options, problem)
    except ArithmeticError as error:
        raise UncertifiedPlan('boundary residual', inf, BOUNDARY_TOLERANCE) from error
    return Plan(
        request=request,
        options=options,
        problem=problem,
        trajectory=found.trajectory,
        boundary_residual=found.boundary_residual,
        optimality_residual=found.optimality_residual,
    )


def _options_in_motion(options: PlanningOptions) -> PlanningOptions:
    """Return the options with the strategy that can start in motion."""
    # A running motion may have been planned with another flat map than the settings have now.
    is_exact = options.flat_model is FlatModel.EXACT
    return options if is_exact else with_quadratic_cost(options)


class _Certified(NamedTuple):
    """A trajectory and its residuals, as a plan states them."""

    trajectory: ReferenceTrajectory
    boundary_residual: float
    optimality_residual: float


def _from_rest(
    request: MotionRequest, options: PlanningOptions, problem: MotionProblem
) -> _Certified:
    """Return the trajectory whose planned variables are multiples of the unit motion."""
    start, final = planned_at_rest(request.start), planned_at_rest(request.final)
    distances = tuple(
        [0.0 if abs(b - a) < NO_DISTANCE else b - a for a, b in zip(start, final, strict=True)]
    )
    if not all(abs(distance) < problem.reach for distance in distances):
        raise UncertifiedPlan('boundary residual', inf, BOUNDARY_TOLERANCE)
    own = OWN_LAWS.get(options.strategy)
    if own is not None and distances[0]:
        motion = own.motion(problem.arm, options, problem.duration, final[0] - start[0])
        return _with_own_law(motion, problem, start, final)
    trajectory = RestToRestTrajectory(
        problem=problem, start=start, final=final, distances=distances
    )
    if not any(distances):
        return _Certified(trajectory, 0.0, 0.0)
    unit = problem.unit
    return _Certified(trajectory, unit.boundary_residual, unit.optimality_residual)


def _with_own_law(
    motion: OwnMotion,
    problem: MotionProblem,
    start: tuple[float, ...],
    final: tuple[float, ...],
) -> _Certified:
    """
    Return the trajectory whose first planned variable has a law of its own.

    Only joint n-1 can excite or quiet the oscillation, and only the first planned variable tells
    its effort: the others move by the problem's law, in the same time.
    """
    others = (
        problem.unit.law_over(problem.duration, end - begin, 0.5 * (begin + end))
        for begin, end in zip(start[1:], final[1:], strict=True)
    )
    trajectory = LawTrajectory(
        problem=problem,
        laws=(motion.law.transformed(final[0] - start[0], 0.5 * (start[0] + final[0])), *others),
        start=_rest(start),
        final=np.array(final),
        edges=(0.0, problem.duration),
        own_cost=motion.cost,
        peak=motion.peak,
    )
    unit = problem.unit
    return _Certified(
        trajectory,
        max(unit.boundary_residual, motion.boundary_residual),
        max(unit.optimality_residual, motion.optimality_residual),
    )


def _from_motion(
    request: MotionRequest, options: PlanningOptions, problem: MotionProblem, start: FloatArray
) -> _Certified:
    """Return the trajectory whose planned variables have given derivatives at the start."""
    final = np.array(planned_at_rest(request.final))
    # Counted from the end, so that a distant place costs no digits of a short way.
    ways = start.copy()
    ways[:, 0] -= final
    own = _own_from_motion(options, problem, start[0], final[0]) if ways[0].any() else None
    rest = np.zeros(CONDITIONS)
    conditions = [BoundaryConditions(start=way, end=rest) for way in ways[own is not None :]]
    with strict_arithmetic():
        found = extremals(problem.cost.characteristic(), problem.duration, conditions)
        pairs = zip(found, ways[own is not None :], strict=True)
        residuals = [_residuals(problem, law, way) for law, way in pairs if way.any()]
        places = zip(found, final[own is not None :].tolist(), strict=True)
        laws: list[Law] = [law.transformed(1.0, place) for law, place in places]
    if own is not None:
        laws.insert(0, own.law)
        residuals.append((own.boundary_residual, own.optimality_residual))
    boundary, optimality = np.max([(0.0, 0.0), *residuals], axis=0).tolist()
    trajectory = LawTrajectory(
        problem=problem,
        laws=tuple(laws),
        start=start,
        final=final,
        edges=(0.0, problem.duration),
        own_cost=None if own is None else own.cost,
        peak=None if own is None else own.peak,
    )
    return _Certified(trajectory, boundary, optimality)


def _own_from_motion(
    options: PlanningOptions, problem: MotionProblem, start: FloatArray, final: float
) -> OwnMotion | None:
    """Return the strategy's own motion of the first planned variable, if it has one."""
    own = OWN_LAWS.get(options.strategy)
    if own is None:
        return None
    return own.motion_from(problem.arm, options, problem.duration, start, final)


def _residuals(problem: MotionProblem, law: SummedLaw, way: FloatArray) -> tuple[float, float]:
    """Return boundary and Euler-Lagrange residual of a law from given derivatives to zero."""
    powers = (0.5 * problem.duration) ** np.arange(CONDITIONS + 1.0)
    near = probes()[0, :-1]
    after_start = np.concatenate([[0.0], near, 2.0 - near[::-1], [2.0]])
    jet = law.normalised_jet(np.array([after_start, after_start[::-1]]), 2 * CONDITIONS)
    peaks = np.abs(jet[: CONDITIONS + 1]).max(axis=1)
    if not (peaks / powers).max() < MAX_DERIVATIVE:
        raise OverflowError(f'derivatives exceed {MAX_DERIVATIVE:g}')
    miss = np.maximum(
        np.abs(jet[:CONDITIONS, 0] - way * powers[:CONDITIONS]), np.abs(jet[:CONDITIONS, -1])
    )
    normalised = problem.cost.characteristic() * powers[::-1] ** 2
    boundary = float((miss / peaks[:CONDITIONS]).max())
    return boundary, stationarity_residual(normalised, jet)


def _through_points(
    request: MotionRequest, options: PlanningOptions, problem: MotionProblem
) -> _Certified:
    """Return the trajectory whose flat outputs pass given values on the way."""
    own = OWN_LAWS.get(options.strategy)
    path = path_of(request, problem)
    count = 0 if own is None else 1
    laws: list[Law] = []
    residuals, cost = [(0.0, 0.0)], None
    if own is not None:
        if own.through is None:
            name = options.strategy.value
            raise InvalidRequest(f'strategy {name} has no via points; another strategy has')
        motion = own.through(problem.arm, options, _part(path, slice(0, 1)))
        laws.append(motion.law)
        residuals.append((motion.boundary_residual, motion.optimality_residual))
        cost = motion.cost
    if len(path.values) > count:
        found = optimal_path(problem.cost, _part(path, slice(count, None)))
        laws += found.laws
        residuals.append((found.boundary_residual, found.optimality_residual))
    boundary, optimality = np.max(residuals, axis=0).tolist()
    trajectory = LawTrajectory(
        problem=problem,
        laws=tuple(laws),
        start=path.start,
        final=path.values[:, -1],
        edges=tuple(path.edges.tolist()),
        own_cost=cost,
    )
    return _Certified(trajectory, boundary, optimality)


def _part(path: PathConditions, variables: slice) -> PathConditions:
    """Return the path of some variables."""
    return PathConditions(
        edges=path.edges,
        start=path.start[variables],
        values=path.values[variables],
        relaxations=path.relaxations[variables],
    )


def path_of(request: MotionRequest, problem: MotionProblem) -> PathConditions:
    """Return what the planned variables of a motion go through."""
    final = np.array(planned_at_rest(request.final))
    start = request.start_jets
    if start is None:
        start = _rest(planned_at_rest(request.start))
    relaxations = np.zeros(len(final))
    # Of the flat outputs, y1 alone may differ from its planned variable ((15a)).
    relaxations[0] = problem.flat_map.relaxation
    return PathConditions(
        edges=np.array([0.0, *(point.time for point in request.via), request.duration]),
        start=start,
        values=np.column_stack([*(point.values for point in request.via), final]),
        relaxations=relaxations,
    )


def _rest(values: tuple[float, ...]) -> FloatArray:
    """Return the derivatives 0 to 5 of planned variables at rest, shape (n - 1, 6)."""
    jets = np.zeros((len(values), CONDITIONS))
    jets[:, 0] = values
    return jets


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
            raise InvalidRequest(f'{name} angle of the passive joint is {angles[-1]:g} rad, not 0')
