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

"""When an arm is said to age."""

from dataclasses import dataclass

from flat_planner_ros.core.arm import check_number, InvalidRequest

FEWEST = 20
"""Estimates of a parameter from which it is judged."""


@dataclass(frozen=True, kw_only=True)
class DriftSettings:
    """
    When an arm is said to age.

    Attributes
    ----------
    window
        Motions, the last ones, over which a parameter is watched.
    false_alarms
        Largest share of motions after which a constant arm is suspected [-].

    """

    window: int = 200
    false_alarms: float = 1e-3

    def __post_init__(self) -> None:
        """Refuse settings without meaning."""
        if self.window < FEWEST:
            raise InvalidRequest(f'window must be at least {FEWEST} motions, got {self.window}')
        check_number('false_alarms', self.false_alarms, '', above=0.0, error=InvalidRequest)
        if self.false_alarms >= 0.5:
            raise InvalidRequest(f'false_alarms must be below 0.5, got {self.false_alarms}')
