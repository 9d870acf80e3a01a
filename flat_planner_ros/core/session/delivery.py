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

"""How long messages take between planner and arm, and the delay of starts that makes up for it."""

from collections import deque
from dataclasses import replace
from statistics import median

from flat_planner_ros.core.session.settings import SessionSettings

AGES = 200
"""Joint states whose age on arrival is remembered."""

AUTO_MARGIN = 0.05
"""What an automatic start has beside the way of the command, for planning and playing [s]."""

AUTO_TRIPS = 3.0
"""Ways over the network that a command is given: a lost piece of it needs two more [-]."""


class Delivery:
    """
    The age of joint states on arrival, taken for the time that a command will be on its way.

    Clocks that differ cannot be told from a network that delays: an age below zero, of an arm with
    a clock ahead, makes commands late by as much and counts as such.
    """

    def __init__(self) -> None:
        """Know nothing: no delay."""
        self._ages: deque[float] = deque(maxlen=AGES)
        self._delay: float | None = 0.0

    def hear(self, age: float) -> None:
        """Take the age of a joint state on arrival [s]."""
        self._ages.append(age)
        self._delay = None

    @property
    def delay(self) -> float:
        """Return the usual time on the way [s]."""
        if self._delay is None:
            self._delay = abs(median(self._ages))
        return self._delay

    @property
    def start_delay(self) -> float:
        """Return the delay of starts with which a command comes in time [s]."""
        return AUTO_MARGIN + AUTO_TRIPS * self.delay

    def applied(self, settings: SessionSettings) -> SessionSettings:
        """Return settings whose automatic delays (0) are numbers."""
        if settings.start_delay > 0.0:
            return settings
        wanted = self.start_delay
        return replace(settings, start_delay=wanted, lookahead=max(settings.lookahead, wanted))

    def doubt(self, settings: SessionSettings) -> str:
        """Return why commands will come late, a clause; empty if they need not."""
        soonest = min(settings.start_delay, settings.lookahead)
        if settings.start_delay == 0.0 or soonest >= self.delay:
            return ''
        name = 'start_delay' if soonest == settings.start_delay else 'replan.lookahead'
        return (
            f'{name} {soonest:g} s is less than the {self.delay:.3f} s that joint states take to '
            f'arrive (or by which the clocks differ): the command may come late; '
            f'{self.start_delay:.2f} s would do, or start_delay: 0.0, which is automatic'
        )
