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

"""Motions of all actuated joints that may be tried next: they tell the first links of an arm."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from math import pi

from flat_planner_ros.core.arm import FloatArray, PlanarArm
from flat_planner_ros.core.excitation.candidates import Candidate, planned, REFINEMENT, SAMPLING
from flat_planner_ros.core.excitation.settings import Room
from flat_planner_ros.core.model_fit import FirstMotion, foresee, ForeseenMotion
from flat_planner_ros.core.planning import (
    JointLimits,
    Plan,
    PlanningOptions,
)
import numpy as np

DURATIONS = (1.6, 2.6, 4.2, 6.8, 11.0)
"""Durations that are tried, in free periods of the passive joint [-]."""

DISTANCES = (1.0, 0.4, 0.16)
"""Distances that are tried until one is allowed, relative to the largest [-]."""

LESS = 0.3
"""Distance of one of the joints where it goes less far than the others [-]."""

WITHIN = 0.95
"""Share of an effort's bound to which distances are shortened [-]."""

SHORTENINGS = 3
"""How often the distances of a motion may be shortened."""


@dataclass(frozen=True, kw_only=True, eq=False)
class AllJointsCandidate:
    """
    A motion of all actuated joints that stays within its bounds.

    Attributes
    ----------
    candidate
        Goal, duration, and what is foreseen of the last two links.
    motion
        Of all joints, the last two as foreseen and those before as planned, with the efforts that
        the best model so far takes for the plan.

    """

    candidate: Candidate
    motion: FirstMotion


@dataclass(frozen=True, kw_only=True, eq=False)
class AllBounds:
    """
    What a motion of all actuated joints may do.

    Attributes
    ----------
    limits
        Of the plan.
    room
        Of the arm.
    shares
        Of effort limit and range that each joint may use, shape (n-1,) [-].
    margin
        By which excursions, speeds and efforts may be larger than foreseen [-].

    """

    limits: JointLimits
    room: Room
    shares: FloatArray
    margin: float

    def most_effort(self, weight: FloatArray) -> FloatArray:
        """Return what joints may give where they hold efforts of (..., n-1) [N m] as it is."""
        most: FloatArray = np.abs(weight) + self.shares * self.room.efforts
        return np.minimum(most, self.room.efforts)

    def distances(self, here: FloatArray) -> FloatArray:
        """Return how far each joint may turn, to its wider side, shape (n-1,) [rad]."""
        low, high = np.array(self.room.ranges[:-1]).T
        up, down = high - here[:-1], here[:-1] - low
        largest = np.minimum(
            self.shares * (high - low), np.maximum(up, down) / (1.0 + self.margin)
        )
        signed: FloatArray = np.where(up >= down, largest, -largest)
        return signed

    def allow(self, here: FloatArray, motion: ForeseenMotion, all_of_it: FirstMotion) -> bool:
        """Tell whether a motion stays inside, the last two links as foreseen."""
        wider = 1.0 + self.margin
        count = all_of_it.times.size
        turned = np.zeros((motion.times.size, here.size))
        turned[:count] = all_of_it.positions - here
        turned[count:] = turned[count - 1]
        # The last two links swing on after it.
        turned[:, -1] = motion.states[:, 1]
        turned[:, -2] = motion.states[:, 0] - turned[:, :-2].sum(axis=1)
        rates = np.gradient(turned, motion.times, axis=0)
        low, high = np.array(self.room.ranges).T
        rest = np.append(here[:-1], 0.0)
        fastest = [joint.velocity for joint in self.room.firsts]
        fastest += [self.room.velocity, self.room.passive_velocity]
        effort = wider * np.abs(all_of_it.efforts).max(axis=0)
        return bool(
            (rest + wider * turned.min(axis=0).clip(max=0.0) >= low).all()
            and (rest + wider * turned.max(axis=0).clip(min=0.0) <= high).all()
            and (wider * np.abs(rates).max(axis=0) <= fastest).all()
            and (effort <= self.room.efforts).all()
        )


def all_joint_candidates(
    here: FloatArray,
    planned_by: PlanarArm,
    options: PlanningOptions,
    estimate: PlanarArm,
    bounds: AllBounds,
    rest: float,
) -> Iterator[AllJointsCandidate]:
    """
    Yield motions of all actuated joints that are allowed from where the arm rests.

    All joints go as far as they may, or one of them less far; a row of the arm tells of a link
    only while the joints at both its ends move.

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
    start = np.append(here[:-1], 0.0)
    farthest = bounds.distances(start)
    patterns = np.vstack((np.ones(farthest.size), 1.0 - (1.0 - LESS) * np.eye(farthest.size)))
    for pattern, duration in product(patterns * farthest, np.array(DURATIONS) * period):
        for distance in DISTANCES:
            made = _within_efforts(
                start, distance * pattern, float(duration), planned_by, options, bounds
            )
            if made is None:
                continue
            found = _foreseen(made, start, estimate, bounds, rest * period)
            if bounds.allow(start, found.candidate.motion, found.motion):
                yield found
                break


def _within_efforts(
    start: FloatArray,
    distances: FloatArray,
    duration: float,
    arm: PlanarArm,
    options: PlanningOptions,
    bounds: AllBounds,
) -> Plan | None:
    """Return a plan with distances shortened to what the efforts allow, None where that fails."""
    for _ in range(SHORTENINGS):
        made = planned(start, start + np.append(distances, 0.0), duration, arm, options)
        if made is None:
            return None
        samples = made.at(np.linspace(0.0, duration, round(duration / SAMPLING) + 1))
        weight = arm.gravity_effort(samples.positions)[:, :-1]
        allowed = bounds.shares * bounds.room.efforts
        used = float((np.abs(samples.efforts[:, :-1] - weight) / allowed).max())
        if used <= 1.0:
            return None if bounds.limits.are_exceeded_by(made) else made
        distances = distances * WITHIN / used
    return None


def _foreseen(
    made: Plan, start: FloatArray, estimate: PlanarArm, bounds: AllBounds, rest: float
) -> AllJointsCandidate:
    """Return a plan with what the best model so far has of it."""
    duration = made.request.duration
    count = round(duration / SAMPLING)
    times = np.linspace(0.0, SAMPLING * count, count + 1)
    samples = made.at(np.minimum(times, duration))
    after = np.zeros(round(rest / SAMPLING))
    effort = np.append(samples.efforts[:, -2], after)
    base = np.append(samples.velocities[:, :-2].sum(axis=1), after)
    longer = np.linspace(0.0, SAMPLING * (effort.size - 1), effort.size)
    motion = foresee(estimate, longer, effort, REFINEMENT, base)
    taken = estimate.inverse_dynamics(
        samples.positions, samples.velocities, samples.accelerations
    )[:, :-1]
    weight = made.problem.arm.gravity_effort(samples.positions)[:, :-1]
    candidate = Candidate(
        final=made.request.final,
        duration=duration,
        peak_effort=float(made.peak_effort[-2]),
        motion=motion,
        most_effort=bounds.most_effort(weight).max(axis=0),
    )
    # Friction that the planner does not know may let joint n-1 rest where it should turn.
    turned = motion.states[: times.size, 0] - (samples.positions - start)[:, :-2].sum(axis=1)
    positions = np.column_stack(
        (samples.positions[:, :-2], start[-2] + turned, motion.states[: times.size, 1])
    )
    return AllJointsCandidate(candidate=candidate, motion=FirstMotion(times, positions, taken))
