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

"""How often joint states come, beside what a loop was made for."""

from math import inf

TOLERANCE = 0.25
"""Largest difference from the rate that is left unsaid, relative to it [-]."""

ENOUGH = 50
"""Samples from which a rate is told [-]."""


class RateWatch:
    """
    Measures the rate of joint states by their stamps.

    Parameters
    ----------
    rate
        For which the loop was made [Hz].

    """

    def __init__(self, rate: float) -> None:
        self._wanted = rate
        self._first, self._last, self._count = inf, -inf, 0
        self._has_said = False

    def heard(self, stamp: float) -> None:
        """Count a sample with a stamp [s]."""
        self._first, self._last = min(self._first, stamp), max(self._last, stamp)
        self._count += 1

    def take_remark(self) -> str:
        """Return, once, that the rate since this was last asked is another one."""
        span, count = self._last - self._first, self._count
        self._first, self._last, self._count = inf, -inf, 0
        if self._has_said or count < ENOUGH or span <= 0.0:
            return ''
        rate = (count - 1) / span
        if abs(rate - self._wanted) <= TOLERANCE * self._wanted:
            return ''
        self._has_said = True
        return (
            f'joint states come at {rate:.3g} Hz, the loop is made and certified for '
            f'{self._wanted:g} Hz: set rate, or the rate of the driver'
        )
