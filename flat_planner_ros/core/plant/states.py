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

"""States of a simulated arm: one, and those of some steps as tables."""

from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray, PlanarArm
import numpy as np


class ArmState(NamedTuple):
    """
    Motion of an arm at one time.

    Attributes
    ----------
    time
        Simulated time [s].
    position, velocity, effort
        Joint angles [rad], velocities [rad/s], efforts with the spring's [N m], shape (n,).

    """

    time: float
    position: FloatArray
    velocity: FloatArray
    effort: FloatArray


class PassedStates(NamedTuple):
    """
    What an arm has done in some steps.

    Attributes
    ----------
    arm
        The arm.
    positions, velocities, efforts
        At the start and after each step, shape (m + 1, n) and, of the motors, (m + 1, n-1).

    """

    arm: PlanarArm
    positions: FloatArray
    velocities: FloatArray
    efforts: FloatArray

    def state(self, time: float, row: int) -> ArmState:
        """Return the state after some steps, at an absolute time [s]."""
        q, dq = self.positions[row], self.velocities[row]
        effort = np.empty(len(q))
        effort[:-1], effort[-1] = self.efforts[row], self.arm.passive_effort(q[-1], dq[-1])
        return ArmState(time, q, dq, effort)
