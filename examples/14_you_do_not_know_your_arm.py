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
You do not know your arm: motions that tell its model, small ones first.

The file says inertias, spring and damper 30 % off and nothing of friction. Each motion is the one
that makes the least certain parameter most certain, as far as it is allowed; only after one that
went as predicted may the next be larger. On a real arm the program `excite` does the same.
"""

from math import inf
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
)
from flat_planner_ros.core.excitation import Excitation, ExcitationSettings, Room
from flat_planner_ros.core.model_fit import Measurements
from matplotlib import pyplot as plt
import numpy as np

NOISE = 1e-4  # of the encoders [rad]
believed = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
real = PlanarArm.reduced(
    inertia_star=(8.3e-4, 2.6e-5),
    stiffness=2.3e-3,
    damping=2.6e-5,
    viscous_friction=[2e-4],
    coulomb_friction=[5e-4],
)

limits = JointLimits.of(2, effort=np.array([0.015, inf]))
options = PlanningOptions()
room = Room.within(limits, here=0.0)
settings = ExcitationSettings(accuracy=0.01, noise=NOISE)
excitation = Excitation(believed, options, limits, room, settings)
rng = np.random.default_rng(1)

here = np.zeros(2)
reached, predicted, peaks = [], [], []
figure, (above, below) = plt.subplots(1, 2, figsize=(9.0, 4.0))
begin = 0.0
while not excitation.is_done:
    proposal = excitation.propose(here)
    wanted = proposal.candidate
    request = MotionRequest(start=here, final=wanted.final, duration=wanted.duration)
    samples = plan(request, believed, options).sample(0.005)
    command = EffortProfile(start=0.0, times=samples.times, efforts=samples.efforts[:, :1])
    played = rollout(real, command, wanted.duration + excitation.record_time, position=here)
    times, angles = played.times[::5], played.positions[::5]
    efforts = np.array([command.effort(time) for time in times])
    shown = angles + rng.normal(0.0, NOISE, angles.shape)
    heard = excitation.hear(Measurements(times=times, positions=shown, efforts=efforts))
    here = np.array([angles[-1, 0], 0.0])  # the swing is waited out
    reached.append(heard.reached[:6])
    predicted.append(proposal.after[:6])
    peaks.append(np.abs(efforts).max())
    above.plot(begin + times, angles[:, 0], color='tab:blue')
    above.plot(begin + times, angles[:, 1], '--', color='tab:orange')
    begin += times[-1]
    print(
        f'{wanted.final[0]:6.2f} rad in {wanted.duration:.2f} s for {proposal.sought:18}: '
        f'errors up to {100 * predicted[-1].max():.2g} % predicted, '
        f'{100 * reached[-1].max():.2g} % reached'
    )

found = excitation.estimate
for name in ('stiffness', 'damping'):
    print(f'{name}: {getattr(found, name):.3g}, in truth {getattr(real, name):.3g}')

above.set(xlabel='time, without the waiting [s]', ylabel='angle [rad]')
above.legend(above.lines[:2], ['joint 1', 'passive joint'], frameon=False)
numbers = np.arange(1, len(reached) + 1)
for label, errors, style in (('predicted', predicted, 'o--'), ('reached', reached, 'o-')):
    below.semilogy(numbers, 100 * np.max(errors, axis=1), style, label=label)
below.axhline(1.0, color='gray', linestyle=':')
below.set_xticks(numbers)
below.yaxis.set(major_formatter='{x:g}', minor_formatter='{x:g}')
below.set_xlabel('motion')
below.set_ylabel('largest standard error [%]')
below.legend(frameon=False)
for axis in (above, below):
    axis.grid(alpha=0.3)
figure.tight_layout()
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).with_suffix('.png'), dpi=100)
