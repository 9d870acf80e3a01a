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

"""Via points through the nodes: plan and plant pass them, and nothing is left swinging."""

from diagnostic_msgs.msg import DiagnosticArray
from flat_planner_ros.ros import conversions, interfaces
from flat_planner_ros.ros.monitor_node import MonitorNode
from flat_planner_ros.ros.planner_node import PlannerNode
from flat_planner_ros.ros.plant_node import PlantNode
import numpy as np
import pytest
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

SPEED = 3.0
"""Simulated seconds per second: what one process of three nodes keeps up with on a busy core."""

TIMES = (0.4, 1.0, 1.6, 2.2)
"""Of three via points and the end, all on the grid of the command [s]."""

ANGLES = (1.0, 0.2, 1.5, 2.0)
"""Of the last link there [rad]."""


class Suite:
    """The three nodes on one graph, the plant owning the time."""

    def __init__(self, graph, **planner):
        """Start them and wait until they have found each other."""
        self.graph = graph
        simulated = {'use_sim_time': True}
        slow = {'reference_rate': 10.0, 'start_delay': 0.5}
        graph.create(PlannerNode, {**simulated, **slow, **planner})
        graph.create(MonitorNode, {**simulated, 'window': 2.0})
        graph.create(PlantNode, {'publish_clock': True, 'real_time_factor': SPEED})
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

    def verdict(self, times) -> dict[str, str]:
        """Send the points at some times; return the values of the verdict."""
        goal = JointTrajectory(joint_names=['joint1'])
        goal.points = [
            JointTrajectoryPoint(positions=[angle], time_from_start=conversions.duration_msg(time))
            for time, angle in zip(times, ANGLES, strict=True)
        ]
        known = len(self.status)
        self.graph.publish('/flat_planner/goal', goal)
        self.graph.expect(lambda: len(self.status) > known, 'a verdict')
        return values(self.status[known])


def values(message: DiagnosticArray) -> dict[str, str]:
    """Return the values of the first status."""
    return {pair.key: pair.value for pair in message.status[0].values}


def last_link(plan: JointTrajectory) -> tuple[np.ndarray, np.ndarray]:
    """Return the times of a plan [s] and the angle of the last link, the sum of all joints'."""
    times = [conversions.seconds(point.time_from_start) for point in plan.points]
    return np.array(times), np.array([sum(point.positions) for point in plan.points])


@pytest.mark.parametrize('strategy', ['polynomial', 'min_control_effort'])
def test_a_goal_with_three_via_points(graph, strategy):
    suite = Suite(graph, strategy=strategy)
    verdict = suite.verdict(TIMES)
    assert verdict['state'] == 'ACCEPTED'
    assert float(verdict['duration']) == TIMES[-1]
    graph.expect(lambda: suite.plans, 'the plan')
    times, angle = last_link(suite.plans[0])
    for time, expected in zip(TIMES, ANGLES, strict=True):
        index = int(np.argmin(np.abs(times - time)))
        assert times[index] == pytest.approx(time, abs=1e-9)
        assert angle[index] == pytest.approx(expected, abs=1e-9)
    # All that a joint_trajectory_controller asks of a command holds with via points, too.
    assert np.ptp(np.diff(times)) < 2e-9
    start = float(verdict['start_time'])
    graph.expect(lambda: suite.reports, 'a report')
    report = values(suite.reports[0])
    assert float(report['amplitude']) < 1e-5
    # Linear effort every 5 ms: it costs more of the place than of the rest.
    assert float(report['final_error.joint1']) == pytest.approx(0.0, abs=1e-4)
    measured = np.array(
        [(conversions.seconds(s.header.stamp) - start, sum(s.position)) for s in suite.states]
    )
    # A busy machine loses some states; those that come are as planned.
    planned = np.interp(measured[:, 0], times, angle)
    np.testing.assert_allclose(measured[:, 1], planned, rtol=0.0, atol=1e-3)


def test_via_points_without_times(graph):
    suite = Suite(graph, **{'duration.default': 2.2, 'strategy': 'min_control_effort'})
    verdict = suite.verdict([0.0] * len(TIMES))
    assert verdict['state'] == 'ACCEPTED'
    prescribed_cost = float(verdict['cost'])
    graph.expect(lambda: suite.plans, 'the plan')
    times, angle = last_link(suite.plans[0])
    assert times[-1] == pytest.approx(2.2)
    # There and back: the angle turns near the first two points and passes all of them.
    for expected in ANGLES[:-1]:
        assert angle.min() <= expected <= angle.max()
    assert angle.max() > ANGLES[0]
    graph.expect(lambda: suite.reports, 'a report')
    assert float(values(suite.reports[0])['amplitude']) < 1e-5
    assert prescribed_cost > 0.0


def test_velocities_at_via_points_are_refused(graph):
    suite = Suite(graph)
    goal = JointTrajectory(joint_names=['joint1'])
    goal.points = [
        JointTrajectoryPoint(
            positions=[1.0], velocities=[0.5], time_from_start=conversions.duration_msg(1.0)
        ),
        JointTrajectoryPoint(positions=[2.0], time_from_start=conversions.duration_msg(2.0)),
    ]
    graph.publish('/flat_planner/goal', goal)
    graph.expect(lambda: suite.status, 'a verdict')
    verdict = values(suite.status[0])
    assert verdict['error_name'] == 'INVALID_GOAL'
    assert verdict['joint'] == 'joint1'
    assert 'via points' in suite.status[0].status[0].message
