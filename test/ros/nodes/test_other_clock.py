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

"""Joint states from a computer with another clock, in real time."""

from math import cos, pi

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from flat_planner_ros.core.arm import OffsetFilter
from flat_planner_ros.ros.nodes.monitor_node import MonitorNode
from flat_planner_ros.ros.wire import diagnostics, interfaces, stamps
import numpy as np
import pytest
from ros.rig import Planner, values
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

AHEAD = 0.2
"""By how much the stamps are ahead [s]."""

DURATION, WINDOW, RATE = 1.0, 1.5, 100.0
AMPLITUDE, FREQUENCY = 0.05, 1.7


def angle(s):
    """Return a motion of joint 1 from rest to rest [rad]."""
    s = min(max(s, 0.0), 1.0)
    return s**3 * (10 - 15 * s + 6 * s**2)


def test_the_monitor_finds_the_offset_and_the_true_amplitude(graph):
    graph.create(MonitorNode, {'window': WINDOW, 'timeout': 5.0})
    reports = graph.collect(DiagnosticArray, '/flat_monitor/report', interfaces.LATCHED)
    health = graph.collect(DiagnosticArray, '/diagnostics')
    start = stamps.now(graph.probe.get_clock()) + 1.0
    plan = JointTrajectory(joint_names=['joint1', 'joint2'])
    plan.header.stamp = stamps.time_msg(start)
    for s in np.linspace(0.0, 1.0, 101).tolist():
        point = JointTrajectoryPoint(time_from_start=stamps.duration_msg(s * DURATION))
        point.positions = [angle(s), 0.0]
        plan.points.append(point)
    graph.publish('/flat_planner/plan', plan, interfaces.LATCHED)
    publisher = graph.probe.create_publisher(JointState, '/joint_states', 10)

    def tell():
        """Publish the state of now with a stamp of the other clock."""
        now = stamps.now(graph.probe.get_clock())
        after = now - start - DURATION
        swing = AMPLITUDE * cos(2 * pi * FREQUENCY * after) if after >= 0.0 else 0.0
        msg = JointState(name=['joint1', 'joint2'])
        msg.header.stamp = stamps.time_msg(now + AHEAD)
        msg.position = [angle((now - start) / DURATION), swing]
        publisher.publish(msg)

    graph.probe.create_timer(1.0 / RATE, tell)
    graph.expect(lambda: reports, 'a report')
    report = values(reports[0])
    assert float(report['clock_offset']) == pytest.approx(AHEAD, abs=2e-3)
    assert "ahead of the plan's clock" in reports[0].status[0].message
    assert float(report['amplitude']) == pytest.approx(AMPLITUDE, rel=0.02)
    graph.expect(
        lambda: 'clock_offset' in values(health[-1]),
        'the same in the next message on /diagnostics',
    )
    # A transport takes time, so that it can only seem less.
    assert AHEAD - 0.05 < float(values(health[-1])['stamp_minus_arrival']) <= AHEAD


@pytest.mark.parametrize(
    ('ahead', 'level', 'said'),
    [
        (0.0, DiagnosticStatus.OK, ''),
        (0.05, DiagnosticStatus.WARN, "are stamped 0.049 s ahead of the planner's clock"),
        (5.0, DiagnosticStatus.ERROR, "are stamped 5 s ahead of the planner's clock"),
        (-5.0, DiagnosticStatus.ERROR, 'arrive 5 s after their stamps'),
    ],
)
def test_a_verdict_says_by_how_much_clocks_differ(ahead, level, said):
    """As the planner hears it: joint states that take 1 ms to come, then a goal."""
    heard = OffsetFilter()
    for time in np.arange(100.0, 101.0, 0.01).tolist():
        heard.hear(time + ahead, time + 0.001)
    given = DiagnosticStatus(level=min(level, DiagnosticStatus.ERROR), message='the verdict')
    if level == DiagnosticStatus.WARN:
        given.level = DiagnosticStatus.OK
    status = diagnostics.with_clock(given, heard.sure)
    assert status.level == level
    assert said in status.message
    assert ('clock_offset' in {pair.key for pair in status.values}) == bool(said)


def test_a_few_late_joint_states_are_no_other_clock():
    heard = OffsetFilter()
    for time in range(10):
        heard.hear(time, time + 0.1)
    assert heard.sure is None


def test_the_planner_says_it_in_its_verdict(graph):
    rig = Planner(graph, {'start.joint_state_timeout': 100.0})
    state = JointState(name=['joint1', 'joint2'], position=[0.0, 0.0], velocity=[0.0, 0.0])

    def has_heard():
        state.header.stamp = stamps.time_msg(rig.now() + AHEAD)
        graph.publish('/joint_states', state)
        return rig.node._offset.sure is not None

    graph.expect(has_heard, 'joint states')
    verdict = rig.send(1.0)
    assert verdict['level'] == DiagnosticStatus.WARN
    assert "s ahead of the planner's clock" in verdict['message']
    assert 0.02 < float(verdict['clock_offset']) <= AHEAD
