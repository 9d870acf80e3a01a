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
Arms of two joints that are not built as the model has them, many side by side.

The equations of motion are integrated here by Runge and Kutta's fourth order, with no formula of
the package in them.
"""

from collections.abc import Sequence
from typing import NamedTuple

from flat_planner_ros.core.arm import COULOMB_VELOCITY, FloatArray, PlanarArm
import numpy as np

STEP = 5e-4
"""Of the integration [s]."""

BACKLASH = 0.005
"""Deflection to either side before the spring pulls [rad]."""

STIFFENING = 0.05
"""Gain of the stiffness at the largest deflection of the arm as modelled [-]."""

UNBALANCED = 0.02
"""Coupling of both links, relative to the inertia of the last one [-]."""

STICTION, STRIBECK_VELOCITY = 0.5, 0.1
"""Friction at rest above Coulomb's, relative to it [-], and the velocity that ends it [rad/s]."""


class Structure(NamedTuple):
    """What differs from the model: each a size, zero for none."""

    backlash: float = 0.0
    stiffening: float = 0.0
    imbalance: float = 0.0
    stiction: float = 0.0


STRUCTURES = {
    'as modelled': Structure(),
    'backlash of 5 mrad': Structure(backlash=BACKLASH),
    'spring stiffens by 5 %': Structure(stiffening=STIFFENING),
    'imbalance of 2 %': Structure(imbalance=UNBALANCED),
    'friction of Stribeck, + 50 %': Structure(stiction=STICTION),
}
"""By the names of the table; the spring stiffens at the largest deflection."""


class Played(NamedTuple):
    """
    Motions of all arms.

    Attributes
    ----------
    times
        Shape (m,) [s].
    positions
        Joint angles, shape (m, arms, 2) [rad].
    efforts
        Shape (m, arms) [N m].

    """

    times: FloatArray
    positions: FloatArray
    efforts: FloatArray


def play(
    arms: Sequence[PlanarArm],
    commands: Sequence[tuple[FloatArray, FloatArray]],
    structure: Structure,
    until: float,
    rate: float,
) -> Played:
    """
    Return the motions of arms that are built alike.

    Parameters
    ----------
    arms
        With the parameters of the model.
    commands
        Times and efforts of joint 1, linear between, for each arm [s], [N m].
    structure
        In what the arms differ from the model.
    until
        Length of the recording [s].
    rate
        Of the samples [Hz].

    """
    every = round(1.0 / (rate * STEP))
    steps = round(until / STEP) // every * every
    halves = np.arange(2 * steps + 1) * STEP / 2
    efforts = np.column_stack([np.interp(halves, *command, left=0.0) for command in commands])
    deflection = np.zeros(len(arms))
    if structure.stiffening:
        deflection = np.abs(play(arms, commands, Structure(), until, rate).positions[..., 1])
        deflection = deflection.max(axis=0)
    rates_of = _Arms(arms, structure, deflection)
    state = np.zeros((4, len(arms)))
    seen = [state]
    for k in range(steps):
        first, middle, last = efforts[2 * k : 2 * k + 3]
        k1 = rates_of(state, first)
        k2 = rates_of(state + STEP / 2 * k1, middle)
        k3 = rates_of(state + STEP / 2 * k2, middle)
        k4 = rates_of(state + STEP * k3, last)
        state = state + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        if (k + 1) % every == 0:
            seen.append(state)
    inner, outer = np.array(seen)[:, :2].transpose(1, 0, 2)
    positions = np.stack((inner, outer - inner), axis=-1)
    return Played(halves[:: 2 * every], positions, efforts[:: 2 * every])


class _Arms:
    """Both links of all arms: absolute angles and rates (4, arms) to their rates."""

    def __init__(
        self, arms: Sequence[PlanarArm], structure: Structure, deflection: FloatArray
    ) -> None:
        both, self.last = np.array([arm.inertia_star for arm in arms]).T
        self.inner = both - self.last
        self.stiffness = np.array([arm.stiffness for arm in arms])
        self.damping = np.array([arm.damping for arm in arms])
        self.viscous = np.array([arm.viscous_friction[-1] for arm in arms])
        self.coulomb = np.array([arm.coulomb_friction[-1] for arm in arms])
        self.coupling = structure.imbalance * self.last
        self.structure = structure
        self.bend = structure.stiffening / np.maximum(deflection, 1e-9) ** 2

    def __call__(self, state: FloatArray, effort: FloatArray) -> FloatArray:
        """Return the rates."""
        q, rate = state[1] - state[0], state[3] - state[2]
        lost = self.structure.backlash
        pulled = q - np.clip(q, -lost, lost)
        spring = self.stiffness * pulled * (1.0 + self.bend * pulled**2) + self.damping * rate
        slow = np.exp(-((state[2] / STRIBECK_VELOCITY) ** 2))
        dry = self.coulomb * (1.0 + self.structure.stiction * slow)
        friction = self.viscous * state[2] + dry * np.tanh(state[2] / COULOMB_VELOCITY)
        coupled, turned = self.coupling * np.cos(q), self.coupling * np.sin(q)
        on_inner = effort - friction + spring + turned * state[3] ** 2
        on_last = -spring - turned * state[2] ** 2
        determinant = self.inner * self.last - coupled**2
        return np.stack(
            (
                state[2],
                state[3],
                (self.last * on_inner - coupled * on_last) / determinant,
                (self.inner * on_last - coupled * on_inner) / determinant,
            )
        )
