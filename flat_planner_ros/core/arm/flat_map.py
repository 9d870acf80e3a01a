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
Flat map of an arm: every joint motion and effort from one planned function of time.

The last two rows of the equations of motion are constant, so deflection and effort are fixed
linear combinations of the derivatives of one *planned variable* w (docs/derivation.md, section 3).
A map is nothing but these combinations; this module is the only home of ratios such as
I_n (I_{n-1} - I_n) / k.
"""

from dataclasses import dataclass
from enum import Enum

from flat_planner_ros.core.arm.arrays import FloatArray, locked
from flat_planner_ros.core.arm.planar_arm import PlanarArm
import numpy as np


class FlatModel(Enum):
    """How the damping of the passive joint enters the flat map."""

    APPROXIMATE = 'approximate'
    """The paper's first-order Taylor expansion of the damping term: w = y1."""

    EXACT = 'exact'
    """No approximation: y1 = w + (c_n / k_n) dw/dt, which solves the damped spring's equation."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FlatMap:
    """
    Linear map from the derivatives of the planned variable w to the last two joints.

    Each attribute is a row of coefficients: entry k multiplies the k-th derivative of w.

    Attributes
    ----------
    output
        Row of the flat output y1, the absolute angle of the last link, shape (i,) [s^k].
    deflection
        Row of the passive joint's angle q_n, shape (j,) [s^k].
    effort
        Row of the effort of joint n-1, shape (m,) [N m s^k / rad].

    """

    output: FloatArray
    deflection: FloatArray
    effort: FloatArray

    def __post_init__(self) -> None:
        """Lock the rows."""
        for row in (self.output, self.deflection, self.effort):
            locked(row)

    @property
    def relaxation(self) -> float:
        """Time constant c_n / k_n of y1 = w + relaxation w'; 0 for the map with y1 = w [s]."""
        return float(self.output[1]) if len(self.output) > 1 else 0.0


def flat_map(arm: PlanarArm, model: FlatModel = FlatModel.EXACT) -> FlatMap:
    """
    Return the flat map of an arm.

    Parameters
    ----------
    arm
        An arm that meets the flatness condition.
    model
        Treatment of the damping of the passive joint.

    Raises
    ------
    NotFlat
        A centre of mass of the last two links is off its joint axis.

    References
    ----------
    Equations (11) to (13) and (15a), (15b) of docs/derivation.md; `eq:qn` and `eq:tau` of the
    paper.

    """
    inner, last = arm.inertia_star
    k, relaxation = arm.stiffness, arm.damping / arm.stiffness
    compliance = last / k
    coupling = (inner - last) * compliance
    if model is FlatModel.EXACT:
        return FlatMap(
            output=np.array([1.0, relaxation]),
            deflection=np.array([0.0, 0.0, -compliance]),
            effort=np.array([0.0, 0.0, inner, inner * relaxation, coupling]),
        )
    return FlatMap(
        output=np.array([1.0]),
        deflection=np.array([0.0, 0.0, -compliance, compliance * relaxation]),
        effort=np.array([0.0, 0.0, inner, 0.0, coupling, -coupling * relaxation]),
    )


def apply_row(row: FloatArray, jet: FloatArray, order: int = 0) -> FloatArray:
    """
    Return a derivative of the quantity that a row describes.

    Parameters
    ----------
    row
        Coefficients over the derivatives of w, shape (m,).
    jet
        w and its derivatives, shape (orders, samples) with orders >= m + order.
    order
        Derivative of the quantity wanted.

    """
    result: FloatArray = row @ jet[order : order + len(row)]
    return result
