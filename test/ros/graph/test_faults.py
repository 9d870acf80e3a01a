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

"""What nobody wants: doubled nodes, broken joint states, clocks that jump. All nodes survive."""

from math import nan

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from flat_planner_ros.ros.nodes.monitor_node import MonitorNode
from flat_planner_ros.ros.nodes.planner_node import PlannerNode
from flat_planner_ros.ros.nodes.plant_node import PlantNode
from flat_planner_ros.ros.wire import interfaces, stamps
import numpy as np
import pytest
from rcl_interfaces.msg import Log
from ros.rig import COMMAND, GOAL, goal, Rig, stamp, STATES, STATUS, values
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

SIMULATED = {'use_sim_time': True}


def state(time, position=(0.0, 0.0), velocity=(0.0, 0.0), names=('joint1', 'joint2')):
    """Return a joint state."""
    msg = JointState(name=list(names), position=list(position), velocity=list(velocity))
    msg.header.stamp = stamps.time_msg(time)
    return msg


def errors(graph, text):
    """Return the nodes that have logged an error with a text."""
    return {e.name for e in graph.log if e.level >= Log.ERROR and text in e.msg}


class Timed(Rig):
    """Nodes that follow a clock of the test."""

    def __init__(self, graph, *classes):
        """Start them."""
        super().__init__(graph)
        self.time = 0.0
        self.hear_plant(matched=False)
        self.hear_planner(matched=False)
        self.hear_monitor(matched=False)
        self.plant, *_ = (graph.create(node_class, SIMULATED) for node_class in classes)
        self.count = len(classes)

    def show(self, time):
        """Publish a time, once all hear it, and let it be worked off."""
        self.time = time
        self.graph.publish('/clock', Clock(clock=stamps.time_msg(time)), readers=self.count)

    def run(self, until, step=0.02):
        """Let time go on until the plant has shown it."""
        while self.time < until:
            self.show(self.time + step)
            self.graph.expect(lambda: abs(self.seen() - self.time) < 0.01, f'{self.time} s')

    def seen(self):
        """Return the stamp of the newest joint state [s]."""
        return stamp(self.states[-1])

    def move(self, position):
        """Send a goal; return its verdict."""
        verdict = self.send(position)
        if verdict['state'] == 'ACCEPTED':
            start = float(verdict['start_time'])
            self.graph.expect(
                lambda: getattr(self.plant._arm._profile, 'end', 0.0) > start, 'a command'
            )
        return verdict


def test_two_planners_on_one_topic_are_found(graph):
    for node_class in (PlannerNode, PlannerNode, PlantNode, MonitorNode):
        graph.create(node_class)
    text = 'is published by /flat_planner, /flat_planner'
    expected = {'flat_planner', 'flat_plant', 'flat_monitor'}
    graph.expect(lambda: errors(graph, text) == expected, 'an error of each node')

    def said():
        return [e for e in graph.log if e.name == 'flat_plant' and text in e.msg]

    graph.expect(lambda: len(said()) >= 3, 'three of the same node')
    times = np.array([stamps.seconds(e.stamp) for e in said()])
    # One a second; a busy node is late, and then in time.
    assert len(times) <= np.ptp(times) + 2.0


def test_two_plants_on_one_topic_are_found(graph):
    for node_class in (PlannerNode, PlantNode, PlantNode, MonitorNode):
        graph.create(node_class, {'publish_clock': True} if node_class is PlantNode else {})
    expected = {'flat_planner', 'flat_plant', 'flat_monitor'}
    text = '/joint_states is published by /flat_plant, /flat_plant'
    graph.expect(lambda: errors(graph, text) == expected, 'an error of each node')
    graph.expect(lambda: errors(graph, '/clock is published by'), 'an error about the clock')


def test_another_source_for_the_same_joints_is_found(graph):
    for node_class in (PlannerNode, PlantNode):
        graph.create(node_class)
    graph.publish(STATES, state(1.0))
    graph.expect(lambda: 'flat_planner' in errors(graph, 'is published by'), 'an error')


def test_several_robots_on_one_topic_are_fine(graph):
    planner = graph.create(PlannerNode)
    # So rarely that a busy planner hears the other one, too.
    graph.create(PlantNode, {'publish_rate': 10.0})
    other = graph.probe.create_publisher(JointState, STATES, 10)
    graph.probe.create_timer(0.2, lambda: other.publish(state(1.0, names=('left', 'right'))))
    graph.expect(lambda: planner.count_publishers(STATES) == 2, 'both sources')
    # Before the other one has been heard, it may be one of the same joints.
    graph.expect(lambda: graph.logged('no joint joint1, joint2 among left, right'), 'its joints')
    # A second planner is a fault, of which every look at the graph tells, with all that it finds.
    graph.probe.create_publisher(JointTrajectory, COMMAND, 10)

    def looks():
        text = f'{COMMAND} is published by'
        return [e.msg for e in graph.log if e.name == 'flat_planner' and text in e.msg]

    graph.expect(lambda: len(looks()) >= 3, 'three looks of the planner')
    assert not [look for look in looks() if f'{STATES} is published by' in look]


BROKEN = {
    'NaN': state(0.0, (nan, 0.0)),
    'passive NaN': state(0.0, (0.0, nan)),
    'sizes': state(0.0, (0.0,)),
    'names': state(0.0, names=('a', 'b')),
    'far away': state(0.0, (1e300, 0.0)),
}
"""Joint states from which no motion can start."""


@pytest.mark.parametrize('name', BROKEN)
def test_no_motion_starts_from_broken_joint_states(graph, name):
    graph.create(PlannerNode)
    statuses = graph.collect(DiagnosticArray, STATUS)
    commands = graph.collect(JointTrajectory, COMMAND)
    BROKEN[name].header.stamp = graph.probe.get_clock().now().to_msg()
    graph.publish(STATES, BROKEN[name])
    graph.publish(GOAL, goal(1.0))
    graph.expect(lambda: statuses, 'a verdict')
    assert values(statuses[0])['state'] == 'REJECTED'
    assert not commands


def test_a_late_joint_state_does_not_take_the_place_of_a_newer_one(graph):
    planner = graph.create(PlannerNode)
    plans = graph.collect(JointTrajectory, '/flat_planner/plan')
    now = stamps.now(graph.probe.get_clock())
    graph.publish(STATES, state(now, (0.5, 0.0)))
    graph.publish(STATES, state(now - 0.1, (-0.5, 0.0)))
    for _ in range(3):  # until both have been worked off
        graph.get_parameters('flat_planner', 'strategy')
    graph.publish(GOAL, goal(1.0))
    graph.expect(lambda: plans, 'a plan')
    assert plans[0].points[0].positions[0] == 0.5
    assert planner.context.ok()


@pytest.mark.parametrize('jump', [-50.0, 50.0, -0.3])
def test_all_survive_a_clock_that_jumps_in_a_motion_and_the_next_one_works(graph, jump):
    timed = Timed(graph, PlantNode, PlannerNode, MonitorNode)
    timed.show(100.0)
    graph.expect(lambda: timed.states, 'joint states')
    timed.run(100.1)
    assert timed.move(1.0)['state'] == 'ACCEPTED'
    timed.run(100.6)
    assert timed.states[-1].effort[0] != 0.0
    seen = len(timed.states)
    timed.show(100.6 + jump)
    graph.expect(
        lambda: graph.logged('skipped to keep up' if jump > 0 else 'clock was set back'),
        'a word of the plant',
    )
    timed.run(100.7 + jump)
    assert not [s for s in timed.states[seen + 2 :] if s.effort[0]]
    timed.run(103.0 + jump, 0.1)
    graph.call(Trigger, '/flat_plant/reset')
    timed.run(103.2 + jump)
    timed.reports.clear()
    verdict = timed.move(0.5)
    if jump < 0 and verdict['state'] == 'REJECTED':  # what was planned lies in the future again
        timed.run(104.5)
        verdict = timed.move(0.5)
    assert verdict['state'] == 'ACCEPTED'
    timed.run(timed.time + 2.0)
    timed.run(timed.time + 4.0, 0.1)
    assert timed.states[-1].position[0] == pytest.approx(0.5, abs=1e-3)
    graph.expect(lambda: timed.reports, 'a report')


def test_the_monitor_follows_what_the_planner_adopts(graph):
    graph.create(MonitorNode)
    status = adoption(stiffness=3.3e-3, damping=2.2e-5)
    graph.publish(STATUS, status, interfaces.LATCHED_HISTORY)
    graph.expect(
        lambda: graph.get_parameters('flat_monitor', 'model.stiffness') == [3.3e-3], 'a new model'
    )
    assert graph.get_parameters('flat_monitor', 'model.damping') == [2.2e-5]
    graph.publish(STATUS, adoption(stiffness=-1.0, damping=0.0))
    graph.expect(lambda: graph.logged('is not followed'), 'a refusal')
    assert graph.get_parameters('flat_monitor', 'model.stiffness') == [3.3e-3]


def adoption(**quantities):
    """Return what a planner says when it has adopted a stiffness and a damping."""
    pairs = [KeyValue(key=key, value=str(value)) for key, value in quantities.items()]
    return DiagnosticArray(status=[DiagnosticStatus(name=interfaces.MODEL_NAME, values=pairs)])
