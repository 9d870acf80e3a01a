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

"""The plant of these tests: the simulated arm, seen through encoders and moved late."""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import ceil, pi

from core.conftest import ARM
from flat_planner_ros.core.arm import JointSample, PlanarArm
from flat_planner_ros.core.planning import MotionRequest, plan, PlanningOptions, Strategy
from flat_planner_ros.core.plant import DriveSettings, SimulatedArm
from flat_planner_ros.core.tracking import TrackedMotion, Tracker
import numpy as np

ENCODER = 2 * pi / 2**14
"""Step of an encoder of 14 bits [rad]."""

STEPS = 10
"""Integration steps between two samples, at any of which an effort may begin to act [-]."""

PLANT_STEP = 1e-3
"""Longest integration step [s]."""


def samples_of(arm=ARM, *, final=None, duration=1.0, start=None, **request):
    """Return the samples of a plan, by default from zero to pi at joint n-1."""
    goal = np.append(np.zeros(arm.n - 2), [pi, 0.0]) if final is None else np.asarray(final)
    asked = MotionRequest(
        start=np.zeros(arm.n) if start is None else start,
        final=goal,
        duration=duration,
        **request,
    )
    options = PlanningOptions(strategy=Strategy.MIN_CONTROL_EFFORT)
    return plan(asked, arm, options).sample(0.005)


def motion_of(samples, start=0.0):
    """Return the motion to follow."""
    return TrackedMotion(
        start=start,
        times=samples.times,
        positions=samples.positions,
        velocities=samples.velocities,
        accelerations=samples.accelerations,
    )


@dataclass
class ClosedLoop:
    """
    A tracker and the arm that it moves, sample by sample.

    Where it is `uneven`, efforts begin to act anywhere between two samples, not at the first.
    """

    tracker: Tracker
    true: PlanarArm
    period: float = 0.002
    late: int = 0
    resolution: float = ENCODER
    noise: float = 0.0
    saturation: list | None = None
    position: np.ndarray | None = None
    push: Callable[[float], float] = lambda _: 0.0
    uneven: bool = False
    times: list = field(default_factory=list)
    positions: list = field(default_factory=list)
    efforts: list = field(default_factory=list)

    def __post_init__(self):
        """Stand still at time zero."""
        longest = self.period / STEPS if self.uneven else PLANT_STEP
        step = self.period / ceil(self.period / longest - 1e-9)
        self.arm = SimulatedArm(
            self.true,
            step=step,
            position=self.position,
            drives=DriveSettings(saturation=self.saturation),
        )
        self.random = np.random.default_rng(1)
        self.acting = np.zeros(self.true.n - 1)
        self.commanded = False
        self.waiting = [None] * self.late

    def sample(self):
        """Return what the sensors show."""
        angles = self.arm.position + self.noise * self.random.standard_normal(self.true.n)
        if self.resolution:
            angles = self.resolution * np.round(angles / self.resolution)
        return JointSample(time=self.arm.time, positions=angles)

    def run(self, duration, spoil=lambda sample: sample):
        """Go on for a time [s]; return times, positions and applied efforts of all of it."""
        for _ in range(round(duration / self.period)):
            now, seen = self.arm.time, spoil(self.sample())
            given = self.tracker.watch(now) if seen is None else self.tracker.hear(seen, now)
            self.waiting.append(given)
            efforts, former = self.waiting.pop(0), self.acting
            self.acting = self.acting if efforts is None else efforts
            self.commanded = self.commanded or efforts is not None
            self.times.append(now)
            self.positions.append(self.arm.position)
            self.efforts.append(former if self.uneven else self.acting)
            if self.uneven and self.commanded:
                self.arm.hold(former)
                self.arm.advance(now + self.period * self.random.integers(STEPS) / STEPS)
            pushed = self.push(now)
            if self.commanded or pushed:  # else brakes hold what weight would move
                self.arm.hold(self.acting + np.append(np.zeros(self.true.n - 2), pushed))
            self.arm.advance(now + self.period)
        return np.array(self.times), np.array(self.positions), np.array(self.efforts)


def settling(times, errors, since, band=5e-3):
    """Return the time from `since` until all errors stay within the band [s]."""
    late = times[(np.abs(errors).max(axis=1) > band) & (times >= since)]
    return late[-1] - since if late.size else 0.0
