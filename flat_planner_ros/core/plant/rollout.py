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

"""Motion of an arm under one command, at every step."""

from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray, PlanarArm
from flat_planner_ros.core.plant.effort_profile import EffortProfile
from flat_planner_ros.core.plant.simulation import SimulatedArm
import numpy as np
import numpy.typing as npt


class Rollout(NamedTuple):
    """
    States on a time grid.

    Attributes
    ----------
    times
        Shape (m,) [s].
    positions, velocities
        Shape (m, n) [rad], [rad/s].

    """

    times: FloatArray
    positions: FloatArray
    velocities: FloatArray


def rollout(
    arm: PlanarArm,
    profile: EffortProfile,
    until: float,
    *,
    step: float = 1e-3,
    position: npt.ArrayLike | None = None,
    saturation: npt.ArrayLike | None = None,
    feedback_p: npt.ArrayLike | None = None,
    feedback_d: npt.ArrayLike | None = None,
) -> Rollout:
    """
    Return the motion of an arm, at rest when the profile starts, at every step.

    Parameters
    ----------
    arm, profile
        What is moved and by what.
    until
        Absolute time of the end [s].
    step, position, saturation, feedback_p, feedback_d
        As in SimulatedArm.

    """
    simulated = SimulatedArm(
        arm,
        position=position,
        time=profile.start,
        step=step,
        saturation=saturation,
        feedback_p=feedback_p,
        feedback_d=feedback_d,
    )
    simulated.command(profile, profile.start)
    times, positions, velocities = [simulated.time], [simulated.position], [simulated.velocity]
    while simulated.advance(min(until, simulated.time + step)):
        times.append(simulated.time)
        positions.append(simulated.position)
        velocities.append(simulated.velocity)
    return Rollout(np.array(times), np.array(positions), np.array(velocities))
