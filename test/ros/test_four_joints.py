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

"""The shipped arms of three and four joints through the three nodes."""

from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray
from flat_planner_ros.ros import conversions, interfaces
from flat_planner_ros.ros.monitor_node import MonitorNode
from flat_planner_ros.ros.planner_node import PlannerNode
from flat_planner_ros.ros.plant_node import PlantNode
import numpy as np
import pytest
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

CONFIG = Path(__file__).resolve().parents[2] / 'config'

SPEED = 2.0
"""Simulated seconds per second: what one process of three nodes keeps up with on a busy core."""


class Suite:
    """The three nodes with one parameter file, the plant owning the time."""

    def __init__(self, graph, file, planner=None, plant=None, speed=SPEED):
        """Start them and wait until they have found each other."""
        self.graph = graph
        given = ('--params-file', str(CONFIG / file))
        simulated = {'use_sim_time': True}
        clock = {'publish_clock': True, 'real_time_factor': speed}
        slow = {'reference_rate': 10.0, 'start_delay': 0.5}
        self.planner = graph.create(PlannerNode, {**simulated, **slow, **(planner or {})}, *given)
        graph.create(MonitorNode, {**simulated, 'window': 2.0}, *given)
        graph.create(PlantNode, {**clock, **(plant or {})}, *given)
        status, report = '/flat_planner/status', '/flat_monitor/report'
        self.status = graph.collect(DiagnosticArray, status, interfaces.LATCHED_HISTORY)
        self.reports = graph.collect(DiagnosticArray, report, interfaces.LATCHED)
        self.commands = graph.collect(JointTrajectory, '/flat_planner/joint_trajectory')
        self.flat = graph.collect(JointTrajectory, '/flat_planner/flat_plan', interfaces.LATCHED)
        self.states = graph.collect(JointState, '/joint_states', interfaces.RELIABLE)
        graph.expect(
            lambda: graph.probe.count_subscribers('/joint_states') == 3 and self.states,
            'the three nodes on joint_states',
        )

    def send(self, angles, duration=1.5):
        """Send a goal for the actuated joints; return the values of its verdict."""
        before = len(self.verdicts('ACCEPTED', 'REJECTED'))
        goal = JointTrajectory(joint_names=[f'joint{i + 1}' for i in range(len(angles))])
        goal.points = [
            JointTrajectoryPoint(
                positions=angles, time_from_start=conversions.duration_msg(duration)
            )
        ]
        self.graph.publish('/flat_planner/goal', goal)
        self.graph.expect(lambda: len(self.verdicts('ACCEPTED', 'REJECTED')) > before, 'a verdict')
        verdict = self.verdicts('ACCEPTED', 'REJECTED')[before]
        assert verdict['state'] == 'ACCEPTED', self.status
        return verdict

    def move(self, angles, duration=1.5):
        """Carry a goal out; return the values of the report on its motion."""
        before = len(self.reports)
        self.send(angles, duration)
        self.graph.expect(lambda: len(self.reports) > before, 'a report')
        return values(self.reports[-1])

    def wait_into(self, verdict, elapsed):
        """Wait for a time within an accepted motion."""
        time = float(verdict['start_time']) + elapsed
        self.graph.expect(
            lambda: conversions.seconds(self.states[-1].header.stamp) >= time, f'{time} s'
        )

    def verdicts(self, *states):
        """Return the values of all verdicts with one of these states."""
        return [found for message in self.status if (found := values(message))['state'] in states]


def values(message: DiagnosticArray) -> dict[str, str]:
    """Return the values of the first status."""
    return {pair.key: pair.value for pair in message.status[0].values}


def final_errors(report, joints):
    """Return the magnitudes of the final errors of some joints."""
    return np.array([abs(float(report[f'final_error.joint{i}'])) for i in joints])


def test_four_joints_in_a_vertical_plane_end_at_rest(graph):
    suite = Suite(graph, 'arm_4dof.yaml')
    brakes = suite.states[-1].position
    np.testing.assert_array_equal(brakes, [0.4, 0.5, -0.3, 0.0])
    report = suite.move([1.6, -0.6, 0.5])
    assert report['joint'] == 'joint4'
    assert float(report['amplitude']) < 1e-5
    assert (final_errors(report, (1, 2, 3)) < 1e-5).all()
    back = suite.move([0.4, 0.5, -0.3])
    assert float(back['amplitude']) < 1e-5
    assert (final_errors(back, (1, 2, 3)) < 2e-5).all()


@pytest.mark.parametrize(
    ('file', 'angles'), [('arm_3dof.yaml', [1.2, 0.8]), ('arm_4dof.yaml', [1.6, -0.6, 0.5])]
)
def test_a_goal_without_times_takes_the_shortest_motion_within_the_limits(graph, file, angles):
    suite = Suite(graph, file)
    report = suite.move(angles, duration=0.0)
    (verdict,) = suite.verdicts('ACCEPTED')
    limits = suite.planner.get_parameters(['limits.velocity', 'limits.effort'])
    shares = [
        float(verdict[f'peak_{quantity}.joint{i + 1}']) / limit
        for quantity, values in zip(('velocity', 'effort'), limits, strict=True)
        for i, limit in enumerate(values.value)
    ]
    assert 0.99 < max(shares) <= 1.0
    assert float(report['amplitude']) < 1e-5


@pytest.mark.timeout(240)
def test_new_goals_and_a_stop_in_motion_leave_the_vertical_arm_at_rest(graph):
    """Spliced commands hold the arm's weight all the way."""
    suite = Suite(graph, 'arm_4dof.yaml', planner={'replan.lookahead': 0.25}, speed=0.5)
    suite.wait_into(suite.send([1.6, -0.6, 0.5]), 0.5)
    verdict = suite.send([0.2, 0.9, -0.4])
    suite.wait_into(verdict, 0.6)
    assert graph.call(Trigger, '/flat_planner/stop').success
    graph.expect(lambda: suite.verdicts('STOPPED'), 'the stop')
    assert len(suite.verdicts('PREEMPTED')) == 1
    graph.expect(lambda: suite.reports, 'a report')
    report = values(suite.reports[-1])
    assert float(report['amplitude']) < 1e-5
    assert (final_errors(report, (1, 2, 3)) < 2e-5).all()
    assert np.abs(suite.commands[-1].points[-1].effort[:2]).min() > 0.5


def test_the_command_of_an_arm_with_weight_holds_it_at_its_ends(graph):
    suite = Suite(graph, 'arm_4dof.yaml')
    suite.move([1.0, 0.1, 0.2], duration=1.0)
    command, flat = suite.commands[-1], suite.flat[-1]
    assert command.joint_names == ['joint1', 'joint2', 'joint3', 'joint4']
    first, last = command.points[0], command.points[-1]
    assert np.abs(first.effort[:2]).min() > 1.0
    assert np.abs(last.effort[:2]).min() > 1.0
    for point in (first, last):
        assert list(point.effort[2:]) == [0.0, 0.0]
        assert list(point.velocities) == list(point.accelerations) == [0.0] * 4
    assert flat.joint_names == ['y1', 'y2', 'y3', 'y1_d3']
    assert len(flat.points) == len(command.points)
    middle = len(flat.points) // 3
    q, y = command.points[middle].positions, flat.points[middle].positions
    assert y[0] == pytest.approx(sum(q), abs=1e-12)
    assert list(y[1:3]) == list(q[:2])


def test_pure_feed_forward_leaves_the_spring_at_rest_though_the_arm_falls(graph):
    """What the feedback of the shipped file is for, and what not."""
    nothing = {'feedback.p': [0.0, 0.0, 0.0], 'feedback.d': [0.0, 0.0, 0.0]}
    report = Suite(graph, 'arm_4dof.yaml', plant=nothing).move([1.6, -0.6, 0.5])
    assert final_errors(report, (1,)) > 0.1
    assert float(report['amplitude']) < 1e-5


def test_a_plant_out_of_balance_swings(graph):
    suite = Suite(graph, 'arm_4dof.yaml', plant={'mismatch.imbalance': [0.0, 1e-4]})
    report = suite.move([1.6, -0.6, 0.5])
    assert 1e-4 < float(report['amplitude']) < 0.1
    graph.set_parameters('/flat_plant', **{'mismatch.imbalance': [0.0, 0.0]})
    graph.call(Trigger, '/flat_plant/reset')
    rest = [0.4, 0.5, -0.3, 0.0]
    graph.expect(lambda: list(suite.states[-1].position) == rest, 'the reset')


def test_three_joints_with_compensated_friction_end_at_rest(graph):
    suite = Suite(graph, 'arm_3dof.yaml')
    report = suite.move([1.2, 0.8], duration=1.2)
    assert float(report['amplitude']) < 1e-5
    assert (final_errors(report, (1, 2)) < 2e-4).all()


def test_an_arm_that_is_not_flat_is_refused_with_what_would_mend_it(graph):
    process = graph.start(
        'planner_node',
        *('--ros-args', '--params-file', str(CONFIG / 'arm_4dof.yaml')),
        *('-p', 'model.counterbalance_arm:=[0.1, 0.04]'),
    )
    assert process.wait() == 1
    (line,) = process.stderr.strip().splitlines()
    assert 'link 4 is not balanced: the centre of mass' in line
    assert '0.00666667 m off the axis of joint 4' in line
    assert 'counterbalance_arm = [0.1, 0.05] m' in line
    assert 'counterbalance_mass = [0.79315, 0.15] kg' in line
