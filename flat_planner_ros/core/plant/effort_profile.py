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

"""Stamped effort commands, played by time as joint_trajectory_controller plays them."""

from bisect import bisect_right
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

from flat_planner_ros.core.arm import (
    check_number,
    checked_array,
    FloatArray,
    InvalidCommand,
    SampledMotion,
)
import numpy as np
import numpy.typing as npt

MAX_EFFORT = 1e6
"""Largest effort of a command [N m]: no motor of a robot gives more, a broken sender may."""

MAX_POSITION = 1e6
"""Largest angle of a command [rad]; as for goals."""

MAX_VELOCITY = 1e4
"""Largest velocity of a command [rad/s]: six hundred times the fastest motion of pi in 1 s."""


SAME = 1e-5
"""
Difference of efforts or positions that is none, relative to the largest of the command [-]: stamps
resolve 0.2 microseconds, in which they change by less.
"""


class JointReference(NamedTuple):
    """
    What a command asks of the actuated joints at one time.

    Attributes
    ----------
    effort, position, velocity, acceleration
        Shape (n-1,) [N m], [rad], [rad/s], [rad/s^2]; all but the first NaN where none are
        commanded.

    """

    effort: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray


class _Course(NamedTuple):
    """
    Efforts that are linear in time between knots.

    Attributes
    ----------
    knots, times
        Times of the knots from the command's start, as an array and as a list, (m,) [s].
    before
        Effort before the first one, shape (n-1,) [N m].
    efforts, slopes
        At the knots, and from each to the next, shape (m, n-1) [N m], [N m/s].

    """

    knots: FloatArray
    times: list[float]
    before: FloatArray
    efforts: FloatArray
    slopes: FloatArray

    def at(self, elapsed: FloatArray) -> FloatArray:
        """Return the efforts at times (m,) from the command's start [s], shape (m, n-1) [N m]."""
        knots = self.knots
        i = np.searchsorted(knots, elapsed, side='right') - 1
        efforts: FloatArray = self.efforts[i] + self.slopes[i] * (elapsed - knots[i])[:, None]
        efforts[i < 0] = self.before
        return efforts


@dataclass(frozen=True, kw_only=True, eq=False)
class EffortProfile:
    """
    A stamped effort command, played by time like joint_trajectory_controller does.

    It is checked as a whole before any of it is played. Efforts are linear between the points. The
    last point is held after the end. Before the first point the effort goes linearly from the
    anchor to it; nothing is applied before the start when there is no anchor.

    Attributes
    ----------
    start
        Absolute time of the command's stamp [s].
    times
        Times of the points from the start, increasing, shape (m,) [s].
    efforts
        Efforts of the actuated joints, shape (m, n-1) [N m].
    positions, velocities
        Where the arm should be, shape (m, n-1) [rad], [rad/s]; both or only positions or none;
        velocities are zero at the end.
    anchor_time, anchor_effort
        Time at which the command was taken over [s] and the effort then, shape (n-1,) [N m].

    """

    start: float
    times: FloatArray
    efforts: FloatArray
    positions: FloatArray | None = None
    velocities: FloatArray | None = None
    anchor_time: float | None = None
    anchor_effort: FloatArray | None = None

    def __post_init__(self) -> None:
        """Refuse what cannot be played and lock the arrays."""
        check_number('start', self.start, 's', error=InvalidCommand)
        times = checked_array('times', self.times, 's', error=InvalidCommand)
        if times.ndim != 1 or times.size < 1:
            raise InvalidCommand(f'times must be (m,) with m >= 1, got shape {times.shape}')
        if times[0] < 0.0:
            raise InvalidCommand(f'times must not be negative, got {times[0]:g} s')
        if (np.diff(times) <= 0.0).any():
            i = int(np.argmax(np.diff(times) <= 0.0))
            raise InvalidCommand(
                f'times must increase, got {times[i]:.9g} s then {times[i + 1]:.9g} s'
            )
        efforts = checked_array('efforts', self.efforts, 'N m', error=InvalidCommand)
        if efforts.ndim != 2 or efforts.shape[0] != times.size or efforts.shape[1] < 1:
            raise InvalidCommand(
                f'efforts must be ({times.size}, n-1) with n >= 2, got shape {efforts.shape}'
            )
        check_bound('effort', efforts, MAX_EFFORT, 'N m')
        if self.velocities is not None and self.positions is None:
            raise InvalidCommand('velocities need positions')
        if (self.anchor_time is None) != (self.anchor_effort is None):
            raise InvalidCommand('anchor_time and anchor_effort go together')
        object.__setattr__(self, 'times', times)
        object.__setattr__(self, 'efforts', efforts)
        self._lock_optional('positions', self.positions, efforts.shape, 'rad')
        self._lock_optional('velocities', self.velocities, efforts.shape, 'rad/s')
        if self.positions is not None:
            check_bound('position', self.positions, MAX_POSITION, 'rad')
        if self.velocities is not None:
            check_bound('velocity', self.velocities, MAX_VELOCITY, 'rad/s')
            if self.velocities[-1].any():
                raise InvalidCommand(
                    f'the last velocity must be 0 rad/s, got {self.velocities[-1]}'
                )
        if self.anchor_time is not None:
            check_number('anchor_time', self.anchor_time, 's', error=InvalidCommand)
        self._lock_optional('anchor_effort', self.anchor_effort, efforts.shape[1:], 'N m')

    @property
    def end(self) -> float:
        """Return the absolute time of the last point [s]."""
        return self.start + float(self.times[-1])

    @property
    def motors(self) -> int:
        """Return the number n-1 of actuated joints."""
        return int(self.efforts.shape[1])

    def taken_over(self, at: float, effort: npt.ArrayLike) -> 'EffortProfile':
        """Return a copy that starts from an effort (n-1,) [N m] applied at a time [s]."""
        return replace(self, anchor_time=at, anchor_effort=np.asarray(effort, dtype=float))

    def effort(self, t: float) -> FloatArray:
        """Return the effort at an absolute time [s], shape (n-1,) [N m]."""
        course, elapsed = self._course, t - self.start
        i = bisect_right(course.times, elapsed) - 1
        if i < 0:
            return course.before
        effort: FloatArray = course.efforts[i] + course.slopes[i] * (elapsed - course.times[i])
        return effort

    def efforts_at(self, times: FloatArray) -> FloatArray:
        """Return the efforts at absolute times (m,) [s], shape (m, n-1) [N m]."""
        return self._course.at(times - self.start)

    def reference(self, t: float) -> JointReference:
        """
        Return effort, position and its derivatives at an absolute time [s].

        The first position is held before the first point, the last one after the end. Positions
        without velocities are joined linearly.
        """
        effort = self.effort(t)
        if self._motion is None:
            missing = np.full(self.motors, np.nan)
            return JointReference(effort, missing, missing, missing)
        elapsed = t - self.start
        position, velocity = self._motion.at(elapsed)
        acceleration = self._motion.acceleration_at(elapsed)
        return JointReference(effort, position, velocity, acceleration)

    def differs(self, other: 'EffortProfile | None', until: float) -> bool:
        """
        Return whether until an absolute time [s] another command, or none, asks for less or more.

        A command that continues another one repeats what that one asks for until it takes over.
        """
        passed = self.times < until - self.start
        times = (self.start + self.times[passed]).tolist()
        for table, index in ((self.efforts, 0), (self.positions, 1)):
            if table is None or not times:
                continue
            if other is None:
                theirs = np.zeros(table[0].shape) if index == 0 else table[0]
            else:
                theirs = np.array([other.reference(time)[index] for time in times])
            if np.abs(table[passed] - theirs).max() > SAME * np.abs(table).max():
                return True
        return False

    def _lock_optional(
        self, name: str, value: npt.ArrayLike | None, shape: tuple[int, ...], unit: str
    ) -> None:
        """Lock a field that may be missing."""
        if value is not None:
            array = checked_array(name, value, unit, shape=shape, error=InvalidCommand)
            object.__setattr__(self, name, array)

    @cached_property
    def _before(self) -> FloatArray:
        """Effort before the first knot."""
        return np.zeros(self.motors) if self.anchor_effort is None else self.anchor_effort

    @cached_property
    def _motion(self) -> SampledMotion | None:
        """Where the arm should be, if that is commanded."""
        if self.positions is None:
            return None
        return SampledMotion(self.times, self.positions, self.velocities)

    @cached_property
    def _course(self) -> _Course:
        """Knots of the effort, the anchor among them if it precedes the first point."""
        times, efforts = self.times, self.efforts
        anchor = 0.0 if self.anchor_time is None else self.anchor_time - self.start
        if anchor < times[0]:
            times, efforts = np.append(anchor, times), np.vstack((self._before, efforts))
        slopes = np.diff(efforts, axis=0) / np.diff(times)[:, None]
        slopes = np.vstack((slopes, np.zeros(self.motors)))
        return _Course(times, times.tolist(), self._before, efforts, slopes)


def check_bound(name: str, values: FloatArray, bound: float, unit: str) -> None:
    """Refuse numbers that no robot has to do with."""
    largest = float(np.abs(values).max())
    if largest > bound:
        raise InvalidCommand(f'{name} of {largest:.3g} {unit} is beyond {bound:g} {unit}')
