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

"""Angles as people write them on a command line: in radians, degrees, or as a part of pi."""

from math import pi, radians
import re

NUMBER = r'(\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?'

PART_OF_PI = re.compile(
    rf'(?P<sign>[-+]?)(?:(?P<factor>{NUMBER})\*?)?(?:pi|π)(?:/(?P<divisor>{NUMBER}))?'
)
"""As in pi, -pi/2, 3*pi/4, 2pi."""

DEGREES = ('deg', '°')
"""Endings of an angle in degrees."""

FORMS = '1.57, 90deg or pi/2'
"""What an angle may look like."""


def angle_of(text: str) -> float:
    """
    Return an angle [rad].

    Raises
    ------
    ValueError
        It is no angle.

    """
    for ending in DEGREES:
        if text.endswith(ending):
            return radians(float(text[: -len(ending)]))
    match = PART_OF_PI.fullmatch(text)
    if match is None:
        return float(text.removesuffix('rad'))
    value = pi * float(match['factor'] or 1.0) / float(match['divisor'] or 1.0)
    return -value if match['sign'] == '-' else value
