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

"""Motion in samples: those that drivers measure, and what lies between those of a plan."""

from bisect import bisect_right
from dataclasses import dataclass
from typing import TypeVar

from flat_planner_ros.core.arm.arrays import FloatArray
import numpy as np
from numpy.typing import NDArray

Number = TypeVar('Number', float, FloatArray)

MERGING_TOLERANCE = 0.05
"""Distance in time within which every joint of a sample has been heard [s]: a period at 20 Hz."""

JUMP = 0.2
"""Change of a joint angle between two samples, beyond its velocity's, that is no motion [rad]."""

CURVATURE = 1.5
"""Mean velocity between two samples at most, relative to the larger one at either end [-]."""

UNUSABLE = 1e6
"""
Number from which an angle, speed or acceleration is no arm's [rad], [rad/s], [rad/s^2], nor an
effort [N m]: damaged, or never set.
"""

UNKNOWN_SPEED = 30.0
"""Speed that a joint may have where its velocity is not measured [rad/s]."""


@dataclass(frozen=True, kw_only=True, eq=False, slots=True)
class JointSample:
    """
    Measured state of the n joints, in the order of the motion's names.

    Attributes
    ----------
    time
        Absolute time of the measurement [s].
    positions
        Joint positions [rad], shape (n,); NaN if unknown.
    velocities, efforts
        Joint velocities [rad/s] and efforts [N m], shape (n,); ``None`` or NaN if unknown.

    """

    time: float
    positions: FloatArray
    velocities: FloatArray | None = None
    efforts: FloatArray | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class SampleTable:
    """
    Measured states of the n joints at m times, as JointSample has each.

    Attributes
    ----------
    times
        Shape (m,) [s].
    positions
        Shape (m, n) [rad].
    velocities, efforts
        Shape (m, n) [rad/s], [N m]; ``None`` if unknown.

    """

    times: FloatArray
    positions: FloatArray
    velocities: FloatArray | None = None
    efforts: FloatArray | None = None

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.times)

    def sample(self, row: int) -> JointSample:
        """Return one of the samples."""
        return JointSample(
            time=float(self.times[row]),
            positions=self.positions[row],
            velocities=None if self.velocities is None else self.velocities[row],
            efforts=None if self.efforts is None else self.efforts[row],
        )

    def rows(self, rows: slice | NDArray[np.intp]) -> 'SampleTable':
        """Return some of the samples."""
        return SampleTable(
            times=self.times[rows],
            positions=self.positions[rows],
            velocities=None if self.velocities is None else self.velocities[rows],
            efforts=None if self.efforts is None else self.efforts[rows],
        )

    def joints(self, places: NDArray[np.intp] | slice) -> 'SampleTable':
        """Return the states of some joints."""
        return SampleTable(
            times=self.times,
            positions=self.positions[:, places],
            velocities=None if self.velocities is None else self.velocities[:, places],
            efforts=None if self.efforts is None else self.efforts[:, places],
        )


@dataclass(frozen=True, kw_only=True)
class JointStateRules:
    """
    How joint states are read.

    Attributes
    ----------
    tolerance
        Distance in time within which all joints of a sample that comes in parts were heard [s].
    unwrap
        Whether the turns of joints that are wrapped, to +-pi or to 0 ... 2 pi, are counted.

    """

    tolerance: float = MERGING_TOLERANCE
    unwrap: bool = True


def travel(former: JointSample, sample: JointSample) -> FloatArray:
    """Return how far each joint can have moved between two samples, shape (n,) [rad]."""
    speed = np.maximum(_speed(former), _speed(sample))
    with np.errstate(over='ignore'):  # infinitely far will do
        distance: FloatArray = CURVATURE * abs(sample.time - former.time) * speed
    return distance


def _speed(sample: JointSample) -> FloatArray:
    """Return how fast each joint moves at most, shape (n,) [rad/s]."""
    if sample.velocities is None:
        return np.full(sample.positions.shape, UNKNOWN_SPEED)
    return np.nan_to_num(np.abs(sample.velocities), nan=UNKNOWN_SPEED, posinf=UNKNOWN_SPEED)


class SampledMotion:
    """
    Position and velocity between points, at rest before the first and after the last.

    Parameters
    ----------
    times
        Of the points, ascending, shape (m,) [s].
    positions
        Shape (m, n) [rad].
    velocities
        Shape (m, n) [rad/s], for cubic Hermite interpolation; without them the points are joined
        by straight lines.

    """

    def __init__(
        self, times: FloatArray, positions: FloatArray, velocities: FloatArray | None
    ) -> None:
        """Form the polynomials of all intervals at once."""
        # By hand: scipy's spline costs ten times as much per call, and 0.3 s at the first import.
        self._times: list[float] = times.tolist()
        self._ends = positions[0], positions[-1]
        self._rest = np.zeros(positions.shape[1])
        steps = np.diff(times)[:, None]
        chords = np.diff(positions, axis=0) / steps
        first, last = (chords, chords) if velocities is None else (velocities[:-1], velocities[1:])
        # In the time u since the interval's start: q = ((a u + b) u + c) u + d.
        cubic, square = cubic_coefficients(steps, chords, first, last)
        nothing = np.zeros_like(chords)
        # Positions and velocities side by side, highest power first, shape (m-1, 4, 2 n).
        self._coefficients = np.concatenate(
            (
                np.stack((cubic, square, first, positions[:-1]), axis=1),
                np.stack((nothing, 3 * cubic, 2 * square, first), axis=1),
            ),
            axis=2,
        )

    def at(self, time: float) -> tuple[FloatArray, FloatArray]:
        """Return position [rad] and velocity [rad/s], shape (n,), on the points' time axis [s]."""
        after = bisect_right(self._times, time)
        if after == 0 or after == len(self._times):
            return self._ends[min(after, 1)], self._rest
        u = time - self._times[after - 1]
        a, b, c, d = self._coefficients[after - 1]
        both = ((a * u + b) * u + c) * u + d
        n = self._rest.size
        return both[:n], both[n:]

    def through(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what `at` does for each of many times (k,) [s], shape (k, n) each."""
        after, points = np.searchsorted(self._times, times, side='right'), len(self._times)
        n, inside = self._rest.size, (after > 0) & (after < points)
        before = after[inside] - 1
        u = (times[inside] - np.array(self._times)[before])[:, None]
        a, b, c, d = np.moveaxis(self._coefficients[before], 1, 0)
        both = np.zeros((len(times), 2 * n))
        both[after == 0, :n], both[after == points, :n] = self._ends
        both[inside] = ((a * u + b) * u + c) * u + d
        return both[:, :n], both[:, n:]

    def acceleration_at(self, time: float) -> FloatArray:
        """Return the acceleration, which may jump at the points, shape (n,) [rad/s^2]."""
        after = bisect_right(self._times, time)
        if after == 0 or after == len(self._times):
            return self._rest
        slope, start = self._coefficients[after - 1][1:3, self._rest.size :]
        acceleration: FloatArray = 2.0 * slope * (time - self._times[after - 1]) + start
        return acceleration


def cubic_coefficients(
    step: Number, chord: Number, first: Number, last: Number
) -> tuple[Number, Number]:
    """
    Return the coefficients of the third and second power of the cubic Hermite interpolant.

    Parameters
    ----------
    step
        Length of the interval [s].
    chord
        Mean velocity over it [rad/s].
    first, last
        Velocities at its ends [rad/s].

    Returns
    -------
    tuple
        [rad/s^3] and [rad/s^2].

    """
    return (first + last - 2 * chord) / step**2, (3 * chord - 2 * first - last) / step
