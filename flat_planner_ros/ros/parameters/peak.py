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

"""Parameters of the strategy `min_peak_effort`."""

from math import inf

from flat_planner_ros.core.insensitive import UncertaintyBox
from flat_planner_ros.core.peak import MAX_INTERVALS, MIN_INTERVALS, PeakSettings
from flat_planner_ros.core.planning import JointLimits
from flat_planner_ros.ros.parameters.row import Row, Values

PEAK_ROWS = [
    Row(
        'peak.intervals',
        PeakSettings.intervals,
        '',
        f'spline intervals of the effort of strategy min_peak_effort, {MIN_INTERVALS} to '
        f'{MAX_INTERVALS}: more come nearer to the least time, and are steeper',
    ),
    Row(
        'peak.effort_rate',
        PeakSettings.effort_rate,
        'N m/s',
        'largest rate of that effort',
        '0 = what the intervals allow',
        lower=0.0,
    ),
    Row(
        'peak.insensitive',
        PeakSettings.insensitive,
        '',
        'let small errors of stiffness and damping leave next to nothing; from a start in motion '
        'those of the stiffness',
    ),
    Row(
        'peak.max_residual',
        PeakSettings.max_residual,
        'rad',
        'residual that may be left on any arm within insensitivity.stiffness, .damping, .inertia '
        'and .payload',
        '0 = whatever is left',
        lower=0.0,
    ),
]
"""Parameters of the planner node that concern motions of least peak."""


def peak_of(values: Values, limits: JointLimits, box: UncertaintyBox) -> PeakSettings:
    """
    Return what the parameters ask for.

    Raises
    ------
    InvalidRequest
        A value has no meaning.

    """
    velocity = inf
    if len(limits.velocity) == 2:
        # With more joints, joint n-1 is not what link n-1 alone does.
        velocity = float(limits.velocity[0])
    return PeakSettings(
        intervals=values['peak.intervals'],
        effort_rate=values['peak.effort_rate'],
        velocity=velocity,
        insensitive=values['peak.insensitive'],
        max_residual=values['peak.max_residual'],
        box=box,
    )
