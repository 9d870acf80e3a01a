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

"""Baselines by input shaping, the plane of effort and residual, and the line of advice."""

import re

from flat_planner_ros.core.arm.errors import InvalidRequest
from flat_planner_ros.core.arm.flat_map import FlatModel
from flat_planner_ros.core.arm.planar_arm import Drive, PlanarArm
from flat_planner_ros.core.insensitive.insensitivity import Insensitivity, Nominal
from flat_planner_ros.core.insensitive.oscillator import Oscillator
from flat_planner_ros.core.insensitive.residual import residual_amplitude
from flat_planner_ros.core.insensitive.shapers import shaped_quintic, Shaper
from flat_planner_ros.core.motion_law.cost import Strategy
from flat_planner_ros.core.planning.planner import plan
from flat_planner_ros.core.planning.request import MotionRequest, PlanningOptions
from flat_planner_ros.core.planning.tradeoff import (
    baselines,
    duration_advice,
    residual_of_plan,
    tradeoff_points,
)
import numpy as np
import pytest
from scipy.integrate import trapezoid

ARM = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3.0e-3, damping=2.0e-5)
REQUEST = MotionRequest(start=np.zeros(2), final=np.array([np.pi, 0.0]), duration=1.0)
TIMES = np.linspace(0.0, 1.0, 4001)


def advised(duration=1.0, **options):
    """Return the advice on a motion from 0 to pi."""
    request = MotionRequest(start=np.zeros(2), final=np.array([np.pi, 0.0]), duration=duration)
    result = plan(request, ARM, PlanningOptions(**options))
    return duration_advice(result, residual_of_plan(result))


@pytest.mark.parametrize('shaper', Shaper)
def test_a_shaped_motion_arrives(shaper):
    effort = shaped_quintic(ARM, 1.3, 1.0, shaper, TIMES)
    speed = trapezoid(effort, TIMES) / ARM.inertia_star.both
    angle = trapezoid(effort * (1.0 - TIMES), TIMES) / ARM.inertia_star.both
    assert speed == pytest.approx(0.0, abs=1e-6)
    assert angle == pytest.approx(1.3, rel=1e-5)
    assert effort[0] == effort[-1] == 0.0


def test_impulses_cancel_the_nominal_oscillation_and_its_slope():
    oscillator = Oscillator.of(ARM)
    shares = np.array([0.0, 0.01, 0.02])
    poles = oscillator.poles(np.column_stack([1.0 + shares, np.ones(3)]))
    left = {
        shaper: residual_amplitude(
            oscillator, shaped_quintic(ARM, 1.0, 1.0, shaper, TIMES), 1.0, poles
        )
        for shaper in Shaper
    }
    assert left[Shaper.NONE][0] > 0.08
    assert left[Shaper.ZV][0] < 1e-6
    assert left[Shaper.ZVD][0] < 1e-6
    # Of first order in the mismatch without the derivative, of second order with it.
    assert left[Shaper.ZV][2] / left[Shaper.ZV][1] == pytest.approx(2.0, rel=0.1)
    assert left[Shaper.ZVD][2] / left[Shaper.ZVD][1] == pytest.approx(4.0, rel=0.1)


def test_impulses_need_time():
    with pytest.raises(InvalidRequest, match='ZVD take 0.642 s'):
        shaped_quintic(ARM, 1.0, 0.6, Shaper.ZVD, TIMES)


def test_known_figures_of_the_baselines():
    expected = {
        'polynomial': (0.0083, 0.119),
        'quintic': (0.0083, 0.39),
        'zv_quintic': (0.0078, 0.106),
        'zvd_quintic': (0.0234, 0.0152),
    }
    found = {p.series: (p.rms_effort, p.worst) for p in baselines(plan(REQUEST, ARM, paper()))}
    assert found.keys() == expected.keys()
    for name, figures in expected.items():
        assert found[name] == pytest.approx(figures, rel=0.01)


def paper():
    """Return the options that the baselines are given with."""
    return PlanningOptions(strategy=Strategy.MIN_CONTROL_EFFORT)


def test_baselines_that_need_more_time_are_left_out():
    short = MotionRequest(start=np.zeros(2), final=np.array([1.0, 0.0]), duration=0.4)
    names = [point.series for point in baselines(plan(short, ARM, paper()))]
    assert names == ['polynomial', 'quintic', 'zv_quintic']


def test_the_paper_s_residuals_are_predicted():
    expected = {
        Strategy.POLYNOMIAL: (0.00449, 0.115),
        Strategy.MIN_CONTROL_EFFORT: (0.00358, 0.094),
        Strategy.MIN_POTENTIAL_ENERGY: (0.00299, 0.081),
    }
    for strategy, (nominal, worst) in expected.items():
        options = PlanningOptions(strategy=strategy, flat_model=FlatModel.APPROXIMATE)
        residual = residual_of_plan(plan(REQUEST, ARM, options))
        assert residual.nominal == pytest.approx(nominal, abs=1e-5)
        assert residual.worst == pytest.approx(worst, abs=6e-4)


def test_a_little_more_time_pays():
    wanted = Insensitivity(nominal=Nominal.FREE, max_effort_rms=0.0083, modes=32)
    line = advised(strategy=Strategy.INSENSITIVE, insensitivity=wanted)
    pattern = r'5 % longer \(1.05 s\) cuts the worst residual from 0.041? to 0.012 rad'
    assert re.fullmatch(pattern, line)


def test_no_advice_where_time_does_not_pay_or_nothing_is_left():
    assert advised(strategy=Strategy.POLYNOMIAL) is None
    assert advised(strategy=Strategy.INSENSITIVE) is None
    assert advised(duration=5.0, strategy=Strategy.INSENSITIVE) is None


def test_advice_keeps_its_promise():
    line = advised(strategy=Strategy.MIN_POTENTIAL_ENERGY)
    assert line == '20 % longer (1.2 s) cuts the worst residual from 0.084 to 0.02 rad'
    longer = MotionRequest(start=np.zeros(2), final=np.array([np.pi, 0.0]), duration=1.2)
    options = PlanningOptions(strategy=Strategy.MIN_POTENTIAL_ENERGY)
    assert residual_of_plan(plan(longer, ARM, options)).worst == pytest.approx(0.02, abs=5e-4)


@pytest.mark.parametrize('drive', Drive)
@pytest.mark.parametrize('way', [np.pi, -1.9, 2.5])
def test_advice_for_any_way_and_arm_is_that_of_the_longer_plan(way, drive):
    options = PlanningOptions(strategy=Strategy.MIN_POTENTIAL_ENERGY, drive=drive)
    for arm in (ARM, ARM.scaled(stiffness=1.05, damping=1.0)):
        start = np.array([0.4, 0.0])
        request = MotionRequest(start=start, final=start + [way, 0.0], duration=1.0)
        found = plan(request, arm, options)
        line = duration_advice(found, residual_of_plan(found))
        stretch = 1.0 + float(line.split(' %')[0]) / 100.0
        longer = plan(request.stretched(stretch), arm, options)
        assert f'to {residual_of_plan(longer).worst:.2g} rad' in line


def test_no_advice_from_the_midst_of_a_motion():
    jets = np.zeros((1, 6))
    jets[0, 1] = 1.0
    request = MotionRequest(
        start=np.zeros(2), final=np.array([np.pi, 0.0]), duration=1.0, start_jets=jets
    )
    result = plan(request, ARM, PlanningOptions(strategy=Strategy.MIN_POTENTIAL_ENERGY))
    residual = residual_of_plan(result)
    assert duration_advice(result, residual) is None
    assert baselines(result) == ()
    # Nothing is left on the nominal arm: the swing at the start is taken into account.
    assert residual.nominal < 1e-6 < residual.worst


def test_the_plane_of_effort_and_residual():
    points = tradeoff_points(
        REQUEST,
        ARM,
        PlanningOptions(strategy=Strategy.POLYNOMIAL),
        stretches=(1.0, 1.2),
        weights=(30.0, 100.0),
    )
    singles = [point for point in points if point.weight == 0.0]
    assert [point.series for point in singles] == [
        'polynomial',
        'min_control_effort',
        'min_potential_energy',
        'quintic',
        'zv_quintic',
        'zvd_quintic',
    ]
    sweeps = [point for point in points if point.weight > 0.0]
    assert len(sweeps) == 2 * 2 * 2
    # The sweep leaves every single motion behind: less residual for the effort of each.
    free = [p for p in sweeps if p.series == 'insensitive_free' and p.duration == 1.0]
    assert free[0].worst < min(p.worst for p in singles if p.rms_effort < free[1].rms_effort)
    assert free[0].rms_effort > free[0].peak_effort / 4.0
    # With 20 % more time, a fraction of it for less effort.
    longer = [p for p in sweeps if p.duration == 1.2 and p.weight == 100.0]
    assert all(p.worst < 0.02 and p.rms_effort < 0.0056 for p in longer)
