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
Your own cost: any weights on the products of the law's first six derivatives.

A cost is a symmetric matrix Q with Q66 = 1; entry (i, j) weights the product of the i-th and the
j-th derivative of the planned variable. The optimal law is computed exactly for any of them. Here
the velocity is weighted more and more, which makes the motion one of nearly constant speed.
"""

from math import pi
from pathlib import Path
import sys

from flat_planner_ros.core import MotionRequest, plan, PlanarArm, PlanningOptions, Strategy
from matplotlib import pyplot as plt
import numpy as np

arm = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
request = MotionRequest(start=(0.0, 0.0), final=(pi, 0.0), duration=1.0)

figure, (speed, torque) = plt.subplots(2, 1, sharex=True, figsize=(7.0, 5.5))
peaks = []
for rate in (0.0, 12.0, 17.0, 24.0):  # weight of the velocity, as an angular frequency [1/s]
    weights = np.diag([rate**10, 0.0, 0.0, 0.0, 0.0, 1.0])
    motion = plan(request, arm, PlanningOptions(strategy=Strategy.CUSTOM, custom=weights))
    samples = motion.sample(0.002)
    peaks.append(np.abs(samples.flat[0, 1]).max())
    print(
        f'{rate:4.0f} 1/s: largest velocity {peaks[-1]:.2f} rad/s, '
        f'largest torque {1e3 * motion.peak_effort[0]:6.1f} mN m'
    )
    speed.plot(samples.times, samples.flat[0, 1], label=f'$Q_{{11}} = ({rate:g}/s)^{{10}}$')
    torque.plot(samples.times, 1e3 * samples.driving_effort)

speed.set_ylabel('last link [rad/s]')
speed.legend(frameon=False)
torque.set_ylabel('torque [mN m]')
torque.set_xlabel('time [s]')
for axis in (speed, torque):
    axis.grid(alpha=0.3)
figure.tight_layout()
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).with_suffix('.png'), dpi=100)
