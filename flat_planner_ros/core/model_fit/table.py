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

"""What an arm has of parameters: their names and units, and what would tell each."""

from typing import NamedTuple

from flat_planner_ros.core.model_fit.first_links import KINDS
from flat_planner_ros.core.model_fit.last_links import COULOMB, NAMES, VISCOUS

UNITS = ('kg m^2', 'kg m^2', 'N m/rad', 'N m s/rad', 'N m s/rad', 'N m', 'rad', 's')
"""Units of `last_links.NAMES`."""

TELLING = (
    'a motion with effort at joint n-1',
    'a motion in which effort at joint n-1 swings the passive joint',
    'a motion that swings the passive joint',
    'a motion after which the passive joint swings on for several periods',
    'motions of joint n-1 at different speeds',
    'slow motions of joint n-1 that turn back',
    'a rest, or a swing of many periods',
    'a motion with quick changes of effort',
)
"""What would tell a parameter, in the order of `last_links.NAMES`."""

FIRST_UNITS = ('kg m^2', 'kg m', 'N m s/rad', 'N m', 'rad')
"""Units of `first_links.KINDS`."""

FIRST_TELLING = (
    'quick motions of joint {i}',
    'motions of joint {i} and of those before it at different angles, or a vertical plane',
    'motions of joint {i} at different speeds',
    'slow motions of joint {i} that turn back',
    'motions of several joints at different angles, or a vertical plane',
)
"""What would tell a parameter of joint or link i, in the order of `first_links.KINDS`."""

ONLY_IN_VERTICAL = 'nothing but a motion in a vertical plane'
"""What would tell static moment and offset of joint 1, which only gravity shows."""

NO_MOTION = 'no motion of a balanced arm but a mark at a known angle'
"""What would tell the offset of joint n-1, on whose angle nothing depends."""


class Entry(NamedTuple):
    """A parameter: name, unit, what would tell it, and whether it is in proportion to efforts."""

    name: str
    unit: str
    telling: str
    is_of_effort: bool


def entries(joints: int, *, has_gravity: bool) -> list[Entry]:
    """Return the parameters of an arm: the last links', the first ones', an offset."""
    found = []
    for index, name in enumerate(NAMES):
        joint = f'[{joints - 1}]' if index in (VISCOUS, COULOMB) else ''
        found.append(Entry(name + joint, UNITS[index], TELLING[index], index <= COULOMB))
    for kind, unit, telling in zip(KINDS, FIRST_UNITS, FIRST_TELLING, strict=True):
        for i in range(1, joints - 1):
            is_hidden = i == 1 and not has_gravity and kind in ('static_moment', 'offset')
            text = ONLY_IN_VERTICAL if is_hidden else telling.format(i=i)
            found.append(Entry(f'{kind}[{i}]', unit, text, kind != 'offset'))
    found.append(Entry(f'offset[{joints - 1}]', 'rad', NO_MOTION, False))
    return found
