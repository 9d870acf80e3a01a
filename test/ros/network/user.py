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
A user on the planner's side of a network, by whom goals are sent and messages heard.

Usage: user.py. Each line of JSON on standard input is a request, answered by one on standard
output: `["goals", COUNT, DURATION]`, `["start", ANGLE, DURATION, TIME]` up to a time after the
start, `["add", ANGLE, DURATION]`, `["wait", TIME]`, `["ask", NAMES]` parameters of the plant.
"""

import json
import sys
from time import monotonic, time

from diagnostic_msgs.msg import DiagnosticArray
from flat_planner_ros.ros.wire import interfaces, stamps
from rcl_interfaces.srv import GetParameters
import rclpy
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

DEADLINE = 20.0
"""Time in which anything must happen [s]."""

SETTLING = 0.3
"""Time after a motion in which its end is heard over the network [s]."""

MOVED = 1e-3
"""Distance of an arm from where it rests from which it is put back to its start [rad]."""

ANSWERS, ENDS = ('ACCEPTED', 'REJECTED'), ('FINISHED', 'FAILED', 'STOPPED')


class User(Node):
    """Hears verdicts, joint states and the reports of both monitors."""

    def __init__(self):
        """Listen."""
        super().__init__('user')
        self.verdicts, self.state, self.reports = [], None, {'near': [], 'far': []}
        self.sent = 0
        every = interfaces.LATCHED_HISTORY
        self.create_subscription(DiagnosticArray, '/flat_planner/status', self._on_status, every)
        states = interfaces.SENSOR_DATA
        self.create_subscription(JointState, '/joint_states', self._on_state, states)
        for side, reports in self.reports.items():
            topic = f'/{side}_monitor/report'
            self.create_subscription(DiagnosticArray, topic, reports.append, every)
        self.goals = self.create_publisher(JointTrajectory, '/flat_planner/goal', 10)
        self.reset = self.create_client(Trigger, '/flat_plant/reset')
        self.asking = self.create_client(GetParameters, '/flat_plant/get_parameters')

    def _on_status(self, msg):
        """Keep a verdict."""
        for status in msg.status:
            values = {pair.key: pair.value for pair in status.values}
            self.verdicts.append({**values, 'message': status.message})

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

    def rest(self):
        """Return where the arm is, at rest; bring it back to its start where it is not."""
        place = self.state.position[0]
        while max(abs(place - round(place)), *map(abs, self.state.velocity)) > MOVED:
            self.reset.call_async(Trigger.Request())
            self.wait(0.3)
            place = self.state.position[0]
        return round(place)

    def send(self, angle, duration):
        """Send a goal; return its verdict."""
        point = JointTrajectoryPoint(positions=[float(angle)])
        point.time_from_start = stamps.duration_msg(duration)
        seen = len(self.verdicts)
        self.sent += 1
        self.goals.publish(JointTrajectory(joint_names=['joint1'], points=[point]))

        def answers():
            return [v for v in self.verdicts[seen:] if v.get('state') in ANSWERS]

        self.expect(answers, 'a verdict')
        return answers()[0]

    def accepted(self, angle, duration):
        """Send a goal until it is accepted; return its verdict."""
        verdict = self.send(angle, duration)
        until = monotonic() + DEADLINE
        while verdict['state'] == 'REJECTED':
            if monotonic() > until:
                raise TimeoutError(verdict)
            self.wait(0.1)
            verdict = self.send(angle, duration)
        return verdict

    def move(self, angle, duration):
        """Send a goal until it is accepted; return how it ended, and how far off the arm is."""
        verdict = self.accepted(angle, duration)
        self.expect(lambda: self.ends(verdict['plan_id']), 'an end')
        self.wait(SETTLING)
        miss = max(abs(self.state.position[0] - angle), abs(self.state.velocity[0]))
        state, start = self.ends(verdict['plan_id'])[0], verdict['start_time']
        return {'state': state, 'miss': miss, 'start_time': start}

    def ends(self, plan_id):
        """Return how a motion has ended, nothing before."""
        ended = [
            v for v in self.verdicts if v.get('state') in ENDS and v.get('plan_id') == plan_id
        ]
        return [verdict['state'] for verdict in ended]

    def on_goals(self, count, duration):
        """Move to and fro."""
        return [self.move(1 - self.rest(), duration) for _ in range(count)]

    def on_start(self, angle, duration, after):
        """Start a motion and watch it for a time."""
        self.rest()
        verdict = self.accepted(angle, duration)
        start = float(verdict['start_time'])
        self.expect(lambda: time() > start + after, 'the motion')
        return verdict

    def on_add(self, angle, duration):
        """Send a goal that takes over."""
        return self.send(angle, duration)

    def on_wait(self, seconds):
        """Listen; return all that is known."""
        self.wait(seconds)
        heard = {
            side: [
                [s.level[0], s.message, *(p.value for p in s.values if p.key == 'start_time')]
                for msg in reports
                for s in msg.status
            ]
            for side, reports in self.reports.items()
        }
        state = [*self.state.position, *self.state.velocity]
        effort = list(self.state.effort)[:-1]  # the last is that of a spring
        known = {'verdicts': self.verdicts, 'sent': self.sent, 'state': state, 'effort': effort}
        return {**known, **heard}

    def on_ask(self, names):
        """Ask the plant for parameters; return how many it has told."""
        self.expect(self.asking.service_is_ready, 'the plant')
        future = self.asking.call_async(GetParameters.Request(names=names))
        self.expect(future.done, 'an answer', 10.0)
        return len(future.result().values)


def main():
    """Answer requests until standard input ends."""
    rclpy.init()
    user = User()
    user.expect(user.goals.get_subscription_count, 'the planner')
    user.expect(lambda: user.state is not None and user.reset.service_is_ready(), 'the plant')
    for line in sys.stdin:
        request, *values = json.loads(line)
        print(json.dumps(getattr(user, f'on_{request}')(*values)), flush=True)
    user.destroy_node()
    rclpy.shutdown()


if __name__ == '__main__':
    main()
