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

"""A flood of faults is few lines, and a console that nobody reads holds nobody up."""

from contextlib import suppress
import os
import subprocess
import sys

from flat_planner_ros.ros.nodes.node_log import FaultGate, LONGEST
from rclpy.logging import LoggingSeverity
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

WARN, ERROR = LoggingSeverity.WARN, LoggingSeverity.ERROR
FLOOD = 1500


def test_one_fault_of_a_kind_passes_in_a_period_and_the_others_are_counted():
    gate = FaultGate()
    admitted = [gate.admits(f'late by {k} ms', WARN, 1.0, 0.001 * k) for k in range(FLOOD // 2)]
    assert admitted.index(True) == 0
    assert sum(admitted) == 1
    assert gate.take_due(0.9) == []
    assert gate.take_due(1.0) == [(WARN, 'late by 749 ms (the last of 749 like it in 1.0 s)')]
    assert not gate.admits('late by 1 ms', WARN, 1.0, 1.5)
    assert gate.take_due(2.0) == [(WARN, 'late by 1 ms')]
    assert gate.take_due(3.0) == []
    assert gate.admits('late by 2 ms', WARN, 1.0, 3.0)


def test_kinds_do_not_hold_each_other_up():
    gate = FaultGate()
    assert gate.admits('joint1 is late by 1 ms', WARN, 1.0, 0.0)
    assert gate.admits('joint2 is late by 1 ms', ERROR, 5.0, 0.0)
    assert not gate.admits('joint1 is late by -1.5e-3 ms', WARN, 1.0, 0.1)
    assert not gate.admits('joint2 is late by 7 ms', ERROR, 5.0, 0.1)
    assert gate.take_due(1.0) == [(WARN, 'joint1 is late by -1.5e-3 ms')]
    assert gate.take_due(5.0) == [(ERROR, 'joint2 is late by 7 ms')]


def test_many_kinds_are_few_lines_too():
    gate = FaultGate()
    admitted = [gate.admits('x' * k, WARN, 1.0, 0.0) for k in range(1, FLOOD)]
    assert sum(admitted) == 9
    assert len(gate.take_due(1.0)) == 1


def broken(names):
    """Return a command that no plant plays."""
    return JointTrajectory(joint_names=names, points=[JointTrajectoryPoint(positions=[1.0])])


def test_a_flood_of_broken_messages_is_a_handful_of_lines(graph):
    """Every message is answered: commands by a count, and the last goal by its verdict."""
    process = graph.start('demo')
    states = graph.collect(JointState, '/joint_states')
    graph.expect(lambda: states, 'joint states')
    for k in range(FLOOD):
        graph.publish('/flat_planner/joint_trajectory', broken(['joint1', 'joint2']), 1000)
        graph.publish('/joint_states', JointState(name=['joint1'], position=[0.0] * k), 1000)
        if k % 50 == 0:
            graph.call(Trigger, '/flat_plant/reset')
    assert process.exit_code is None
    lines = [x for x in process.stderr.splitlines() if 'ignored' in x]
    seconds = 1 + int(len(states) / 200)
    assert 0 < len(lines) <= 9 * seconds
    assert len(lines) < FLOOD / 20


def test_a_console_that_nobody_reads_holds_no_node_up(graph):
    reader, writer = os.pipe()
    environment = {**os.environ, 'ROS_DOMAIN_ID': str(graph.domain)}
    command = [sys.executable, '-m', 'flat_planner_ros.ros.nodes.plant_node']
    process = subprocess.Popen(command, stderr=writer, env=environment)
    try:
        states = graph.collect(JointState, '/joint_states')
        graph.expect(lambda: states, 'joint states')
        graph.call(Trigger, '/flat_plant/reset')
        fill(writer)
        for k in range(200):
            # Of kinds of their own, since one line for all would hardly fill anything.
            graph.publish(
                '/flat_planner/joint_trajectory', broken([f'j{k}' + LONGEST * 'x']), 1000
            )
        assert graph.call(Trigger, '/flat_plant/reset').success
        count = len(states)
        graph.expect(lambda: len(states) > count + 100, 'joint states')
    finally:
        process.kill()
        process.wait()
        os.close(reader)
        os.close(writer)


def fill(pipe):
    """Write to a pipe until it takes no more, through a description of its own."""
    # Not blocking through this one alone: the node's own end still waits.
    own = os.open(f'/proc/self/fd/{pipe}', os.O_WRONLY | os.O_NONBLOCK)
    with suppress(BlockingIOError):
        while True:
            os.write(own, bytes(4096))
    with suppress(BlockingIOError):
        while True:
            os.write(own, bytes(1))
    os.close(own)
