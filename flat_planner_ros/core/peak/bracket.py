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

"""Bracket of a duration in which a peak becomes what is wanted."""

from math import exp, inf, log, sqrt
from typing import NamedTuple

POWER = 5.0
"""Power of the duration with which peaks fall, about, before more is known [-]."""

MOST_SHARE = 1.5
"""Largest ratio of a peak to what is wanted that counts for that [-]."""

PULL = 0.02
"""Part of the way to the middle of two durations that a guess between them is moved [-]."""


class Tried(NamedTuple):
    """A duration, and the peak that it takes over what is wanted."""

    duration: float
    share: float


def between(low: Tried, high: Tried, stride: float) -> float:
    """
    Return the duration to try next; peaks fall like powers of it.

    Parameters
    ----------
    low, high
        The longest too short one, and the shortest that is not; of these one may be unknown.
    stride
        Step from a duration in which there is no motion at all [s].

    """
    if high.duration == inf:
        if low.share == inf:
            return low.duration + stride
        return low.duration * float(min(low.share, MOST_SHARE) ** (1.0 / POWER))
    if low.duration == 0.0:
        return high.duration * float(max(high.share, 1.0 / MOST_SHARE) ** (1.0 / POWER))
    if low.share == inf:
        return sqrt(low.duration * high.duration)
    share = log(low.share) / log(low.share / high.share)
    width = log(high.duration / low.duration)
    # A little towards the middle, so that the ends close in from both sides.
    share += PULL * (0.5 - share)
    return low.duration * exp(share * width)
