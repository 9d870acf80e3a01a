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

"""Planner, plant and monitor together: a goal in, a motion, a report of what it leaves."""

from math import pi

import pytest
from ros.rig import Suite, values
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory


@pytest.mark.parametrize(
    'strategy', ['polynomial', 'min_control_effort', 'min_potential_energy', 'mixed']
)
def test_the_exact_map_leaves_nothing_with_damping(graph, strategy):
    suite = Suite(graph, planner={'strategy': strategy, 'flat_model': 'exact'})
    _, report = suite.carry_out(pi)
    assert float(report['amplitude']) < 1e-5
    assert float(report['final_error.joint1']) == pytest.approx(0.0, abs=1e-5)


def test_the_papers_map_leaves_what_the_paper_found(graph):
    suite = Suite(graph, planner={'strategy': 'polynomial', 'flat_model': 'approximate'})
    _, report = suite.carry_out(pi)
    assert float(report['amplitude']) == pytest.approx(0.00449, rel=0.02)


def test_without_damping_nothing_is_left(graph):
    undamped = {'model.inertia_star': [6.4e-4, 3.3e-5], 'model.stiffness': 3e-3}
    undamped |= {'model.damping': 0.0, 'joints': ['joint1', 'joint2']}
    suite = Suite(graph, planner=undamped, plant=undamped)
    verdict, report = suite.carry_out(pi)
    assert float(report['amplitude']) < 2e-5
    assert float(report['final_error.joint1']) == pytest.approx(0.0, abs=2e-4)
    assert float(report['rms_effort.joint1']) == pytest.approx(
        # From the samples that arrived: a busy machine loses some.
        float(verdict['rms_effort.joint1']),
        rel=0.03,
    )
    assert float(report['start_time']) == pytest.approx(float(verdict['start_time']), abs=1e-6)


def test_a_mismatch_is_seen_and_its_frequency_is_measured(graph):
    mismatch = {'mismatch.stiffness_scale': 1.1, 'mismatch.damping_scale': 1.1}
    suite = Suite(graph, planner={'flat_model': 'approximate'}, plant=mismatch)
    _, report = suite.carry_out(pi)
    assert float(report['amplitude']) == pytest.approx(0.0758, rel=0.02)
    # The plant's own frequency, not the one that the model expects.
    ratio = float(report['frequency']) / float(report['frequency_expected'])
    assert ratio == pytest.approx(1.1**0.5, rel=2e-3)
    assert report['joint'] == 'joint2'
    assert suite.reports[-1].status[0].level == b'\x02'


def test_two_motions_give_two_reports_and_each_starts_where_the_last_ended(graph):
    approximate = {'strategy': 'min_potential_energy', 'flat_model': 'approximate'}
    suite = Suite(graph, planner=approximate)
    suite.carry_out(1.0)
    _, second = suite.carry_out(-0.5)
    assert len(suite.reports) == 2
    assert suite.plans[1].points[0].positions[0] == pytest.approx(1.0, abs=0.01)
    # What the first motion left, 0.95e-3 rad, has decayed to a third and adds to it.
    assert float(second['amplitude']) == pytest.approx(1.5 / pi * 0.00299, abs=0.35e-3)
    assert suite.states[-1].position[0] == pytest.approx(-0.5, abs=0.01)


def test_a_rejected_goal_disturbs_no_motion(graph):
    suite = Suite(graph, planner={'flat_model': 'approximate'})
    suite.send(pi)
    graph.expect(lambda: abs(suite.states[-1].effort[0]) > 0.0, 'the motion')
    graph.publish('/flat_planner/goal', JointTrajectory())
    graph.expect(lambda: suite.reports, 'a report')
    names = [values(message).get('error_name') for message in suite.status]
    assert names == ['SUCCESSFUL', 'EMPTY_GOAL', 'SUCCESSFUL']
    assert [values(message)['state'] for message in suite.status][-1] == 'FINISHED'
    assert float(values(suite.reports[0])['amplitude']) == pytest.approx(0.00358, rel=0.02)


def test_replan_repeats_the_last_goal(graph):
    suite = Suite(graph)
    suite.carry_out(0.5)
    graph.call(Trigger, '/flat_plant/reset')
    graph.expect(lambda: suite.states[-1].position[0] == 0.0, 'the reset')

    def is_replanned() -> bool:
        return graph.call(Trigger, '/flat_planner/replan').success

    before = len(suite.reports)
    graph.expect(is_replanned, 'a plan from the reset state')
    graph.expect(lambda: len(suite.reports) > before, 'a report')
    assert suite.plans[-1].points[-1].positions[0] == 0.5
    assert suite.states[-1].position[0] == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize(('bandwidth', 'tolerance'), [(0.0, 1e-6), (20.0, 0.0)])
def test_servos_leave_what_is_predicted_for_servos(graph, bandwidth, tolerance):
    heavy = {
        'joints': ['joint1', 'joint2'],
        'model.inertia_star': [6.4e-4, 2.5e-4],
        'model.stiffness': 2.3e-2,
        'model.damping': 2.0e-5,
    }
    command = {
        'command.include_effort': False,
        'command.include_passive_joint': False,
        'command.include_acceleration': False,
        'command.tolerance': tolerance,
    }
    softer = {'mismatch.stiffness_scale': 0.9, 'servo.bandwidth': bandwidth}
    suite = Suite(
        graph,
        {**heavy, **command, 'strategy': 'insensitive'},
        {**heavy, **softer},
        *('-p', 'drive:=position'),
    )
    verdict, report = suite.carry_out(pi, 1.2)
    assert float(verdict['predicted_residual_worst']) < 0.006
    assert (len(suite.commands[-1].points) < 150) == bool(tolerance)
    left = float(report['amplitude'])
    assert 5e-4 < left <= float(verdict['predicted_residual_worst']) * 1.02
