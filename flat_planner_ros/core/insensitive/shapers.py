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

"""
Input shaping: what a rigid-arm motion convolved with impulses does, as a baseline.

A quintic for the arm without its spring is split into two or three copies, a half-period of the
nominal oscillation apart, so that their oscillations cancel on the nominal arm (Singer and Seering
1990; docs/derivation.md, I.6).
"""

from enum import Enum
from math import comb, exp, pi, sqrt

from flat_planner_ros.core.arm import Drive, FloatArray, InvalidRequest, PlanarArm
import numpy as np


class Shaper(Enum):
    """Sequence of impulses; the value is how many there are."""

    NONE = 1
    """The motion itself."""

    ZV = 2
    """Zero vibration on the nominal arm."""

    ZVD = 3
    """Its derivative with respect to the frequency is zero too."""


def shaped_quintic(
    arm: PlanarArm,
    distance: float,
    duration: float,
    shaper: Shaper,
    times: FloatArray,
    drive: Drive = Drive.EFFORT,
) -> FloatArray:
    """
    Return what drives a shaped rigid motion from rest to rest.

    Parameters
    ----------
    arm
        Nominal model; must be flat.
    distance
        Of the last two links [rad].
    duration
        From the first impulse to the end of the last copy [s].
    shaper
        Which impulses.
    times
        From the start, shape (m,) [s].
    drive
        What moves joint n-1.

    Returns
    -------
    FloatArray
        Effort of joint n-1 [N m], or velocity of link n-1 [rad/s], shape (m,).

    Raises
    ------
    InvalidRequest
        The impulses take longer than the motion, or the arm does not oscillate.

    References
    ----------
    (I14) of docs/derivation.md.

    """
    mode = arm.natural_mode(held=drive is Drive.POSITION)
    copies = shaper.value
    delay = 0.0
    ratio = 0.0
    if copies > 1:
        if not mode.damped_frequency > 0.0:
            raise InvalidRequest('input shaping needs an arm that oscillates')
        delay = pi / mode.damped_frequency
        ratio = exp(-mode.damping_ratio * pi / sqrt(1.0 - mode.damping_ratio**2))
    base = duration - (copies - 1) * delay
    if not base > 0.0:
        raise InvalidRequest(
            f'the impulses of {shaper.name} take {(copies - 1) * delay:.3g} s, the whole motion '
            f'only {duration:.3g} s'
        )
    signal = np.zeros(len(times))
    for copy in range(copies):
        share = comb(copies - 1, copy) * ratio**copy / (1.0 + ratio) ** (copies - 1)
        u = np.clip((times - copy * delay) / base, 0.0, 1.0)
        # First or second derivative of 10 u^3 - 15 u^4 + 6 u^5, zero at both ends and beyond.
        if drive is Drive.POSITION:
            signal += share * 30.0 * (u * (1.0 - u)) ** 2 / base
        else:
            inertia = arm.inertia_star.both
            signal += share * 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) * inertia / base**2
    return distance * signal
