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

"""The three nodes, from the outside: what a goal is, what they answer, what the arm does."""

import re
from time import monotonic

from diagnostic_msgs.msg import DiagnosticArray
from flat_planner_ros.ros.nodes.monitor_node import MonitorNode
from flat_planner_ros.ros.nodes.planner_node import PlannerNode
from flat_planner_ros.ros.nodes.plant_node import PlantNode
from flat_planner_ros.ros.wire import interfaces, stamps
import numpy as np
import pytest
from rclpy.qos import QoSProfile
from ros.conftest import TIMEOUT
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

NODES = ('planner_node', 'plant_node', 'monitor_node')
GOAL, STATUS = '/flat_planner/goal', '/flat_planner/status'
PLAN, COMMAND = '/flat_planner/plan', '/flat_planner/joint_trajectory'
STATES = '/joint_states'
REPORT = '/flat_monitor/report'
EVERY_VERDICT = QoSProfile(depth=1000, durability=interfaces.LATCHED.durability)
ANSWERS = ('ACCEPTED', 'REJECTED')

START_DELAY = 0.5
"""From a verdict to the motion or splice [s]; a busy machine may need it for the command."""

LATE = ('ms after its start', 'skipped to keep up', 'trajectory ignored')
"""What the plant says of commands that it could not play as they were planned."""

ATTEMPTS = 5
"""How often a motion is repeated on a machine that is too busy to play it in time."""

NOT_YET = ('START_STATE_UNKNOWN', 'START_STATE_STALE', 'NOT_AT_REST')


def goal(positions, duration=1.0):
    """Return a goal for joint 1, or for the first joints."""
    point = JointTrajectoryPoint(positions=np.ravel(positions).astype(float).tolist())
    point.time_from_start = stamps.duration_msg(duration)
    names = [f'joint{i + 1}' for i in range(len(point.positions))]
    return JointTrajectory(joint_names=names, points=[point])


def values(msg):
    """Return the values of a message's only status."""
    return {pair.key: pair.value for pair in msg.status[0].values}


def stamp(msg):
    """Return when a message is stamped [s]."""
    return stamps.seconds(msg.header.stamp)


def table(trajectory, field):
    """Return one field of all points, shape (points, joints)."""
    return np.array([list(getattr(point, field)) for point in trajectory.points])


class Late(Exception):
    """An attempt was too late to show anything; the text says what came late."""


def not_verified(reason):
    """End a test as "xfailed": the summary of the run names it, and says why."""
    pytest.xfail(f'not verified: {reason}')


def on_time(attempt):
    """
    Return what an attempt gives as soon as it is in time.

    An attempt that raises `Late` is repeated. If all of them do, the test is `not_verified`.
    """
    for _ in range(ATTEMPTS):
        try:
            return attempt()
        except Late as late:
            reason = str(late)
    return not_verified(f'late in all of {ATTEMPTS} attempts, the last: {reason}')


class Rig:
    """
    An arm's nodes, in this process or in others, and what is heard of them.

    Attributes
    ----------
    status, plans, commands
        What the planner has said, once `hear_planner` was called.
    states
        What the plant has shown, once `hear_plant` was called.
    reports
        What the monitor has said, once `hear_monitor` was called.

    """

    def __init__(self, graph, namespace=''):
        """Know where they are, in a namespace such as '/left'."""
        self.graph = graph
        self.namespace = namespace

    def hear(self, kind, topic, qos=1000, **options):
        """Return a list that grows with every message on a topic of this arm; see `collect`."""
        return self.graph.collect(kind, self.namespace + topic, qos, **options)

    def hear_planner(self, *, matched=True, raw=False):
        """
        Listen to the planner; `matched`, here and below, waits until it is found.

        Plans and commands that are heard `raw` are bytes.
        """
        options = {'matched': matched, 'raw': raw}
        self.status = self.hear(DiagnosticArray, STATUS, EVERY_VERDICT, matched=matched)
        self.plans = self.hear(JointTrajectory, PLAN, interfaces.LATCHED, **options)
        self.commands = self.hear(JointTrajectory, COMMAND, **options)

    def hear_plant(self, *, qos=1000, matched=True):
        """Listen to the plant; with a long queue all is heard, but on a busy machine late."""
        self.states = self.hear(JointState, STATES, qos, matched=matched)

    def hear_monitor(self, *, matched=True):
        """Listen to the monitor."""
        self.reports = self.hear(DiagnosticArray, REPORT, interfaces.LATCHED, matched=matched)

    def wait_until(self, time):
        """Wait for a joint state stamped then or later."""
        self.graph.expect(lambda: self.states and stamp(self.states[-1]) >= time, f'{time} s')

    def verdicts(self, *states):
        """Return the values of all that was said of goals and motions in one of these states."""
        return [v for v in map(values, self.status) if v.get('state') in states]

    def answers(self):
        """Return the values of all verdicts on goals."""
        return self.verdicts(*ANSWERS)

    def ask(self, message, topic=GOAL):
        """Send a goal; return the values of its verdict, with `message` and `level`."""
        seen = len(self.status)

        def answered():
            return [s for s in self.status[seen:] if values(s).get('state') in ANSWERS]

        # Of a planner that was killed, the reader stays listed; its successor's may come late.
        for _ in range(ATTEMPTS):
            self.graph.publish(self.namespace + topic, message, interfaces.BURST)
            if self.graph.spin_until(answered, TIMEOUT / ATTEMPTS):
                break
        self.graph.expect(answered, 'a verdict', 0.0)
        verdict = answered()[0]
        status = verdict.status[0]
        return {**values(verdict), 'message': status.message, 'level': status.level}

    def send(self, positions, duration=1.0):
        """Send a goal for the first joints; return its verdict as `ask` does."""
        return self.ask(goal(positions, duration))

    def move(self, positions, duration=1.0):
        """Send a goal until it is accepted: at first a planner may not have heard of the arm."""
        until = monotonic() + TIMEOUT
        verdict = self.send(positions, duration)
        while verdict['state'] != 'ACCEPTED':
            assert verdict['error_name'] in NOT_YET, verdict
            assert monotonic() < until, verdict
            seen = len(self.states)
            self.graph.spin_until(lambda n=seen: len(self.states) > n, 0.1)
            verdict = self.send(positions, duration)
        self.begin = float(verdict['start_time'])
        self.end = self.begin + float(verdict['duration'])
        return verdict

    def efforts(self, since=0.0):
        """Return the efforts of joint 1 from a time [s] on [N m]."""
        return np.array([s.effort[0] for s in self.states if stamp(s) >= since])


class Planner(Rig):
    """A planner alone, in this process."""

    def __init__(self, graph, parameters=None, *arguments, is_heard=True):
        """Start it, and listen to it."""
        self.node = graph.create(PlannerNode, parameters, *arguments)
        super().__init__(graph, self.node.get_namespace().rstrip('/'))
        if is_heard:
            self.hear_planner()

    def now(self):
        """Return the time of the node [s]."""
        return stamps.now(self.node.get_clock())

    def measure(self, position=(0.0, 0.0), velocity=(0.0, 0.0), names=('joint1', 'joint2')):
        """Publish a joint state and wait until the node has it."""
        state = JointState(name=list(names), position=list(position), velocity=list(velocity))
        state.header.stamp = stamps.time_msg(self.now())
        self.graph.publish(self.node.resolve_topic_name('joint_states'), state)

        def has_arrived():
            sample = self.node._session.measured
            return sample is not None and sample.time == stamp(state)

        self.graph.expect(has_arrived, 'the measured state')


class Suite(Rig):
    """The three nodes in this process, the plant owning the time."""

    def __init__(self, graph, planner=None, plant=None, *given, speed=3.0, window=2.0):
        """
        Start them, with parameters or what else is `given`; wait until they hear each other.

        By default as many simulated seconds per second as one process keeps up with when busy.
        """
        super().__init__(graph)
        simulated = {'use_sim_time': True}
        slow = {'reference_rate': 10.0, 'start_delay': START_DELAY}
        clock = {'publish_clock': True, 'real_time_factor': speed}
        self.planner = graph.create(PlannerNode, {**simulated, **slow, **(planner or {})}, *given)
        graph.create(MonitorNode, {**simulated, 'window': window}, *given)
        graph.create(PlantNode, {**clock, **(plant or {})}, *given)
        self.hear_planner()
        self.hear_monitor()
        self.hear_plant(qos=interfaces.RELIABLE)
        graph.expect(
            lambda: graph.probe.count_subscribers(STATES) == 3 and self.states,
            'the three nodes on joint_states',
        )

    def carry_out(self, positions, duration=1.0):
        """Carry a goal out; return the values of its verdict and of the report on its motion."""
        count = len(self.reports)
        verdict = self.send(positions, duration)
        assert verdict['state'] == 'ACCEPTED', self.status
        self.graph.expect(lambda: len(self.reports) > count, 'a report')
        return verdict, values(self.reports[-1])


class World(Rig):
    """The three nodes in processes."""

    def __init__(
        self, graph, *programs, arguments=(), delay=START_DELAY, namespace='', **environment
    ):
        """
        Start them, in one process or in several.

        The `delay` is that of every motion and splice [s]; None leaves the planner's own.
        """
        super().__init__(graph, namespace)
        self.environment = environment
        self.processes = {}
        self.arguments = ['--ros-args', *arguments]
        if delay is not None:
            for name in ('start_delay', 'replan.lookahead'):
                self.arguments += ['-p', f'flat_planner:{name}:={delay}']
        if namespace:
            self.arguments += ['-r', f'__ns:={namespace}']
        self.hear_plant(matched=False)
        self.hear_planner(matched=False)
        self.hear_monitor(matched=False)
        self.start(*programs or ['demo'])

    def start(self, *programs):
        """Start programs and wait until their nodes are ready."""
        ready = len(self.graph.logged('ready'))
        for name in programs:
            self.processes[name] = self.graph.start(name, *self.arguments, **self.environment)
        count = sum(3 if name == 'demo' else 1 for name in programs)
        self.graph.expect(lambda: len(self.graph.logged('ready')) >= ready + count, 'ready nodes')

    def kill(self, *programs):
        """End programs by SIGKILL; return when [s]."""
        for name in programs:
            self.processes.pop(name).kill()
        return stamps.now(self.graph.probe.get_clock())

    def amplitude(self):
        """Return what the monitor says of this motion [rad]; `Late` if it missed samples."""

        def mine():
            own = [
                r for r in self.reports if abs(float(values(r)['start_time']) - self.begin) < 1e-3
            ]
            return own[-1:]

        self.graph.expect(mine, 'a report of this motion')
        (report,) = mine()
        if 'amplitude' not in values(report):
            raise Late(report.status[0].message)
        return float(values(report)['amplitude'])

    def lateness(self, allowed=0.0):
        """Return all that this arm's plant has said of motions that it could not play in time."""
        plant = f'{self.namespace}/flat_plant'.strip('/').replace('/', '.')
        said = [entry.msg for entry in self.graph.log if entry.name == plant]
        said = [text for text in said if any(word in text for word in LATE)]
        delays = [re.search(r'arrived ([\d.]+) ms', text) for text in said]
        return [
            text
            for text, delay in zip(said, delays, strict=True)
            if delay is None or float(delay[1]) > 1e3 * allowed
        ]

    def in_time(self, attempt, allowed=0.0):
        """
        Return what an attempt to move gives once it was played in time; see `on_time`.

        The command of a re-plan repeats the motion under way until the splice: it may be `allowed`
        to arrive so many seconds after its start.
        """

        def watched():
            before = len(self.lateness(allowed))
            if before:  # half a motion leaves joint 1 turning
                self.graph.call(Trigger, f'{self.namespace}/flat_plant/reset')
            result = attempt()
            late = self.lateness(allowed)[before:]
            if late:
                raise Late(late[-1])
            return result

        return on_time(watched)

    def assert_next_goal_works(self, position):
        """Move and look at where the arm comes to rest."""

        def arrive():
            self.move(position)
            self.wait_until(self.end + 0.1)
            rest = self.efforts(self.end + 0.02)
            assert rest.size
            assert not rest.any()
            return self.states[-1].position[0]

        assert self.in_time(arrive) == pytest.approx(position, abs=1e-3)
