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

"""Many arms of as many joints side by side: the same equations of motion, row by row."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from flat_planner_ros.core.arm.arrays import FloatArray, locked
from flat_planner_ros.core.arm.dynamics import ArmDynamics, ROUNDING
from flat_planner_ros.core.arm.planar_arm import free_oscillation, PlanarArm
import numpy as np


@dataclass(frozen=True, kw_only=True, eq=False)
class ArmStack(ArmDynamics):
    """
    The constants of m arms of n joints; angles, rates and efforts have m rows.

    Attributes
    ----------
    inertia, static_moment, viscous_friction, coulomb_friction
        As those of `PlanarArm`, with an axis of length m in front.
    stiffness, damping, gravity
        Shape (m,).

    """

    inertia: FloatArray
    static_moment: FloatArray
    stiffness: FloatArray  # type: ignore[assignment]  # one number per arm
    damping: FloatArray  # type: ignore[assignment]
    gravity: FloatArray  # type: ignore[assignment]
    viscous_friction: FloatArray
    coulomb_friction: FloatArray

    def __post_init__(self) -> None:
        """Lock the arrays."""
        for name in self.__dataclass_fields__:
            locked(getattr(self, name))

    @classmethod
    def of(cls, arms: Sequence[PlanarArm]) -> 'ArmStack':
        """Return arms of as many joints as a stack."""
        return cls(
            **{
                name: np.array([getattr(arm, name) for arm in arms], dtype=float)
                for name in cls.__dataclass_fields__
            }
        )

    def __len__(self) -> int:
        """Return the number m of arms."""
        return len(self.stiffness)

    def rows(self, places: 'np.typing.NDArray[np.intp] | slice') -> 'ArmStack':
        """Return some of the arms."""
        return ArmStack(
            **{name: getattr(self, name)[places] for name in self.__dataclass_fields__}
        )

    @property
    def n(self) -> int:
        """Return the number of joints."""
        return int(self.static_moment.shape[-1])

    @property
    def is_linear(self) -> bool:
        """Tell whether no arm has coupled links, weight or Coulomb friction."""
        return not (self._is_coupled or self.has_weight or self.coulomb_friction.any())

    @cached_property
    def has_weight(self) -> bool:
        """Whether gravity moves any of the arms."""
        return bool(self._static_load.any())

    def swing(self, positions: FloatArray, velocities: FloatArray, *, held: bool) -> FloatArray:
        """
        Return the amplitude with which each passive joint of flat arms swings freely from now on.

        Parameters
        ----------
        positions, velocities
            Of all joints, shape (m, n) [rad], [rad/s].
        held
            Whether the actuated joints are held; otherwise joint n-1 is free.

        Returns
        -------
        FloatArray
            Shape (m,) [rad]; NaN for an arm that does not oscillate.

        """
        last = self.inertia[:, -1, -1]
        both = self.inertia[:, -2, -2] + last
        frequency, ratio = free_oscillation(both, last, self.stiffness, self.damping, held=held)
        damped = frequency * np.sqrt(np.where(ratio < 1.0, 1.0 - ratio**2, np.nan))
        angle, rate = positions[:, -1], velocities[:, -1]
        amplitude: FloatArray = np.hypot(angle, (rate + ratio * frequency * angle) / damped)
        return amplitude

    @cached_property
    def _is_coupled(self) -> bool:
        """Whether a link of any arm is coupled to another."""
        own = np.sqrt(np.diagonal(self.inertia, axis1=-2, axis2=-1))
        coupling = np.triu(np.abs(self.inertia), k=1)
        return bool((coupling > ROUNDING * own[:, :, None] * own[:, None, :]).any())

    @cached_property
    def _inverse_mass(self) -> FloatArray | None:
        """Return that there is no one matrix for all arms."""
        return None

    @cached_property
    def _static_load(self) -> FloatArray:
        """Effort that holds each link when it points along x, shape (m, n) [N m]."""
        return self.gravity[:, None] * self.static_moment
