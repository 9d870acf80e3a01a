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

"""Peak: motions of least peak effort, and the shortest within a peak, with a dual certificate."""

from flat_planner_ros.core.peak.bound import SwitchingFunction
from flat_planner_ros.core.peak.law import LinearEffortLaw
from flat_planner_ros.core.peak.motion import (
    check_peak,
    peak_motion,
    peak_motion_from,
)
from flat_planner_ros.core.peak.problem import PeakMotion
from flat_planner_ros.core.peak.settings import MAX_INTERVALS, MIN_INTERVALS, PeakSettings
from flat_planner_ros.core.peak.shortest import (
    shortest_peak_duration,
    shortest_peak_duration_from,
)

__all__ = [
    'check_peak',
    'LinearEffortLaw',
    'MAX_INTERVALS',
    'MIN_INTERVALS',
    'peak_motion',
    'peak_motion_from',
    'PeakMotion',
    'PeakSettings',
    'shortest_peak_duration',
    'shortest_peak_duration_from',
    'SwitchingFunction',
]
