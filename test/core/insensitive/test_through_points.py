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

"""Insensitive motions through via points."""

from dataclasses import replace

from core.conftest import ARM, ELBOW
from flat_planner_ros.core.arm import Drive, InvalidRequest
from flat_planner_ros.core.insensitive import Insensitivity
from flat_planner_ros.core.insensitive.insensitivity import Criterion, Nominal
from flat_planner_ros.core.motion_law import Strategy
from flat_planner_ros.core.planning import (
    DurationRules,
    JointLimits,
    MotionRequest,
    OnViolation,
    plan,
    PlanningOptions,
    residual_of_plan,
    ViaPoint,
)
import numpy as np
import pytest
from truth import simulated


def options_of(drive=Drive.EFFORT, **wanted):
    """Return the options of the strategy."""
    return PlanningOptions(
        strategy=Strategy.INSENSITIVE, insensitivity=Insensitivity(**wanted), drive=drive
    )


def request_of(arm, times, duration):
    """Return a motion from rest through random points."""
    values = np.random.default_rng(len(times)).normal(size=(len(times), arm.n - 1))
    via = tuple(
        ViaPoint(time=time, values=value) for time, value in zip(times, values, strict=True)
    )
    final = np.array([*[0.5] * (arm.n - 2), 1.0, 0.0])
    return MotionRequest(start=np.zeros(arm.n), final=final, duration=duration, via=via)


@pytest.mark.parametrize('nominal', Nominal)
@pytest.mark.parametrize('drive', Drive)
@pytest.mark.parametrize('arm', [ARM, ELBOW], ids=['2', '3'])
@pytest.mark.parametrize('times', [[0.7], [0.6, 1.3], [0.5, 1.0, 1.2, 1.6]])
def test_passes_the_points_and_leaves_what_is_predicted(arm, drive, times, nominal):
    planned = plan(request_of(arm, times, 2.0), arm, options_of(drive, nominal=nominal))
    wanted = np.array([point.values for point in planned.request.via]).T
    assert planned.at(np.array(times)).flat[:, 0] == pytest.approx(wanted, abs=1e-10)
    samples = planned.sample(2.0 / 8000.0)
    is_pushed = drive is Drive.EFFORT
    signal = samples.driving_effort if is_pushed else samples.driving_velocity
    left = residual_of_plan(planned, samples)
    for place, predicted in (
        ((1.0, 1.0, 1.0), left.nominal),
        ((left.stiffness_factor, left.damping_factor, left.inertia_factor), left.worst),
    ):
        found = simulated(arm, drive, signal, 2.0, np.array(place), np.zeros(4))
        assert found == pytest.approx(predicted, rel=0.01, abs=3e-5)
    if nominal is Nominal.EXACT:
        assert left.nominal < 3e-5
    cheapest = plan(planned.request, arm, PlanningOptions(drive=drive))
    assert left.worst < 0.5 * residual_of_plan(cheapest).worst


@pytest.mark.parametrize('drive', Drive)
def test_a_point_on_its_own_way_costs_nothing(drive):
    wanted = {'criterion': Criterion.MEAN, 'weight': 100.0}
    request = MotionRequest(start=np.zeros(2), final=np.array([2.0, 0.0]), duration=1.0)
    # From rest to rest the cost is that of 1 rad.
    costs = [
        4.0 * plan(request, ARM, options_of(drive, modes=modes, **wanted)).cost_value
        for modes in (16, 24)
    ]
    free = plan(request, ARM, options_of(drive, **wanted))
    via = ViaPoint(time=0.4, values=free.at(np.array([0.4])).flat[:, 0, 0])
    through = plan(replace(request, via=(via,)), ARM, options_of(drive, **wanted)).cost_value
    assert costs[1] * (1.0 - 1e-9) <= through <= costs[0] * (1.0 + 1e-9)


def test_from_a_start_in_motion():
    options = options_of()
    first = plan(request_of(ARM, [0.7], 2.0), ARM, options)
    here = first.at(np.array([1.0]))
    request = replace(
        request_of(ARM, [0.5, 1.0], 1.6),
        start=here.positions[0],
        start_jets=here.planned[:, :6, 0],
    )
    planned = plan(request, ARM, options)
    assert planned.trajectory.jets(np.array([1e-12]))[0, :4, 0] == pytest.approx(
        here.planned[0, :4, 0], rel=1e-6
    )
    assert residual_of_plan(planned, planned.sample(1e-3)).nominal < 3e-5


@pytest.mark.parametrize('has_point', [False, True])
def test_limits_stretch_it_as_any_other(has_point):
    request = request_of(ARM, [0.4] if has_point else [], 0.8)
    jets = np.zeros((1, 6))
    jets[0, 1] = 0.5
    request = replace(request, start_jets=jets)
    limits = JointLimits.of(2, effort=np.array([0.03, 0.0]))
    rules = DurationRules(
        joints=('joint1', 'joint2'),
        limits=limits,
        on_violation=OnViolation.SCALE,
        shortest=0.1,
        longest=20.0,
    )
    found, exceeded = rules.plan_within(request, ARM, options_of(), is_prescribed=True)
    assert exceeded is not None
    assert found.duration > 0.8
    assert found.peak_effort[0] <= 0.03 * (1.0 + 1e-6)
    assert found.options.strategy is Strategy.INSENSITIVE


def test_more_points_than_it_can_pass_are_refused():
    times = np.linspace(0.0, 8.0, 18)
    plan(request_of(ARM, times[1:-1], 8.0), ARM, options_of())
    with pytest.raises(InvalidRequest, match='up to 16'):
        plan(request_of(ARM, times[1:], 9.0), ARM, options_of())
