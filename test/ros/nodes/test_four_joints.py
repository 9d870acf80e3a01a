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

from flat_planner_ros.ros.wire import interfaces
import numpy as np
import pytest
from ros.rig import Suite, values
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

CONFIG = Path(__file__).resolve().parents[3] / 'config'

SPEED = 2.0
"""Simulated seconds per second: what one process of three nodes keeps up with on a busy core."""


class Arm(Suite):
    """The three nodes with one of the shipped parameter files."""

    def __init__(self, graph, file, planner=None, plant=None, speed=SPEED):
        """Start them."""
        super().__init__(graph, planner, plant, '--params-file', str(CONFIG / file), speed=speed)

    def report(self, angles, duration=1.5):
        """Carry a goal out; return the values of the report on its motion."""
        return self.carry_out(angles, duration)[1]

    def send_and_wait(self, angles, elapsed):
        """Send a goal; wait for a time within its motion."""
        verdict = self.send(angles, 1.5)
        assert verdict['state'] == 'ACCEPTED', self.status
        self.wait_until(float(verdict['start_time']) + elapsed)


def final_errors(report, joints):
    """Return the magnitudes of the final errors of some joints."""
    return np.array([abs(float(report[f'final_error.joint{i}'])) for i in joints])


def test_four_joints_in_a_vertical_plane_end_at_rest(graph):
    arm = Arm(graph, 'arm_4dof.yaml')
    brakes = arm.states[-1].position
    np.testing.assert_array_equal(brakes, [0.4, 0.5, -0.3, 0.0])
    report = arm.report([1.6, -0.6, 0.5])
    assert report['joint'] == 'joint4'
    assert float(report['amplitude']) < 1e-5
    assert (final_errors(report, (1, 2, 3)) < 1e-5).all()
    back = arm.report([0.4, 0.5, -0.3])
    assert float(back['amplitude']) < 1e-5
    assert (final_errors(back, (1, 2, 3)) < 2e-5).all()


@pytest.mark.parametrize(
    ('file', 'angles'), [('arm_3dof.yaml', [1.2, 0.8]), ('arm_4dof.yaml', [1.6, -0.6, 0.5])]
)
def test_a_goal_without_times_takes_the_shortest_motion_within_the_limits(graph, file, angles):
    arm = Arm(graph, file, planner={'duration.factor': 1.0})
    report = arm.report(angles, duration=0.0)
    (verdict,) = arm.verdicts('ACCEPTED')
    limits = arm.planner.get_parameters(['limits.velocity', 'limits.effort'])
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
    arm = Arm(graph, 'arm_4dof.yaml', planner={'replan.lookahead': 0.25}, speed=0.5)
    arm.send_and_wait([1.6, -0.6, 0.5], 0.5)
    arm.send_and_wait([0.2, 0.9, -0.4], 0.6)
    assert graph.call(Trigger, '/flat_planner/stop').success
    graph.expect(lambda: arm.verdicts('STOPPED'), 'the stop')
    assert len(arm.verdicts('PREEMPTED')) == 1
    graph.expect(lambda: arm.reports, 'a report')
    report = values(arm.reports[-1])
    assert float(report['amplitude']) < 1e-5
    assert (final_errors(report, (1, 2, 3)) < 2e-5).all()
    assert np.abs(arm.commands[-1].points[-1].effort[:2]).min() > 0.5


def test_the_command_of_an_arm_with_weight_holds_it_at_its_ends(graph):
    arm = Arm(graph, 'arm_4dof.yaml')
    plans = graph.collect(JointTrajectory, '/flat_planner/flat_plan', interfaces.LATCHED)
    arm.carry_out([1.0, 0.1, 0.2])
    command, flat = arm.commands[-1], plans[-1]
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
    report = Arm(graph, 'arm_4dof.yaml', plant=nothing).report([1.6, -0.6, 0.5])
    assert final_errors(report, (1,)) > 0.1
    assert float(report['amplitude']) < 1e-5


def test_a_plant_out_of_balance_swings(graph):
    arm = Arm(graph, 'arm_4dof.yaml', plant={'mismatch.imbalance': [0.0, 1e-4]})
    report = arm.report([1.6, -0.6, 0.5])
    assert 1e-4 < float(report['amplitude']) < 0.1
    graph.set_parameters('/flat_plant', **{'mismatch.imbalance': [0.0, 0.0]})
    graph.call(Trigger, '/flat_plant/reset')
    rest = [0.4, 0.5, -0.3, 0.0]
    graph.expect(lambda: list(arm.states[-1].position) == rest, 'the reset')


def test_three_joints_with_compensated_friction_end_at_rest(graph):
    arm = Arm(graph, 'arm_3dof.yaml')
    report = arm.report([1.2, 0.8], duration=1.2)
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
