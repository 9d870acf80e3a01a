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
    A motion's start in motion, and where the arm would be without its swing.

    Attributes
    ----------
    jets
        Derivatives 0 to 5 of the planned variables, shape (n-1, 6) [rad/s^k].
    rest
        Pose that the arm swings about, shape (n,) [rad].
    drift
        Velocity of that pose if nothing acts, shape (n,) [rad/s].

    """

    jets: FloatArray
    rest: FloatArray
    drift: FloatArray


def moving_start(
    arm: PlanarArm,
    positions: FloatArray,
    velocities: FloatArray,
    ahead: float,
    *,
    held: bool = False,
    inputs: tuple[float, ...] = (),
) -> MovingStart:
    """
    Return the start of a motion that catches a swing.

    Until then nothing moves the arm but its spring; the joints before the last two go on as they
    move.

    Parameters
    ----------
    arm
        The model.
    positions, velocities
        Estimated state, shape (n,) [rad], [rad/s].
    ahead
        Time from that state to the start of the motion [s].
    held
        Whether a position servo moves joint n-1; otherwise its effort does.
    inputs
        What acts at the start, and its derivative: the effort of joint n-1 [N m], or the
        acceleration of link n-1 if that is held [rad/s^2]; zero if left out.

    Raises
    ------
    NotFlat
        The arm does not meet the flatness condition.

    """
    chain = last_links(arm, held=held)
    state = np.array([positions[:-1].sum(), positions[-1], velocities[:-1].sum(), velocities[-1]])
    flow, _ = chain.over(ahead)
    jets = np.zeros((arm.n - 1, ORDERS))
    jets[0] = chain.jet(flow[:4, :4] @ state, ORDERS, inputs)
    jets[1:, 0] = positions[:-2] + ahead * velocities[:-2]
    jets[1:, 1] = velocities[:-2]
    # Integrated twice, input_row @ jet = 0 says that this combination stays what it is.
    row = chain.input_row[2:]
    centre, drift = (_pose(row @ jets[0, k : k + 3] / row[0], jets[1:, k]) for k in (0, 1))
    return MovingStart(jets, centre, drift)


def _pose(last: float, inner: FloatArray) -> FloatArray:
    """Return joint angles, or their rates, of link n-1 and of those before, shape (n,)."""
    return np.array([*inner, last - inner.sum(), 0.0])
