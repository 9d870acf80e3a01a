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

"""What a loop watches besides single samples: how late it is, and whether its errors grow."""

from flat_planner_ros.core.arm import FloatArray
import numpy as np
from numpy.typing import NDArray

AVERAGED = 0.2
"""Time over which the age of joint samples is averaged [s]: two swings of an unstable loop."""

SMALL = 0.02
"""Error below which growth is none [rad]: noise and encoders make errors of any sign."""

GROWTH = 1.02
"""Ratio of a half-swing to the one before from which it has grown [-]."""

GROWN = 3
"""Half-swings in a row that have grown; wrong models and pushes make one or two of them."""


class AgeWatch:
    """
    Age of joint samples when they are used.

    The loop knows it and predicts; the way of the efforts back is not known, and likely as late.

    Parameters
    ----------
    period
        Usual time between two samples [s].

    Attributes
    ----------
    mean
        Age on average, of late [s].
    oldest
        Largest age since the last `restart` [s].
    unanswered
        Samples since then that should have come and did not, or came too late to be of use.

    """

    def __init__(self, period: float) -> None:
        self._period = period
        self.mean = self.oldest = 0.0
        self.unanswered = 0

    def restart(self) -> None:
        """Count anew; the average goes on."""
        self.oldest, self.unanswered = 0.0, 0

    def note(self, age: float, gap: float) -> None:
        """Take the age of a sample, and the time since the one before [s]."""
        # Where samples are missing, the effort of the last one goes on and grows old.
        aged = age + 0.5 * max(0.0, gap - self._period)
        self.mean += min(1.0, gap / AVERAGED) * (aged - self.mean)
        self.oldest = max(self.oldest, age)
        self.unanswered += max(0, round(gap / self._period) - 1)


class GrowthWatch:
    """
    Swings of errors around zero that grow from one to the next: an unstable loop.

    Parameters
    ----------
    joints
        Number of angles.

    """

    def __init__(self, joints: int) -> None:
        """Know of no swing."""
        self._peaks, self._last = np.zeros(joints), np.zeros(joints)
        self._grown = np.zeros(joints, dtype=int)
        self._is_positive = np.zeros(joints, dtype=bool)

    def note(self, errors: FloatArray) -> float:
        """Take the errors of the angles, (n,) [rad]; return a peak that has grown, or zero."""
        turned = (errors > 0.0) != self._is_positive
        if turned.any():
            grows = (self._last > SMALL) & (self._peaks > GROWTH * self._last)
            counted = np.where(grows, self._grown + 1, 0)
            self._grown = np.where(turned, counted, self._grown)
            self._last = np.where(turned, self._peaks, self._last)
            self._peaks = np.where(turned, 0.0, self._peaks)
            self._is_positive = errors > 0.0
        self._peaks = np.maximum(self._peaks, np.abs(errors))
        return float(self._last[self.has_grown].max(initial=0.0))

    @property
    def has_grown(self) -> NDArray[np.bool_]:
        """Tell for each angle whether its errors grow from swing to swing, shape (n,)."""
        return self._grown >= GROWN
