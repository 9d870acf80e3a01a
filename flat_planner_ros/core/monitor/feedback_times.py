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

"""When feedback acts on an arm: what swings then is not the arm's free oscillation."""

from collections import deque
from dataclasses import dataclass
from math import inf

SILENCE = 3.0
"""Time after its last word for which feedback is taken to act on [s]; it speaks once a second."""

REMEMBERED = 32
"""Stretches of time that are kept [-]."""


@dataclass(kw_only=True)
class _Stretch:
    """Time for which somebody's feedback acts, as far as is known."""

    sender: str
    since: float
    heard: float
    is_over: bool = False

    @property
    def until(self) -> float:
        """Return the end [s]; whoever falls silent is taken to go on for a while."""
        return self.heard if self.is_over else self.heard + SILENCE


class FeedbackTimes:
    """Keeps when feedback acted; times are of the clock of the plans, in seconds."""

    def __init__(self) -> None:
        """Know of none."""
        self._stretches: deque[_Stretch] = deque(maxlen=REMEMBERED)

    def hear(self, time: float, *, is_active: bool, sender: str = '') -> None:
        """
        Learn whether somebody's feedback acts.

        Parameters
        ----------
        time
            At which it does [s].
        is_active
            Whether it does.
        sender
            Who says so; of two, one may be idle.

        """
        own = (each for each in self._stretches if each.sender == sender and not each.is_over)
        present = next(own, None)
        if present is not None and present.since <= time <= present.until:
            present.heard, present.is_over = max(present.heard, time), not is_active
            return
        if present is not None:  # it fell silent, or the clock was set back
            present.heard, present.is_over = present.until, True
        if is_active:
            self._stretches.append(_Stretch(sender=sender, since=time, heard=time))

    def has_acted(self, start: float, end: float = inf) -> bool:
        """Tell whether feedback acted between two times [s]."""
        return any(each.since < end and each.until > start for each in self._stretches)
