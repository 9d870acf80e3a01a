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
Exact versus approximate: what the paper's treatment of damping leaves behind.

With a damper the paper approximates the torque to first order in it. The error grows with the
damping, and the motor's joint drifts afterwards. The exact flat model, the default, has neither:
what it leaves is the roundoff and the sampling of the command.
"""

from math import pi
from pathlib import Path
import sys

from flat_planner_ros.core import (
    EffortProfile,
    FlatModel,
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
factors = np.array([0.1, 0.3, 1.0, 3.0, 10.0])

figure, axis = plt.subplots(figsize=(7.0, 4.5))
left = {model: [] for model in FlatModel}
for model in FlatModel:
    for factor in factors:
        damped = arm.scaled(damping=factor)
        samples = plan(request, damped, PlanningOptions(flat_model=model)).sample(0.005)
        command = EffortProfile(start=0.0, times=samples.times, efforts=samples.efforts[:, :-1])
        played = rollout(damped, command, until=2.0)
        after = played.times >= request.duration
        left[model].append(np.abs(played.positions[after, 1]).max())
    ratios = [arm.scaled(damping=factor).natural_mode().damping_ratio for factor in factors]
    axis.loglog(ratios, left[model], marker='o', label=model.value)
    print(model.value, ' '.join(f'{value:.1e}' for value in left[model]), 'rad')

axis.set_xlabel('damping ratio of the spring [-]')
axis.set_ylabel('largest deflection after the motion [rad]')
axis.legend(title='flat model', frameon=False)
axis.grid(alpha=0.3)
figure.tight_layout()
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).with_suffix('.png'), dpi=100)
