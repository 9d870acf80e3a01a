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
What a request may leave open, chosen where the cost is least.

Times of via points: the path itself is solved exactly for any times, and its cost has a
derivative with respect to each of them ((V8) of docs/derivation.md); they are refined by a
quasi-Newton method on the same cost that the strategy minimises, the duration kept.

Final pose of a stop: where the cost is least, the costate that belongs to the value of each
planned variable is zero at the end ((S2)); it is linear in the final value, so that two laws tell
where that is.
"""

from dataclasses import replace
from functools import partial
from math import inf

from flat_planner_ros.core.arm import FloatArray, OutOfReach, PlanarArm, UncertifiedPlan
from flat_planner_ros.core.motion_law import (
    CONDITIONS,
    costate,
    path_cost,
    PathConditions,
    QuadraticCost,
)
from flat_planner_ros.core.planning.certified_plan import Plan
from flat_planner_ros.core.planning.limits import JointLimits
from flat_planner_ros.core.planning.planner import path_of, plan
from flat_planner_ros.core.planning.reference_trajectory import problem_of
from flat_planner_ros.core.planning.request import MotionRequest, PlanningOptions, ViaPoint
from flat_planner_ros.core.planning.strategies import OWN_LAWS, with_quadratic_cost
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

SHORTEST = 1.0 / 16.0
"""Shortest stop that is considered, in terms of the rest of the motion [-]."""

HALVINGS = 6
"""Halvings of the range of durations, in logarithm: finds the stop within 5 %."""

DEMAND = 2.0
"""Peaks that a stop may reach, in terms of those of the motion that it ends [-]."""

REST_DURATION = 0.1
"""Longest stop of an arm that does not move yet [s]."""

PROBE = 1.0
"""Distance between the two final values that are tried [rad]."""


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
        edges = _cheapest_edges(problem.cost, path_of(request, problem))
    except ArithmeticError as error:
        raise UncertifiedPlan('boundary residual', inf, 0.0) from error
    via = tuple(
        ViaPoint(time=time, values=point.values)
        for point, time in zip(request.via, edges[1:-1].tolist(), strict=True)
    )
    return replace(request, via=via)


def _cheapest_edges(cost: QuadraticCost, path: PathConditions) -> FloatArray:
    """Return edges of a path's segments that make it cheap: no small change of them is cheaper."""
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
    value, slopes = path_cost(
        cost,
        PathConditions(
            edges=edges, start=path.start, values=path.values, relaxations=path.relaxations
        ),
    )
    # A longer segment moves all later edges but the last.
    by_length = np.append(np.cumsum(slopes[::-1])[::-1], 0.0)
    shares = _shares(logarithms)
    by_logarithm = shares * (by_length - shares @ by_length)
    scale = duration * (1.0 - LEAST_SHARE) / value
    return float(np.log(value)), scale * by_logarithm


def stop_plan(
    running: Plan,
    pose: FloatArray,
    jets: FloatArray | None,
    remaining: float,
    limits: JointLimits | None = None,
) -> Plan:
    """
    Return the shortest plan to rest that demands little more than the motion that it ends.

    Its peaks of effort and velocity stay below twice the motion's: with the same effort, a motion
    that is optimal cannot be stopped much before its end. Where no stop keeps within the limits,
    which may have been lowered since, it takes all the time that the motion would have taken.

    Parameters
    ----------
    running
        The plan that is being carried out, whose model and cost are kept.
    pose
        Angles of all joints at the start of the stop, shape (n,) [rad].
    jets
        Derivatives 0 to 5 of the planned variables there, shape (n - 1, 6) [rad/s^k]; None when
        the arm has not begun to move.
    remaining
        Time that the motion would still take [s], the longest stop.
    limits
        Limits of the joints, if there are any.

    """
    if jets is None:
        request = MotionRequest(start=pose, final=pose, duration=min(remaining, REST_DURATION))
        return plan(request, running.problem.arm, running.options)
    effort = DEMAND * running.peak_effort
    velocity = DEMAND * running.peak_velocity
    options = running.options
    try:
        best = _stop(running, options, pose, jets, remaining)
    except OutOfReach:
        # To stop at all comes before bounds that were kept until now.
        options = replace(options, peak=options.peak.unbounded)
        best = _stop(running, options, pose, jets, remaining)
    shortest, longest = SHORTEST * remaining, remaining
    for _ in range(HALVINGS):
        middle = (shortest * longest) ** 0.5
        try:
            tried = _stop(running, options, pose, jets, middle)
        except (UncertifiedPlan, OutOfReach):
            shortest = middle
            continue
        demanding = (tried.peak_effort > effort).any() or (tried.peak_velocity > velocity).any()
        if demanding or _exceeds(tried, limits):
            shortest = middle
        else:
            best, longest = tried, middle
    return best


def _exceeds(tried: Plan, limits: JointLimits | None) -> bool:
    """Tell whether a stop goes beyond a limit."""
    use = None if limits is None else limits.worst(tried)
    return use is not None and use.is_exceeded


def _stop(
    running: Plan, options: PlanningOptions, pose: FloatArray, jets: FloatArray, duration: float
) -> Plan:
    """Return the plan to rest of a given duration that costs least."""

    def plan_to(values: FloatArray, options: PlanningOptions) -> Plan:
        request = MotionRequest(
            start=pose, final=_pose(values), duration=duration, start_jets=jets
        )
        return plan(request, arm, options)

    arm = running.problem.arm
    own = OWN_LAWS.get(options.strategy)
    # Costates are those of a quadratic cost.
    quadratic = with_quadratic_cost(options)
    here = jets[:, 0]
    low, high = (_end_costates(plan_to(here + probe, quadratic)) for probe in (0.0, PROBE))
    values = here + PROBE * low / (low - high)
    if own is None or own.stop is None:
        return plan_to(values, quadratic)
    values[0] = own.stop(arm, options, duration, jets[0])
    return plan_to(values, options)


def _end_costates(planned: Plan) -> FloatArray:
    """Return the costate of each planned variable at the end, shape (n - 1,)."""
    coefficients = planned.problem.cost.characteristic()
    end = np.array([planned.duration])
    return np.array(
        [
            costate(coefficients, law.jet(end, 2 * CONDITIONS - 1))[0]
            for law in planned.trajectory.laws
        ]
    )


def _pose(values: FloatArray) -> FloatArray:
    """Return the joint angles at rest of given planned variables, the passive joint relaxed."""
    inner = values[1:]
    return np.array([*inner, values[0] - inner.sum(), 0.0])
