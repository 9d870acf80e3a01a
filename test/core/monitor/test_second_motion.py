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

"""One motion tells the model: what the second one leaves of the first's swing and of its miss."""

from dataclasses import replace
from math import pi

from flat_planner_ros.core.arm import Drive, PlanarArm
from flat_planner_ros.core.monitor import (
    ActuatedJoints,
    fit_oscillation,
    identify,
    LastLinks,
)
from flat_planner_ros.core.monitor.model_estimate import estimate_model
from flat_planner_ros.core.planning import MotionRequest, plan, PlanningOptions
from flat_planner_ros.core.plant import DriveSettings, EffortProfile, rollout
import numpy as np
import pytest

BELIEVED = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
FRICTION = {'viscous': 2e-4, 'coulomb': 5e-4}
DURATION, WINDOW, EVERY = 1.0, 2.0, 5
"""Of a motion and of the time after it [s]; steps of 1 ms between samples."""


def true_arm(inertia, spring):
    """Return an arm whose inertias, and whose spring and damper, are other than believed."""
    both, last = (inertia * each for each in BELIEVED.inertia_star)
    stiffness, damping = spring * BELIEVED.stiffness, spring * BELIEVED.damping
    return LastLinks(both, last, stiffness, damping, **FRICTION).applied_to(BELIEVED)


def carried_out(true, model, noise, drive=Drive.EFFORT):
    """Return times, angles as they are and as measured, and efforts of half a turn."""
    options = PlanningOptions(compensate_friction=True, drive=drive)
    request = MotionRequest(start=(0.0, 0.0), final=(pi, 0.0), duration=DURATION)
    samples = plan(request, model, options).sample(0.005)
    command = EffortProfile(
        start=0.0,
        times=samples.times,
        efforts=samples.efforts[:, :-1],
        positions=samples.positions[:, :-1],
        velocities=samples.velocities[:, :-1],
    )
    settings = DriveSettings(drive=drive)
    seen = rollout(true, command, DURATION + WINDOW, drives=settings)
    times, angles = seen.times[::EVERY], seen.positions[::EVERY]
    efforts = np.array([[*command.effort(time), 0.0] for time in times])
    shown = angles + noise * np.random.default_rng(1).standard_normal(angles.shape)
    return times, angles, shown, efforts


def left(times, angles):
    """Return the swing of the passive joint and the miss of joint 1 [rad]."""
    after = times >= DURATION
    fit = fit_oscillation(times[after], angles[after, 1], end_time=DURATION)
    swing = np.ptp(angles[after, 1]) / 2 if fit.amplitude is None else fit.amplitude
    return swing, abs(angles[after, 0].mean() - pi)


@pytest.mark.parametrize(
    ('inertia', 'spring', 'noise', 'share'),
    [(1.25, 1.25, 0.0, 0.02), (0.75, 0.75, 1e-4, 0.05), (1.1, 0.9, 1e-4, 0.05)],
)
def test_the_second_motion_leaves_little_of_swing_and_miss(inertia, spring, noise, share):
    true = true_arm(inertia, spring)
    times, angles, shown, efforts = carried_out(true, BELIEVED, noise)
    found = estimate_model(times, shown, efforts, BELIEVED)
    assert found.is_trustworthy, found.reason
    errors = np.array(found.values) - np.array(LastLinks.of(true))
    assert (np.abs(errors) < 4.0 * np.array(found.stds)).all()
    first = left(times, angles)
    second = left(*carried_out(true, found.values.applied_to(BELIEVED), noise)[:2])
    assert second[0] <= share * first[0]
    assert second[1] <= share * first[1]


@pytest.mark.parametrize(('inertia', 'spring', 'noise'), [(1.25, 0.75, 0.0), (0.9, 1.1, 1e-4)])
def test_with_a_servo_the_ratios_are_enough(inertia, spring, noise):
    true = true_arm(inertia, spring)
    times, angles, shown, _ = carried_out(true, BELIEVED, noise, Drive.POSITION)
    after = times >= DURATION
    fit = fit_oscillation(times[after], shown[after, 1], end_time=DURATION)
    errors = shown[after] - [pi, 0.0]
    found = identify(times[after] - DURATION, errors, fit, BELIEVED, ActuatedJoints.HELD)
    assert found.is_trustworthy, found.reason
    ratio = true.stiffness / true.inertia_star.last
    assert found.stiffness / BELIEVED.inertia_star.last == pytest.approx(ratio, rel=2e-3)
    tuned = replace(BELIEVED, stiffness=found.stiffness, damping=found.damping)
    first = left(times, angles)
    second = left(*carried_out(true, tuned, noise, Drive.POSITION)[:2])
    assert second[0] <= (0.05 if noise else 0.02) * first[0]
    assert first[1] < 1e-3 > second[1]
