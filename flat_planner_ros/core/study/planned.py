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

"""What becomes of a case: its plan or its refusal, what it takes, and what is predicted of it."""

from collections.abc import Callable
from dataclasses import dataclass
from math import nan

from flat_planner_ros.core.arm import Drive, FlatPlannerError, FloatArray, PlanarArm
from flat_planner_ros.core.insensitive import driven_angle, UncertaintyBox
from flat_planner_ros.core.planning import (
    Plan,
    PlanSamples,
    RequestRejected,
    residual_of_plan,
    residual_on,
)
from flat_planner_ros.core.session import Motion, single_goal
from flat_planner_ros.core.study.case import Case
import numpy as np

ACCEPTED = 'ACCEPTED'
"""Verdict on a case that has a plan."""

NOW = 1.0
"""Any time will do for a plan that nobody carries out [s]."""

CERTAIN = UncertaintyBox(stiffness=0.0, damping=0.0)
"""Of an arm that is known."""

Clock = Callable[[], float]
"""Tells the time since whenever [s]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Answer:
    """
    What a planner says to a case.

    Attributes
    ----------
    verdict
        `ACCEPTED`, the name of a `Reason`, or that of the error that a model or a parameter is.
    message
        Why it is refused, with the numbers; empty if it is not.
    motion
        The plan and its samples on the grid of the command; None if it is refused.
    seconds
        What planning took [s]; NaN where no clock tells.

    """

    verdict: str
    message: str = ''
    motion: Motion | None = None
    seconds: float = nan


@dataclass(frozen=True, kw_only=True, eq=False)
class Figures:
    """
    What a plan takes, and what is predicted of it.

    Attributes
    ----------
    duration
        [s].
    peak_effort, rms_effort
        Of every actuated joint, shape (n-1,) [N m].
    residual, miss
        Predicted on the case's own true arm [rad]; NaN where nobody knows them.
    worst_residual, worst_miss
        The largest over the uncertainty of the planner [rad]; NaN as well.

    """

    duration: float
    peak_effort: FloatArray
    rms_effort: FloatArray
    residual: float
    miss: float
    worst_residual: float
    worst_miss: float


def refusal(error: FlatPlannerError) -> Answer:
    """Return the answer that an error is."""
    if isinstance(error, RequestRejected):
        return Answer(verdict=error.reason.value, message=str(error))
    return Answer(verdict=type(error).__name__, message=str(error))


def answer(case: Case, clock: Clock | None = None) -> Answer:
    """Return what the planner node would answer to the goal of a case."""
    names = case.settings.joints
    poses = [case.start, *(point.position for point in case.via), case.final]
    times = [*(point.time for point in case.via), case.duration]
    try:
        session, goal = single_goal(
            case.settings, [dict(zip(names, pose, strict=True)) for pose in poses], times
        )
        begun = nan if clock is None else clock()
        motion = session.submit(goal, NOW)
        seconds = nan if clock is None else clock() - begun
    except FlatPlannerError as error:
        return refusal(error)
    return Answer(verdict=ACCEPTED, motion=motion, seconds=seconds)


def figures(case: Case, motion: Motion) -> Figures:
    """Return what a motion takes and what is predicted of it."""
    plan, samples = motion.plan, motion.samples
    worst_residual, worst_miss = _worst(plan, samples)
    return Figures(
        duration=plan.duration,
        peak_effort=plan.peak_effort[:-1],
        rms_effort=plan.rms_effort[:-1],
        residual=_residual(case.true, plan, samples),
        miss=_miss(case, plan, samples),
        worst_residual=worst_residual,
        worst_miss=worst_miss,
    )


def _worst(plan: Plan, samples: PlanSamples) -> tuple[float, float]:
    """Return the largest residual and miss over the box."""
    try:
        found = residual_of_plan(plan, samples)
    except FlatPlannerError:
        return nan, nan
    return found.worst, nan if found.miss is None else found.miss


def _residual(true: PlanarArm, plan: Plan, samples: PlanSamples) -> float:
    """Return what is predicted of the true arm, NaN for one that is not flat or oscillates not."""
    try:
        return residual_on(true, CERTAIN, plan, samples).nominal
    except FlatPlannerError:
        return nan


def _miss(case: Case, plan: Plan, samples: PlanSamples) -> float:
    """Return how far from the goal the true arm's last two links are predicted to stop."""
    if case.drive is Drive.POSITION:
        return 0.0
    try:
        other = case.true.inertia_star.both
    except FlatPlannerError:
        return nan
    effort: FloatArray = np.asarray(samples.driving_effort)
    way = sum(case.final) - sum(case.start)
    return abs(driven_angle(other, effort, plan.duration) - way)
