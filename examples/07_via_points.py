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
Via points: one law of least cost through all of them, without stopping at any.

A via point fixes the flat outputs: the absolute angle of the last link, and the angles of the
joints before the last motor. Where the times are left open, the cheapest ones are found: those at
which the integral that the strategy minimises is least.
"""

from math import pi
from pathlib import Path
import sys

from flat_planner_ros.core import (
    MotionRequest,
    plan,
    PlanarArm,
    PlanningOptions,
    Strategy,
    ViaPoint,
    with_via_times,
)
from matplotlib import pyplot as plt
import numpy as np

arm = PlanarArm.reduced(
    inertia_star=(2.525e-2, 1.1e-3),
    tip_mass=1.05315,
    link_length=[0.25],
    link_com=[0.212],
    link_mass=[0.501],
    link_inertia=[2.6e-3],
    stiffness=0.25,
    damping=3.3e-4,
)
options = PlanningOptions(strategy=Strategy.MIN_CONTROL_EFFORT, effort_weight=1.55)
points = [(0.8, 0.6), (1.2, -0.2), (2.4, 0.5)]  # last link's angle, joint 1 [rad]
evenly = MotionRequest(
    start=(0.0, 0.0, 0.0),
    final=(1.0, pi / 2, 0.0),
    duration=3.0,
    via=tuple(
        ViaPoint(time=0.75 * (index + 1), values=values) for index, values in enumerate(points)
    ),
)
cheapest = with_via_times(evenly, arm, options)
motions = {'even times': plan(evenly, arm, options), 'best times': plan(cheapest, arm, options)}

figure, axes = plt.subplots(2, 1, sharex=True, figsize=(7.0, 6.0))
for (name, motion), color in zip(motions.items(), ('C1', 'C0'), strict=True):
    samples = motion.sample(0.005)
    passed = [point.time for point in motion.request.via]
    for axis, output, index in zip(axes, samples.flat[:, 0], (0, 1), strict=True):
        axis.plot(samples.times, output, color=color, label=name)
        axis.plot(passed, [values[index] for values in points], 'o', color=color)
    relative = motion.cost_value / motions['even times'].cost_value
    print(f'{name}: at {np.round(passed, 3)} s, cost {relative:.3f}')
axes[0].set_ylabel('last link, $y_1$ [rad]')
axes[1].set_ylabel('joint 1, $y_2$ [rad]')
axes[1].set_xlabel('time [s]')
axes[0].legend(frameon=False)
for axis in axes:
    axis.grid(alpha=0.3)
figure.tight_layout()
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).with_suffix('.png'), dpi=100)
