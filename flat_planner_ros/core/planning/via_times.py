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
Times of via points that have none: those at which the optimal path is cheapest.

The path itself is solved exactly for any times, and its cost has a derivative with respect to each
of them ((V8) of docs/derivation.md). So the times are refined by a quasi-Newton method on the same
cost that the strategy minimises, the duration kept.
"""

from dataclasses import replace
from functools import partial
from math import inf

from flat_planner_ros.core.arm import FloatArray, PlanarArm, UncertifiedPlan
from flat_planner_ros.core.motion_law import (
    CONDITIONS,
    optimal_path,
    PathConditions,
    QuadraticCost,
)
from flat_planner_ros.core.planning.problem import MotionProblem, problem_of
from flat_planner_ros.core.planning.request import (
    MotionRequest,
    planned_at_rest,
    PlanningOptions,
    ViaPoint,
)
import numpy as np

LEAST_SHARE = 0.05
"""
Shortest segment, relative to an even share of the duration [-].

Between equal values the optimum would let a segment vanish, and its two points with it.
"""

GRADIENT_TOLERANCE = 1e-3
"""Derivative of the cost's logarithm by that of a segment's length at which times are kept [-]."""

MAX_ITERATIONS = 40
"""Bound on the quasi-Newton steps; the cost has long settled then."""


def allocate_times(cost: QuadraticCost, path: PathConditions) -> FloatArray:
    """
    Return times of the via points that make a path cheap.

    Parameters
    ----------
    cost
        What is minimised, over the laws and the times.
    path
        What to go through, and in which duration; its other times do not matter.

    Returns
    -------
    FloatArray
        Edges for the path: 0, the times and the duration, shape (p + 1,) [s]. A local minimum:
        no small change of the times is cheaper.

    Raises
    ------
    UncertifiedPlan
        The conditions of a path tried are singular in double precision.
    ArithmeticError
        Its numbers leave double precision.

    """
    from scipy.optimize import minimize  # here: slow to import, and only for goals without times

    duration, count = float(path.edges[-1]), path.values.shape[1]
    if count == 1:
        return path.edges
    lengths = np.linalg.norm(np.diff(path.values, prepend=path.start[:, :1], axis=1), axis=0)
    if not lengths.any():
        return np.linspace(0.0, duration, count + 1)
    # Between constant speed and equal times: the ends are at rest, the rest is passed at speed.
    guess = np.log(np.maximum(np.sqrt(lengths / lengths.max()), LEAST_SHARE))
    found = minimize(
        partial(_log_cost, cost, path),
        guess - guess.mean(),
        jac=True,
        method='BFGS',
        options={'gtol': GRADIENT_TOLERANCE, 'maxiter': MAX_ITERATIONS},
    )
    return _edges(found.x, duration)


def path_of(request: MotionRequest, problem: MotionProblem) -> PathConditions:
    """Return what the planned variables of a motion go through."""
    final = np.array(planned_at_rest(request.final))
    start = request.start_jets
    if start is None:
        start = np.zeros((len(final), CONDITIONS))
        start[:, 0] = planned_at_rest(request.start)
    relaxations = np.zeros(len(final))
    # Of the flat outputs, y1 alone may differ from its planned variable ((15a)).
    relaxations[0] = problem.flat_map.relaxation
    return PathConditions(
        edges=np.array([0.0, *(point.time for point in request.via), request.duration]),
        start=start,
        values=np.column_stack([*(point.values for point in request.via), final]),
        relaxations=relaxations,
    )


def with_via_times(
    request: MotionRequest, arm: PlanarArm, options: PlanningOptions
) -> MotionRequest:
    """
    Return a request whose via points have the times at which the motion is cheapest.

    Parameters
    ----------
    request
        Points in their order, and the duration, which is kept; the times of the via points do not
        matter.
    arm, options
        As for `plan`.

    Raises
    ------
    FlatPlannerError
        The arm, the weights or the numbers allow no plan.

    """
    try:
        problem = problem_of(arm, options, request.duration)
        edges = allocate_times(problem.cost, path_of(request, problem))
    except ArithmeticError as error:
        raise UncertifiedPlan('boundary residual', inf, 0.0) from error
    via = tuple(
        ViaPoint(time=time, values=point.values)
        for point, time in zip(request.via, edges[1:-1].tolist(), strict=True)
    )
    return replace(request, via=via)


def _shares(logarithms: FloatArray) -> FloatArray:
    """Return the parts of the free time that segments take, from any numbers."""
    parts = np.exp(logarithms - logarithms.max())
    shares: FloatArray = parts / parts.sum()
    return shares


def _edges(logarithms: FloatArray, duration: float) -> FloatArray:
    """Return the edges of segments, (V9) of docs/derivation.md."""
    least = LEAST_SHARE / len(logarithms)
    inner = np.cumsum(least + (1.0 - LEAST_SHARE) * _shares(logarithms))[:-1]
    return np.concatenate([[0.0], duration * inner, [duration]])


def _log_cost(
    cost: QuadraticCost, path: PathConditions, logarithms: FloatArray
) -> tuple[float, FloatArray]:
    """Return the logarithm of the cost and its gradient."""
    duration = float(path.edges[-1])
    edges = _edges(logarithms, duration)
    found = optimal_path(
        cost,
        PathConditions(
            edges=edges, start=path.start, values=path.values, relaxations=path.relaxations
        ),
    )
    # A longer segment moves all later edges but the last.
    by_length = np.append(np.cumsum(found.time_slopes[::-1])[::-1], 0.0)
    shares = _shares(logarithms)
    by_logarithm = shares * (by_length - shares @ by_length)
    scale = duration * (1.0 - LEAST_SHARE) / found.cost_value
    return float(np.log(found.cost_value)), scale * by_logarithm
