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

from diagnostic_msgs.msg import DiagnosticArray
from flat_planner_ros.ros import conversions, interfaces
from flat_planner_ros.ros.monitor_node import MonitorNode
from flat_planner_ros.ros.planner_node import PlannerNode
from flat_planner_ros.ros.plant_node import PlantNode
import pytest
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

SPEED = 3.0
"""Simulated seconds per second: what one process of three nodes keeps up with on a busy core."""


class Suite:
    """The three nodes on one graph, the plant owning the time."""

    def __init__(self, graph, planner=None, plant=None, monitor=None):
        """Start them and wait until they have found each other."""
        self.graph = graph
        simulated = {'use_sim_time': True}
        clock = {'publish_clock': True, 'real_time_factor': SPEED}
        slow = {'reference_rate': 10.0, 'start_delay': 0.5}
        self.planner = graph.create(PlannerNode, {**simulated, **slow, **(planner or {})})
        self.monitor = graph.create(MonitorNode, {**simulated, 'window': 2.0, **(monitor or {})})
        self.plant = graph.create(PlantNode, {**clock, **(plant or {})})
        self.status = graph.collect(
            DiagnosticArray, '/flat_planner/status', interfaces.LATCHED_HISTORY
        )
        self.reports = graph.collect(DiagnosticArray, '/flat_monitor/report', interfaces.LATCHED)
        self.plans = graph.collect(JointTrajectory, '/flat_planner/plan', interfaces.LATCHED)
        self.states = graph.collect(JointState, '/joint_states', interfaces.RELIABLE)
        self.clock = graph.collect(Clock, '/clock')
        graph.expect(
            lambda: graph.probe.count_subscribers('/joint_states') == 3 and self.states,
            'the three nodes on joint_states',
        )

    def move(self, angle: float, duration: float = 1.0) -> tuple[dict[str, str], dict[str, str]]:
        """Send a goal; return the values of its verdict and of the report on its motion."""
        verdicts, reports = len(self.status), len(self.reports)
        goal = JointTrajectory(joint_names=['joint1'])
        goal.points = [
            JointTrajectoryPoint(
                positions=[angle], time_from_start=conversions.duration_msg(duration)
            )
        ]
        self.graph.publish('/flat_planner/goal', goal)
        self.graph.expect(lambda: len(self.status) > verdicts, 'a verdict')
        verdict = values(self.status[verdicts])
        assert verdict['state'] == 'ACCEPTED', self.status[verdicts].status[0].message
        self.graph.expect(lambda: len(self.reports) > reports, 'a report')
        return verdict, values(self.reports[-1])


def values(message: DiagnosticArray) -> dict[str, str]:
    """Return the values of the first status."""
    return {pair.key: pair.value for pair in message.status[0].values}


@pytest.mark.parametrize(
    'strategy', ['polynomial', 'min_control_effort', 'min_potential_energy', 'mixed']
)
def test_the_exact_map_leaves_nothing_with_damping(graph, strategy):
    suite = Suite(graph, planner={'strategy': strategy, 'flat_model': 'exact'})
    _, report = suite.move(pi)
    assert float(report['amplitude']) < 1e-5
    assert float(report['final_error.joint1']) == pytest.approx(0.0, abs=1e-5)


def test_the_papers_map_leaves_what_the_paper_found(graph):
    suite = Suite(graph, planner={'strategy': 'polynomial', 'flat_model': 'approximate'})
    _, report = suite.move(pi)
    assert float(report['amplitude']) == pytest.approx(0.00449, rel=0.02)


def test_without_damping_nothing_is_left(graph):
    undamped = {'model.inertia_star': [6.4e-4, 3.3e-5], 'model.stiffness': 3e-3}
    undamped |= {'model.damping': 0.0, 'joints': ['joint1', 'joint2']}
    suite = Suite(graph, planner=undamped, plant=undamped)
    verdict, report = suite.move(pi)
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
    _, report = suite.move(pi)
    assert float(report['amplitude']) == pytest.approx(0.0758, rel=0.02)
    # The plant's own frequency, not the one that the model expects.
    ratio = float(report['frequency']) / float(report['frequency_expected'])
    assert ratio == pytest.approx(1.1**0.5, rel=2e-3)
    assert report['joint'] == 'joint2'
    assert suite.reports[-1].status[0].level == b'\x02'


def test_two_motions_give_two_reports_and_each_starts_where_the_last_ended(graph):
    approximate = {'strategy': 'min_potential_energy', 'flat_model': 'approximate'}
    suite = Suite(graph, planner=approximate)
    suite.move(1.0)
    _, second = suite.move(-0.5)
    assert len(suite.reports) == 2
    assert suite.plans[1].points[0].positions[0] == pytest.approx(1.0, abs=0.01)
    # What the first motion left, 0.95e-3 rad, has decayed to a third and adds to it.
    assert float(second['amplitude']) == pytest.approx(1.5 / pi * 0.00299, abs=0.35e-3)
    assert suite.states[-1].position[0] == pytest.approx(-0.5, abs=0.01)


def test_a_rejected_goal_disturbs_no_motion(graph):
    suite = Suite(graph, planner={'flat_model': 'approximate'})
    goal = JointTrajectory(joint_names=['joint1'])
    goal.points = [
        JointTrajectoryPoint(positions=[pi], time_from_start=conversions.duration_msg(1.0))
    ]
    graph.publish('/flat_planner/goal', goal)
    graph.expect(lambda: suite.status, 'a verdict')
    graph.expect(lambda: abs(suite.states[-1].effort[0]) > 0.0, 'the motion')
    graph.publish('/flat_planner/goal', JointTrajectory())
    graph.expect(lambda: suite.reports, 'a report')
    names = [values(message).get('error_name') for message in suite.status]
    assert names == ['SUCCESSFUL', 'EMPTY_GOAL', 'SUCCESSFUL']
    assert [values(message)['state'] for message in suite.status][-1] == 'FINISHED'
    assert float(values(suite.reports[0])['amplitude']) == pytest.approx(0.00358, rel=0.02)


def test_replan_repeats_the_last_goal(graph):
    suite = Suite(graph)
    suite.move(0.5)
    graph.call(Trigger, '/flat_plant/reset')
    graph.expect(lambda: suite.states[-1].position[0] == 0.0, 'the reset')

    def is_replanned() -> bool:
        return graph.call(Trigger, '/flat_planner/replan').success

    before = len(suite.reports)
    graph.expect(is_replanned, 'a plan from the reset state')
    graph.expect(lambda: len(suite.reports) > before, 'a report')
    assert suite.plans[-1].points[-1].positions[0] == 0.5
    assert suite.states[-1].position[0] == pytest.approx(0.5, abs=0.01)
