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

"""Answer to a goal: from its target to a plan within the limits, or a refusal with its reason."""

from dataclasses import replace

from flat_planner_ros.core.arm import InvalidRequest, OutOfReach, UncertifiedPlan
from flat_planner_ros.core.planning import (
    MotionRequest,
    plan,
    planned_at_rest,
    Reason,
    RequestRejected,
    TimedPlan,
    ViaPoint,
    with_via_times,
)
from flat_planner_ros.core.session.goal import RestTarget
from flat_planner_ros.core.session.settings import SessionSettings
from flat_planner_ros.core.session.takeover import Origin
import numpy as np

NOMINAL_DURATION = 1.0
"""Duration of a request before its own is found [s]."""


def answer(
    settings: SessionSettings, origin: Origin, target: RestTarget, duration: float | None
) -> TimedPlan:
    """
    Return the plan that answers a goal, within the limits and good to the promised accuracy.

    Parameters
    ----------
    settings
        Arm, cost, limits and accepted durations.
    origin
        Where the motion starts.
    target
        What the goal asks for.
    duration
        Of the motion [s]; None for the shortest within the limits.

    Raises
    ------
    RequestRejected
        No plan can be accepted.
    FlatPlannerError
        The settings allow no plan.

    """
    arm, options = settings.arm, settings.options
    if origin.jets is not None and origin.before is not None:
        # What the arm is planned to do then is said in terms of the model it was planned with.
        arm = origin.before.plan.problem.arm
        options = replace(options, flat_model=origin.before.plan.options.flat_model)

    rules = settings.duration_rules(origin.pose)
    rules.check_pose('the start', origin.pose)
    for index, point in enumerate(target.via):
        rules.check_pose(f'via point {index}', np.array(point.positions))
    rules.check_pose('the final', np.array(target.positions))

    def timed(request: MotionRequest) -> TimedPlan:
        return rules.timed(lambda time: plan(request.stretched(time), arm, options), duration)

    request = _request(target, origin, duration or NOMINAL_DURATION)
    try:
        if not target.chooses_times:
            return timed(request)
        found = timed(with_via_times(request, arm, options))
        if duration is not None:
            return found
        # The best shares of the time depend on the time, if little.
        return timed(with_via_times(found.plan.request, arm, options))
    except InvalidRequest as error:
        raise RequestRejected(Reason.INVALID_GOAL, str(error)) from error
    except OutOfReach as error:
        raise RequestRejected(
            Reason.SOLVER_FAILED, str(error), value=error.value, limit=error.limit
        ) from error
    except UncertifiedPlan as error:
        raise RequestRejected(
            Reason.ILL_CONDITIONED,
            f'no plan to the promised accuracy: {error}; use a longer duration or smaller weights',
            value=error.residual,
            limit=error.tolerance,
        ) from error


def _request(target: RestTarget, origin: Origin, duration: float) -> MotionRequest:
    """Return what is asked of a plan; via times that are to be chosen are even for now."""
    count = len(target.via) + 1
    via = tuple(
        ViaPoint(
            time=duration * index / count if point.time is None else point.time,
            values=np.array(planned_at_rest(np.array(point.positions))),
        )
        for index, point in enumerate(target.via, start=1)
    )
    return MotionRequest(
        start=origin.pose,
        final=np.array(target.positions),
        duration=duration,
        via=via,
        start_jets=origin.jets,
    )
