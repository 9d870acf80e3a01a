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

"""One motion tells the whole model, so that the next one neither swings nor misses."""

from math import inf, pi

from flat_planner_ros.core.arm import JointSample, PlanarArm
from flat_planner_ros.core.monitor import (
    AdoptionRefused,
    LastLinks,
    ModelTuner,
    MonitorSettings,
    PlannedMotion,
    ReportedModel,
    VibrationMonitor,
)
from flat_planner_ros.core.planning import MotionRequest, plan, PlanningOptions
from flat_planner_ros.core.plant import EffortProfile, SimulatedArm
import numpy as np
import pytest

BELIEVED = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
OPTIONS = PlanningOptions(compensate_friction=True)
WINDOW, RATE = 2.0, 200.0


def off_by(scale):
    """Return an arm with all four parameters off, and friction that nobody knows of."""
    return PlanarArm.reduced(
        inertia_star=tuple(scale * np.array(BELIEVED.inertia_star)),
        stiffness=scale * BELIEVED.stiffness,
        damping=scale * BELIEVED.damping,
        viscous_friction=[2e-4],
        coulomb_friction=[5e-4],
    )


def moved(true, believed, *, noise=0.0, with_efforts=True, fits_model=True):
    """Return the report on a motion, its true swing [rad] and its true miss [rad]."""
    goal = np.array([pi, 0.0])
    request = MotionRequest(start=np.zeros(2), final=goal, duration=1.0)
    samples = plan(request, believed, OPTIONS).sample(0.005)
    arm = SimulatedArm(true)
    profile = EffortProfile(start=0.0, times=samples.times, efforts=samples.efforts[:, :-1])
    arm.command(profile, 0.0)
    settings = MonitorSettings(window=WINDOW, arm=believed, fits_model=fits_model)
    monitor = VibrationMonitor(settings)
    planned = PlannedMotion(
        joint_names=('joint1', 'joint2'),
        start=0.0,
        times=samples.times,
        positions=samples.positions,
    )
    monitor.watch(planned)
    random, reports, after = np.random.default_rng(0), [], []
    for time in np.arange(0.0, 1.0 + WINDOW + 0.02, 1.0 / RATE):
        arm.advance(time)
        efforts = np.append(profile.effort(time), 0.0)
        seen = arm.position + noise * random.standard_normal(2)
        reports += monitor.add(
            JointSample(time=time, positions=seen, efforts=efforts if with_efforts else None)
        )
        if time > 1.0:
            after.append(arm.position - goal)
    (report,) = reports
    errors = np.array(after)
    return report, np.ptp(errors[:, 1]) / 2, abs(errors[-100:, 0].mean())


def reported(report):
    """Return the estimate of a report as a planner hears it."""
    return ReportedModel(
        start_time=0.0, joint='joint2', values=report.model.values, stds=report.model.stds
    )


@pytest.mark.parametrize(
    ('scale', 'noise', 'left'),
    [(1.1, 0.0, 0.02), (0.9, 0.0, 0.02), (1.25, 0.0, 0.02), (0.75, 0.0, 0.02), (1.25, 1e-4, 0.05)],
)
def test_the_second_motion_leaves_a_fiftieth_of_swing_and_miss(scale, noise, left):
    true = off_by(scale)
    report, swing, miss = moved(true, BELIEVED, noise=noise)
    assert report.model.is_trustworthy, report.model.reason
    tuner = ModelTuner()
    tuner.hear(reported(report))
    tuned = tuner.propose(BELIEVED, 'joint2').arm
    _, second_swing, second_miss = moved(true, tuned, fits_model=False)
    assert swing > 0.01
    assert miss > 0.1
    assert second_swing < left * swing
    assert second_miss < left * miss


def test_without_efforts_nothing_is_invented():
    report, _, _ = moved(off_by(1.1), BELIEVED, with_efforts=False)
    assert not report.model.is_trustworthy
    assert 'not measured' in report.model.reason
    assert 'whole model not estimated' in report.message


def test_friction_that_is_not_told_is_kept():
    true = LastLinks.of(off_by(1.1))
    stds = LastLinks(*(1e-3 * value for value in true[:4]), 1e-5, inf)
    estimate = ReportedModel(start_time=0.0, joint='joint2', values=true, stds=stds)
    tuned = estimate.tuned(BELIEVED)
    assert LastLinks.of(tuned)[:5] == pytest.approx(true[:5])
    assert tuned.coulomb_friction[-1] == 0.0
    tuner = ModelTuner()
    tuner.hear(estimate)
    with pytest.raises(AdoptionRefused, match='nothing to adopt'):
        tuner.propose(tuned, 'joint2')
