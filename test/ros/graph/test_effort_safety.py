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

from time import monotonic

from flat_planner_ros.ros.nodes.planner_node import PlannerNode
from flat_planner_ros.ros.wire import interfaces, stamps
import numpy as np
import pytest
from ros.conftest import TIMEOUT
from ros.rig import COMMAND, GOAL, PLAN, Rig, stamp, START_DELAY
from rosgraph_msgs.msg import Clock
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

DURATION = 3.0
"""Of a motion [s]: time stands still while a process is started in the middle of it."""

PACE = 0.1
"""Time that goes on at once [s]: a command comes some of them before its start."""

AGAIN = 0.05
"""Real time after which the clock is shown again, should it have been missed [s]."""

SIMULATED = {'use_sim_time': True, 'start_delay': START_DELAY}


class Watched(Rig):
    """A planner in the test and a plant in a process of its own, by a clock of the test."""

    def __init__(self, graph):
        """Start both and wait for the first joint state."""
        super().__init__(graph)
        self.time = 100.0
        self.hear_plant(matched=False)
        self.planner = graph.create(PlannerNode, SIMULATED)
        self.hear_planner()
        self.start()

    def start(self):
        """Start a plant and wait until it shows itself and hears commands."""
        # One that was killed stays in the graph for a while.
        listeners = self.graph.probe.count_subscribers(COMMAND)
        last = self.time
        self.time += 2.0 * PACE
        self.plant = self.graph.start('plant_node', '--ros-args', '-p', 'use_sim_time:=true')
        self.graph.expect(lambda: 'ready' in self.plant.stderr, 'a new plant')
        # Its first joint states may be sent to nobody: a sample later each time.
        self.show(
            lambda: self.states and stamp(self.states[-1]) > last, 'joint states of it', 0.005
        )
        # Some of the former one's may have been on their way.
        self.states[:] = [state for state in self.states if stamp(state) > last]
        self.graph.expect(
            lambda: self.planner.count_subscribers(COMMAND) > listeners, 'a new listener'
        )

    def show(self, condition, what, step=0.0):
        """Publish the time, later by a step [s] each time, until a condition holds."""
        until = monotonic() + TIMEOUT
        self.graph.publish('/clock', Clock(clock=stamps.time_msg(self.time)))
        while not self.graph.spin_until(condition, AGAIN):
            assert monotonic() < until, what
            self.time += step
            self.graph.publish('/clock', Clock(clock=stamps.time_msg(self.time)))

    def wait_until(self, time):
        """Let time go on, as fast as the plant follows."""
        while self.time < time:
            self.time += PACE
            self.show(self.is_followed, f'{self.time:.3f} s')

    def is_followed(self):
        """Return whether plant and planner have the present time."""
        planner = self.time if self.planner is None else stamps.now(self.planner.get_clock())
        return planner > self.time - 1e-6 and stamp(self.states[-1]) > self.time - 0.01

    def ask(self, message, topic=GOAL):
        """Send a goal; between two of them the arm shows itself."""
        self.wait_until(self.time + PACE)
        return super().ask(message, topic)

    def move(self, position: float, duration: float = DURATION) -> JointTrajectory:
        """Send a goal until it is accepted; return its plan."""
        plans = self.graph.collect(JointTrajectory, PLAN)
        super().move(position, duration)
        self.graph.expect(lambda: plans, 'the plan')
        return plans[0]

    def assert_next_goal_works(self) -> None:
        """Move until it is seen: a new process may not be reached for seconds by its peers."""
        until = monotonic() + TIMEOUT
        while monotonic() < until:
            self.move(0.5, 1.0)
            self.wait_until(self.end + 0.1)
            if self.states[-1].position[0] > 0.49:
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

    def has_a_state_of_it():
        watched.wait_until(watched.time + PACE)
        return watched.planner._session.measured.time > new

    graph.expect(has_a_state_of_it, 'a state of it there')
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
    message.header.stamp = stamps.time_msg(max(1e-9, watched.time - late_by * DURATION))
    graph.publish(COMMAND, message, readers=2)
    graph.expect(lambda: graph.logged('trajectory ignored: it ended at'), 'a refusal')
    watched.wait_until(watched.time + 0.2)
    assert not watched.efforts().any()


def test_a_planner_that_was_restarted_moves_nothing(graph):
    watched = Watched(graph)
    graph.remove(watched.planner)
    watched.planner = None
    words = [word for name, value in SIMULATED.items() for word in ('-p', f'{name}:={value}')]
    planner = graph.start('planner_node', '--ros-args', *words)
    start = stamp(watched.move(1.0, 1.0))
    watched.wait_until(start + 0.5)
    planner.kill()
    watched.wait_until(start + 1.2)  # The plant has all of the motion, and ends it.
    assert watched.states[-1].position[0] == pytest.approx(1.0, abs=1e-3)
    watched.states.clear()
    started = len(graph.logged('no model is given'))
    graph.start('planner_node', '--ros-args', *words)
    graph.expect(lambda: len(graph.logged('no model is given')) > started, 'a new planner')
    watched.wait_until(start + 3.0)
    assert not watched.efforts().any()
    watched.move(0.0, 1.0)
    watched.wait_until(watched.end + 0.1)
    assert abs(watched.states[-1].position[0]) < 1e-3
