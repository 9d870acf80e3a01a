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

"""Insensitive motions and the predicted residual through the planner node."""

from dataclasses import replace
from math import pi

from core.conftest import ARM, envelope
from diagnostic_msgs.msg import DiagnosticStatus
from flat_planner_ros.core import (
    EffortProfile,
    FlatPlannerError,
    MotionRequest,
    plan,
    PlanningOptions,
    residual_of_plan,
    rollout,
    Strategy,
)
from flat_planner_ros.core.arm import Drive
from flat_planner_ros.ros.nodes.planner_node import PlannerNode
import numpy as np
import pytest
from ros.rig import Planner

REST = {'start.source': 'parameter', 'start.position': [0.0, 0.0], 'execute': False}


class Resting(Planner):
    """A planner that starts from given rest."""

    def __init__(self, graph, **parameters):
        """Start it."""
        super().__init__(graph, {**REST, **parameters})

    def send(self, angle=pi, duration=1.0):
        """Send a goal for joint 1; return its verdict."""
        return super().send(angle, duration)

    def command(self):
        """Return the points of the last plan."""
        self.graph.expect(lambda: self.plans, 'a plan')
        return self.plans[-1].points


def simulated_amplitude(points, factor):
    """Return what a plan leaves on an arm with another stiffness and damping."""
    times = [p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in points]
    efforts = np.array([[point.effort[0]] for point in points])
    arm = ARM.scaled(stiffness=factor, damping=factor)
    profile = EffortProfile(start=0.0, times=np.array(times), efforts=efforts)
    motion = rollout(arm, profile, times[-1], step=5e-4)
    return envelope(arm, motion.positions[-1, 1], motion.velocities[-1, 1])


@pytest.mark.parametrize('nominal', ['exact', 'free'])
def test_scenario_3_on_either_side(graph, nominal):
    planner = Resting(graph, strategy='insensitive', **{'insensitivity.nominal': nominal})
    verdict = planner.send()
    assert verdict['state'] == 'ACCEPTED', verdict['message']
    left = {f: simulated_amplitude(planner.command(), f) for f in (0.9, 1.0, 1.1)}
    assert max(left.values()) <= 0.012
    assert max(left.values()) <= float(verdict['predicted_residual_worst']) * 1.001
    assert left[1.0] == pytest.approx(float(verdict['predicted_residual']), rel=1e-3)
    last = planner.command()[-1]
    assert list(last.positions) == [pi, 0.0]
    for quantity in (last.velocities, last.accelerations, last.effort):
        assert list(quantity) == [0.0, 0.0]


def test_every_verdict_predicts_and_may_advise(graph):
    planner = Resting(graph, strategy='min_potential_energy')
    verdict = planner.send()
    assert float(verdict['predicted_residual']) < 1e-6
    assert float(verdict['predicted_residual_worst']) == pytest.approx(0.0841, abs=1e-4)
    assert verdict['predicted_residual_box'] == 'stiffness +-10 %, damping +-10 %'
    assert verdict['advice'].startswith('20 % longer (1.2 s) cuts the worst residual from 0.084')
    assert not [key for key in verdict if key.startswith('baseline.')]
    results = graph.set_parameters(
        'flat_planner', report_baselines=True, report_advice=False, **{'flat_model': 'approximate'}
    )
    assert all(result.successful for result in results)
    verdict = planner.send()
    assert float(verdict['predicted_residual']) == pytest.approx(0.00297, abs=1e-5)
    assert 'advice' not in verdict
    assert float(verdict['baseline.zv_quintic.residual_worst']) == pytest.approx(0.106, abs=1e-3)
    assert float(verdict['baseline.polynomial.rms_effort']) == pytest.approx(0.0083, abs=1e-4)


def test_bounds_are_kept_or_the_goal_is_rejected(graph):
    planner = Resting(graph, strategy='insensitive', **{'insensitivity.max_residual': 0.02})
    assert float(planner.send()['predicted_residual_worst']) <= 0.0201
    verdict = planner.send(duration=0.25)
    assert verdict['error_name'] == 'SOLVER_FAILED'
    assert float(verdict['value']) > float(verdict['limit']) == 0.02
    assert 'longer duration' in verdict['message']


def test_a_start_in_motion_is_planned_by_the_same_strategy(graph):
    planner = Resting(graph, strategy='insensitive', execute=True, **{'replan.lookahead': 1.0})
    verdict = planner.send(duration=4.0)
    assert verdict['level'] == DiagnosticStatus.OK
    assert verdict['strategy'] == 'insensitive'
    verdict = planner.send(angle=1.0, duration=4.0)
    assert verdict['level'] == DiagnosticStatus.OK
    assert verdict['strategy'] == 'insensitive'
    assert verdict['message'].startswith('plan 2: insensitive, 4 s')
    assert float(verdict['predicted_residual_worst']) < 0.005


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [
        ({'insensitivity.max_residual': 0.1}, 'one of weight, max_effort_rms and max_residual'),
        ({'flat_model': 'approximate'}, 'flat_model: exact'),
        ({'insensitivity.modes': 100}, 'modes must be in [6, 48]'),
        ({'insensitivity.stiffness': 0.95}, '0.95'),
        ({'model.damping': 6.2e-4}, 'does not oscillate'),
    ],
)
def test_settings_that_make_no_sense_are_refused(graph, changes, reason):
    parameters = {'strategy': 'insensitive', 'insensitivity.weight': 100.0}
    Resting(graph, **parameters)
    (result,) = graph.set_parameters('flat_planner', **changes)
    assert not result.successful
    assert reason in result.reason or 'range' in result.reason


def test_an_arm_that_does_not_oscillate_has_no_predicted_residual(graph):
    model = {
        'joints': ['joint1', 'joint2'],
        'model.inertia_star': [6.4e-4, 3.3e-5],
        'model.stiffness': 3.0e-3,
        'model.damping': 2.0e-3,
    }
    verdict = Resting(graph, **model).send()
    assert verdict['state'] == 'ACCEPTED'
    assert 'predicted_residual' not in verdict
    with pytest.raises(FlatPlannerError, match='does not oscillate'):
        graph.create(PlannerNode, {**REST, **model, 'strategy': 'insensitive'})


def test_a_servo_has_predictions_and_laws_of_its_own(graph):
    options = PlanningOptions(strategy=Strategy.INSENSITIVE, drive=Drive.POSITION)
    request = MotionRequest(start=np.zeros(2), final=np.array([pi, 0.0]), duration=1.0)
    expected = residual_of_plan(plan(request, ARM, options)).worst
    other = residual_of_plan(plan(request, ARM, replace(options, drive=Drive.EFFORT))).worst
    verdict = Resting(graph, strategy='insensitive', drive='position').send()
    assert float(verdict['predicted_residual_worst']) == pytest.approx(expected, rel=1e-4)
    assert 'predicted_miss_worst' not in verdict
    assert abs(other - expected) > 5e-5


def test_a_payload_is_weighed_and_may_miss_the_goal(graph):
    payload = {'insensitivity.payload': [0.0, 0.5]}
    verdict = Resting(graph, strategy='insensitive', **payload).send()
    assert verdict['predicted_residual_box'] == (
        'stiffness +-10 %, damping +-10 %, inertia of the last link +0 to +50 %'
    )
    both, last = ARM.inertia_star
    miss = pi * 0.5 * last / (both + 0.5 * last)
    assert float(verdict['predicted_miss_worst']) == pytest.approx(miss, rel=1e-3)
    (result,) = graph.set_parameters('flat_planner', **{'insensitivity.payload': [0.5]})
    assert 'two numbers' in result.reason
