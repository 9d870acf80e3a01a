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
First motion: plan half a turn of the paper's arm in one second, and play it in simulation.

The arm has one motor; its second joint is a spring with a damper. The planned torque turns the arm
and leaves the spring relaxed at the end. The simulation integrates the full dynamics and knows
nothing of the plan but the torque.
"""

from math import pi
from pathlib import Path
import sys

from flat_planner_ros.core import (
    EffortProfile,
    MotionRequest,
    plan,
    PlanarArm,
    PlanningOptions,
    rollout,
)
from matplotlib import pyplot as plt
import numpy as np

arm = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
request = MotionRequest(start=(0.0, 0.0), final=(pi, 0.0), duration=1.0)
motion = plan(request, arm, PlanningOptions())

samples = motion.sample(0.005)
command = EffortProfile(start=0.0, times=samples.times, efforts=samples.efforts[:, :-1])
played = rollout(arm, command, until=2.0)

after = played.times >= motion.duration
left = np.abs(played.positions[after] - request.final).max()
print(f'largest torque: {1e3 * motion.peak_effort[0]:.1f} mN m')
print(f'largest deflection of the spring: {np.abs(played.positions[:, 1]).max():.3f} rad')
print(f'largest deviation after the motion: {left:.1e} rad')

figure, (angles, torque) = plt.subplots(2, 1, sharex=True, figsize=(7.0, 5.0))
angles.plot(played.times, played.positions, label=['joint 1, the motor', 'joint 2, the spring'])
angles.set_ylabel('angle [rad]')
angles.legend(frameon=False)
torque.plot(samples.times, 1e3 * samples.efforts[:, 0], color='C0')
torque.set_ylabel('torque of the motor [mN m]')
torque.set_xlabel('time [s]')
for axis in (angles, torque):
    axis.axvline(motion.duration, color='gray', linestyle=':')
    axis.grid(alpha=0.3)
figure.tight_layout()
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).with_suffix('.png'), dpi=100)
