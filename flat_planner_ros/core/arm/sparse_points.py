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

"""The points of a sampled motion that cubic interpolation needs."""

from flat_planner_ros.core.arm.arrays import FloatArray
from flat_planner_ros.core.arm.samples import cubic_coefficients
import numpy as np
from numpy.typing import NDArray

BETWEEN = 0.75
"""Share of the tolerance that is left at the samples: between two of them it is 1/0.79 as much."""


def sparse_rows(
    times: FloatArray, positions: FloatArray, velocities: FloatArray, tolerance: float
) -> NDArray[np.intp]:
    """
    Return which points to keep, the first and the last among them, shape (k,).

    Cubic Hermite interpolation between those that are kept goes through all others within the
    tolerance; each interval is as long as that allows, by doubling and bisection.

    Parameters
    ----------
    times
        Ascending, shape (m,) [s].
    positions, velocities
        Shape (m, n) [rad], [rad/s].
    tolerance
        Largest distance of the interpolated from the given motion [rad].

    """
    rows, last = [0], len(times) - 1
    motion = (times, positions, velocities)
    while rows[-1] < last:
        first = rows[-1]
        good, length = first + 1, 2
        while first + length <= last and _fits(*motion, first, first + length, tolerance):
            good, length = first + length, 2 * length
        bad = min(first + length, last + 1)
        while bad - good > 1:
            middle = (good + bad) // 2
            if _fits(*motion, first, middle, tolerance):
                good = middle
            else:
                bad = middle
        rows.append(good)
    return np.array(rows, dtype=np.intp)


def _fits(
    times: FloatArray,
    positions: FloatArray,
    velocities: FloatArray,
    first: int,
    last: int,
    tolerance: float,
) -> bool:
    """Return whether a cubic from one point to another goes through those between."""
    step = times[last] - times[first]
    chord = (positions[last] - positions[first]) / step
    cubic, square = cubic_coefficients(step, chord, velocities[first], velocities[last])
    u = (times[first + 1 : last] - times[first])[:, None]
    found = ((cubic * u + square) * u + velocities[first]) * u + positions[first]
    return bool(np.abs(found - positions[first + 1 : last]).max() <= BETWEEN * tolerance)
