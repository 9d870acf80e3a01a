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

"""The motion of an arm under one command, from rest to an end."""

from math import floor
from typing import Any, NamedTuple

from flat_planner_ros.core.arm import FloatArray, PlanarArm
from flat_planner_ros.core.plant.effort_profile import EffortProfile
from flat_planner_ros.core.plant.simulation import GRID_TOLERANCE, SimulatedArm
import numpy as np


class Rollout(NamedTuple):
    """States on a grid of times (m,) [s]: positions [rad] and velocities [rad/s], shape (m, n)."""

    times: FloatArray
    positions: FloatArray
    velocities: FloatArray


def rollout(
    arm: PlanarArm,
    profile: EffortProfile,
    until: float,
    *,
    step: float = 1e-3,
    **options: Any,
) -> Rollout:
    """
    Return the motion of an arm, at rest when the profile starts, at every step.

    Parameters
    ----------
    arm, profile
        What is moved and by what.
    until
        Absolute time of the end [s].
    step, options
        As in SimulatedArm.

    """
    simulated = SimulatedArm(arm, time=profile.start, step=step, **options)
    simulated.command(profile, profile.start)
    count = floor((until - profile.start) / step + GRID_TOLERANCE)
    grid = profile.start + np.arange(max(0, count) + 1) * step
    states = simulated.advance_through(grid.tolist(), until)
    positions = np.array([state.position for state in states])
    velocities = np.array([state.velocity for state in states])
    return Rollout(np.array([state.time for state in states]), positions, velocities)
