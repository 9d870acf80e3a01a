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

"""Nothing moves by itself: not after a restart, not from an old, late or foreign command."""

from flat_planner_ros.ros.nodes.planner_node import PlannerNode
from flat_planner_ros.ros.wire import interfaces, stamps
import numpy as np
import pytest
from ros.rig import COMMAND, PLAN, Rig, stamp, START_DELAY
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

DURATION = 9.0
"""Of a motion [s]: long enough to restart a process in the middle of it."""


class Watched(Rig):
    """A planner in the test and a plant in a process of its own, both watched."""

    def __init__(self, graph, *arguments):
        """Start both and wait for the first joint state."""
        super().__init__(graph)
        self.arguments = arguments
        self.hear_plant(matched=False)
        self.planner = graph.create(PlannerNode, {'start_delay': START_DELAY})
        self.hear_planner()
        self.start()

    def start(self):
        """Start a plant and wait until it shows itself and hears commands."""
        # One that was killed stays in the graph for a while.
        listeners = self.graph.probe.count_subscribers(COMMAND)
        now = stamps.now(self.graph.probe.get_clock())
        self.plant = self.graph.start('plant_node', *self.arguments)
        self.graph.expect(
            lambda: self.states and stamp(self.states[-1]) > now, 'joint states of a new plant'
        )
        # Some of the former one's may have been on their way.
        self.states[:] = [state for state in self.states if stamp(state) > now]
        self.graph.expect(
            lambda: self.planner.count_subscribers(COMMAND) > listeners, 'a new listener'
        )

    def move(self, position: float, duration: float = DURATION) -> JointTrajectory:
        """Send a goal until it is accepted; return its plan."""
        plans = self.graph.collect(JointTrajectory, PLAN)
        super().move(position, duration)
        self.graph.expect(lambda: plans, 'the plan')
        return plans[0]

    def assert_next_goal_works(self) -> None:
        """Move until it is seen: a new process may not be reached for seconds by its peers."""
        for _ in range(5):
            self.move(0.5, 1.0)
            if self.graph.spin_until(lambda: self.states[-1].position[0] > 0.49, 5.0):
                return
        pytest.fail('no motion is played')


def test_a_plant_that_was_killed_in_a_motion_does_not_take_it_up_again(graph):
    watched = Watched(graph)
    start = stamp(watched.move(1.0))
    watched.wait_until(start + 0.15 * DURATION)
    assert watched.efforts().any()
    watched.plant.kill()
    watched.start()
    assert stamp(watched.states[0]) < start + DURATION, 'restarted within the motion'
    late = graph.collect(JointTrajectory, PLAN, interfaces.LATCHED)
    graph.expect(lambda: late, 'the plan, latched all the same')
    watched.wait_until(start + DURATION + 0.2)
    assert not watched.efforts().any()
    assert not np.any([state.position for state in watched.states])
    watched.assert_next_goal_works()


def test_no_motion_takes_over_where_a_restarted_plant_stands_still(graph):
    watched = Watched(graph)
    end = stamp(watched.move(2.0)) + DURATION
    watched.wait_until(end - 0.5 * DURATION)
    watched.plant.kill()
    watched.start()
    new = stamp(watched.states[0])
    graph.expect(lambda: watched.planner._session.measured.time > new, 'a state of it there')
    verdict = watched.send(1.0, 1.0)
    assert watched.planner._session.measured.time < end, 'within the motion'
    assert verdict['error_name'] == 'START_STATE_MISMATCH', verdict
    assert float(verdict['limit']) == 0.5
    watched.wait_until(end + 0.2)
    assert not watched.efforts().any()
    watched.assert_next_goal_works()


def test_a_command_sent_again_after_a_restart_is_refused_as_elsewhere(graph):
    watched = Watched(graph)
    commands = graph.collect(JointTrajectory, COMMAND)
    watched.move(1.0)
    graph.expect(lambda: commands, 'a command')
    watched.wait_until(stamp(commands[0]) + 0.15 * DURATION)
    watched.plant.kill()
    watched.start()
    graph.publish(COMMAND, commands[0], readers=3)
    graph.expect(lambda: graph.logged('trajectory ignored: joint 1 should be at'), 'a refusal')
    watched.wait_until(stamp(commands[0]) + DURATION + 0.2)
    assert not watched.efforts().any()


@pytest.mark.parametrize('late_by', [1.001, 2.0, 1e9])
def test_a_command_older_than_its_own_length_is_never_played(graph, late_by):
    watched = Watched(graph)
    point = JointTrajectoryPoint(time_from_start=stamps.duration_msg(DURATION), effort=[0.0])
    first = JointTrajectoryPoint(effort=[1e-3])
    message = JointTrajectory(joint_names=['joint1'], points=[first, point])
    now = stamps.now(watched.planner.get_clock())
    message.header.stamp = stamps.time_msg(max(1e-9, now - late_by * DURATION))
    graph.publish(COMMAND, message)
    graph.expect(lambda: graph.logged('trajectory ignored: it ended at'), 'a refusal')
    watched.wait_until(stamp(watched.states[-1]) + 0.2)
    assert not watched.efforts().any()


def test_a_planner_that_was_restarted_moves_nothing(graph):
    watched = Watched(graph)
    graph.remove(watched.planner)
    planner = graph.start('planner_node')
    start = stamp(watched.move(1.0, 1.0))
    watched.wait_until(start + 0.5)
    planner.kill()
    watched.wait_until(start + 1.2)  # The plant has all of the motion, and ends it.
    assert watched.states[-1].position[0] == pytest.approx(1.0, abs=1e-3)
    watched.states.clear()
    started = len(graph.logged('no model is given'))
    graph.start('planner_node')
    graph.expect(lambda: len(graph.logged('no model is given')) > started, 'a new planner')
    watched.wait_until(start + 3.0)
    assert not watched.efforts().any()
    watched.move(0.0, 1.0)
    graph.expect(lambda: abs(watched.states[-1].position[0]) < 1e-3, 'the way back')
