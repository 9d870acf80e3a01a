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

"""Drivers as they are: joint states in parts, without stamps, from several publishers."""

from math import pi

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from flat_planner_ros.ros.nodes.monitor_node import MonitorNode
from flat_planner_ros.ros.nodes.planner_node import PlannerNode
from flat_planner_ros.ros.wire import interfaces, stamps
import numpy as np
import pytest
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

STATES = '/joint_states'
START, DURATION, WINDOW = 100.0, 0.5, 2.0
AMPLITUDE, FREQUENCY = 0.02, 1.7


def goal(angle=pi, duration=1.0):
    """Return a goal for joint 1."""
    point = JointTrajectoryPoint(
        positions=[float(angle)], time_from_start=stamps.duration_msg(duration)
    )
    return JointTrajectory(joint_names=['joint1'], points=[point])


def values(msg):
    """Return a message's only status as a dictionary, with its message."""
    (status,) = msg.status
    return {**{pair.key: pair.value for pair in status.values}, 'message': status.message}


class Drivers:
    """A planner and the drivers of an arm, each of which publishes by itself."""

    def __init__(self, graph, **parameters):
        """Start the planner."""
        self.graph = graph
        self.node = graph.create(PlannerNode, parameters)
        self.status = graph.collect(
            DiagnosticArray, '/flat_planner/status', interfaces.LATCHED_HISTORY
        )

    def publish(self, stamp=None, **positions):
        """Publish a joint state of now, or with a stamp of one's own."""
        msg = JointState(name=list(positions), position=list(positions.values()))
        now = stamps.now(self.node.get_clock())
        msg.header.stamp = stamps.time_msg(now if stamp is None else stamp)
        self.graph.publish(STATES, msg)

    def send(self, message):
        """Send a goal and return the values of the next thing that the planner says."""
        count = len(self.status)
        self.graph.publish('/flat_planner/goal', message)
        self.graph.expect(lambda: len(self.status) > count, 'a verdict')
        return values(self.status[count])


def test_a_motion_that_nobody_carries_out_fails_in_so_many_words(graph):
    drivers = Drivers(graph, **{'finish.patience': 0.2})
    graph.probe.create_timer(0.02, lambda: drivers.publish(joint1=0.25, joint2=0.0))
    nobody = 'nobody listens to /flat_planner/joint_trajectory'
    accepted = drivers.send(goal(duration=0.5))
    assert accepted['state'] == 'ACCEPTED'
    assert accepted['message'].endswith(nobody)
    assert drivers.status[0].status[0].level == DiagnosticStatus.WARN
    graph.expect(lambda: len(drivers.status) == 3, 'what became of it')
    astray, failed = map(values, drivers.status[1:])
    assert (astray['state'], astray['error_code']) == ('ASTRAY', '-4')
    assert (failed['state'], failed['error_code']) == ('FAILED', '-5')
    assert failed['error_name'] == 'GOAL_TOLERANCE_VIOLATED'
    assert (failed['plan_id'], failed['joint'], failed['value']) == ('1', 'joint1', '0.25')
    assert failed['message'] == (
        'plan 1 was not carried out: joint1 is at 0.25 rad, not at 3.142 rad '
        f'(finish.position_tolerance 0.1 rad): the arm has not moved; {nobody}'
    )


def test_an_executor_that_is_there_is_no_doubt(graph):
    drivers = Drivers(graph)
    commands = graph.collect(JointTrajectory, '/flat_planner/joint_trajectory')
    drivers.publish(joint1=0.0, joint2=0.0)
    assert 'nobody' not in drivers.send(goal(duration=0.3))['message']
    graph.expect(lambda: commands, 'a command')
    graph.expect(lambda: len(drivers.status) == 2, 'the end')
    finished = values(drivers.status[1])
    assert finished['state'] == 'FINISHED'
    assert finished['message'].endswith('; no joint state tells whether the arm is there')


def test_goals_before_the_first_joint_state_wait_for_it_and_keep_their_order(graph):
    drivers = Drivers(graph, **{'start.wait': 60.0})
    for angle in (1.0, 2.0):
        graph.publish('/flat_planner/goal', goal(angle))
    wrong = goal(duration=0.0)
    graph.publish('/flat_planner/goal', wrong)
    # The parameter services answer after all that came before.
    graph.get_parameters('flat_planner', 'start.wait')
    assert not drivers.status
    drivers.publish(joint1=0.25, joint2=0.0)
    graph.expect(lambda: len(drivers.status) >= 4, 'three verdicts and a preemption')
    verdicts = [v for v in map(values, drivers.status) if 'goal.positions' in v]
    assert [v['goal.positions'] for v in verdicts] == ['[1]', '[2]', f'[{pi:.9g}]']
    assert [v['state'] for v in verdicts] == ['ACCEPTED', 'ACCEPTED', 'REJECTED']


def test_a_goal_waits_no_longer_than_told_and_one_that_breaks_a_rule_not_at_all(graph):
    drivers = Drivers(graph, **{'start.wait': 0.1})
    refusal = drivers.send(goal())
    assert refusal['error_name'] == 'START_STATE_UNKNOWN'
    graph.set_parameters('flat_planner', **{'start.wait': 60.0})
    assert drivers.send(goal(duration=0.0))['error_name'] == 'DURATION_OUT_OF_RANGE'
    count = len(drivers.status)
    graph.publish('/flat_planner/goal', goal())
    graph.get_parameters('flat_planner', 'start.wait')
    assert len(drivers.status) == count
    graph.call(Trigger, '/flat_planner/stop')
    graph.expect(lambda: len(drivers.status) > count, 'a verdict')
    assert values(drivers.status[count])['error_name'] == 'START_STATE_UNKNOWN'


def test_goals_start_from_joint_states_in_parts(graph):
    drivers = Drivers(graph, **{'start.wait': 0.0})
    drivers.publish(joint1=0.25)
    graph.expect(lambda: graph.logged('joint states come in parts'), 'the first part')
    refusal = drivers.send(goal())
    assert refusal['error_name'] == 'START_STATE_UNKNOWN'
    assert refusal['message'] == ('joint2 has not been heard on joint_states; heard: joint1')
    drivers.publish(joint2=0.0)
    drivers.publish(joint1=0.25)
    graph.expect(lambda: drivers.node._session.measured, 'a sample')
    assert drivers.send(goal())['state'] == 'ACCEPTED'


def test_a_goal_starts_from_a_joint_state_without_a_stamp(graph):
    drivers = Drivers(graph)
    for _ in range(3):
        drivers.publish(stamp=0.0, joint1=0.25, joint2=0.0)
    graph.expect(lambda: drivers.node._session.measured, 'a sample')
    assert drivers.send(goal())['state'] == 'ACCEPTED'
    assert len(graph.logged('joint states have no stamp')) == 1


@pytest.mark.parametrize(
    ('shown', 'start', 'said'),
    [((3.1, -3.1), 2 * pi - 3.1, '+-pi'), ((0.02, 2 * pi - 0.01), -0.01, '0 to 2 pi')],
)
def test_a_goal_starts_from_the_turns_that_a_wrapped_joint_has_made(graph, shown, start, said):
    drivers = Drivers(graph)
    plans = graph.collect(JointTrajectory, '/flat_planner/plan', interfaces.LATCHED)
    for angle in shown:
        drivers.publish(joint1=angle, joint2=0.0)
        graph.expect(
            lambda q=angle: (
                (s := drivers.node._session.measured)
                and np.cos(s.positions[0] - q) == pytest.approx(1.0)
            ),
            'the sample',
        )
    assert drivers.send(goal(start + 0.4))['state'] == 'ACCEPTED'
    graph.expect(lambda: plans, 'a plan')
    assert plans[0].points[0].positions[0] == pytest.approx(start)
    graph.expect(lambda: graph.logged('joint1 is wrapped'), 'the remark')
    assert len(graph.logged(f'joint1 is wrapped to {said}')) == 1


def plan(start=0.0, final=1.0):
    """Return a cubic motion of joint 1."""
    msg = JointTrajectory(joint_names=['joint1', 'joint2'])
    msg.header.stamp = stamps.time_msg(START)
    for s in np.linspace(0.0, 1.0, 51).tolist():
        point = JointTrajectoryPoint(time_from_start=stamps.duration_msg(s * DURATION))
        point.positions = [start + (final - start) * s**2 * (3 - 2 * s), 0.0]
        point.velocities = [(final - start) * 6 * s * (1 - s) / DURATION, 0.0]
        msg.points.append(point)
    return msg


def test_the_monitor_judges_joint_states_in_parts(graph):
    """Joint 1 at 50 Hz and joint 2, which swings by a known amplitude, at 100 Hz."""
    monitor = graph.create(MonitorNode, {'window': WINDOW, 'timeout': 60.0})
    reports = graph.collect(DiagnosticArray, '/flat_monitor/report', interfaces.LATCHED)
    graph.publish('/flat_planner/plan', plan(), interfaces.LATCHED)
    graph.expect(lambda: monitor._plan, 'the plan')
    residuals = graph.collect(JointState, '/flat_monitor/residual')

    def told(time, name, position):
        msg = JointState(name=[name], position=[position])
        msg.header.stamp = stamps.time_msg(time)
        graph.publish(STATES, msg)

    told(START, 'joint1', 0.0)
    for k in range(round((DURATION + WINDOW) * 50) + 3):
        time = START + k / 50
        for fast in (time, time + 0.01):
            elapsed = fast - START - DURATION
            swing = AMPLITUDE * np.cos(2 * pi * FREQUENCY * elapsed) if elapsed >= 0.0 else 0.0
            told(fast, 'joint2', float(swing))
        s = min((time - START + 0.02) / DURATION, 1.0)
        told(time + 0.02, 'joint1', s**2 * (3 - 2 * s))
        graph.expect(lambda n=2 * k: len(residuals) > n, 'two residuals')
    graph.expect(lambda: reports, 'a report')
    report = values(reports[0])
    assert float(report['amplitude']) == pytest.approx(AMPLITUDE, rel=1e-3)
    assert float(report['frequency']) == pytest.approx(FREQUENCY, rel=1e-3)
    assert int(report['samples']) == pytest.approx(100 * WINDOW, abs=3)
    assert len(graph.logged('joint states come in parts')) == 2


def test_the_monitor_judges_a_wrapped_joint_by_its_turns(graph):
    """It comes from a turn that the monitor has not seen, and goes on over +pi."""
    monitor = graph.create(MonitorNode, {'window': WINDOW, 'timeout': 60.0})
    reports = graph.collect(DiagnosticArray, '/flat_monitor/report', interfaces.LATCHED)
    start, final = 2 * pi + 1.0, 3 * pi
    graph.publish('/flat_planner/plan', plan(start, final), interfaces.LATCHED)
    graph.expect(lambda: monitor._plan, 'the plan')
    residuals = graph.collect(JointState, '/flat_monitor/residual')
    noise = 1e-4 * np.random.default_rng(1).standard_normal(200)
    for k in range(round((DURATION + WINDOW) * 50) + 1):
        elapsed = k / 50 - DURATION
        s = min(k / 50 / DURATION, 1.0)
        angle = start + (final - start) * s**2 * (3 - 2 * s) + noise[k]
        swing = AMPLITUDE * np.cos(2 * pi * FREQUENCY * elapsed) if elapsed >= 0.0 else 0.0
        msg = JointState(name=['joint1', 'joint2'])
        msg.position = [float((angle + pi) % (2 * pi) - pi), float(swing)]
        msg.header.stamp = stamps.time_msg(START + k / 50)
        graph.publish(STATES, msg)
        graph.expect(lambda n=k: len(residuals) > n, 'a residual')
    graph.expect(lambda: reports, 'a report')
    report = values(reports[0])
    assert float(report['amplitude']) == pytest.approx(AMPLITUDE, rel=1e-3)
    assert float(report['final_error.joint1']) == pytest.approx(0.0, abs=1e-4)
    assert max(abs(msg.position[0]) for msg in residuals) < 1e-3
    assert len(graph.logged('joint1 is wrapped to +-pi')) == 1
