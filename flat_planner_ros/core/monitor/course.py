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

"""How a motion was carried out: its measured course against the planned one, and its end."""

from dataclasses import dataclass, replace
from math import exp, log, pi, sqrt
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.monitor.motion_record import PlannedMotion
from flat_planner_ros.core.monitor.settings import Level, MonitorSettings
import numpy as np

MOVED = 1e-3
"""Smallest planned travel that is compared with the measured one [rad]."""

STILL = 0.1
"""Largest travel of an arm that has not moved, relative to the planned one [-]."""

FEWEST = 8
"""Fewest samples within the motion for a comparison [-]."""

COURSE_GAP = 0.25
"""Longest hole in the samples of the motion, relative to it [-]."""

SPLICED = 1e-2
"""Largest velocity at the start of a motion from rest, relative to the mean one [-]."""

CLEAR = 1e-2
"""What a comparison leaves at most, as a time, relative to the duration [-]."""

STRETCHES = (1.0, 0.5, 0.7, 1.4, 2.0, 2.8, 4.0)
"""Durations relative to the planned one at which the comparison is tried first [-]."""

SHIFTS = np.linspace(-1.0, 2.0, 61)
"""Delays relative to the duration at which it is tried first [-]."""

GRID = 1000
"""Number of intervals between which the plan is interpolated linearly [-]."""

STRETCHED = 0.1
"""Change of the duration that is said, relative to it [-]."""

LATE = 0.05
"""Delay of the whole motion that is said [s]: a servo's lag is less."""

OFF = 2.0
"""Error of a joint that was to go no way worth a comparison, relative to that way [-]."""

DEGREES = 180.0 / pi
"""Degrees in a radian [-]."""

DEGREES_TOLERANCE = 0.05
"""Deviation from it of an arm whose joint states are in degrees, relative to it [-]."""


@dataclass(frozen=True, kw_only=True)
class Course:
    """
    What the actuated joint that moves furthest did, compared with its plan.

    Attributes
    ----------
    joint
        Its name.
    planned
        Range of its planned angles [rad].
    ratio
        Range of the measured angles relative to that [-]; negative for the other way round.
    duration
        Planned duration [s].
    shift, stretch
        Time by which the motion began later than planned [s], and its duration relative to the
        planned one [-]; ``None`` where the measured motion does not resemble the planned one.

    """

    joint: str
    planned: float
    ratio: float
    duration: float
    shift: float | None = None
    stretch: float | None = None

    @property
    def is_still(self) -> bool:
        """Return whether the joint has not moved."""
        return abs(self.ratio) < STILL

    @property
    def is_in_degrees(self) -> bool:
        """Return whether the joint went as many degrees as it should have gone radians."""
        return abs(abs(self.ratio) / DEGREES - 1.0) < DEGREES_TOLERANCE

    @property
    def is_stretched(self) -> bool:
        """Return whether the motion took another time than planned."""
        return self.stretch is not None and abs(self.stretch - 1.0) > STRETCHED

    @property
    def is_late(self) -> bool:
        """Return whether the motion as a whole came at another time than planned."""
        return self.shift is not None and abs(self.shift) > LATE

    @property
    def remark(self) -> str:
        """Return what is to be said of it, empty for a motion as planned."""
        if self.is_still:
            return f'{self.joint} never moved, {self.planned:.3g} rad were planned'
        if self.is_in_degrees:
            return (
                f'{self.joint} travelled {abs(self.ratio):.3g} times what was planned: its joint '
                'states seem to be in degrees'
            )
        remarks = []
        if self.ratio < 0.0:
            remarks.append(f'{self.joint} moved the other way round')
        if self.is_stretched:
            took = (self.stretch or 1.0) * self.duration
            remarks.append(f'the arm took {took:.2g} s for a motion of {self.duration:.2g} s')
        if self.is_late:
            order = 'later' if (self.shift or 0.0) > 0.0 else 'earlier'
            remarks.append(f'the arm moved {abs(self.shift or 0.0):.3g} s {order} than planned')
        return '; '.join(remarks)

    def carried_out(self, motion: PlannedMotion) -> PlannedMotion:
        """Return the motion at the time at which it was carried out, where that is known."""
        if self.shift is None or self.stretch is None:
            return motion
        return replace(
            motion,
            start=motion.start + self.shift,
            times=motion.times * self.stretch,
            velocities=None,
        )


def compare(motion: PlannedMotion, times: FloatArray, rows: FloatArray) -> Course | None:
    """
    Compare the measured course of a motion with the planned one.

    Parameters
    ----------
    motion
        The motion.
    times
        Sampling times [s], shape (m,), ascending, from its start to after its end.
    rows
        Measured positions [rad], shape (m, n).

    Returns
    -------
    Course or None
        The comparison, ``None`` if nothing moves by plan or too little of it was seen.

    """
    actuated = motion.positions[:, : max(len(motion.joint_names) - 1, 1)]
    ranges = np.ptp(actuated, axis=0)
    joint = int(ranges.argmax())
    duration = motion.end - motion.start
    if ranges[joint] < MOVED or not _is_covered(motion, times):
        return None
    measured = rows[:, joint]
    course = Course(
        joint=motion.joint_names[joint],
        planned=float(ranges[joint]),
        ratio=float(np.ptp(measured) / ranges[joint]),
        duration=duration,
    )
    if course.is_still or _is_spliced(motion, joint):
        return course
    grid = (motion.start + np.linspace(0.0, duration, GRID + 1)).tolist()
    table = np.array([motion.reference(time)[0][joint] for time in grid])
    return _timed(course, _Fit((times - motion.start) / duration, measured, table))


class _Fit:
    """Measured angles as the planned ones, delayed, stretched and scaled; time in durations."""

    def __init__(self, times: FloatArray, measured: FloatArray, planned: FloatArray) -> None:
        self._times = times
        self._centred = measured - measured.mean()
        self._grid = np.linspace(0.0, 1.0, planned.size)
        self._planned = planned
        self._slope = np.gradient(planned, self._grid)

    def scale(self, shift: float, stretch: float) -> tuple[float, FloatArray]:
        """Return the factor of best agreement and what it leaves, shape (m,) [rad]."""
        planned = np.interp((self._times - shift) / stretch, self._grid, self._planned)
        planned = planned - planned.mean()
        power = float(planned @ planned)
        factor = float(planned @ self._centred) / power if power > 0.0 else 0.0
        return factor, self._centred - factor * planned

    def cost(self, shift: float, stretch: float) -> float:
        """Return the sum of squares of what is left [rad^2]."""
        left = self.scale(shift, stretch)[1]
        return float(left @ left)

    def spread(self, shift: float, stretch: float) -> float:
        """Return what is left as a time: relative to the slope [durations]."""
        factor, left = self.scale(shift, stretch)
        slope = np.interp(
            (self._times - shift) / stretch, self._grid, self._slope, left=0.0, right=0.0
        )
        power = (factor / stretch) ** 2 * float(slope @ slope)
        return sqrt(float(left @ left) / power) if power > 0.0 else float('inf')

    def refined(self, shift: float, stretch: float, *, is_fixed: bool) -> tuple[float, float]:
        """Return the best delay, and duration unless it is fixed, near the given ones."""
        from scipy.optimize import least_squares  # here: slow to import, needed for reports only

        if is_fixed:
            found = least_squares(lambda x: self.scale(x[0], stretch)[1], [shift])
            return float(found.x[0]), stretch
        found = least_squares(lambda x: self.scale(x[0], exp(x[1]))[1], [shift, log(stretch)])
        return float(found.x[0]), exp(float(found.x[1]))


def _timed(course: Course, fit: _Fit) -> Course:
    """Return the course with delay and duration where the plan is recognised."""
    for stretches in (STRETCHES[:1], STRETCHES):
        is_fixed = len(stretches) == 1
        starts = [(float(shift), stretch) for stretch in stretches for shift in SHIFTS]
        best = min(starts, key=lambda start: fit.cost(*start))
        shift, stretch = fit.refined(*best, is_fixed=is_fixed)
        if fit.spread(shift, stretch) <= CLEAR * stretch:
            factor, _ = fit.scale(shift, stretch)
            ratio = -course.ratio if factor < 0.0 else course.ratio
            return replace(course, shift=shift * course.duration, stretch=stretch, ratio=ratio)
    return course


def _is_covered(motion: PlannedMotion, times: FloatArray) -> bool:
    """Return whether the samples show all of the motion."""
    within = times[(times >= motion.start) & (times <= motion.end)]
    if within.size < FEWEST:
        return False
    gaps = np.diff(np.concatenate(([motion.start], within, [motion.end])))
    return bool(gaps.max() <= COURSE_GAP * (motion.end - motion.start))


def _is_spliced(motion: PlannedMotion, joint: int) -> bool:
    """Return whether the joint is planned to be in motion at the start."""
    if motion.velocities is None or motion.times.size < 2:
        return False
    mean = float(np.ptp(motion.positions[:, joint])) / (motion.end - motion.start)
    return abs(float(motion.velocities[0, joint])) > SPLICED * mean


class Arrival(NamedTuple):
    """Level of what the joints have missed, and a clause on it, empty if they have arrived."""

    level: Level
    remark: str


def judge_arrival(
    motion: PlannedMotion,
    final_error: tuple[float, ...],
    course: Course | None,
    settings: MonitorSettings,
) -> Arrival:
    """
    Judge where the joints have come to and how.

    Parameters
    ----------
    motion
        The motion.
    final_error
        Measured minus final position of the joints to be judged [rad], the first ones of the
        motion; fewer where less is known.
    course
        How it was carried out, ``None`` if too little of it was seen.
    settings
        Bounds of the final error.

    """
    if course is not None and course.is_in_degrees:
        return Arrival(Level.ERROR, course.remark)
    levels = [_level(abs(error), settings) for error in final_error]
    remarks = [
        _missed(motion, joint, final_error[joint], settings)
        for joint, level in enumerate(levels)
        if level is not Level.OK
    ]
    if course is not None and course.remark:
        is_severe = course.is_still and course.planned > settings.final_error
        levels.append(Level.ERROR if is_severe else Level.WARN)
        remarks.insert(0, course.remark)
    return Arrival(Level.worst(levels), '; '.join(remarks))


def _level(error: float, settings: MonitorSettings) -> Level:
    """Return how severe a final error is [rad]."""
    if error <= settings.final_ok:
        return Level.OK
    return Level.WARN if error <= settings.final_error else Level.ERROR


def _missed(motion: PlannedMotion, joint: int, error: float, settings: MonitorSettings) -> str:
    """Return by how much a joint has missed its goal, and what share of its way it went."""
    name = motion.joint_names[joint]
    is_error = abs(error) > settings.final_error
    bound = f'above {settings.final_error if is_error else settings.final_ok:.3g} rad'
    way = float(motion.positions[-1, joint] - motion.positions[0, joint])
    if abs(error) > OFF * abs(way):
        return f'{name} is {abs(error):.3g} rad off its goal, {bound}'
    side = 'short of' if error * way < 0.0 else 'beyond'
    return (
        f'{name} stopped {abs(error):.3g} rad {side} its goal, {bound}: it travelled '
        f'{1.0 + error / way:.3g} of the planned {abs(way):.3g} rad'
    )
