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

"""The time of joint states, between and after them."""


class StampClock:
    """
    The time of the joint states' stamps, carried on by another clock while none come.

    The two clocks may differ: a simulator or a recording stamps in its own time. Before the first
    joint state the other clock stands for both. A simulated clock shows 0 until it is first heard;
    that is no time, and what follows it is no silence.

    Attributes
    ----------
    stamp
        The last one [s]; set it with every joint state. None before the first.

    """

    def __init__(self) -> None:
        self.stamp: float | None = None
        self._seen: float | None = None
        self._offset = 0.0

    def now(self, other: float) -> float:
        """Return the present time of the stamps, given that of the other clock [s]."""
        if not other:
            return self.stamp or 0.0
        if self.stamp is not None and self.stamp != self._seen:
            self._seen = self.stamp
            self._offset = self.stamp - other
        return other + self._offset
