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

"""What a command contains."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class CommandForm:
    """
    What a command contains; by default all that is planned.

    Attributes
    ----------
    include_passive_joint, include_acceleration, include_effort
        Columns of the points.
    absolute_stamp
        Whether its stamp is its start, or zero.
    tolerance
        Distance of cubic interpolation between its points from the motion [rad]; with 0 it has
        all points.

    """

    include_passive_joint: bool = True
    include_acceleration: bool = True
    include_effort: bool = True
    absolute_stamp: bool = True
    tolerance: float = 0.0


WHOLE = CommandForm()
"""All that is planned, as `~/plan` has it."""
