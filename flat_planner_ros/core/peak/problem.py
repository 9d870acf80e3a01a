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
from flat_planner_ros.core.peak.bounds import Bound, Caps, Course
from flat_planner_ros.core.peak.driven_mode import DrivenMode, ModeState
from flat_planner_ros.core.peak.effort_spline import EffortSpline
from flat_planner_ros.core.peak.law import LinearEffortLaw
from flat_planner_ros.core.peak.programme import PeakProgramme
from flat_planner_ros.core.peak.settings import PeakSettings
import numpy as np
from numpy.typing import NDArray

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

STRIDE = 4.0
"""Largest ratio of a duration to the next one tried, beyond what a bad guess is off [-]."""

BACK_STRIDE = 1.2
"""The same towards shorter ones, after a step that went a little too far [-]."""

MOST_PIECES = 1000
"""Most pieces of a drive with bounds for which durations are tried."""

BOUND_STEPS = 8
"""Durations that are tried for one that dual values rule out within bounds."""

BOUND_STRIDE = 0.01
"""Step between the first ones, relative to them [-]."""

NODES_PER_PIECE = 3
"""Gauss-Legendre nodes on each piece, over which a switching function with bounds is summed."""

PLACES = 400
"""Durations in between at which is looked whether the dual values rule them out."""

PLACES_PER_PIECE = 4
"""Places between two samples at which the velocity is looked at."""

_NODES, _SHARES = np.polynomial.legendre.leggauss(NODES_PER_PIECE)


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
    bounds
        On more than the peak.
    least_intervals
        Of the spline, whatever the settings ask for.
    idle
        First interval and last one, exclusive, in the midst of which the drive rests.

    """

    mode: DrivenMode
    duration: float
    settings: PeakSettings
    start: FloatArray
    final: float | None
    distance: float
    place: float = 0.0
    bounds: tuple[Bound, ...] = ()
    least_intervals: int = 0
    idle: tuple[int, int] = (0, 0)

    @cached_property
    def spline(self) -> EffortSpline:
        """Return the form of the drive."""
        turn = self.mode.frequency * self.duration
        needed = ceil(INTERVALS_PER_TURN * turn / (2.0 * pi))
        wanted = max(self.settings.intervals, self.least_intervals, needed)
        intervals = min(wanted, MOST_INTERVALS)
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
        growth = np.exp(self.mode.pole * durations)
        swings = self.state.swing * growth
        targets = np.zeros((6 if self.settings.insensitive else 4, len(durations)))
        targets[0] = -self.state.sigma_rate
        targets[2:4] = -swings.real, -swings.imag
        if self.final is not None:
            targets[PLACE] = self.final - self.state.sigma - self.state.sigma_rate * durations
        if self.settings.insensitive:
            # The deflection at the start stays what it is, whatever the stiffness.
            slopes = swings * durations + self.start[2] * growth
            targets[4:] = -slopes.real, -slopes.imag
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
        target = self.target[self.conditions]
        if self.idle[1] > 0:
            quiet_rows, quiet_target = self._quiet()
            rows = np.concatenate([rows, quiet_rows])
            target = np.append(target, quiet_target)
        caps, offsets, limits = Caps.together(self.caps, self.spline.size)
        return PeakProgramme(
            rows=rows[:, self._free],
            target=target - rows[:, 0] * self.first_drive,
            caps=caps[:, self._free],
            cap_target=offsets + caps[:, 0] * self.first_drive,
            cap_limits=limits,
        )

    def _quiet(self) -> tuple[FloatArray, FloatArray]:
        """Return the conditions that no swing is left where the drive begins to rest."""
        pieces = self.idle[0] * self.spline.pieces
        until = self.duration * self.idle[0] / self.spline.intervals
        samples = np.zeros((2, self.course.pieces + 1))
        samples[:, : pieces + 1] = self.mode.end_rows(until, pieces, insensitive=False)[2:4]
        free = self.state.swing * np.exp(self.mode.pole * until)
        return self.spline.gathered(samples), np.array([-free.real, -free.imag])

    @cached_property
    def _free(self) -> NDArray[np.intp]:
        """Return which coefficients of the drive are free."""
        first, last = self.idle
        every = np.arange(1, self.spline.size - 1)
        return every[(every < first) | (every >= last)]

    @property
    def is_idle(self) -> NDArray[np.bool_]:
        """Return at which of `Course.halves` the drive rests."""
        first, last = self.idle
        interval = self.duration / self.spline.intervals
        halves = self.course.halves
        # One interval more at either end, where the velocity is that of the rest.
        return (halves > first * interval) & (halves < (last - 1) * interval)

    @cached_property
    def course(self) -> Course:
        """Return what is driven by which spline."""
        return Course(mode=self.mode, spline=self.spline, duration=self.duration, state=self.state)

    @cached_property
    def caps(self) -> list[Caps]:
        """Return each bound in all coefficients."""
        return [bound.caps(self.course) for bound in self.bounds]

    def lasting(self, duration: float) -> 'PeakProblem':
        """Return the same with another duration."""
        return replace(self, duration=duration)

    def motion(self) -> 'PeakMotion':
        """Return the motion with its certificate."""
        solution = self.programme.solve()
        if solution is None:
            raise self.refusal()
        coefficients = np.zeros(self.spline.size)
        coefficients[0] = self.first_drive
        coefficients[self._free] = solution.coefficients
        peak = float(np.abs(coefficients).max())
        multipliers = np.zeros(len(self.target))
        multipliers[self.conditions] = solution.multipliers[: len(self.conditions)]
        switching = SwitchingFunction(mode=self.mode, multipliers=multipliers)
        edges = np.cumsum([len(part.limits) for part in self.caps])
        of_bounds = tuple(np.split(solution.cap_multipliers, edges)[: len(self.caps)])
        # No effort is less than the one that acts at the start.
        first = abs(self.first_drive)
        proven = max(solution.proven_peak, first)
        return PeakMotion(
            problem=self,
            samples=self.spline.samples(coefficients),
            peak=peak,
            inner_peak=float(np.abs(solution.coefficients).max()),
            least_peak=max(self.proven_peak(switching, of_bounds), first),
            optimality_residual=abs(peak / proven - 1.0),
            switching=switching,
            of_bounds=of_bounds,
            target=float(multipliers @ self.target),
        )

    def proven_peak(
        self, switching: SwitchingFunction, of_bounds: tuple[FloatArray, ...]
    ) -> float:
        """
        Return the peak below which no drive whatsoever makes this motion.

        Parameters
        ----------
        switching
            Of any multipliers of the conditions.
        of_bounds
            Any multipliers of the bounds, one array for each; without them the integral is in
            closed form, with them a sum, good to 1e-5 of itself.

        References
        ----------
        (B7) and (B10) of docs/derivation.md.

        """
        gain = float(switching.multipliers @ self.target)
        if not any(multipliers.any() for multipliers in of_bounds):
            return gain / switching.magnitude(self.duration)
        pieces = self.course.pieces
        step = self.duration / pieces
        starts = step * np.arange(pieces)
        times = (starts[:, None] + 0.5 * step * (_NODES + 1.0)).ravel()
        values = switching.at(self.duration - times)
        for bound, multipliers in zip(self.bounds, of_bounds, strict=True):
            gain += bound.worth(self.course, multipliers)
            values -= bound.weighed(self.course, multipliers, times)
        magnitude = float(np.abs(values).reshape(pieces, -1).sum(axis=0) @ _SHARES)
        return gain / (0.5 * step * magnitude)

    def refusal(self) -> OutOfReach:
        """Return the refusal of a motion that is too short for its bounds."""
        wanted = self.settings
        return OutOfReach(
            'effort',
            inf,
            wanted.effort_rate,
            f'no motion of {self.duration:g} s keeps within peak.effort_rate = '
            f'{wanted.effort_rate:g}, peak.max_residual = {wanted.max_residual:g} (0 = none) and '
            f'a velocity of {wanted.velocity:g} rad/s: use a longer duration',
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
    of_bounds
        Dual values of the bounds, one array for each.
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
    of_bounds: tuple[FloatArray, ...]
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

    def velocities(self, times: FloatArray) -> FloatArray:
        """Return the velocity of link n-1 at times, shape (m,) [rad/s]."""
        mode = self.problem.mode
        jet = self.law.jet(times, 3)
        sigma_rate = jet[1] + mode.relaxation * jet[2] + jet[3] / mode.frequency**2
        velocities: FloatArray = sigma_rate + mode.reaction * jet[3]
        return velocities

    @property
    def peak_velocity(self) -> float:
        """Return the largest velocity of link n-1, at and between the samples [rad/s]."""
        pieces = PLACES_PER_PIECE * (len(self.samples) - 1)
        times = np.arange(pieces + 1.0) / pieces * self.law.duration
        return float(np.abs(self.velocities(times)).max())

    @property
    def least_duration(self) -> float:
        """Return the duration below which no motion from rest to rest has as small a peak [s]."""
        problem = self.problem
        least = self.switching.shortest_duration(self.target, self.peak, problem.duration)
        if not self.of_bounds:
            return least
        # No link goes further than at full speed all the time.
        least = max(least, problem.distance / problem.settings.velocity)
        if problem.course.pieces > MOST_PIECES or problem.idle[1] > 0:
            return least
        return max(least, self._least_duration_within())

    def _least_duration_within(self) -> float:
        """Return the same within the bounds: the longest of the durations tried and ruled out."""
        # Bounds belong to the intervals of this spline.
        problem = replace(self.problem, least_intervals=self.problem.spline.intervals)
        high, low = problem.duration, 0.0
        for _ in range(BOUND_STEPS):
            # Not far below: near what no spline can do, its dual values prove little.
            duration = 0.5 * (low + high) if low else (1.0 - BOUND_STRIDE) * high
            try:
                is_ruled_out = problem.lasting(duration).motion().least_peak >= self.peak
            except OutOfReach:
                break
            low, high = (duration, high) if is_ruled_out else (low, duration)
        return low

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
