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

"""A motion carried out by the tracker, sample by sample."""

from math import ceil

from flat_planner_ros.core.arm import Drive, JointSample, locked
from flat_planner_ros.core.planning import PlanSamples
from flat_planner_ros.core.plant import SimulatedArm, States
from flat_planner_ros.core.study.axes import InvalidStudy
from flat_planner_ros.core.study.case import Case
from flat_planner_ros.core.tracking import TrackedMotion, Tracker
import numpy as np

ROUNDING = 1e-6
"""Share of a step by which a time may miss the grid [-]."""


def tracked_end(case: Case, samples: PlanSamples) -> States:
    """
    Return the state of the true arm at the end of a motion that a tracker carries out.

    Parameters
    ----------
    case
        With a tracker, whose model is the planner's. It sees every angle as it is.
    samples
        The motion.

    Raises
    ------
    InvalidStudy
        Servos move the arm, which take no efforts.
    UncertifiedLoop
        There is no such tracker.

    """
    if case.tracker is None or case.drive is Drive.POSITION:
        raise InvalidStudy('a tracker gives efforts, and servos take positions')
    settings, period = case.tracker, case.tracker.period
    # A grid on which efforts can come as late as they do.
    step = period / ceil(period / min(case.step, settings.delay or case.step) - ROUNDING)
    late = round(settings.delay / step)
    tracker = Tracker(case.settings.arm, settings)
    arm = SimulatedArm(case.true, position=case.start, time=-period, step=step, drives=case.drives)
    tracker.hear(_seen(arm), arm.time)
    tracker.follow(
        TrackedMotion(
            start=0.0,
            times=samples.times,
            positions=samples.positions,
            velocities=samples.velocities,
            accelerations=samples.accelerations,
        ),
        arm.time,
    )
    for index in range(ceil(float(samples.times[-1]) / period - ROUNDING) + 1):
        arm.advance((index + ROUNDING) * period)
        efforts = tracker.hear(_seen(arm), arm.time)
        arm.advance(arm.time + (late + ROUNDING) * step)
        if efforts is not None:
            arm.hold(efforts)
    return States(arm.position[None], arm.velocity[None])


def _seen(arm: SimulatedArm) -> JointSample:
    """Return the angles as sensors without errors show them."""
    return JointSample(time=arm.time, positions=locked(np.asarray(arm.position)))
