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

"""A motion that is planned for one arm and carried out by another, as a monitor hears of both."""

from math import pi

from flat_planner_ros.core.arm import JointSample
from flat_planner_ros.core.monitor import PlannedMotion
from flat_planner_ros.core.planning import MotionRequest, plan, PlanningOptions
from flat_planner_ros.core.plant import EffortProfile, rollout
import numpy as np

NAMES = ('joint1', 'joint2')
PERIOD = 0.005
"""Time between two samples of the integration [s]."""

START = 10.0
"""Time at which every motion starts [s]."""


def driven(true, believed, goal=pi, duration=1.0, after=9.5):
    """
    Return a motion, and what the arm did from 0.5 s before its start on.

    Times are those of the arm [s], shape (m,), positions in radians, shape (m, 2); samples between
    two of the integration are joined linearly where a test needs them.
    """
    request = MotionRequest(start=np.zeros(2), final=np.array((goal, 0.0)), duration=duration)
    samples = plan(request, believed, PlanningOptions()).sample(PERIOD)
    motion = PlannedMotion(
        joint_names=NAMES,
        start=START,
        times=samples.times,
        positions=samples.positions,
        velocities=samples.velocities,
    )
    profile = EffortProfile(start=0.0, times=samples.times, efforts=samples.efforts[:, :1])
    states = rollout(true, profile, duration + after, step=PERIOD / 5)
    times, positions = states.times[::5], states.positions[::5]
    before = np.arange(-0.5, 0.0, PERIOD)
    still = np.zeros((before.size, 2))
    return (
        motion,
        START + np.concatenate((before, times)),
        np.concatenate((still, positions)),
    )


def sampled(times, positions, at):
    """Return the positions at other times [s], shape (k, 2); at rest before the first."""
    return np.stack([np.interp(at, times, column) for column in positions.T], axis=-1)


def reports_on(monitor, motion, stamps, positions, arrivals=None):
    """Return the reports of a monitor that is fed with these samples."""
    reports = list(monitor.watch(motion, None if arrivals is None else START - 0.2))
    for index, (time, row) in enumerate(zip(stamps.tolist(), positions, strict=True)):
        if arrivals is not None:
            monitor.hear(time, float(arrivals[index]))
        reports += monitor.add(JointSample(time=time, positions=row))
    return reports
