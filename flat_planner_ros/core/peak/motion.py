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
Motions of least peak effort, and the shortest within a peak.

The drive is a spline, sampled and joined linearly as the executor plays it; its coefficients solve
a linear programme, whose dual values prove how little any other effort could do better.
"""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import ceil, factorial, inf, pi

from flat_planner_ros.core.arm import Drive, FloatArray, OutOfReach, PlanarArm
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

START_ORDERS = 5
"""Derivatives of the planned variable that a start gives, the value included."""

MOTIONS_KEPT = 64
"""Solved motions that are remembered."""

MARGIN = 1e-5
"""Share by which the shortest duration exceeds the bound that was met, for rounding [-]."""

STRIDE = 4.0
"""Largest ratio of a duration tried to the one before, beyond what a bad guess is off [-]."""

MAX_STEPS = 20
"""Programmes on the way to the shortest duration; three or four are usual."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PeakMotion:
    """
    A motion of least peak over 1 rad, or from a start in motion.

    Attributes
    ----------
    law
        The planned variable; from -1/2 to 1/2 where the motion starts at rest.
    peak
        Largest magnitude of the drive: effort [N m], or acceleration of link n-1 [rad/s^2].
    least_peak
        No drive whatsoever meets the conditions in this duration with less.
    boundary_residual
        Largest miss of a condition at the end, relative to the derivative's peak [-].
    optimality_residual
        Distance of the peak to what the dual values prove for this spline [-].
    switching
        The switching function that proves it.
    target
        Its conditions, p b: any motion has this integral of drive times switching function.

    """

    law: LinearEffortLaw
    peak: float
    least_peak: float
    boundary_residual: float
    optimality_residual: float
    switching: SwitchingFunction
    target: float

    @property
    def gap(self) -> float:
        """Return the most by which another drive's peak might be smaller, relative to it [-]."""
        return self.peak / self.least_peak - 1.0


def peak_motion(
    arm: PlanarArm,
    duration: float,
    settings: PeakSettings,
    distance: float,
    drive: Drive = Drive.EFFORT,
) -> PeakMotion:
    """
    Return the motion of least peak from rest to rest over 1 rad, for use over a distance.

    Parameters
    ----------
    arm
        Nominal model; must be flat.
    duration
        Length of the motion [s].
    settings
        How steep, how fast and how robust it may be.
    distance
        Of the planned variable; only bounds on rate and velocity depend on it [rad].
    drive
        What moves joint n-1.

    Raises
    ------
    OutOfReach
        No motion meets the bounds on rate and velocity.
    InvalidRequest
        The passive joint does not oscillate.
    NotFlat
        The arm is not flat.

    """
    reach = 1.0 if settings.is_homogeneous else abs(distance)
    return _from_rest(arm, duration, settings, reach, drive)


@lru_cache(maxsize=MOTIONS_KEPT)
def _from_rest(
    arm: PlanarArm, duration: float, settings: PeakSettings, distance: float, drive: Drive
) -> PeakMotion:
    """Return the motion over 1 rad; arms count as equal if identical."""
    start = np.zeros(START_ORDERS)
    start[0] = -0.5
    return _Problem(
        mode=DrivenMode.of(arm, drive),
        duration=duration,
        settings=settings,
        start=start,
        final=0.5,
        distance=distance,
    ).motion()


def peak_motion_from(
    arm: PlanarArm,
    duration: float,
    settings: PeakSettings,
    start: FloatArray,
    final: float,
    drive: Drive = Drive.EFFORT,
) -> PeakMotion:
    """
    Return the motion of least peak from a start in motion to rest.

    Parameters
    ----------
    arm, duration, settings, drive
        As for `peak_motion`; such a motion is not made insensitive.
    start
        Derivatives 0 to 4 of the planned variable, or more, shape (5,) [rad/s^k].
    final
        The planned variable at rest at the end [rad].

    Raises
    ------
    OutOfReach, InvalidRequest, NotFlat
        As for `peak_motion`.

    """
    way = np.array(start[:START_ORDERS])
    # Counted from the end, so that a distant place costs no digits of a short way.
    way[0] -= final
    plain = replace(settings, insensitive=False)
    found = _Problem(
        mode=DrivenMode.of(arm, drive),
        duration=duration,
        settings=plain,
        start=way,
        final=0.0,
        distance=1.0,
    ).motion()
    return replace(found, law=found.law.transformed(1.0, final))


def shortest_peak_duration(
    arm: PlanarArm,
    settings: PeakSettings,
    distance: float,
    peak: float,
    drive: Drive = Drive.EFFORT,
) -> float:
    """
    Return the shortest duration from rest to rest within a peak; bounds aside, a little less.

    Parameters
    ----------
    arm, settings, distance, drive
        As for `peak_motion`, the distance above zero; bounds on rate and velocity are left out.
    peak
        Largest magnitude of the drive, above zero.

    References
    ----------
    (B8) of docs/derivation.md: Newton's method, the switching function being the slope.

    """
    plain = replace(settings, effort_rate=0.0, velocity=inf)
    wanted = (1.0 - MARGIN) * peak / abs(distance)
    duration = _first_guess(DrivenMode.of(arm, drive), wanted, settings.insensitive)
    for _ in range(MAX_STEPS):
        found = _from_rest(arm, duration, plain, 1.0, drive)
        if abs(found.peak / wanted - 1.0) < MARGIN:
            break
        # What the spline lacks of the best of all drives hardly changes with the duration.
        sought = found.target * found.peak / found.least_peak
        duration = found.switching.shortest_duration(sought, wanted, STRIDE * duration)
    return duration


def _first_guess(mode: DrivenMode, peak: float, is_insensitive: bool) -> float:
    """Return the longest of the durations with a stiff spring, with a soft one, and a second."""
    orders = (2, 4, 6) if is_insensitive else (2, 4)
    # An r-fold integrator over 1 takes 2^(2r-2) (r-1)! / T^r; each half turn adds two integrals.
    guesses = [
        2.0 ** (2 * r - 2) * factorial(r - 1) / (mode.gain * mode.frequency ** (r - 2) * peak)
        for r in orders
    ]
    return max(float(guess ** (1.0 / r)) for guess, r in zip(guesses, orders, strict=True))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Problem:
    """
    A motion to rest, as a linear programme.

    Attributes
    ----------
    mode, duration, settings
        What moves, how long and how.
    start
        Derivatives 0 to 4 of the planned variable at the start.
    final
        The planned variable at the end.
    distance
        What 1 rad of them stands for [rad].

    """

    mode: DrivenMode
    duration: float
    settings: PeakSettings
    start: FloatArray
    final: float
    distance: float

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
        """Return what the whole drive has to add to the state at the end."""
        swing = self.state.swing * np.exp(self.mode.pole * self.duration)
        target = np.zeros(6 if self.settings.insensitive else 4)
        target[:4] = (
            -self.state.sigma_rate,
            self.final - self.state.sigma - self.state.sigma_rate * self.duration,
            -swing.real,
            -swing.imag,
        )
        return target

    @cached_property
    def programme(self) -> PeakProgramme:
        """Return the conditions of the end, and the bounds."""
        pieces = self.spline.intervals * self.spline.pieces
        by_sample = self.mode.end_rows(
            self.duration, pieces, insensitive=self.settings.insensitive
        )
        rows = self.spline.gathered(by_sample)
        caps, offsets, limits = self._caps()
        return PeakProgramme(
            rows=rows[:, 1:-1],
            target=self.target - rows[:, 0] * self.first_drive,
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

    def motion(self) -> PeakMotion:
        """Return the motion with its certificate."""
        solution = self.programme.solve()
        if solution is None:
            raise self._refusal()
        coefficients = np.concatenate([[self.first_drive], solution.coefficients, [0.0]])
        samples = self.spline.samples(coefficients)
        law = LinearEffortLaw.of(self.mode, self.state, samples, self.duration)
        peak = float(np.abs(coefficients).max())
        switching = SwitchingFunction(mode=self.mode, multipliers=solution.multipliers)
        target = float(solution.multipliers @ self.target)
        # No effort is less than the one that acts at the start.
        first = abs(self.first_drive)
        proven = max(self.programme.proven_peak(solution), first)
        return PeakMotion(
            law=law,
            peak=peak,
            least_peak=max(target / switching.magnitude(self.duration), first),
            boundary_residual=self._miss(law),
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

    def _miss(self, law: LinearEffortLaw) -> float:
        """Return the largest miss of rest at the end, relative to each derivative's peak."""
        jet = law.jet(law.knots, START_ORDERS - 1)
        peaks = np.abs(jet).max(axis=1)
        jet[0] -= self.final
        return float((np.abs(jet[:, -1]) / peaks).max())
