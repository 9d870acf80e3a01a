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
Insensitive planning: little is left on any arm within an uncertainty.

Stiffness is never known exactly. The strategy `insensitive` takes the range it may lie in and
keeps the largest residual over that range small, within a torque of one's choice. What is left
follows from one integral over the torque, so that no simulation is needed to know it.
"""

from math import pi
from pathlib import Path
import sys

from flat_planner_ros.core import (
    Insensitivity,
    MotionRequest,
    plan,
    PlanarArm,
    PlanningOptions,
    predict_residual,
    residual_of_plan,
    Strategy,
    UncertaintyBox,
)
from matplotlib import pyplot as plt
import numpy as np

arm = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
request = MotionRequest(start=(0.0, 0.0), final=(pi, 0.0), duration=1.0)
box = UncertaintyBox(stiffness=0.1, damping=0.5)
least = plan(
    request,
    arm,
    PlanningOptions(strategy=Strategy.MIN_CONTROL_EFFORT, insensitivity=Insensitivity(box=box)),
)
insensitive = plan(
    request,
    arm,
    PlanningOptions(
        strategy=Strategy.INSENSITIVE,
        insensitivity=Insensitivity(box=box, max_effort_rms=1.3 * least.rms_effort[0]),
    ),
)

figure, axis = plt.subplots(figsize=(7.0, 4.5))
factors = np.linspace(0.8, 1.2, 81)
nothing = UncertaintyBox(stiffness=0.0, damping=0.0)
worst = {}
for motion in (least, insensitive):
    name = motion.options.strategy.value
    torque = motion.sample(0.001).driving_effort
    left = [
        predict_residual(arm.scaled(stiffness=factor), torque, motion.duration, nothing).nominal
        for factor in factors
    ]
    worst[name] = residual_of_plan(motion).worst
    axis.plot(factors, left, label=f'{name}, {1e3 * motion.rms_effort[0]:.1f} mN m')
    print(f'{name:20} RMS {1e3 * motion.rms_effort[0]:.2f} mN m, worst {worst[name]:.1e} rad')

axis.axvspan(0.9, 1.1, color='gray', alpha=0.2, label='planned for')
axis.set_xlabel('true stiffness over that of the model [-]')
axis.set_ylabel('oscillation left [rad]')
axis.legend(frameon=False)
axis.grid(alpha=0.3)
figure.tight_layout()
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).with_suffix('.png'), dpi=100)
