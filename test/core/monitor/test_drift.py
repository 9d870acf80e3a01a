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

"""Arms that age are noticed, arms that do not are left alone."""

from dataclasses import replace
from math import inf, pi

from flat_planner_ros.core.arm import InvalidRequest, PlanarArm
from flat_planner_ros.core.monitor import (
    ActuatedJoints,
    DriftSettings,
    DriftWatch,
    LastLinks,
    Level,
    ModelEstimate,
    OscillationFit,
    StiffnessEstimate,
    VibrationReport,
)
from flat_planner_ros.core.planning import MotionRequest, plan, PlanningOptions
from flat_planner_ros.core.plant import EffortProfile, rollout
import numpy as np
import pytest

ARM = PlanarArm.reduced(
    inertia_star=(6.4e-4, 3.3e-5),
    stiffness=3e-3,
    damping=2e-5,
    viscous_friction=[2e-4],
    coulomb_friction=[5e-4],
)
SHARES = np.array([0.001, 0.003, 0.005, 0.03, 0.01, 0.02])
"""Standard errors of a motion's estimates, relative to them."""


def report(model=None, swing=None):
    """Return a report with nothing but estimates."""
    return VibrationReport(
        level=Level.OK,
        message='',
        start_time=0.0,
        end_time=1.0,
        joint='joint2',
        fit=OscillationFit(samples=0),
        frequency_expected=None,
        damping_expected=None,
        settling_time=None,
        joint_names=('joint1', 'joint2'),
        final_error=(),
        rms_effort=(),
        window=0.0,
        samples=0,
        estimate=swing,
        model=model,
    )


def told(rng, changes=None, scatter=1.0):
    """Return a report on the arm, with estimates that scatter more than they say."""
    true = np.array(LastLinks.of(replace(ARM, **(changes or {}))))
    stds = SHARES * np.array(LastLinks.of(ARM))
    values = true + scatter * stds * rng.standard_normal(6)
    return report(ModelEstimate(values=LastLinks(*values), stds=LastLinks(*stds)))


def swing(arm, believed):
    """Return what half a turn that is planned with another arm leaves of one [rad]."""
    request = MotionRequest(start=(0.0, 0.0), final=(pi, 0.0), duration=1.0)
    samples = plan(request, believed, PlanningOptions(compensate_friction=True)).sample(0.005)
    command = EffortProfile(start=0.0, times=samples.times, efforts=samples.efforts[:, :-1])
    seen = rollout(arm, command, 2.0)
    return np.ptp(seen.positions[seen.times > 1.0, 1]) / 2


@pytest.mark.parametrize('scatter', [1.0, 3.0])
def test_a_constant_arm_is_suspected_after_one_motion_in_a_thousand_at_most(scatter):
    rng = np.random.default_rng(1)
    watch, settings = DriftWatch(), DriftSettings()
    count = 1000
    alarms = sum(
        any(drift.is_noticed for drift in watch.hear(told(rng, scatter=scatter), settings))
        for _ in range(count)
    )
    assert alarms <= 1e-3 * count


@pytest.mark.parametrize(('before', 'seed'), [(0, 2), (300, 3)])
def test_a_spring_that_softens_is_noticed_before_the_residual_doubles(before, seed):
    """The model is 1 % too stiff at first, which another 1 % doubles."""
    rng = np.random.default_rng(seed)
    watch, settings = DriftWatch(), DriftSettings()
    for _ in range(before):
        watch.hear(told(rng), settings)
    noticed = None
    for motion in range(120):
        softer = {'stiffness': ARM.stiffness * (1.0 - 1e-4 * motion)}
        drifts = watch.hear(told(rng, softer), settings)
        named = [drift for drift in drifts if drift.is_noticed]
        if named:
            noticed = motion
            break
    assert noticed is not None
    aged, believed = replace(ARM, **softer), replace(ARM, stiffness=1.01 * ARM.stiffness)
    assert swing(aged, believed) < 2.0 * swing(ARM, believed)
    (drift,) = named
    assert drift.name == 'stiffness'
    assert drift.rate < 0.0
    assert 'stiffness 0.003' in drift.text


def test_the_line_is_that_of_numpy():
    rng = np.random.default_rng(5)
    watch, settings = DriftWatch(), DriftSettings(window=1000)
    stds = 1e-5 * rng.uniform(0.5, 2.0, 60)
    values = 3e-3 + 1e-6 * np.arange(60) + stds * rng.standard_normal(60)
    for value, std in zip(values, stds, strict=True):
        swing = StiffnessEstimate(
            stiffness=value * 2.0,
            stiffness_std=std * 2.0,
            damping=1.0,
            damping_std=1.0,
            case=ActuatedJoints.FREE,
            inertia=2.0,
            is_trustworthy=True,
            reason='',
        )
        drifts = watch.hear(report(swing=swing), settings)
    found = {drift.name: drift for drift in drifts}['stiffness_ratio.free']
    line, covariance = np.polyfit(np.arange(60), values, 1, w=1 / stds, cov='unscaled')
    assert found.rate == pytest.approx(line[0], rel=1e-9)
    left = (values - np.polyval(line, np.arange(60))) / stds
    excess = max(1.0, left @ left / 58)
    assert found.rate_std == pytest.approx(np.sqrt(excess * covariance[0, 0]), rel=1e-9)
    assert found.value == pytest.approx(np.polyval(line, 59), rel=1e-9)
    assert found.motions == 59
    assert found.is_noticed


def test_what_tells_nothing_is_not_judged():
    rng = np.random.default_rng(6)
    watch, settings = DriftWatch(), DriftSettings(window=30)
    assert watch.hear(report(), settings) == []
    for _ in range(19):
        assert watch.hear(told(rng), settings) == []
    assert len(watch.hear(told(rng), settings)) == 6
    untold = LastLinks(*(*SHARES[:4] * np.array(LastLinks.of(ARM))[:4], inf, inf))
    model = ModelEstimate(values=LastLinks.of(ARM), stds=untold)
    for _ in range(10):
        drifts = watch.hear(report(model), settings)
    assert {drift.name for drift in drifts} == {'both', 'last', 'stiffness', 'damping'}
    assert watch.hear(report(replace(model, reason='doubtful')), settings) == []


@pytest.mark.parametrize('changes', [{'window': 5}, {'false_alarms': 0.0}, {'false_alarms': 0.7}])
def test_settings_without_meaning_are_refused(changes):
    with pytest.raises(InvalidRequest, match=next(iter(changes))):
        DriftSettings(**changes)
