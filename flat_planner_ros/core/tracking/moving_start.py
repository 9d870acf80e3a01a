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

"""A swinging arm as the start of a motion: its flat outputs' derivatives, carried forward."""

from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray, PlanarArm
from flat_planner_ros.core.tracking.chain import last_links
import numpy as np

ORDERS = 6
"""Derivatives of each planned variable at the start of a motion, the values included."""


class MovingStart(NamedTuple):
    """
    A motion's start in motion, and where the arm would come to rest without it.

    Attributes
    ----------
    jets
        Derivatives 0 to 5 of the planned variables, shape (n-1, 6) [rad/s^k].
    rest
        Pose that the swing dies away to if the first joints are held, shape (n,) [rad].

    """

    jets: FloatArray
    rest: FloatArray


def moving_start(
    arm: PlanarArm,
    positions: FloatArray,
    velocities: FloatArray,
    ahead: float,
    *,
    held: bool = False,
) -> MovingStart:
    """
    Return the start of a motion that catches a swing.

    Until then nothing moves the arm but its spring; the joints before the last two go on as they
    move. The effort of joint n-1 is zero at the start, or what holds it.

    Parameters
    ----------
    arm
        The model.
    positions, velocities
        Estimated state, shape (n,) [rad], [rad/s].
    ahead
        Time from that state to the start of the motion [s].
    held
        Whether position servos hold the actuated joints; otherwise joint n-1 is free.

    Raises
    ------
    NotFlat
        The arm does not meet the flatness condition.

    """
    chain = last_links(arm, held=held)
    state = np.array([positions[:-1].sum(), positions[-1], velocities[:-1].sum(), velocities[-1]])
    if held:
        state[2] = 0.0
    flow, _ = chain.over(ahead)
    jets = np.zeros((arm.n - 1, ORDERS))
    jets[0] = chain.jet(flow[:4, :4] @ state, ORDERS)
    jets[1:, 0] = positions[:-2] + ahead * velocities[:-2]
    jets[1:, 1] = velocities[:-2]
    # Integrated twice, input_row @ jet = 0 says that this combination stays what it is.
    row = chain.input_row[2:]
    last = float(row @ jets[0, :3] / row[0])
    inner = jets[1:, 0]
    return MovingStart(jets, np.array([*inner, last - inner.sum(), 0.0]))
