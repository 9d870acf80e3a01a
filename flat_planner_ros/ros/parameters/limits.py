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

"""Parameters of what the joints may do, and of how long motions take within that."""

from collections.abc import Sequence

from flat_planner_ros.core.planning import JointLimits
from flat_planner_ros.core.session import SessionSettings
from flat_planner_ros.ros.parameters.row import DOUBLES, InvalidParameter, Row, Values

LIMITS = ('position_min', 'position_max', 'velocity', 'effort')
"""Quantities that may be limited."""

LIMIT_ROWS = [
    Row(
        'duration.default',
        SessionSettings.default_duration,
        's',
        'duration of goals without times',
        '0 = the shortest within limits',
        lower=0.0,
    ),
    Row(
        'duration.factor',
        SessionSettings.duration_factor,
        '-',
        'duration of goals without times, in terms of the shortest within limits',
        'where duration.default is 0',
        lower=1.0,
        upper=100.0,
    ),
    Row('duration.min', SessionSettings.min_duration, 's', 'shortest duration', lower=0.0),
    Row('duration.max', SessionSettings.max_duration, 's', 'longest duration', lower=0.0),
    Row(
        'limits.position_min',
        DOUBLES,
        'rad',
        'lower position limits per joint',
        '.inf = none',
        may_be_infinite=True,
    ),
    Row(
        'limits.position_max',
        DOUBLES,
        'rad',
        'upper position limits per joint',
        '.inf = none',
        may_be_infinite=True,
    ),
    Row(
        'limits.velocity',
        DOUBLES,
        'rad/s',
        'velocity limits per joint',
        '.inf = none',
        may_be_infinite=True,
    ),
    Row(
        'limits.effort',
        DOUBLES,
        'N m',
        'effort limits per joint',
        '.inf = none',
        may_be_infinite=True,
    ),
    Row(
        'limits.on_violation',
        SessionSettings.on_violation,
        '',
        'what becomes of a motion that is too fast for the limits',
    ),
]


def limits_of(values: Values, joints: Sequence[str]) -> JointLimits:
    """
    Return the limits of all joints.

    Raises
    ------
    InvalidParameter
        A limit has not one number for each joint.

    """
    given = {name: values[f'limits.{name}'] for name in LIMITS if f'limits.{name}' in values}
    for name, numbers in given.items():
        if len(numbers) != len(joints):
            raise InvalidParameter(
                f'limits.{name} needs one number for each of {", ".join(joints)}, .inf where '
                f'there is no limit; got {len(numbers)}'
            )
    return JointLimits.of(len(joints), **given)
