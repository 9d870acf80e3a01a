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

"""The clock of a motion's samples beside the clock that it was planned by."""

from dataclasses import replace
from typing import NamedTuple

from flat_planner_ros.core.arm import is_noticed
from flat_planner_ros.core.monitor.course import Course
from flat_planner_ros.core.monitor.motion_record import PlannedMotion


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
