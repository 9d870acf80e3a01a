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
A servo in place of a motor: the same arm has another resonance.

Most arms take positions. Their joint n-1 does not give way to the spring, which therefore swings
at another frequency, and a motion that is insensitive for a torque is not for a servo: tell the
planner the drive. Torques and servos are both simulated here, on springs of any stiffness.
"""

from math import pi
from pathlib import Path
import sys

from flat_planner_ros.core import (
    Drive,
    DriveSettings,
    EffortProfile,
    MotionRequest,
    plan,
    PlanarArm,
    PlanningOptions,
    residual_of_plan,
    rollout,
    Strategy,
)
from matplotlib import pyplot as plt
import numpy as np

arm = PlanarArm.reduced(inertia_star=(6.4e-4, 2.5e-4), stiffness=2.3e-2, damping=2e-5)
request = MotionRequest(start=(0.0, 0.0), final=(pi, 0.0), duration=1.2)
motions = {
    drive: plan(request, arm, PlanningOptions(strategy=Strategy.INSENSITIVE, drive=drive))
    for drive in Drive
}
worst = {drive: residual_of_plan(motion).worst for drive, motion in motions.items()}


def left(motion, true_arm, drive):
    """Return the oscillation that a motion leaves on an arm."""
    samples = motion.sample(0.005)
    command = EffortProfile(
        start=0.0,
        times=samples.times,
        efforts=samples.efforts[:, :-1],
        positions=samples.positions[:, :-1],
        velocities=samples.velocities[:, :-1],
    )
    played = rollout(true_arm, command, until=1.8, step=2e-3, drives=DriveSettings(drive=drive))
    return np.abs(played.positions[played.times >= motion.duration, 1]).max()


figure, axis = plt.subplots(figsize=(7.0, 4.5))
factors = np.linspace(0.8, 1.2, 9)
arms = [arm.scaled(stiffness=factor) for factor in factors]
cases = {
    'planned for a torque, under a torque': (Drive.EFFORT, Drive.EFFORT),
    'planned for a torque, under a servo': (Drive.EFFORT, Drive.POSITION),
    'planned for a servo, under a servo': (Drive.POSITION, Drive.POSITION),
}
found = {}
for name, (planned_for, played_by) in cases.items():
    found[name] = np.array([left(motions[planned_for], true, played_by) for true in arms])
    axis.plot(factors, found[name], label=name)
    inside = found[name][(factors > 0.899) & (factors < 1.101)].max()
    print(f'{name:37}: {worst[planned_for]:.4f} rad predicted, {inside:.4f} left')

axis.axvspan(0.9, 1.1, color='gray', alpha=0.2, label='planned for')
axis.set_xlabel('true stiffness over that of the model [-]')
axis.set_ylabel('oscillation left [rad]')
axis.legend(frameon=False)
axis.grid(alpha=0.3)
figure.tight_layout()
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).with_suffix('.png'), dpi=100)
