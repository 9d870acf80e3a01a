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

"""Piecewise law: motion laws one after the other, one function of time."""

from dataclasses import dataclass

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.motion_law.law import ExponentialLaw
import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True, kw_only=True, eq=False)
class PiecewiseLaw:
    """
    A function of time on [0, duration] made of one law for each segment.

    Attributes
    ----------
    edges
        Start, joints between the segments and end, ascending from 0, shape (p + 1,) [s].
    laws
        Of the segments, each in its own time from 0.

    """

    edges: FloatArray
    laws: tuple[ExponentialLaw, ...]

    def __post_init__(self) -> None:
        """Lock the edges."""
        self.edges.setflags(write=False)

    @property
    def duration(self) -> float:
        """Length of the motion [s]."""
        return float(self.edges[-1])

    def __call__(self, t: ArrayLike, order: int = 0) -> FloatArray:
        """Return a derivative with respect to time, shape (m,) [rad/s^order]."""
        derivative: FloatArray = self.jet(t, order)[order]
        return derivative

    def jet(self, t: ArrayLike, order: int) -> FloatArray:
        """
        Return the value and its derivatives up to an order.

        Parameters
        ----------
        t
            Times from the start of the motion, in any order, shape (m,) [s]; at a joint the
            segment after it counts.
        order
            Highest derivative wanted.

        Returns
        -------
        FloatArray
            Row k holds the k-th derivative, shape (order + 1, m) [rad/s^k].

        """
        times = np.atleast_1d(np.asarray(t, dtype=float))
        segments = np.searchsorted(self.edges[1:-1], times, side='right')
        result = np.empty((order + 1, len(times)))
        # Stable: times that are sorted already, as nearly always, stay slices of the result.
        by_segment = np.argsort(segments, kind='stable')
        bounds = np.searchsorted(segments[by_segment], np.arange(len(self.laws) + 1))
        for index in np.flatnonzero(np.diff(bounds)):
            chosen = by_segment[bounds[index] : bounds[index + 1]]
            local = times[chosen] - self.edges[index]
            result[:, chosen] = self.laws[index].jet(local, order)
        return result
