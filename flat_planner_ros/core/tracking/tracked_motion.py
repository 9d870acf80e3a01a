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

"""A planned motion as the tracker follows it: states of its chains at any time."""

from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray, InvalidCommand, SampledMotion, UNUSABLE
import numpy as np


class Reference(NamedTuple):
    """
    Where all joints should be at one time, or at many.

    Attributes
    ----------
    positions, velocities, accelerations
        Shape (..., n) [rad], [rad/s], [rad/s^2].

    """

    positions: FloatArray
    velocities: FloatArray
    accelerations: FloatArray


class TrackedMotion:
    """
    Joint motion on a time axis, at rest after its end.

    Parameters
    ----------
    start
        Absolute time of the samples' time 0 [s].
    times
        Ascending, shape (m,) [s].
    positions, velocities
        Of all joints, the passive one too, shape (m, n) [rad], [rad/s].
    accelerations
        The same [rad/s^2]; None to take them from the velocities.

    Raises
    ------
    InvalidCommand
        It cannot be followed.

    """

    def __init__(
        self,
        *,
        start: float,
        times: FloatArray,
        positions: FloatArray,
        velocities: FloatArray,
        accelerations: FloatArray | None = None,
    ) -> None:
        """Check it as a whole."""
        shape = (len(times), positions.shape[-1])
        if len(times) < 2 or positions.shape != shape or velocities.shape != shape:
            raise InvalidCommand(
                f'a motion needs at least two points with positions and velocities of all joints, '
                f'got {positions.shape} and {velocities.shape} at {len(times)} times'
            )
        if not (np.diff(times) > 0.0).all():
            raise InvalidCommand('times must increase')
        given = [table for table in (positions, velocities, accelerations) if table is not None]
        if not (np.isfinite(start) and all((np.abs(t) < UNUSABLE).all() for t in given)):
            raise InvalidCommand(f'a motion must be finite, its numbers below {UNUSABLE:g}')
        if accelerations is None:
            accelerations = np.gradient(velocities, times, axis=0)
        if velocities[-1].any():
            raise InvalidCommand(f'the last velocity must be 0 rad/s, got {velocities[-1]}')
        self._start, self._times = float(start), times
        self._motion = SampledMotion(times, positions, velocities)
        self._accelerations = SampledMotion(times, accelerations, None)
        self.joints = int(positions.shape[1])
        """Number n of joints."""

    @property
    def start(self) -> float:
        """Return the absolute time of the first point [s]."""
        return self._start + float(self._times[0])

    @property
    def end(self) -> float:
        """Return the absolute time of the last point [s]."""
        return self._start + float(self._times[-1])

    def at(self, time: float) -> Reference:
        """Return what is planned at an absolute time [s]."""
        elapsed = time - self._start
        positions, velocities = self._motion.at(elapsed)
        if not self._times[0] <= elapsed <= self._times[-1]:
            return Reference(positions, velocities, np.zeros(self.joints))
        return Reference(positions, velocities, self._accelerations.at(elapsed)[0])

    def through(self, times: FloatArray) -> Reference:
        """Return what `at` does for each of many absolute times (k,) [s]."""
        elapsed = times - self._start
        positions, velocities = self._motion.through(elapsed)
        is_under_way = (self._times[0] <= elapsed) & (elapsed <= self._times[-1])
        accelerations = self._accelerations.through(elapsed)[0] * is_under_way[:, None]
        return Reference(positions, velocities, accelerations)
