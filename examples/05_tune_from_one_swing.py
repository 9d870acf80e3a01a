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
Tune from one swing: the oscillation after a bad motion tells the true stiffness and damping.

The true arm is 15 % stiffer and has 40 % more damping than the model. The first motion leaves it
swinging; two seconds of its encoders, noise included, are enough to correct the model, and the
second motion leaves next to nothing.
"""

from dataclasses import replace
from math import pi
from pathlib import Path
import sys

from flat_planner_ros.core import (
    EffortProfile,
    fit_oscillation,
    identify,
    MotionRequest,
    plan,
    PlanarArm,
    PlanningOptions,
    rollout,
)
from matplotlib import pyplot as plt
import numpy as np

model = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
truth = model.scaled(stiffness=1.15, damping=1.4)
request = MotionRequest(start=(0.0, 0.0), final=(pi, 0.0), duration=1.0)
noise = np.random.default_rng(1)


def swing(believed):
    """Return times and joint angles after a motion that was planned with a model."""
    samples = plan(request, believed, PlanningOptions()).sample(0.005)
    command = EffortProfile(start=0.0, times=samples.times, efforts=samples.efforts[:, :-1])
    played = rollout(truth, command, until=3.0)
    seen = np.flatnonzero(played.times >= request.duration)[::5]
    angles = played.positions[seen]
    return played.times[seen], angles + noise.normal(0.0, 1e-4, angles.shape)


times, before = swing(model)
fit = fit_oscillation(times, before[:, 1], request.duration)
estimate = identify(times - request.duration, before, fit, model)
print(f'trustworthy: {estimate.is_trustworthy}, joint 1 was {estimate.case.value}')
print(f'stiffness {estimate.stiffness:.3e} N m/rad, truly {truth.stiffness:.3e}')
print(f'damping   {estimate.damping:.3e} N m s/rad, truly {truth.damping:.3e}')

tuned = replace(model, stiffness=estimate.stiffness, damping=estimate.damping)
_, after = swing(tuned)
amplitudes = [fit_oscillation(times, y[:, 1], request.duration).amplitude for y in (before, after)]
print(f'left behind: {amplitudes[0]:.1e} rad, then {amplitudes[1]:.1e} rad')

figure, axis = plt.subplots(figsize=(7.0, 4.0))
axis.plot(times, before[:, 1], label='first motion')
axis.plot(times, after[:, 1], label='second motion, with the model corrected')
axis.set_xlabel('time [s]')
axis.set_ylabel('angle of the spring [rad]')
axis.legend(frameon=False)
axis.grid(alpha=0.3)
figure.tight_layout()
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).with_suffix('.png'), dpi=100)
