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
"""Joint states in parts: readings of several drivers, merged into samples of the arm."""

from bisect import bisect_right
from collections.abc import Sequence
from math import inf, isfinite, nan
from typing import NamedTuple

from flat_planner_ros.core.arm.arrays import FloatArray
from flat_planner_ros.core.arm.samples import cubic_coefficients, JointSample, MERGING_TOLERANCE
import numpy as np

KEPT = 1.0
"""Time for which readings wait for those of the other joints [s]; stamps further back restart."""


class _Reading(NamedTuple):
    """What a driver says of one joint; NaN where it says nothing."""

    time: float
    position: float
    velocity: float
    effort: float


class JointMerger:
    """
    Forms samples of all joints from messages that name some of them each.

    A sample is of a time at which the last joint, whose oscillation is judged, was read: that one
    is as read, the others are interpolated between their readings before and after.

    Parameters
    ----------
    joints
        Names in the order of the samples, length n.
    tolerance
        Distance in time of the sample from the nearest reading of every joint, at most [s]; may
        be replaced at any time.

    """

    def __init__(self, joints: Sequence[str], tolerance: float = MERGING_TOLERANCE) -> None:
        self.tolerance = tolerance
        self._joints = tuple(joints)
        self._forget()

    def add(self, indices: Sequence[int], part: JointSample) -> list[JointSample]:
        """
        Take readings of some joints.

        Parameters
        ----------
        indices
            Which joints they are of, length m.
        part
            Their state, arrays of length m. A joint's reading that comes late is left out.

        Returns
        -------
        list of JointSample
            The samples that are complete with it, in the order of time.

        """
        latest = max((readings[-1].time for readings in self._heard()), default=-inf)
        if part.time < latest - KEPT:
            self._forget()
        unknown = np.full(len(indices), nan)
        velocities = unknown if part.velocities is None else part.velocities
        efforts = unknown if part.efforts is None else part.efforts
        rows = np.stack((part.positions, velocities, efforts), axis=1).tolist()
        for index, row in zip(indices, rows, strict=True):
            readings = self._readings[index]
            if not readings or part.time > readings[-1].time:
                readings.append(_Reading(part.time, *row))
        samples = self._take_samples()
        for readings in self._heard():
            old = bisect_right(readings, readings[-1].time - KEPT, key=_time_of)
            del readings[: max(old - 1, 0)]
        return samples

    @property
    def lack(self) -> str:
        """Return why there is no present sample, a clause; empty where nothing is to be said."""
        heard = [name for name, own in zip(self._joints, self._readings, strict=True) if own]
        if not heard:
            return ''
        unheard = [name for name in self._joints if name not in heard]
        if unheard:
            have = 'has' if len(unheard) == 1 else 'have'
            return (
                f'{", ".join(unheard)} {have} not been heard on joint_states; '
                f'heard: {", ".join(heard)}'
            )
        times = [readings[-1].time for readings in self._readings]
        apart = max(times) - min(times)
        if apart <= self.tolerance:
            return ''
        last, first = (self._joints[times.index(time)] for time in (min(times), max(times)))
        return (
            f'{last} was last heard {apart:.3f} s before {first} on joint_states '
            f'(joint_states.tolerance {self.tolerance:g} s)'
        )

    def _forget(self) -> None:
        """Wait for all joints, as at the start."""
        self._readings: list[list[_Reading]] = [[] for _ in self._joints]
        self._told = -inf

    def _heard(self) -> list[list[_Reading]]:
        """Return the readings of the joints that have some."""
        return [readings for readings in self._readings if readings]

    def _take_samples(self) -> list[JointSample]:
        """Return the samples that have not been returned yet."""
        if not all(self._readings):
            return []
        covered = min(readings[-1].time for readings in self._readings)
        judged = self._readings[-1]
        new = slice(*(bisect_right(judged, time, key=_time_of) for time in (self._told, covered)))
        self._told = max(self._told, covered)
        samples = (self._sample(reading.time) for reading in judged[new])
        return [sample for sample in samples if sample is not None]

    def _sample(self, time: float) -> JointSample | None:
        """Return the state at a time [s], None if a joint was not heard close to it."""
        row = [self._at(readings, time) for readings in self._readings]
        if None in row:
            return None
        _, positions, velocities, efforts = np.array(row, dtype=float).T
        return JointSample(
            time=time,
            positions=positions,
            velocities=_or_none(velocities),
            efforts=_or_none(efforts),
        )

    def _at(self, readings: Sequence[_Reading], time: float) -> _Reading | None:
        """Return a joint's state at a time that its readings reach [s], None far from them."""
        after = bisect_right(readings, time, key=_time_of)
        if after == 0:
            return None
        before = readings[after - 1]
        if before.time == time:
            return before
        following = readings[after]
        if min(time - before.time, following.time - time) > self.tolerance:
            return None
        return _between(before, following, time)


def _time_of(reading: _Reading) -> float:
    """Return the time of a reading [s]."""
    return reading.time


def _between(first: _Reading, last: _Reading, time: float) -> _Reading:
    """Return a joint's state between two readings: cubic where both know the velocity."""
    step, elapsed = last.time - first.time, time - first.time
    share = elapsed / step
    effort = first.effort + share * (last.effort - first.effort)
    chord = (last.position - first.position) / step
    velocity = first.velocity + share * (last.velocity - first.velocity)
    if not isfinite(velocity):
        return _Reading(time, first.position + chord * elapsed, velocity, effort)
    cubic, square = cubic_coefficients(step, chord, first.velocity, last.velocity)
    position = ((cubic * elapsed + square) * elapsed + first.velocity) * elapsed + first.position
    velocity = (3 * cubic * elapsed + 2 * square) * elapsed + first.velocity
    return _Reading(time, position, velocity, effort)


def _or_none(values: FloatArray) -> FloatArray | None:
    """Return values unless none is known."""
    return None if np.isnan(values).all() else values
