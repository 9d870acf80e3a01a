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

"""Planning: a goal turned into certified motion laws, joint motion and feed-forward effort."""

from dataclasses import replace
from math import inf

from flat_planner_ros.core.arm import (
    FlatModel,
    FloatArray,
    InvalidRequest,
    PlanarArm,
    strict_arithmetic,
    UncertifiedPlan,
)
from flat_planner_ros.core.motion_law import optimal_path, Strategy
from flat_planner_ros.core.planning.certified_plan import BOUNDARY_TOLERANCE, Plan, PlanSamples
from flat_planner_ros.core.planning.moving_start import laws_to_rest
from flat_planner_ros.core.planning.problem import MotionProblem, problem_of
from flat_planner_ros.core.planning.reference_trajectory import (
    LawTrajectory,
    ReferenceTrajectory,
    RestToRestTrajectory,
)
from flat_planner_ros.core.planning.request import (
    MotionRequest,
    planned_at_rest,
    PlanningOptions,
    ViaPoint,
)
from flat_planner_ros.core.planning.shaped_trajectory import shaped_trajectory
from flat_planner_ros.core.planning.via_times import path_of
import numpy as np

__all__ = ['MotionRequest', 'Plan', 'plan', 'PlanningOptions', 'PlanSamples', 'ViaPoint']


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
        if request.via:
            return _through_points(request, options, problem)
        if request.start_jets is not None:
            return _from_motion(request, options, problem, request.start_jets)
    except ArithmeticError as error:
        raise UncertifiedPlan('boundary residual', inf, BOUNDARY_TOLERANCE) from error
    return _from_rest(request, options, problem)


def _from_rest(request: MotionRequest, options: PlanningOptions, problem: MotionProblem) -> Plan:
    """Return a plan whose planned variables are multiples of the unit motion."""
    start, final = planned_at_rest(request.start), planned_at_rest(request.final)
    distances = tuple(
        [0.0 if abs(b - a) < NO_DISTANCE else b - a for a, b in zip(start, final, strict=True)]
    )
    if not all(abs(distance) < problem.reach for distance in distances):
        raise UncertifiedPlan('boundary residual', inf, BOUNDARY_TOLERANCE)
    trajectory: ReferenceTrajectory = RestToRestTrajectory(
        problem=problem, start=start, final=final, distances=distances
    )
    moves = any(distances)
    boundary = problem.unit.boundary_residual if moves else 0.0
    optimality = problem.unit.optimality_residual if moves else 0.0
    if options.strategy is Strategy.INSENSITIVE and distances[0]:
        if options.flat_model is not FlatModel.EXACT:
            raise InvalidRequest('strategy insensitive needs flat_model exact')
        trajectory, boundary, optimality = shaped_trajectory(
            problem, options.insensitivity, start, final
        )
    return Plan(
        request=request,
        options=options,
        problem=problem,
        trajectory=trajectory,
        boundary_residual=boundary,
        optimality_residual=optimality,
    )


def _from_motion(
    request: MotionRequest, options: PlanningOptions, problem: MotionProblem, start: FloatArray
) -> Plan:
    """Return a plan whose planned variables have given derivatives at the start."""
    if options.strategy is Strategy.INSENSITIVE:
        # It has no law from a start in motion; the problem's cost is the polynomial one.
        options = replace(options, strategy=Strategy.POLYNOMIAL)
    final = np.array(planned_at_rest(request.final))
    with strict_arithmetic():
        found = laws_to_rest(problem, start, final)
    return Plan(
        request=request,
        options=options,
        problem=problem,
        trajectory=LawTrajectory(
            problem=problem,
            laws=found.laws,
            start=start,
            final=final,
            edges=(0.0, problem.duration),
        ),
        boundary_residual=found.boundary_residual,
        optimality_residual=found.optimality_residual,
    )


def _through_points(
    request: MotionRequest, options: PlanningOptions, problem: MotionProblem
) -> Plan:
    """Return a plan whose flat outputs pass given values on the way."""
    if options.strategy is Strategy.INSENSITIVE:
        raise InvalidRequest('strategy insensitive has no via points; another strategy has')
    path = path_of(request, problem)
    found = optimal_path(problem.cost, path)
    return Plan(
        request=request,
        options=options,
        problem=problem,
        trajectory=LawTrajectory(
            problem=problem,
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
