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
Where a stop comes to rest, chosen where the cost is least.

There, the costate that belongs to the value of each planned variable is zero at the end ((S2) of
docs/derivation.md); it is linear in the final value, so that two laws tell where that is.
"""

from dataclasses import replace

from flat_planner_ros.core.arm import FloatArray, OutOfReach, UncertifiedPlan
from flat_planner_ros.core.motion_law import (
    CONDITIONS,
    costate,
)
from flat_planner_ros.core.planning.certified_plan import Plan
from flat_planner_ros.core.planning.limits import JointLimits
from flat_planner_ros.core.planning.planner import plan
from flat_planner_ros.core.planning.request import MotionRequest, PlanningOptions
from flat_planner_ros.core.planning.strategies import OWN_LAWS, with_quadratic_cost
import numpy as np

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
        if demanding or (limits is not None and limits.are_exceeded_by(tried)):
            shortest = middle
        else:
            best, longest = tried, middle
    return best


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
