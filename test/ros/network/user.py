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
A user on the planner's side of a network: sends goals, tells what became of each.

Usage: user.py GOALS DURATION. Prints one line of JSON per goal.
"""

import json
import sys
from time import monotonic

from diagnostic_msgs.msg import DiagnosticArray
from flat_planner_ros.ros.wire import interfaces, stamps
import rclpy
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

DEADLINE = 60.0
"""Time in which anything must happen [s]."""

SETTLING = 0.5
"""Time after a motion in which its end is heard over the network [s]."""


class User(Node):
    """Hears verdicts and joint states."""

    def __init__(self):
        """Listen."""
        super().__init__('user')
        self.verdicts, self.state = [], None
        status = '/flat_planner/status'
        every = interfaces.LATCHED_HISTORY
        self.create_subscription(DiagnosticArray, status, self._on_status, every)
        states = interfaces.SENSOR_DATA
        self.create_subscription(JointState, '/joint_states', self._on_state, states)
        self.goals = self.create_publisher(JointTrajectory, '/flat_planner/goal', 10)
        self.reset = self.create_client(Trigger, '/flat_plant/reset')

    def _on_status(self, msg):
        """Keep a verdict."""
        self.verdicts += [{p.key: p.value for p in status.values} for status in msg.status]

    def _on_state(self, msg):
        """Keep the last joint state."""
        self.state = msg

    def expect(self, condition, what, timeout=DEADLINE):
        """Wait for a condition."""
        until = monotonic() + timeout
        while not condition():
            if monotonic() > until:
                raise TimeoutError(what)
            rclpy.spin_once(self, timeout_sec=0.02)

    def wait(self, seconds):
        """Let a time pass."""
        until = monotonic() + seconds
        self.expect(lambda: monotonic() > until, 'time')

    def is_at_rest(self):
        """Tell whether the arm was last seen at rest at its start."""
        return self.state is not None and not any([*self.state.position, *self.state.velocity])

    def rest(self):
        """Bring the arm back to its start, over a network on which requests are late."""
        while not self.is_at_rest():
            self.reset.call_async(Trigger.Request())
            self.wait(0.3)

    def move(self, angle, duration):
        """Send a goal; return its verdict, how it ended, and how far from the goal the arm is."""
        point = JointTrajectoryPoint(positions=[angle])
        point.time_from_start = stamps.duration_msg(duration)
        seen = len(self.verdicts)
        self.goals.publish(JointTrajectory(joint_names=['joint1'], points=[point]))

        def said(*states):
            return [v for v in self.verdicts[seen:] if v.get('state') in states]

        self.expect(lambda: said('ACCEPTED', 'REJECTED'), 'a verdict')
        verdict = said('ACCEPTED', 'REJECTED')[0]
        if verdict['state'] == 'REJECTED':
            return {'state': 'REJECTED', 'why': verdict['error_name']}
        self.expect(lambda: said('FINISHED', 'FAILED', 'STOPPED'), 'an end')
        self.wait(SETTLING)
        miss = max(abs(self.state.position[0] - angle), abs(self.state.position[1]))
        return {'state': said('FINISHED', 'FAILED', 'STOPPED')[0]['state'], 'miss': miss}


def main(count, duration):
    """Send the goals."""
    rclpy.init()
    user = User()
    user.expect(user.goals.get_subscription_count, 'the planner')
    user.expect(lambda: user.state is not None and user.reset.service_is_ready(), 'the plant')
    for _ in range(count):
        user.rest()
        answer = {'state': 'REJECTED'}
        while answer['state'] == 'REJECTED':
            answer = user.move(1.0, duration)
            user.wait(0.1)
        print(json.dumps(answer), flush=True)
    user.destroy_node()
    rclpy.shutdown()


if __name__ == '__main__':
    main(int(sys.argv[1]), float(sys.argv[2]))
