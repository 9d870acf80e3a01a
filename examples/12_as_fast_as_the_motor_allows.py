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
As fast as the motor allows: the shortest motion within a limit on the effort.

Every strategy finds its shortest motion within a limit; `min_peak_effort` alone is made for it. It
comes within 2 % of bang-bang, the least time of all, with an effort that is continuous and zero at
both ends, and leaves no swing. A plan of it proves how much faster any other motion could be.
"""

from math import inf, pi
from pathlib import Path
import sys

from flat_planner_ros.core import (
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

arm = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
request = MotionRequest(start=(0.0, 0.0), final=(pi, 0.0), duration=1.0)
limits = JointLimits.of(2, effort=np.array([0.015, inf]))

figure, (above, below) = plt.subplots(2, sharex=True, figsize=(7.0, 5.5))
motions, left = {}, {}
for strategy in (Strategy.POLYNOMIAL, Strategy.MIN_CONTROL_EFFORT, Strategy.MIN_PEAK_EFFORT):
    options = PlanningOptions(strategy=strategy)
    motion = shortest_plan(
        lambda duration, options=options: plan(request.stretched(duration), arm, options),
        limits,
        shortest=0.1,
        longest=10.0,
    )
    samples = motion.sample(0.005)
    command = EffortProfile(start=0.0, times=samples.times, efforts=samples.efforts[:, :1])
    played = rollout(arm, command, motion.duration + 0.5)
    after = played.times > motion.duration
    motions[strategy] = motion
    left[strategy] = np.abs(played.positions[after, 1]).max()
    print(f'{strategy.value:20} {motion.duration:.4f} s, swing {left[strategy]:.0e} rad')
    above.plot(samples.times, 1e3 * samples.driving_effort, label=strategy.value)
    below.plot(played.times, played.positions.sum(axis=1))

bound = motions[Strategy.MIN_PEAK_EFFORT].least_duration
print(f'no motion whatsoever within the limit takes less than {bound:.4f} s')
for axis in (above, below):
    axis.axvline(bound, color='gray', linestyle=':')
    axis.grid(alpha=0.3)
above.set_ylabel('effort of joint 1 [mN m]')
above.legend(frameon=False, loc='upper right')
below.set_ylabel('angle of the last link [rad]')
below.set_xlabel('time [s]; dotted: proven least time')
figure.tight_layout()
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).with_suffix('.png'), dpi=100)
