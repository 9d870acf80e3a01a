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

"""Plan of a checked goal, or of a motion to rest, from its start and within the limits."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from flat_planner_ros.core.arm import (
    FlatModel,
    FloatArray,
    InvalidRequest,
    OutOfReach,
    PlanarArm,
    UncertifiedPlan,
)
from flat_planner_ros.core.planning import (
    DurationRules,
    IsOver,
    LimitUse,
    MotionRequest,
    Plan,
    plan,
    planned_at_rest,
    PlanningOptions,
    Reason,
    RequestRejected,
    stop_plan,
    ViaPoint,
    with_via_times,
)
from flat_planner_ros.core.session.allowance import Allowance
from flat_planner_ros.core.session.caught_start import patience, swing_time
from flat_planner_ros.core.session.goal import Goal
from flat_planner_ros.core.session.motion_start import MotionStart
from flat_planner_ros.core.session.settings import SessionSettings, SettlePose
from flat_planner_ros.core.session.timeline import Motion
import numpy as np

NOMINAL_DURATION = 1.0
"""Duration of a request before its own is found [s]."""

ROUGH_TRIALS = 8
"""Durations that are tried for one that tells the shares of via points."""

TIMES_SHARE = 0.4
"""Part of the time for planning in motion after which times of via points are kept [-]."""

SETTLING_TRIALS = 50
"""Durations that are tried at most until a motion to rest is sent: it is urgent."""


def plan_of_goal(
    settings: SessionSettings,
    start: MotionStart,
    goal: Goal,
    duration: float | None,
    allowance: Allowance | None = None,
) -> tuple[Plan, LimitUse | None]:
    """Return the plan of a checked goal within the limits, and what made it longer than asked."""
    is_over = None if allowance is None else allowance.over_at(1.0)
    arm, options = _model(settings, start)
    rules = settings.duration_rules(start.pose)
    rules.check_pose('the start', start.pose)
    *via, final = (np.array(point.positions) for point in goal.points)
    for index, positions in enumerate(via):
        rules.check_pose(f'via point {index}', positions)
    rules.check_pose('the final', final)
    is_prescribed = duration is not None
    # From a start in motion, much longer motions swing far out: no place for a search to start.
    first = None if start.running is None else start.running.plan.duration
    with _refusals(settings, start):
        request = _request(goal, start, duration or NOMINAL_DURATION)
        if not via or goal.duration is not None:
            return rules.plan_within(
                request, arm, options, is_prescribed=is_prescribed, first=first, is_over=is_over
            )
        enough = None if allowance is None else allowance.over_at(TIMES_SHARE)
        request = with_via_times(request, arm, options, is_over=enough)
        if is_prescribed:
            return rules.plan_within(request, arm, options, is_prescribed=True, is_over=is_over)
        # The best shares of the time depend on the time, if little: first it is found roughly.
        rough = _rough_plan(rules, request, arm, options, first, is_over)
        if is_over is not None and is_over():
            return rough, None
        gentle = rough.request.stretched(min(rules.factor * rough.duration, rules.longest))
        request = with_via_times(gentle, arm, options, is_near=True, is_over=is_over)
        return rules.plan_within(
            request, arm, options, is_prescribed=False, first=rough.duration, is_over=is_over
        )


def _rough_plan(
    rules: DurationRules,
    request: MotionRequest,
    arm: PlanarArm,
    options: PlanningOptions,
    first: float | None,
    is_over: IsOver | None,
) -> Plan:
    """Return a plan of nearly the shortest duration, by few trials if they find one."""
    try:
        return rules.shortest_of(
            lambda time: plan(request.stretched(time), arm, options),
            most=ROUGH_TRIALS,
            first=first,
            is_over=is_over,
        )
    except RequestRejected:
        return rules.plan_within(
            request, arm, options, is_prescribed=False, first=first, is_over=is_over
        )[0]


def settling_plan(settings: SessionSettings, start: MotionStart, last: FloatArray | None) -> Plan:
    """
    Return the shortest plan to rest from a measured start, within the limits.

    Parameters
    ----------
    settings
        Where it is to rest, and the limits; without limits it takes one swing, or the duration of
        goals without times.
    start
        In motion, as measured.
    last
        Pose of the last goal, shape (n,) [rad]; None if there was none.

    Raises
    ------
    RequestRejected
        There is no such plan, or no last goal where it is asked for.

    """
    arm, options = _model(settings, start)
    is_here = settings.settle_pose is SettlePose.HERE
    if start.swing is None or not (is_here or last is not None):
        raise RequestRejected(
            Reason.START_STATE_UNKNOWN,
            'there has been no motion yet whose end could be gone to (settle.pose: last_goal)',
        )
    rest, drift = start.swing.rest, start.swing.drift

    def request(duration: float) -> MotionRequest:
        # At an even rate to zero, what coasts goes half as far.
        final = rest + 0.5 * duration * drift if is_here or last is None else last
        return MotionRequest(
            start=start.pose, final=final, duration=duration, start_jets=start.jets
        )

    rules = settings.duration_rules(start.pose)
    with _refusals(settings, start):
        if rules.limits.bounds_duration:
            return rules.shortest_of(
                lambda duration: plan(request(duration), arm, options), most=SETTLING_TRIALS
            )
        usual = settings.default_duration or swing_time(settings)
        duration = min(max(usual, rules.shortest), rules.longest)
        return rules.plan_within(request(duration), arm, options, is_prescribed=True)[0]


def stopping_plan(settings: SessionSettings, start: MotionStart, running: Motion) -> Plan:
    """Return the plan that brings a running motion to rest early, from a start in its midst."""
    limits = settings.duration_rules(start.pose).limits
    return stop_plan(running.plan, start.pose, start.jets, running.end - start.time, limits)


def _model(settings: SessionSettings, start: MotionStart) -> tuple[PlanarArm, PlanningOptions]:
    """Return the model in whose terms a motion is planned, and what is minimised."""
    arm, options = settings.arm, settings.options
    flat_model = options.flat_model
    if start.swing is not None:  # a measured state is not said in terms of a flat model
        flat_model = FlatModel.EXACT
    elif start.jets is not None and start.running is not None:
        # What the arm is planned to do then is said in terms of the model it was planned with.
        running = start.running.plan
        arm, flat_model = running.problem.arm, running.options.flat_model
    # The very same ones, as far as can be: what is prepared for them serves again.
    if flat_model is not options.flat_model:
        options = replace(options, flat_model=flat_model)
    return arm, options


@contextmanager
def _refusals(settings: SessionSettings, start: MotionStart) -> Iterator[None]:
    """Turn what goes wrong into refusals; one of a start in a swing says its remedy."""
    try:
        yield
    except RequestRejected as error:
        if start.swing is None:
            raise
        message = error.message + patience(settings, start.swing.amplitude)
        raise replace(error, message=message) from error
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


def _request(goal: Goal, start: MotionStart, duration: float) -> MotionRequest:
    """Return what is asked of a plan; via times that are to be chosen are even for now."""
    *passed, final = goal.points
    via = tuple(
        ViaPoint(
            time=point.time or duration * index / len(goal.points),
            values=np.array(planned_at_rest(np.array(point.positions))),
        )
        for index, point in enumerate(passed, start=1)
    )
    return MotionRequest(
        start=start.pose,
        final=np.array(final.positions),
        duration=duration,
        via=via,
        start_jets=start.jets,
    )
