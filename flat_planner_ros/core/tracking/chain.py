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
Chains of integrators that feedback acts on: the last two links, and each joint before them.

The last two rows of the equations of motion are constant in any pose and for any number of joints
(docs/derivation.md, section 3), and computed torque makes each joint before them a double
integrator. Both are a chain: the input is a fixed combination of one flat output's derivatives.
"""

from dataclasses import dataclass
from functools import cached_property

from flat_planner_ros.core.arm import flat_map, FloatArray, locked, PlanarArm
import numpy as np


@dataclass(frozen=True, kw_only=True, eq=False)
class Chain:
    """
    A linear system whose input and joint angles are combinations of a flat output's derivatives.

    Its state x holds the measured angles and then their rates; it obeys x' = A x + b u.

    Attributes
    ----------
    input_row
        Input u over the derivatives 0 to m of the flat output, shape (m + 1,).
    angle_rows
        Measured angles over the derivatives 0 to m - 1, shape (m / 2, m) [s^k].

    """

    input_row: FloatArray
    angle_rows: FloatArray

    def __post_init__(self) -> None:
        """Lock the rows."""
        for row in (self.input_row, self.angle_rows):
            locked(row)

    @property
    def order(self) -> int:
        """Return the number m of states."""
        return self.input_row.size - 1

    @property
    def angles(self) -> int:
        """Return the number m / 2 of measured angles."""
        return len(self.angle_rows)

    @cached_property
    def coordinates(self) -> FloatArray:
        """State over the derivatives 0 to m - 1 of the flat output, shape (m, m)."""
        return np.vstack([self.angle_rows, np.roll(self.angle_rows, 1, axis=1)])

    @cached_property
    def dynamics(self) -> FloatArray:
        """Return A, shape (m, m)."""
        companion = np.eye(self.order, k=1)
        companion[-1] = -self.input_row[:-1] / self.input_row[-1]
        dynamics: FloatArray = self.coordinates @ companion @ np.linalg.inv(self.coordinates)
        return dynamics

    @cached_property
    def input_effect(self) -> FloatArray:
        """Return b, shape (m,)."""
        effect: FloatArray = self.coordinates[:, -1] / self.input_row[-1]
        return effect

    @cached_property
    def disturbed(self) -> FloatArray:
        """Dynamics of (x, d, u) where a disturbance d is added to the input, (m + 2, m + 2)."""
        m = self.order
        matrix = np.zeros((m + 2, m + 2))
        matrix[:m, :m] = self.dynamics
        matrix[:m, m:] = self.input_effect[:, None]
        return matrix

    def over(self, time: float) -> tuple[FloatArray, FloatArray]:
        """Return what (x, d) and a constant input make after a time [s], (m+1, m+1), (m+1,)."""
        from scipy.linalg import expm  # here: slow to import

        whole = expm(self.disturbed * time)
        return whole[:-1, :-1], whole[:-1, -1]

    def jet(self, state: FloatArray, orders: int, inputs: tuple[float, ...] = ()) -> FloatArray:
        """
        Return the first derivatives of the flat output, shape (orders,).

        Parameters
        ----------
        state
            Shape (m,).
        orders
            How many.
        inputs
            The input and its derivatives, zero from where they end.

        """
        jet = np.zeros(max(orders, self.order))
        jet[: self.order] = np.linalg.solve(self.coordinates, state)
        for k in range(self.order, orders):
            entry = inputs[k - self.order] if k - self.order < len(inputs) else 0.0
            known = self.input_row[:-1] @ jet[k - self.order : k]
            jet[k] = (entry - known) / self.input_row[-1]
        return jet[:orders]


def last_links(arm: PlanarArm, *, held: bool = False) -> Chain:
    """
    Return the chain of theta_(n-1), the absolute angle of link n-1, and q_n.

    Parameters
    ----------
    arm
        A flat arm.
    held
        Whether a stiff position servo moves joint n-1: the input is then the acceleration of link
        n-1 [rad/s^2], otherwise the effort of joint n-1 [N m].

    Raises
    ------
    NotFlat
        The last two links are not balanced.

    """
    rows = flat_map(arm)
    angles = np.zeros((2, 4))
    angles[1, : rows.deflection.size] = rows.deflection
    angles[0, : rows.output.size] = rows.output
    angles[0] -= angles[1]
    row = np.append([0.0, 0.0], angles[0, :3]) if held else rows.effort.copy()
    return Chain(input_row=row, angle_rows=angles)


def linearised_joint(inertia: float = 1.0) -> Chain:
    """Return the chain of a joint under computed torque, for an inertia off by a factor [-]."""
    return Chain(input_row=np.array([0.0, 0.0, inertia]), angle_rows=np.array([[1.0, 0.0]]))
