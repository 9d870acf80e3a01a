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

from dataclasses import replace
from math import inf
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.monitor.course import Course
from flat_planner_ros.core.monitor.motion_record import PlannedMotion
import numpy as np

KEPT = 5.0
"""Time for which an arrival counts at least, and at most twice [s]: a clock may be set."""

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

    def hear(self, stamp: float, arrival: float) -> None:
        """Take a stamp and the time of its arrival by one's own clock [s]."""
        if not self._since <= arrival < self._since + KEPT:
            is_next = self._since <= arrival < self._since + 2 * KEPT
            self._former = self._present if is_next else -inf
            self._present = -inf
            self._since = arrival
        self._present = max(self._present, stamp - arrival)

    def hear_all(self, stamps: FloatArray, arrivals: FloatArray) -> None:
        """Take stamps that are `unnoticed`, shape (m,) [s]."""
        self._present = max(self._present, float((stamps - arrivals).max()))

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


class SampleClock(NamedTuple):
    """
    What is known of the stamps of a motion's samples.

    Attributes
    ----------
    offset
        By how much they are ahead by their arrival [s], ``None`` if nobody knows.
    correction
        What has been added to them before the samples were kept [s].

    """

    offset: float | None = None
    correction: float = 0.0

    def ahead(self, course: Course | None) -> float | None:
        """Return how far the stamps are ahead, by the motion itself where it shows that [s]."""
        if not is_noticed(self.offset) or course is None or course.shift is None:
            return self.offset
        return course.shift - self.correction

    def is_other(self, course: Course | None) -> bool:
        """Return whether the stamps are of another clock than the plan, as far as is known."""
        return is_noticed(self.ahead(course))

    def is_doubtful(self, course: Course | None) -> bool:
        """Return whether nothing shows when the motion was by the samples' clock."""
        return self.is_other(course) and (course is None or course.shift is None)

    def own(self, course: Course | None) -> Course | None:
        """Return a course without a delay that is the clock's."""
        if course is None or course.shift is None:
            return course
        shift = 0.0 if self.is_other(course) else course.shift - self.correction
        return replace(course, shift=shift)

    def carried_out(self, motion: PlannedMotion, course: Course | None) -> PlannedMotion:
        """Return the motion at the time at which the kept samples show it."""
        own = self.own(course)
        if course is not None and (self.is_other(course) or (own is not None and own.remark)):
            return course.carried_out(motion)
        # The stamps were right all along, whatever has been added to them.
        return motion.shifted(self.correction)

    def remark(self, course: Course | None) -> str:
        """Return what is to be said of the clock, empty if it is the plan's."""
        ahead = self.ahead(course)
        if self.offset is None or ahead is None or not is_noticed(self.offset):
            return ''
        if not is_noticed(ahead):
            late = -self.offset
            return f'joint states arrive {late:.3g} s after their stamps' if late > 0.0 else ''
        order = 'ahead of' if ahead > 0.0 else 'behind'
        return f"joint states are stamped {abs(ahead):.4g} s {order} the plan's clock"


def is_noticed(offset: float | None) -> bool:
    """Return whether an offset is more than a slow transport [s]."""
    return offset is not None and abs(offset) >= NOTICED
