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
Choose a strategy: the same motion under four costs, on the model and on a stiffer arm.

Every strategy leaves the model itself at rest. They differ in what they spend on it, and in what
is left on an arm whose spring is not quite the model's: `min_control_effort` and `mixed` take the
least torque, `min_potential_energy` bends the spring least and forgives most.
"""

from math import pi
from pathlib import Path
import sys

from flat_planner_ros.core import (
    EffortProfile,
    fit_oscillation,
    MotionRequest,
    plan,
    PlanarArm,
    PlanningOptions,
    rollout,
    Strategy,
)
from matplotlib import pyplot as plt

arm = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
stiffer = arm.scaled(stiffness=1.1)
request = MotionRequest(start=(0.0, 0.0), final=(pi, 0.0), duration=1.0)
strategies = [
    Strategy.POLYNOMIAL,
    Strategy.MIN_CONTROL_EFFORT,
    Strategy.MIN_POTENTIAL_ENERGY,
    Strategy.MIXED,
]

figure, (torque, swing) = plt.subplots(2, 1, figsize=(7.0, 6.0))
efforts, residuals = {}, {}
print(f'{"strategy":22} RMS torque [mN m]  left on a 10 % stiffer arm [rad]')
for strategy in strategies:
    motion = plan(request, arm, PlanningOptions(strategy=strategy))
    samples = motion.sample(0.005)
    command = EffortProfile(start=0.0, times=samples.times, efforts=samples.efforts[:, :-1])
    played = rollout(stiffer, command, until=3.0)
    after = played.times >= motion.duration
    fit = fit_oscillation(played.times[after], played.positions[after, 1], motion.duration)
    efforts[strategy], residuals[strategy] = 1e3 * motion.rms_effort[0], fit.amplitude
    print(f'{strategy.value:22} {efforts[strategy]:17.2f}  {fit.amplitude:33.3f}')
    torque.plot(samples.times, 1e3 * samples.efforts[:, 0], label=strategy.value)
    swing.plot(played.times[after], played.positions[after, 1])

torque.set_ylabel('torque [mN m]')
torque.legend(frameon=False, fontsize=8)
swing.set_ylabel('spring on the stiffer arm [rad]')
for axis in (torque, swing):
    axis.set_xlabel('time [s]')
    axis.grid(alpha=0.3)
figure.tight_layout()
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).with_suffix('.png'), dpi=100)
