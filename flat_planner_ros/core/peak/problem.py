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
One motion to rest as a linear programme, and its solution with the certificate.

The drive is a spline, sampled and joined linearly as the executor plays it.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil, inf, pi

from flat_planner_ros.core.arm import FloatArray, OutOfReach
from flat_planner_ros.core.peak.bound import SwitchingFunction
from flat_planner_ros.core.peak.driven_mode import DrivenMode, ModeState
from flat_planner_ros.core.peak.effort_spline import EffortSpline
from flat_planner_ros.core.peak.law import LinearEffortLaw
from flat_planner_ros.core.peak.programme import PeakProgramme
from flat_planner_ros.core.peak.settings import PeakSettings
import numpy as np

PIECES = 4
"""Pieces of the sampled drive per interval of its spline, or more."""

INTERVALS_PER_TURN = 8
"""Intervals of the spline per turn of the oscillation, or more, up to `MOST_INTERVALS`."""

MOST_INTERVALS = 4096
"""Most of them, for 500 turns; a motion of 2000 turns still comes within 1e-3 of the least."""

MAX_TURN = 1.0
"""Turn of the oscillation on one piece, up to which its series serve [rad]."""

PLACE = 1
"""Row of `DrivenMode.end_rows` that tells where a motion ends."""

START_ORDERS = 5
"""Derivatives of the planned variable that a start gives, the value included."""

VELOCITY_ROUNDS = 6
"""Programmes after which the velocity is taken as it is."""

VELOCITY_MARGIN = 1e-5
"""Share of the velocity that is kept in reserve between the places where it is looked at [-]."""

STRIDE = 4.0
"""Largest ratio of a duration to the next one tried, beyond what a bad guess is off [-]."""

BACK_STRIDE = 1.2
"""The same towards shorter ones, after a step that went a little too far [-]."""

PLACES = 400
"""Durations in between at which is looked whether the dual values rule them out."""

PLACES_PER_PIECE = 4
"""Places between two samples at which the velocity is looked at."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PeakProblem:
    """
    A motion to rest, as a linear programme.

    Attributes
    ----------
    mode, duration, settings
        What moves, how long and how.
    start
        Derivatives 0 to 4 of the planned variable at the start.
    final
        The planned variable at the end; None for any.
    distance
        What 1 rad of them stands for [rad].
    place
        From where they are counted [rad].

    """

    mode: DrivenMode
    duration: float
    settings: PeakSettings
    start: FloatArray
    final: float | None
    distance: float
    place: float = 0.0

    @cached_property
    def spline(self) -> EffortSpline:
        """Return the form of the drive."""
        turn = self.mode.frequency * self.duration
        needed = ceil(INTERVALS_PER_TURN * turn / (2.0 * pi))
        intervals = min(max(self.settings.intervals, needed), MOST_INTERVALS)
        return EffortSpline(
            intervals=intervals, pieces=max(PIECES, ceil(turn / (MAX_TURN * intervals)))
        )

    @cached_property
    def state(self) -> ModeState:
        """Return the state at the start."""
        return self.mode.state(self.start)

    @cached_property
    def first_drive(self) -> float:
        """Return the drive at the start."""
        return self.mode.drive_of(self.start)

    @cached_property
    def target(self) -> FloatArray:
        """Return what the whole drive has to add to the state at the end, shape (r,)."""
        return self.targets(np.array([self.duration]))[:, 0]

    def targets(self, durations: FloatArray) -> FloatArray:
        """Return the same for other durations, shape (r, m)."""
        swings = self.state.swing * np.exp(self.mode.pole * durations)
        targets = np.zeros((6 if self.settings.insensitive else 4, len(durations)))
        targets[0] = -self.state.sigma_rate
        targets[2:4] = -swings.real, -swings.imag
        if self.final is not None:
            targets[PLACE] = self.final - self.state.sigma - self.state.sigma_rate * durations
        return targets

    @property
    def conditions(self) -> list[int]:
        """Return which rows of the end are conditions."""
        rows = range(len(self.target))
        return [row for row in rows if row != PLACE or self.final is not None]

    @cached_property
    def programme(self) -> PeakProgramme:
        """Return the conditions of the end, and the bounds."""
        pieces = self.spline.intervals * self.spline.pieces
        by_sample = self.mode.end_rows(
            self.duration, pieces, insensitive=self.settings.insensitive
        )
        rows = self.spline.gathered(by_sample[self.conditions])
        caps, offsets, limits = self._caps()
        return PeakProgramme(
            rows=rows[:, 1:-1],
            target=self.target[self.conditions] - rows[:, 0] * self.first_drive,
            caps=caps[:, 1:-1],
            cap_target=offsets + caps[:, 0] * self.first_drive,
            cap_limits=limits,
        )

    def _caps(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the bounded quantities in all coefficients, at rest in them, and bounds."""
        size = self.spline.size
        caps, offsets, limits = [np.empty((0, size))], [np.empty(0)], [np.empty(0)]
        if self.settings.effort_rate > 0.0:
            spacing = self.duration / self.spline.intervals * self.spline.spans
            caps.append(np.diff(np.eye(size), axis=0) / spacing[:, None])
            offsets.append(np.zeros(size - 1))
            limits.append(np.full(size - 1, self.settings.effort_rate / self.distance))
        if self.settings.velocity < inf:
            matrix, start = self._velocities()
            caps.append(matrix)
            offsets.append(start)
            limits.append(np.full(len(start), self.settings.velocity / self.distance))
        return np.concatenate(caps), np.concatenate(offsets), np.concatenate(limits)

    def _velocities(self) -> tuple[FloatArray, FloatArray]:
        """Return the velocity of link n-1 at the spline's knots, in coefficients and before."""
        spline, mode = self.spline, self.mode
        step = self.duration / spline.intervals
        rows = mode.end_rows(step, spline.pieces, insensitive=False)
        growth = np.exp(mode.pole * step)
        rate, swing = np.zeros(spline.size), np.zeros(spline.size, dtype=complex)
        free = self.state.swing
        matrix, start = [], []
        for index in range(spline.intervals - 1):
            part = slice(index, index + 3)
            local = spline.interval_rows(rows, index)
            swing = growth * swing
            rate = rate.copy()
            rate[part] += local[0]
            swing[part] += local[2] + 1j * local[3]
            free = growth * free
            matrix.append(rate + mode.reaction * mode.jerk(swing))
            start.append(self.state.sigma_rate + mode.reaction * mode.jerk(free))
        return np.array(matrix), np.array(start)

    def motion_within_velocity(self) -> 'PeakMotion':
        """Return the motion whose velocity keeps its bound between the knots too."""
        bound = self.settings.velocity
        found = self._bounded(inf).motion()
        if bound == inf:
            return found
        cap = bound
        for _ in range(VELOCITY_ROUNDS):
            reached = self.distance * found.peak_velocity
            if reached <= bound:
                break
            found = self._bounded(cap).motion()
            cap *= (1.0 - VELOCITY_MARGIN) * min(
                1.0, bound / (self.distance * found.peak_velocity)
            )
        return found

    def _bounded(self, velocity: float) -> 'PeakProblem':
        """Return the same with another bound on the velocity at the spline's knots."""
        return replace(self, settings=replace(self.settings, velocity=velocity))

    def motion(self) -> 'PeakMotion':
        """Return the motion with its certificate."""
        solution = self.programme.solve()
        if solution is None:
            raise self._refusal()
        coefficients = np.concatenate([[self.first_drive], solution.coefficients, [0.0]])
        peak = float(np.abs(coefficients).max())
        multipliers = np.zeros(len(self.target))
        multipliers[self.conditions] = solution.multipliers
        switching = SwitchingFunction(mode=self.mode, multipliers=multipliers)
        target = float(multipliers @ self.target)
        # No effort is less than the one that acts at the start.
        first = abs(self.first_drive)
        proven = max(self.programme.proven_peak(solution), first)
        return PeakMotion(
            problem=self,
            samples=self.spline.samples(coefficients),
            peak=peak,
            inner_peak=float(np.abs(solution.coefficients).max()),
            least_peak=max(target / switching.magnitude(self.duration), first),
            optimality_residual=abs(peak / proven - 1.0),
            switching=switching,
            target=target,
        )

    def _refusal(self) -> OutOfReach:
        """Return the refusal of a motion that is too short for its bounds."""
        rate, velocity = self.settings.effort_rate, self.settings.velocity
        return OutOfReach(
            'effort',
            inf,
            rate,
            f'no motion of {self.duration:g} s keeps within peak.effort_rate = {rate:g} '
            f'(0 = none) and a velocity of {velocity:g} rad/s: use a longer duration',
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class PeakMotion:
    """
    A motion of least peak over 1 rad, or from a start in motion.

    Attributes
    ----------
    problem
        What it solves.
    samples
        Even samples of the drive, joined linearly, shape (m,).
    peak
        Largest magnitude of the drive: effort [N m], or acceleration of link n-1 [rad/s^2].
    inner_peak
        The same without the value at the start, which no motion can change.
    least_peak
        No drive whatsoever meets the conditions in this duration with less.
    optimality_residual
        Distance of the peak to what the dual values prove for this spline [-].
    switching
        The switching function that proves it.
    target
        Its conditions, p b: any motion has this integral of drive times switching function.

    """

    problem: PeakProblem
    samples: FloatArray
    peak: float
    inner_peak: float
    least_peak: float
    optimality_residual: float
    switching: SwitchingFunction
    target: float

    @cached_property
    def law(self) -> LinearEffortLaw:
        """Return the planned variable; from -1/2 to 1/2 where the motion starts at rest [rad]."""
        problem = self.problem
        law = LinearEffortLaw.of(problem.mode, problem.state, self.samples, problem.duration)
        return law.transformed(1.0, problem.place)

    @cached_property
    def boundary_residual(self) -> float:
        """Return the largest miss of rest at the end, relative to each derivative's peak [-]."""
        jet = self.law.jet(self.law.knots, START_ORDERS - 1)
        jet[0] -= self.problem.place
        peaks = np.abs(jet).max(axis=1)
        jet[0] -= jet[0, -1] if self.problem.final is None else self.problem.final
        return float((np.abs(jet[:, -1]) / peaks).max())

    @property
    def peak_velocity(self) -> float:
        """Return the largest velocity of link n-1, at and between the samples [rad/s]."""
        mode, law = self.problem.mode, self.law
        pieces = PLACES_PER_PIECE * (len(self.samples) - 1)
        jet = law.jet(np.arange(pieces + 1.0) / pieces * law.duration, 3)
        sigma_rate = jet[1] + mode.relaxation * jet[2] + jet[3] / mode.frequency**2
        return float(np.abs(sigma_rate + mode.reaction * jet[3]).max())

    @property
    def least_duration(self) -> float:
        """Return the duration below which no motion from rest to rest has as small a peak [s]."""
        return self.switching.shortest_duration(self.target, self.peak, self.problem.duration)

    def next_duration(self, peak: float) -> float:
        """
        Return the duration up to which the dual values rule out a peak [s].

        Where this motion's own peak is less, the longest shorter one that they rule out. What the
        spline lacks of the best of all drives hardly changes with the duration, and is allowed
        for.
        """
        is_short = self.inner_peak > peak
        ratio = STRIDE if is_short else 1.0 / BACK_STRIDE
        durations = self.problem.duration * np.geomspace(1.0, ratio, PLACES)
        needed = self.switching.multipliers @ self.problem.targets(durations)
        reached = self.switching.magnitudes(durations)
        excess = self.inner_peak * reached[0] / needed[0] * needed - peak * reached
        beyond = np.flatnonzero((excess > 0.0) != is_short)
        if not beyond.size:
            return float(durations[-1])
        last = max(int(beyond[0]), 1)
        share = excess[last - 1] / (excess[last - 1] - excess[last])
        return float(durations[last - 1] + share * (durations[last] - durations[last - 1]))

    @property
    def gap(self) -> float:
        """Return the most by which another drive's peak might be smaller, relative to it [-]."""
        return self.peak / self.least_peak - 1.0
