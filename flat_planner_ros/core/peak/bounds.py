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
Bounds on a motion besides that on its peak: rate of the drive, velocity, residual on other arms.

Each is a row of the linear programme, and a function of time that any drive is weighed with, so
that dual values prove what no drive within the bounds can do ((B10) of docs/derivation.md).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

from flat_planner_ros.core.arm import ComplexArray, FloatArray
from flat_planner_ros.core.peak.driven_mode import DrivenMode, ModeState
from flat_planner_ros.core.peak.effort_spline import EffortSpline
import numpy as np
from numpy.typing import NDArray

BoolArray = NDArray[np.bool_]


class Caps(NamedTuple):
    """
    Quantities that are bounded from above.

    Attributes
    ----------
    rows
        In the coefficients of the drive, shape (s, size).
    offsets
        What each has without a drive, shape (s,).
    limits
        Shape (s,).

    """

    rows: FloatArray
    offsets: FloatArray
    limits: FloatArray

    @classmethod
    def together(cls, parts: 'list[Caps]', size: int) -> 'Caps':
        """Return several as one."""
        none = cls(np.empty((0, size)), np.empty(0), np.empty(0))
        return cls(*(np.concatenate(columns) for columns in zip(none, *parts, strict=True)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Course:
    """
    What a spline drives, for how long, and from which state.

    Attributes
    ----------
    mode, spline, duration, state
        These.

    """

    mode: DrivenMode
    spline: EffortSpline
    duration: float
    state: ModeState

    @property
    def pieces(self) -> int:
        """Return the number of pieces of the sampled drive."""
        return self.spline.intervals * self.spline.pieces

    @cached_property
    def halves(self) -> FloatArray:
        """Return the middles and ends of the spline's intervals but the last, (m,) [s]."""
        spline = self.spline
        ends = np.array([spline.pieces // 2, spline.pieces])
        samples = spline.pieces * np.arange(spline.intervals - 1.0)[:, None] + ends
        times: FloatArray = self.duration / self.pieces * samples.ravel()
        return times


class Bound(Protocol):
    """A bound besides that on the peak."""

    def caps(self, course: Course) -> Caps:
        """Return it in the coefficients of the drive."""

    def worth(self, course: Course, multipliers: FloatArray) -> float:
        """Return what multiplied quantities have without a drive, less what they may have."""

    def weighed(self, course: Course, multipliers: FloatArray, times: FloatArray) -> FloatArray:
        """Return the multiplied quantities' response at the end to the drive at times, (m,)."""


@dataclass(frozen=True, kw_only=True)
class RateBound:
    """
    Largest rate of the drive.

    Attributes
    ----------
    limit
        For a motion over 1 rad.

    """

    limit: float

    def caps(self, course: Course) -> Caps:
        """Return the differences of neighbours."""
        spline = course.spline
        spacing = course.duration / spline.intervals * spline.spans
        rows = np.diff(np.eye(spline.size), axis=0) / spacing[:, None]
        both = np.concatenate([rows, -rows])
        return Caps(both, np.zeros(len(both)), np.full(len(both), self.limit))

    def worth(self, course: Course, multipliers: FloatArray) -> float:
        """Return nothing: a rate is no integral of the drive, and proves nothing here."""
        return 0.0

    def weighed(self, course: Course, multipliers: FloatArray, times: FloatArray) -> FloatArray:
        """Return nothing, too."""
        return np.zeros(len(times))


@dataclass(frozen=True, kw_only=True, eq=False)
class VelocityBound:
    """
    Largest velocity of link n-1 at ends and middles of the spline's intervals.

    Attributes
    ----------
    limit
        For a motion over 1 rad [rad/s].
    signs
        Direction in which each of `Course.halves` is bounded, 0 for none, shape (m,).
    margin
        Share of it that is kept in reserve [-].

    """

    limit: float
    signs: FloatArray
    margin: float = 0.0

    def caps(self, course: Course) -> Caps:
        """Return the velocities."""
        mode, bounded = course.mode, self.signs != 0.0
        signs = self.signs[bounded]
        rows = signs[:, None] * _velocity_rows(course, bounded)
        free = course.state.swing * np.exp(mode.pole * course.halves[bounded])
        start = signs * (course.state.sigma_rate + mode.reaction * mode.jerk(free))
        return Caps(rows, start, np.full(len(start), (1.0 - self.margin) * self.limit))

    def worth(self, course: Course, multipliers: FloatArray) -> float:
        """Return the free velocities, over the surroundings of each place, less the limit."""
        density, edges = self._spread(course, multipliers)
        mode = course.mode
        swings = course.state.swing * np.diff(np.exp(mode.pole * edges)) / mode.pole
        free = course.state.sigma_rate * np.diff(edges) + mode.reaction * mode.jerk(swings)
        return float(density @ free - multipliers.sum() * self.limit)

    def weighed(self, course: Course, multipliers: FloatArray, times: FloatArray) -> FloatArray:
        """Return what the drive adds to the velocities at later places."""
        mode = course.mode
        density, edges = self._spread(course, multipliers)
        # Sums over what is later than each edge, seen from it.
        lengths = np.diff(edges)
        growth = np.exp(mode.pole * lengths)
        sums = np.zeros(len(edges), dtype=complex)
        for index in range(len(density) - 1, -1, -1):
            own = density[index] * (growth[index] - 1.0) / mode.pole
            sums[index] = own + growth[index] * sums[index + 1]
        totals = np.append(np.cumsum((density * lengths)[::-1])[::-1], 0.0)
        ahead = np.clip(np.searchsorted(edges, times, side='right'), 0, len(edges) - 1)
        until = edges[ahead] - times
        # None before the first edge.
        here = np.append(0.0, density)[ahead]
        growth = np.exp(mode.pole * until)
        swing = here * (growth - 1.0) / mode.pole + growth * sums[ahead]
        rate = totals[ahead] + here * until
        values: FloatArray = mode.gain * rate + mode.reaction * mode.jerk(mode.swing_gain * swing)
        return np.where(times < edges[-1], values, 0.0)

    def _spread(self, course: Course, multipliers: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return multipliers per time around each place, and the edges between them."""
        signs, places = self.signs, course.halves
        signed = np.zeros(len(places))
        signed[signs != 0.0] = signs[signs != 0.0] * multipliers
        middles = 0.5 * (places[:-1] + places[1:])
        edges = np.concatenate(
            [[2.0 * places[0] - middles[0]], middles, [2.0 * places[-1] - middles[-1]]]
        )
        return signed / np.diff(edges), edges


@dataclass(frozen=True, kw_only=True, eq=False)
class ResidualBound:
    """
    Largest part of a residual along given phases, on given arms.

    Attributes
    ----------
    poles
        Those of the arms, shape (s,) [1/s].
    phases
        Which part of each residual, shape (s,) [rad].
    limit
        For a motion over 1 rad [rad].
    margin
        Share of it that is kept in reserve [-].

    """

    poles: ComplexArray
    phases: FloatArray
    limit: float
    margin: float = 0.0

    def caps(self, course: Course) -> Caps:
        """Return the parts of the residuals."""
        turns = np.exp(-1j * self.phases)
        rows = turns[:, None] * residual_rows(course, self.poles)
        offsets = (turns * free_residuals(course, self.poles)).real
        gathered = course.spline.gathered(rows.real)
        limits = np.full(len(self.poles), (1.0 - self.margin) * self.limit)
        return Caps(gathered, offsets, limits)

    def worth(self, course: Course, multipliers: FloatArray) -> float:
        """Return what the passive joint's state at the start leaves, less the limit."""
        turns = np.exp(-1j * self.phases)
        free = (turns * free_residuals(course, self.poles)).real
        return float(multipliers @ free - multipliers.sum() * self.limit)

    def weighed(self, course: Course, multipliers: FloatArray, times: FloatArray) -> FloatArray:
        """Return what the drive adds to the parts at the end."""
        mode, left = course.mode, course.duration - times
        values = np.zeros(len(times))
        used = np.flatnonzero(multipliers)
        for pole, phase, multiplier in zip(
            self.poles[used], self.phases[used], multipliers[used], strict=True
        ):
            factor = -mode.compliance * mode.swing_gain * multiplier / pole.imag
            values += factor * np.exp(pole * left - 1j * phase).real
        return values


def _velocity_rows(course: Course, wanted: BoolArray) -> FloatArray:
    """Return the velocity of link n-1 at some of `Course.halves` in the coefficients."""
    mode, spline = course.mode, course.spline
    middle = spline.pieces // 2
    parts = [(0, middle), (middle, spline.pieces)]
    steps = [course.duration / course.pieces * (last - first) for first, last in parts]
    local = [
        mode.end_rows(step, last - first, insensitive=False)
        for step, (first, last) in zip(steps, parts, strict=True)
    ]
    growths = [complex(np.exp(mode.pole * step)) for step in steps]
    rate, swing = np.zeros(spline.size), np.zeros(spline.size, dtype=complex)
    matrix = []
    chosen = iter(wanted.tolist())
    for index in range(spline.intervals - 1):
        place = slice(index, index + 3)
        for part, growth, samples in zip(parts, growths, local, strict=True):
            rows = spline.interval_rows(samples, index, *part)
            swing *= growth
            rate[place] += rows[0]
            swing[place] += rows[2] + 1j * rows[3]
            if next(chosen):
                matrix.append(rate + mode.reaction * mode.jerk(swing))
    return np.array(matrix).reshape(-1, spline.size)


def residual_rows(course: Course, poles: ComplexArray) -> ComplexArray:
    """
    Return what each sample of the drive adds to the residual of other arms.

    Parameters
    ----------
    course
        Of the nominal arm.
    poles
        Those of the arms, shape (p,) [1/s].

    Returns
    -------
    ComplexArray
        Shape (p, pieces + 1); the magnitude of the sum, with `free_residuals`, is the amplitude
        of the passive joint's oscillation at the end [rad].

    """
    mode = course.mode
    rows = [mode.swing_row(complex(pole), course.duration, course.pieces) for pole in poles]
    scaled: ComplexArray = np.array(rows) * (-mode.compliance / poles.imag)[:, None]
    return scaled


def free_residuals(course: Course, poles: ComplexArray) -> ComplexArray:
    """Return what the passive joint's angle and velocity at the start leave at the end, (p,)."""
    mode, swing = course.mode, course.state.swing
    acceleration, jerk = swing.imag / mode.pole.imag, mode.jerk(swing)
    free = -mode.compliance * (jerk - poles.conj() * acceleration)
    left: ComplexArray = np.exp(poles * course.duration) * free / poles.imag
    return left
