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
Four joints and gravity: the shortest motion within limits, in a vertical plane.

The motors carry the arm's weight while they move it, and keep carrying it afterwards; small
position gains hold the joints that would fall at the slightest error. The passive joint and the
motor before it stay without feedback: both last links are balanced, so gravity leaves them alone.
"""

from pathlib import Path
import sys

from flat_planner_ros.core import (
    DriveSettings,
    EffortProfile,
    JointLimits,
    MotionRequest,
    plan,
    PlanarArm,
    PlanningOptions,
    rollout,
    shortest_plan,
    Strategy,
)
from matplotlib import pyplot as plt
import numpy as np

LENGTHS = [0.30, 0.25, 0.25, 0.20]
arm = PlanarArm.from_links(
    link_length=LENGTHS,
    link_com=[0.256, 0.211, 0.173, 0.100],
    link_mass=[0.846, 0.655, 0.155, 0.060],
    link_inertia=[6.14e-3, 3.47e-3, 1.08e-3, 2.0e-4],
    counterbalance_mass=[0.71815, 0.12],
    counterbalance_arm=[0.10, 0.05],
    stiffness=0.25,
    damping=3.3e-4,
    gravity=9.81,
)
limits = JointLimits.of(
    4,
    velocity=np.array([3.0, 3.0, 6.0, np.inf]),
    effort=np.array([20.0, 8.0, 0.5, np.inf]),
)
request = MotionRequest(start=(0.4, 0.5, -0.3, 0.0), final=(1.6, -0.6, 0.8, 0.0), duration=1.0)
options = PlanningOptions(strategy=Strategy.MIN_CONTROL_EFFORT, effort_weight=1.55)
motion = shortest_plan(
    lambda duration: plan(request.stretched(duration), arm, options),
    limits,
    shortest=0.2,
    longest=5.0,
)
samples = motion.sample(0.005)
command = EffortProfile(
    start=0.0,
    times=samples.times,
    efforts=samples.efforts[:, :-1],
    positions=samples.positions[:, :-1],
    velocities=samples.velocities[:, :-1],
)
played = rollout(
    arm,
    command,
    until=motion.duration + 1.0,
    position=request.start,
    drives=DriveSettings(feedback_p=(50.0, 50.0, 0.0), feedback_d=(5.0, 5.0, 0.0)),
)
use = limits.worst(motion)
left = np.abs(played.positions[played.times >= motion.duration] - motion.request.final).max()
print(f'shortest motion: {motion.duration:.3f} s; at its bound: {use.quantity.value}')
print(f'largest deviation after it: {left:.1e} rad')

figure, (pose, effort) = plt.subplots(1, 2, figsize=(9.0, 4.5))
for angles in samples.positions[:: len(samples.times) // 12]:
    links = np.cumsum(LENGTHS * np.exp(1j * np.cumsum(angles)))
    pose.plot(*np.c_[[0, 0], [links.real, links.imag]], color='C0', marker='.', alpha=0.5)
pose.set_aspect('equal')
pose.set_xlabel('x [m]')
pose.set_ylabel('y, upwards [m]')
effort.plot(samples.times, samples.efforts[:, :-1], label=['joint 1', 'joint 2', 'joint 3'])
effort.set_xlabel('time [s]')
effort.set_ylabel('torque [N m]')
effort.legend(frameon=False)
for axis in (pose, effort):
    axis.grid(alpha=0.3)
figure.tight_layout()
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).with_suffix('.png'), dpi=100)
