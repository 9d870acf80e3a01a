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

"""Samples of a plan: joint motion and effort on a grid of times, each formed when asked for."""

from dataclasses import dataclass
from functools import cached_property

from flat_planner_ros.core.arm import FlatMap, FloatArray, PlanarArm
import numpy as np

FLAT_ORDERS = 6
"""Derivatives of the flat outputs in a plan, the values included."""

JOINT_ORDERS = 3
"""Position, velocity and acceleration."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanSamples:
    """
    A plan on a grid of times.

    Attributes
    ----------
    times
        From the start of the motion, shape (m,) [s].
    planned
        Derivatives 0 to 6 of the planned variables w, shape (n - 1, 7, m) [rad/s^k].
    torque
        Effort of joint n-1, the last with a motor, without friction, shape (m,) [N m].
    arm, flat_map
        From these to everything below.
    compensates_friction
        Whether the efforts include what friction takes.

    """

    times: FloatArray
    planned: FloatArray
    torque: FloatArray
    arm: PlanarArm
    flat_map: FlatMap
    compensates_friction: bool = False

    def __post_init__(self) -> None:
        """Lock the tables."""
        self.times.setflags(write=False)
        self.planned.setflags(write=False)
        self.torque.setflags(write=False)

    @property
    def positions(self) -> FloatArray:
        """Angles of all joints, shape (m, n) [rad]."""
        return self._joints[0]

    @property
    def velocities(self) -> FloatArray:
        """First derivatives of the positions, shape (m, n) [rad/s]."""
        return self._joints[1]

    @property
    def accelerations(self) -> FloatArray:
        """Second derivatives of the positions, shape (m, n) [rad/s^2]."""
        return self._joints[2]

    @cached_property
    def efforts(self) -> FloatArray:
        """
        Feed-forward effort of all joints, zero for the passive one, shape (m, n) [N m].

        Joint n-1 follows from the flat map ((13) of docs/derivation.md), those before it from the
        inverse dynamics of the arm.
        """
        n = self.arm.n
        efforts = np.zeros((len(self.times), n))
        efforts[:, n - 2] = self.torque
        if n > 2:
            efforts[:, : n - 2] = self.arm.rigid_effort(*self._joints)[:, : n - 2]
        if self.compensates_friction:
            efforts[:, :-1] += self.arm.friction(self.velocities)
        efforts.setflags(write=False)
        return efforts

    @cached_property
    def flat(self) -> FloatArray:
        """Return derivatives 0 to 5 of every flat output, shape (n - 1, 6, m) [rad/s^k]."""
        flat = _derivatives(self.flat_map.output, self.planned[0], FLAT_ORDERS)[None]
        if len(self.planned) > 1:
            flat = np.concatenate([flat, self.planned[1:, :FLAT_ORDERS]])
        flat.setflags(write=False)
        return flat

    @cached_property
    def _joints(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return positions, velocities and accelerations."""
        n = self.arm.n
        passive = _derivatives(self.flat_map.deflection, self.planned[0], JOINT_ORDERS)
        joints = np.empty((JOINT_ORDERS, len(self.times), n))
        # y1 is the angle of the last link, the sum of all joints'.
        inner = np.subtract(self.flat[0, :JOINT_ORDERS], passive, out=joints[:, :, n - 2])
        for i in range(n - 2):
            joints[:, :, i] = self.planned[1 + i, :JOINT_ORDERS]
            inner -= joints[:, :, i]
        joints[:, :, n - 1] = passive
        joints.setflags(write=False)
        positions, velocities, accelerations = joints
        return positions, velocities, accelerations


def _derivatives(row: FloatArray, jet: FloatArray, count: int) -> FloatArray:
    """Return the quantity of a row and its derivatives, shape (count, m)."""
    table = np.empty((count, jet.shape[1]))
    for order, values in enumerate(table):
        np.matmul(row, jet[order : order + len(row)], out=values)
    return table
