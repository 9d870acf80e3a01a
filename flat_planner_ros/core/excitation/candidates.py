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

"""Motions that may be tried next: distances and durations, planned and foreseen."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import inf, pi

from flat_planner_ros.core.arm import FlatPlannerError, FloatArray, PlanarArm
from flat_planner_ros.core.excitation.settings import Room
from flat_planner_ros.core.model_fit import foresee, ForeseenMotion
from flat_planner_ros.core.planning import (
    JointLimits,
    MotionRequest,
    Plan,
    plan,
    PlanningOptions,
)
import numpy as np

DURATIONS = (1.0, 1.6, 2.6, 4.2)
"""Durations that are tried, in free periods of the passive joint [-]."""

DISTANCES = (1.0, 0.4)
"""Distances that are tried, relative to the largest that is allowed [-]."""

REFINEMENT = 0.3
"""Refinement of the steps with which motions are compared: many, and not to be followed [-]."""

SAMPLING = 0.005
"""Time between samples that are foreseen [s]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """
    A motion that stays within its bounds, planned by one model and foreseen by another.

    Attributes
    ----------
    final
        The goal, shape (n,) [rad].
    duration
        Of the motion [s].
    peak_effort
        Of joint n-1 [N m].
    motion
        Of the last two links, as the best model so far has it, with the time after it.
    most_effort
        What each actuated joint may be planned with at most, shape (n-1,) [N m].

    """

    final: FloatArray
    duration: float
    peak_effort: float
    motion: ForeseenMotion
    most_effort: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Bounds:
    """
    What a motion may do.

    Attributes
    ----------
    limits
        Of the plan.
    room
        Of the arm.
    share
        Of effort limit and range that may be used [-].
    margin
        By which excursions and speeds may be larger than foreseen [-].

    """

    limits: JointLimits
    room: Room
    share: float
    margin: float

    def allow_plan(self, made: Plan) -> bool:
        """Tell whether a plan takes no more of the motor of joint n-1 and obeys the limits."""
        most = self.share * self.room.effort
        return float(made.peak_effort[-2]) <= most and not self.limits.are_exceeded_by(made)

    def allow(self, motion: ForeseenMotion, here: float) -> bool:
        """Tell whether a motion that starts at an angle of joint n-1 [rad] stays inside."""
        room, wider = self.room, 1.0 + self.margin
        link, passive, rate, passive_rate = motion.states.T * wider
        # The rate of the passive joint is relative to link n-1, as its angle is.
        return bool(
            here + link.min() >= room.low
            and here + link.max() <= room.high
            and passive.min() >= room.passive_low
            and passive.max() <= room.passive_high
            and np.abs(rate).max() <= room.velocity
            and np.abs(passive_rate).max() <= room.passive_velocity
        )


def candidates(
    here: FloatArray,
    planned_by: PlanarArm,
    options: PlanningOptions,
    estimate: PlanarArm,
    bounds: Bounds,
    rest: float,
) -> Iterator[Candidate]:
    """
    Yield the motions that are allowed from where the arm rests.

    Parameters
    ----------
    here
        Joint angles, shape (n,) [rad].
    planned_by, options
        Model and options of the planner that will plan the goal.
    estimate
        Model that foresees the motion.
    bounds
        What it may do.
    rest
        Time after the motion that is looked at, in free periods [-].

    """
    period = 2 * pi / estimate.natural_mode().frequency
    room = bounds.room
    start = np.append(here[:-1], 0.0)
    at = float(here[-2])
    up, down = room.high - at, at - room.low
    largest = min(bounds.share * (room.high - room.low), max(up, down) / (1.0 + bounds.margin))
    toward = 1.0 if up >= down else -1.0
    for distance in DISTANCES:
        final = start.copy()
        final[-2] += toward * distance * largest
        for duration in DURATIONS:
            made = planned(start, final, duration * period, planned_by, options)
            if made is None or not bounds.allow_plan(made):
                continue
            effort = np.append(_efforts_of(made), np.zeros(round(rest * period / SAMPLING)))
            times = np.linspace(0.0, SAMPLING * (effort.size - 1), effort.size)
            motion = foresee(estimate, times, effort, REFINEMENT)
            if bounds.allow(motion, at):
                yield Candidate(
                    final=final,
                    duration=duration * period,
                    peak_effort=float(made.peak_effort[-2]),
                    motion=motion,
                    most_effort=_last_only(here.size, bounds),
                )


def _last_only(joints: int, bounds: Bounds) -> FloatArray:
    """Return the bound on the effort of joint n-1; those before it only hold against it."""
    most = np.full(joints - 1, inf)
    most[-1] = bounds.share * bounds.room.effort
    return most


def planned(
    start: FloatArray,
    final: FloatArray,
    duration: float,
    arm: PlanarArm,
    options: PlanningOptions,
) -> Plan | None:
    """Return the plan from rest to rest, None where there is none."""
    request = MotionRequest(start=start, final=final, duration=duration)
    try:
        return plan(request, arm, options)
    except FlatPlannerError:
        return None


def _efforts_of(made: Plan) -> FloatArray:
    """Return the efforts of joint n-1, zero after the end of the motion, shape (m,) [N m]."""
    times = np.arange(0.0, made.duration + SAMPLING, SAMPLING)
    efforts = made.at(np.minimum(times, made.duration)).efforts[:, -2]
    return np.where(times < made.duration, efforts, 0.0)
