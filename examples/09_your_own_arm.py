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
Your own arm from CAD data: what keeps it from being flat, and what to add.

CAD programs give each link's length, mass, centre of mass and inertia. The planner needs the last
two links balanced about their joints; an arm as drawn usually is not, and is refused with the
remedy in words. Choose the counterbalances' masses or arms, and the others are computed.
"""

from math import pi
from pathlib import Path
import sys

from flat_planner_ros.core import (
    counterbalances,
    EffortProfile,
    MotionRequest,
    NotFlat,
    plan,
    PlanarArm,
    PlanningOptions,
    rollout,
    Strategy,
    suggest_counterbalances,
)
from matplotlib import pyplot as plt
import numpy as np

shape = {
    'link_length': [0.20, 0.15],  # [m]
    'link_com': [0.11, 0.075],  # from the link's joint [m]
    'link_mass': [0.20, 0.05],  # [kg]
}
rest = {
    'link_inertia': [8.0e-4, 1.0e-4],  # about the centre of mass [kg m^2]
    'stiffness': 0.12,  # [N m/rad]
    'damping': 2e-4,  # [N m s/rad]
}
request = MotionRequest(start=(0.0, 0.0), final=(pi / 2, 0.0), duration=1.0)

as_drawn = PlanarArm.from_links(**shape, **rest)
try:
    plan(request, as_drawn, PlanningOptions())
except NotFlat as error:
    print(f'refused: {error}')
arms = [0.06, 0.04]  # behind the joints [m]
print(suggest_counterbalances(**shape, counterbalance_mass=[0.0, 0.0], counterbalance_arm=arms))

weights = counterbalances(**shape, arm=arms)
print(f'added: {weights.mass[0]:.3f} kg behind joint 1, {weights.mass[1]:.3f} kg behind joint 2')
arm = PlanarArm.from_links(
    **shape, **rest, counterbalance_mass=weights.mass, counterbalance_arm=weights.arm
)
mode = arm.natural_mode()
print(f'I*: {arm.inertia_star.both:.3e}, {arm.inertia_star.last:.3e} kg m^2')
print(f'its spring oscillates at {mode.frequency / (2 * pi):.2f} Hz')

motion = plan(request, arm, PlanningOptions(strategy=Strategy.POLYNOMIAL))
samples = motion.sample(0.005)
command = EffortProfile(start=0.0, times=samples.times, efforts=samples.efforts[:, :-1])
balanced = rollout(arm, command, until=3.0)
unbalanced = rollout(as_drawn, command, until=3.0)
left = np.abs(balanced.positions[balanced.times >= 1.0] - request.final).max()
print(f'largest deviation after the motion: {left:.1e} rad')

figure, axis = plt.subplots(figsize=(7.0, 4.0))
axis.plot(unbalanced.times, unbalanced.positions[:, 1], label='as drawn, the same torque')
axis.plot(balanced.times, balanced.positions[:, 1], label='with counterbalances')
axis.set_xlabel('time [s]')
axis.set_ylabel('angle of the spring [rad]')
axis.legend(frameon=False)
axis.grid(alpha=0.3)
figure.tight_layout()
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).with_suffix('.png'), dpi=100)
