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

"""What is simulated, how it is measured, and what it lets itself be told."""

from dataclasses import dataclass, field
from math import ceil

from flat_planner_ros.core.arm import check_number, InvalidModel, PlanarArm
from flat_planner_ros.core.plant.drives import Drives, DriveSettings
from flat_planner_ros.core.plant.simulation import GRID_TOLERANCE
from flat_planner_ros.core.plant.states import ArmState
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
            check_number(name, getattr(self, name), 'rad', lower=0.0)
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
        self._is_ideal = not (sensing.position_std or sensing.resolution)

    def measure(self, state: ArmState) -> ArmState:
        """Return a state as it is measured."""
        if self._is_ideal:
            return state
        position = state.position
        if self._sensing.position_std:
            noise = self._random.standard_normal(position.size)
            position = position + self._sensing.position_std * noise
        if self._sensing.resolution:
            position = self._sensing.resolution * np.round(position / self._sensing.resolution)
        return state._replace(position=position)


@dataclass(frozen=True, kw_only=True)
class SimulationSettings:
    """
    What is simulated, and how it is sampled.

    Attributes
    ----------
    arm
        The arm as it is.
    position
        Joint angles at rest at the start and after a reset [rad].
    rate
        Samples per second of simulated time [Hz].
    step
        Longest integration step [s]; the step taken divides the time between samples.
    drives
        What the motors are.
    sensing
        Imperfections of the sensors.
    start_tolerance
        Largest distance of a command's present position from the arm's, or from that of the
        command it takes the place of [rad]; infinite for any.
    input_timeout
        Time for which an effort without a command is applied at most [s].

    """

    arm: PlanarArm
    position: tuple[float, ...]
    rate: float = 200.0
    step: float = 1e-3
    drives: DriveSettings = field(default_factory=DriveSettings)
    sensing: Sensing = field(default_factory=Sensing)
    start_tolerance: float = 0.05
    input_timeout: float = 0.1

    def __post_init__(self) -> None:
        """Refuse times without meaning."""
        for name, unit in {'rate': 'Hz', 'step': 's', 'input_timeout': 's'}.items():
            check_number(name, getattr(self, name), unit, above=0.0)
        if not self.start_tolerance >= 0.0:
            raise InvalidModel(
                f'start_tolerance must be at least 0 rad, got {self.start_tolerance}'
            )
        Drives(self.arm, self.drives, self.true_step)

    @property
    def true_step(self) -> float:
        """Return the integration step that is taken [s]."""
        return 1.0 / (self.rate * self.steps_per_sample)

    @property
    def steps_per_sample(self) -> int:
        """Return the number of integration steps from one sample to the next."""
        return max(1, ceil(1.0 / (self.rate * self.step) - GRID_TOLERANCE))
