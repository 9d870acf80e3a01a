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

"""Peaks and mean values of arms whose joints do more than follow one planned variable."""

from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray, PlanarArm
from flat_planner_ros.core.motion_law import JET_ORDER, UnitMotions
from flat_planner_ros.core.plan_table.arm_table import IntArray
import numpy as np

DERIVATIVES = 3
"""Position, velocity and acceleration."""


class JointMotion(NamedTuple):
    """
    Motions of one arm and form.

    Attributes
    ----------
    arm
        What moves.
    motions
        Over 1 rad, q of them.
    rates
        Factors of their derivatives 0 to 6 in physical time, shape (q, 7) [1/s^k].
    rows
        As those of an `ArmTable`, shape (3, 7).
    starts, distances
        Planned variables at the start, and the way to go, shape (q, n - 1) [rad].
    has_friction
        Whether the efforts include what friction takes.

    """

    arm: PlanarArm
    motions: UnitMotions
    rates: FloatArray
    rows: FloatArray
    starts: FloatArray
    distances: FloatArray
    has_friction: bool

    def figures(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return RMS and peak of every effort [N m] and peak of every velocity, (q, n) each."""
        square, peak, fastest = np.zeros((3, len(self.starts), self.arm.n))
        for rows, weights, halves in self.motions.at_nodes(self._quantities()):
            for half in halves:
                positions, velocities, accelerations = self._joints(rows, half[:, 1:])
                efforts = np.zeros_like(positions)
                rigid = self.arm.rigid_effort(positions, velocities, accelerations)
                efforts[..., :-2] = rigid[..., :-2]
                efforts[..., -2] = self.distances[rows, :1] * half[:, 0]
                if self.has_friction:
                    efforts[..., :-1] += self.arm.friction(velocities)
                square[rows] += 0.5 * np.einsum('m,qmn->qn', weights, efforts**2)
                peak[rows] = np.maximum(peak[rows], np.abs(efforts).max(axis=1))
                fastest[rows] = np.maximum(fastest[rows], np.abs(velocities).max(axis=1))
        return np.sqrt(square), peak, fastest

    def _quantities(self) -> FloatArray:
        """Return rows of the effort, then of link n-1, joint n and the unit motion, (q, 10, 7)."""
        table = np.zeros((1 + 3 * DERIVATIVES, JET_ORDER + 1))
        table[0] = self.rows[0]
        for order in range(DERIVATIVES):
            # The rows are those of velocities, one derivative above angles.
            table[1 + order] = np.roll(self.rows[1], order - 1)
            table[1 + DERIVATIVES + order] = np.roll(self.rows[2], order - 1)
            table[1 + 2 * DERIVATIVES + order, order] = 1.0
        return table * self.rates[:, None]

    def _joints(self, rows: IntArray, unit: FloatArray) -> tuple[FloatArray, ...]:
        """Return positions, velocities and accelerations of all joints, (q, m, n) each."""
        starts, distances = self.starts[rows, None], self.distances[rows, None]
        middle = starts + 0.5 * distances
        motions = []
        for order in range(DERIVATIVES):
            inner, last, value = unit[:, order::DERIVATIVES].swapaxes(0, 1)[..., None]
            offset = middle if order == 0 else np.zeros_like(middle)
            link = distances[..., :1] * inner + offset[..., :1]
            others = distances[..., 1:] * value + offset[..., 1:]
            driven = link - others.sum(axis=2, keepdims=True)
            motions.append(np.concatenate([others, driven, distances[..., :1] * last], axis=2))
        return tuple(motions)
