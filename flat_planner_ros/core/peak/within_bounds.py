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
Motions within bounds that hold for more than their rows tell.

A velocity is bounded at knots and looked at in between, a residual on a few arms and looked at on
all: what is exceeded adds rows or tightens them, until nothing is.
"""

from dataclasses import replace
from math import ceil, inf, pi

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.insensitive import largest, Oscillator
from flat_planner_ros.core.peak.bounds import (
    free_residuals,
    RateBound,
    residual_rows,
    ResidualBound,
    VelocityBound,
)
from flat_planner_ros.core.peak.problem import MOST_INTERVALS, PeakMotion, PeakProblem
import numpy as np

ROUNDS = 20
"""Programmes after which bounds are given up."""

FIRST_MARGIN = 4e-3
"""Share of the velocity that is kept in reserve between the places of its bound, at first [-]."""

CRUISE_TURNS = 2.0
"""Turns of the oscillation that a motion may take to come to full speed without a swing [-]."""

LONGEST_RAMPS = 0.3
"""Share of the duration up to which both ends are solved for alone [-]."""

ZONE_INTERVALS = 40
"""Spline intervals of each of them."""

NEAR = 0.4
"""Share of the velocity from which a place is bounded, too [-]."""

BEYOND = 2e-3
"""Excess over a tightened bound from which a place is bounded that was not [-]."""

TIGHTENED = 1e-3
"""Share by which a bound is tightened beyond what a motion exceeds it: programmes are few [-]."""

VELOCITY_MARGIN = 1e-5
"""The same where it is looked at [-]."""

BESIDE = (-0.3, 0.0, 0.3)
"""Phases at which a residual is bounded, beside its own: more of its circle at once [rad]."""

RESIDUAL_MARGIN = 2e-3
"""The same of the residual, between the arms that are looked at [-]."""


def motion_within(problem: PeakProblem, oscillator: Oscillator) -> PeakMotion:
    """
    Return the motion of least peak within the bounds of a problem's settings.

    Parameters
    ----------
    problem
        Without bounds yet.
    oscillator
        That of the arm, for the arms beside it.

    Raises
    ------
    OutOfReach
        No motion meets the bounds.

    """
    wanted = problem.settings
    bounds = []
    if wanted.effort_rate > 0.0:
        bounds.append(RateBound(limit=wanted.effort_rate / problem.distance))
    found = replace(problem, bounds=tuple(bounds)).motion()
    if problem.distance * found.peak_velocity > wanted.velocity:
        cruising = _cruising(problem)
        if cruising is not problem:
            problem = cruising
            found = replace(problem, bounds=tuple(bounds)).motion()
    velocity = _Velocity(problem)
    residual = _Residual(problem, oscillator)
    for _ in range(ROUNDS):
        if not (velocity.is_exceeded_by(found) | residual.is_exceeded_by(found)):
            return found
        found = replace(problem, bounds=(*bounds, *velocity.bounds, *residual.bounds)).motion()
    raise found.problem.refusal()


def _cruising(problem: PeakProblem) -> PeakProblem:
    """Return the same with a drive that rests in the midst of a long way at full speed."""
    if problem.final is None:
        return problem
    limit = problem.settings.velocity / problem.distance
    turn = 2.0 * pi / problem.mode.frequency
    # What speeding up and slowing down take more than the same way at full speed.
    slack = problem.duration - abs(problem.final - problem.state.sigma) / limit
    zone = float(np.maximum(slack, 0.0)) + CRUISE_TURNS * turn
    if 2.0 * zone > LONGEST_RAMPS * problem.duration:
        return problem
    wanted = ceil(ZONE_INTERVALS * problem.duration / zone)
    intervals = min(max(problem.spline.intervals, wanted), MOST_INTERVALS)
    first = ceil(zone / problem.duration * intervals)
    return replace(
        problem, least_intervals=intervals, idle=(first + 1, max(intervals + 1 - first, first + 1))
    )


class _Velocity:
    """Bound on the velocity at more and more places, tightened until it holds in between."""

    def __init__(self, problem: PeakProblem) -> None:
        """Begin without one."""
        self._limit = problem.settings.velocity / problem.distance
        self.bounds: tuple[VelocityBound, ...] = ()

    def is_exceeded_by(self, found: PeakMotion) -> bool:
        """Tell whether a motion exceeds it, and bound more of it."""
        if self._limit == inf:
            return False
        reached = found.peak_velocity
        if reached <= (1.0 - VELOCITY_MARGIN) * self._limit:
            return False
        velocities = found.velocities(found.problem.course.halves)
        if not self.bounds:
            near = (np.abs(velocities) > NEAR * self._limit) & ~found.problem.is_idle
            signs = np.where(near, np.sign(velocities), 0.0)
            self.bounds = (VelocityBound(limit=self._limit, signs=signs, margin=FIRST_MARGIN),)
            return True
        (last,) = self.bounds
        speeds = np.abs(velocities)
        beyond = speeds > (1.0 - last.margin) * self._limit * (1.0 + BEYOND)
        # While the drive rests the velocity stays what it is.
        beyond &= ~found.problem.is_idle
        signs = np.where(last.signs == 0.0, np.where(beyond, np.sign(velocities), 0.0), last.signs)
        margin = 1.0 - (1.0 - TIGHTENED) * (1.0 - last.margin) * self._limit / reached
        if (signs != last.signs).any():
            margin = last.margin
        self.bounds = (VelocityBound(limit=self._limit, signs=signs, margin=margin),)
        return True


class _Residual:
    """Bound on the residual on more and more arms, until it holds on all."""

    def __init__(self, problem: PeakProblem, oscillator: Oscillator) -> None:
        """Begin with none."""
        self._limit = problem.settings.max_residual / problem.distance
        self.bounds: tuple[ResidualBound, ...] = ()
        if self._limit == 0.0:
            return
        self._edges = oscillator.edges(problem.settings.box, problem.duration)
        self._poles = oscillator.poles(np.concatenate(self._edges))
        self._rows = residual_rows(problem.course, self._poles)
        self._free = free_residuals(problem.course, self._poles)
        self._chosen: list[int] = []
        self._phases: list[float] = []

    def is_exceeded_by(self, found: PeakMotion) -> bool:
        """Tell whether a motion exceeds it, and add the arms on which it does most."""
        if self._limit == 0.0:
            return False
        left = self._rows @ found.samples + self._free
        amplitudes = np.abs(left)
        worst, _ = largest(self._edges, amplitudes)
        if worst <= self._limit:
            return False
        for index in self._tops(amplitudes):
            phase = float(np.angle(left[index]))
            self._chosen += [index] * len(BESIDE)
            self._phases += [phase + beside for beside in BESIDE]
        bound = ResidualBound(
            poles=self._poles[self._chosen],
            phases=np.array(self._phases),
            limit=self._limit,
            margin=RESIDUAL_MARGIN,
        )
        self.bounds = (bound,)
        return True

    def _tops(self, amplitudes: FloatArray) -> list[int]:
        """Return where each edge has most, and its ends, if that is beyond the bound."""
        tops, first = [], 0
        for edge in self._edges:
            last = first + len(edge) - 1
            top = first + int(np.argmax(amplitudes[first : last + 1]))
            tops += [first, top]
            first = last + 1
        return sorted({top for top in tops if amplitudes[top] > self._limit})
