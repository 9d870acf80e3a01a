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

"""By how much the stamps of joint states differ from the clock that they are compared with."""

from math import inf

from flat_planner_ros.core.arm.arrays import FloatArray
import numpy as np

KEPT = 5.0
"""Time for which an arrival counts at least, and at most twice [s]: a clock may be set."""

SURE = 50
"""Messages of which one at least is not delayed by a busy computer."""

NOTICED = 0.02
"""Offset from which stamps are of another clock [s]; below it a transport is merely slow."""


class OffsetFilter:
    """
    Tells how far stamps are ahead of the time of their arrival.

    A transport delays some messages more than others and none less than not at all: what counts is
    the message that came fastest of those in the last seconds.

    """

    def __init__(self) -> None:
        self._since = -inf
        self._present = -inf
        self._former = -inf
        self._count = 0

    def hear(self, stamp: float, arrival: float) -> None:
        """Take a stamp and the time of its arrival by one's own clock [s]."""
        if not self._since <= arrival < self._since + KEPT:
            is_next = self._since <= arrival < self._since + 2 * KEPT
            self._former = self._present if is_next else -inf
            self._present = -inf
            self._since = arrival
        self._present = max(self._present, stamp - arrival)
        self._count += 1

    def hear_all(self, stamps: FloatArray, arrivals: FloatArray) -> None:
        """Take stamps that are `unnoticed`, shape (m,) [s]."""
        self._present = max(self._present, float((stamps - arrivals).max()))
        self._count += len(stamps)

    def unnoticed(self, stamps: FloatArray, arrivals: FloatArray) -> int:
        """Return how many stamps in a row leave it at being no more than a slow transport."""
        if self.offset is None or is_noticed(self.offset):
            return 0
        is_plain = (arrivals >= self._since) & (arrivals < self._since + KEPT)
        is_plain &= stamps - arrivals < NOTICED
        return int(np.append(is_plain, False).argmin())

    @property
    def offset(self) -> float | None:
        """Return by how much stamps are ahead [s], negative for behind; None before the first."""
        offset = max(self._present, self._former)
        return None if offset == -inf else offset

    @property
    def sure(self) -> float | None:
        """Return the offset [s] once so many messages were heard that not all can be late."""
        return self.offset if self._count >= SURE else None


def is_noticed(offset: float | None) -> bool:
    """Return whether an offset is more than a slow transport [s]."""
    return offset is not None and abs(offset) >= NOTICED
