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

"""What the sensors of a simulated arm show of its true motion."""

from dataclasses import dataclass
from math import isfinite

from flat_planner_ros.core.arm import InvalidModel
from flat_planner_ros.core.plant.simulation import ArmState
import numpy as np

FINEST = 1e-12
"""Finest step of an encoder; below, the number of steps in an angle means nothing [rad]."""


@dataclass(frozen=True, kw_only=True)
class Sensing:
    """
    Imperfections of the position sensors.

    Attributes
    ----------
    position_std
        Standard deviation of the white noise on every joint angle [rad].
    seed
        Where its random numbers start; the same seed gives the same noise.
    resolution
        Step of the encoders [rad], 0 for ideal ones.

    """

    position_std: float = 0.0
    seed: int = 0
    resolution: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what no sensor does."""
        for name in ('position_std', 'resolution'):
            value = getattr(self, name)
            if not (isfinite(value) and value >= 0.0):
                raise InvalidModel(f'{name} must be finite and at least 0 rad, got {value}')
        if 0.0 < self.resolution < FINEST:
            raise InvalidModel(
                f'resolution must be 0 or at least {FINEST:g} rad, got {self.resolution} rad'
            )
        if self.seed < 0:
            raise InvalidModel(f'seed must be at least 0, got {self.seed}')


class Sensor:
    """
    The sensors of an arm, one sample after the other.

    Noise comes first, then the encoder rounds. Velocities and efforts are the true ones: a model
    of how a driver would differentiate the positions is not part of it.

    Parameters
    ----------
    sensing
        Their imperfections.

    """

    def __init__(self, sensing: Sensing) -> None:
        """Start the noise."""
        self._sensing = sensing
        self._random = np.random.default_rng(sensing.seed)

    def measure(self, state: ArmState) -> ArmState:
        """Return a state as it is measured."""
        position = state.position
        if self._sensing.position_std:
            noise = self._random.standard_normal(position.size)
            position = position + self._sensing.position_std * noise
        if self._sensing.resolution:
            position = self._sensing.resolution * np.round(position / self._sensing.resolution)
        return state._replace(position=position)
