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

"""
Faults in the midst of a motion, by either clock, as the tracker's node meets them.

The test is the arm: it publishes joint states one by one and waits for the answer of each.
"""

from dataclasses import dataclass, field

from flat_planner_ros.ros.nodes.tracker_node import TrackerNode
from flat_planner_ros.ros.wire import stamps
import numpy as np
import pytest
from ros.rig import COMMAND
from ros.tracked_arm import EFFORTS
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

DURATION, LEAD = 1.0, 0.05
"""Duration of a motion and time before it [s]."""

PERIOD = 0.01
"""Time between two joint states by the simulated clock [s]; the other one is what it is."""

RAMP = 0.1
"""Time in which the effort goes to zero [s]."""

PATIENCE = 0.1
"""Time that a joint state without an answer is given [s]."""


@dataclass
class Arm:
    """Joint states along a motion of joint 1, which the tracker hears one after the other."""

    graph: object
    is_simulated: bool
    time: float = 100.0
    sent: list = field(default_factory=list)
    begin: float = 0.0
    goal: float = 0.0
    ahead: float = 0.0

    def start(self, **settings):
        """Start a tracker, which idles until a command; return the arm."""
        if not self.is_simulated:
            settings |= {'timeout': 1.0, 'max_age': 1.0}  # a busy machine is no silence
        given = {'use_sim_time': self.is_simulated, 'ramp': RAMP, 'timeout': 0.2, **settings}
        self.node = self.graph.create(TrackerNode, given)
        self.sent = self.graph.collect(Float64MultiArray, EFFORTS)
        for _ in range(3):
            self.step()
        assert not self.sent
        return self

    def now(self):
        """Return the time by the stamps of joint states, `ahead` of the tracker's clock [s]."""
        now = self.time if self.is_simulated else stamps.now(self.graph.probe.get_clock())
        return now + self.ahead

    def pose(self, time):
        """Return the planned position of joint 1 [rad] and its velocity [rad/s]."""
        s = min(max((time - self.begin) / DURATION, 0.0), 1.0)
        away = self.goal * np.array((s**2 * (3.0 - 2.0 * s), 6.0 * s * (1.0 - s) / DURATION))
        return away[0], away[1]

    def command(self):
        """
        Send a motion, so small a one that an arm that feels no effort is no surprise.

        By the system's clock, which a busy machine lets run away, it stands still.
        """
        self.begin = self.now() + (LEAD if self.is_simulated else 10.0 * LEAD)
        self.goal = 0.01 if self.is_simulated else 0.0
        msg = JointTrajectory(joint_names=['joint1', 'joint2'])
        msg.header.stamp = stamps.time_msg(self.begin)
        for time in np.linspace(0.0, DURATION, 41).tolist():
            position, velocity = self.pose(self.begin + time)
            point = JointTrajectoryPoint(positions=[position, 0.0], velocities=[velocity, 0.0])
            point.time_from_start = stamps.duration_msg(time)
            msg.points.append(point)
        self.graph.publish(COMMAND, msg)

    def step(self, offset=0.0):
        """Show where the arm is, `offset` [rad] from the plan; return whether it is answered."""
        count, errors = len(self.sent), len(self.errors())
        if self.is_simulated:
            self.time += PERIOD
            self.graph.publish('/clock', Clock(clock=stamps.time_msg(self.time)))
            clock = self.node.get_clock()
            self.graph.expect(lambda: stamps.now(clock) >= self.time - 1e-6, 'the time')
        now = self.now()
        state = JointState(name=['joint1', 'joint2'], position=[self.pose(now)[0] + offset, 0.0])
        state.header.stamp = stamps.time_msg(now)
        self.graph.publish('/joint_states', state, readers=1)
        return self.graph.spin_until(
            lambda: len(self.sent) > count or len(self.errors()) > errors, PATIENCE
        )

    def move_into(self, share=0.4):
        """Go on to the midst of the motion."""
        while self.now() < self.begin + share * DURATION:
            self.step()
        self.graph.expect(lambda: self.sent, 'efforts')
        assert any(effort.data[0] for effort in self.sent) is self.is_simulated

    def errors(self):
        """Return why tracking was given up, as often as it was."""
        return self.graph.logged('tracking given up')

    def assert_let_go(self, reason, *, is_silent=False):
        """Check that one error says why, the effort fades, and nothing follows."""
        if is_silent:
            self.graph.expect(self.is_let_go_in_silence, 'an effort of zero')
        self.graph.expect(lambda: self.is_quiet() and self.errors(), 'an end of the efforts')
        assert self.sent[-1].data[0] == 0.0
        (error,) = self.errors()
        assert reason in error
        count = len(self.sent)
        assert self.is_quiet()
        assert len(self.sent) == count
        assert len(self.errors()) == 1

    def is_quiet(self):
        """Show where the arm is, some times; return whether nothing is answered."""
        answers = [self.step() for _ in range(4)]
        return not any(answers)

    def is_let_go_in_silence(self):
        """Let time pass without joint states; return whether the effort is zero, and why."""
        if self.is_simulated:
            self.time += PERIOD
            self.graph.publish('/clock', Clock(clock=stamps.time_msg(self.time)))
        self.graph.spin_until(lambda: False, PERIOD)
        return self.errors() and not self.sent[-1].data[0]

    def assert_obeys(self):
        """Check that the next command is followed."""
        count, self.begin, self.goal = len(self.sent), 0.0, 0.0
        for _ in range(2):  # the arm has been taken back
            self.step()
        self.command()
        self.move_into(0.1)
        assert len(self.sent) > count
        assert len(self.errors()) == 1


@pytest.fixture
def arm_ahead(graph):
    """Return an arm in the midst of a motion, whose clock is half a second ahead."""
    arm = Arm(graph, is_simulated=True, ahead=0.5)
    arm.start()
    arm.command()
    arm.move_into()
    assert arm.sent[-1].data[0]
    return arm


@pytest.fixture(params=[True, False], ids=['simulated clock', 'system clock'])
def arm(request, graph):
    """Return an arm by either clock."""
    return Arm(graph, request.param)


def test_joint_states_that_stop_end_the_motion(arm):
    arm.start()
    arm.command()
    arm.move_into()
    arm.assert_let_go('joint sample is', is_silent=True)
    arm.assert_obeys()


def test_joint_states_of_a_clock_ahead_that_stop_end_the_motion_as_soon(arm_ahead):
    begin = arm_ahead.time
    arm_ahead.assert_let_go('joint sample is', is_silent=True)
    assert arm_ahead.time - begin < 0.6  # timeout and ramp are 0.3


def test_an_arm_of_a_clock_ahead_is_let_go_along_the_ramp(arm_ahead):
    last, count = arm_ahead.sent[-1].data[0], len(arm_ahead.sent)
    assert arm_ahead.graph.call(Trigger, '/flat_tracker/release').success
    arm_ahead.graph.expect(arm_ahead.is_quiet, 'silence')
    shares = np.array([effort.data[0] for effort in arm_ahead.sent[count:]]) / last
    assert (np.diff(shares) <= 0.0).all()
    assert shares[-1] == 0.0
    assert ((shares > 0.0) & (shares < 0.8)).sum() >= 3


def test_a_joint_that_jumps_ends_the_motion(arm):
    arm.start()
    arm.command()
    arm.move_into()
    arm.step(0.5)
    arm.assert_let_go('a joint jumped by 0.')
    arm.assert_obeys()


def test_a_joint_state_that_is_not_finite_ends_the_motion(arm):
    arm.start()
    arm.command()
    arm.move_into()
    arm.step(np.nan)
    arm.assert_let_go('is not finite')
    arm.assert_obeys()


def test_a_clock_that_is_set_back_ends_the_motion(graph):
    arm = Arm(graph, is_simulated=True)
    arm.start()
    arm.command()
    arm.move_into()
    arm.time -= 5.0
    arm.assert_let_go('the clock was set back by', is_silent=True)
    arm.assert_obeys()


def test_an_effort_that_stays_at_its_limit_ends_the_motion(graph):
    arm, limit = Arm(graph, is_simulated=True), 1e-6
    arm.start(**{'limits.effort': [limit], 'saturation_timeout': 0.2})
    arm.command()
    arm.move_into(0.05)
    arm.assert_let_go('has been at its limit for 0.')
    assert np.abs([effort.data[0] for effort in arm.sent]).max() == pytest.approx(limit)


def test_an_arm_that_leaves_its_plan_ends_the_motion(graph):
    arm = Arm(graph, is_simulated=True)
    arm.start(max_error=0.1)
    arm.command()
    arm.move_into()
    begin = arm.now()
    while not arm.errors() and arm.now() < begin + 5.0:
        arm.step(0.3 * (arm.now() - begin))
    arm.assert_let_go('rad from its plan')


@pytest.mark.parametrize('hold', [True, False])
def test_after_the_motion_the_pose_is_held_or_let_go(arm, hold):
    arm.start(hold=hold)
    arm.command()
    arm.move_into(1.2)
    if hold:
        count = len(arm.sent)
        arm.graph.expect(lambda: arm.step() and len(arm.sent) > count + 3, 'efforts that go on')
    else:
        arm.graph.expect(arm.is_quiet, 'silence')  # answers may be on their way
        assert arm.sent[-1].data[0] == 0.0
    assert not arm.errors()
    if hold:
        assert arm.graph.call(Trigger, '/flat_tracker/release').success
        arm.graph.expect(lambda: not arm.step() and not arm.sent[-1].data[0], 'silence')
        assert not arm.errors()
