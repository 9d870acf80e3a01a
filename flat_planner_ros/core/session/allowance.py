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

"""Time for planning a motion that starts in motion: it has to be sent before its start."""

from collections.abc import Callable
from dataclasses import dataclass, field

from flat_planner_ros.core.session.motion_start import MotionStart

Clock = Callable[[], float]

DELIVERY_SHARE = 0.25
"""Part of the lookahead that is left for a command to reach its executor [-]."""

FINISHING_SHARE = 0.25
"""Part of it that is left for what follows a search: its last trial, the samples [-]."""


@dataclass(kw_only=True)
class Allowance:
    """
    Time within which searches have to be content with the best that they have found.

    Attributes
    ----------
    clock
        Tells the time [s].
    begin, until
        When planning began, and when searching has to be over [s].
    was_needed
        Whether a search was told that it is over.

    """

    clock: Clock
    begin: float
    until: float
    was_needed: bool = field(default=False, init=False)

    def over_at(self, share: float) -> Callable[[], bool]:
        """Return what tells a search that its share of the time is used up."""
        moment = self.begin + share * (self.until - self.begin)

        def is_over() -> bool:
            """Tell that it is time, and remember it."""
            is_late = self.clock() >= moment
            self.was_needed = self.was_needed or is_late
            return is_late

        return is_over


def allowance_for(
    start: MotionStart, now: float, clock: Clock | None, lookahead: float
) -> Allowance | None:
    """
    Return the time there is for planning a motion, None for all that it takes.

    Parameters
    ----------
    start
        Where the motion starts: one that is at rest there waits until it is planned.
    now, clock
        Present time [s], and what tells it later; None if planning is to take no time.
    lookahead
        Of goals in motion [s].

    """
    if clock is None or start.may_wait:
        return None
    left = (DELIVERY_SHARE + FINISHING_SHARE) * lookahead
    return Allowance(clock=clock, begin=now, until=max(now, start.time - left))
