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

"""What the tracker leaves through the nodes, each in a process of its own, in real time."""

from argparse import Namespace
from collections.abc import Iterator
from dataclasses import replace
from math import hypot, pi, tau
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
from flat_planner_ros.core.arm import FloatArray, PlanarArm
from flat_planner_ros.core.planning import plan, PlanningOptions, PlanSamples, Strategy
from flat_planner_ros.core.plant import EffortProfile, rollout
from flat_planner_ros.ros.wire import interfaces, stamps
from measurement import Section
import numpy as np
from problem import arm, request
from processes import Listener, listener, NodeProcess, processes, SHIPPED
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

RATE = 500.0
"""Joint states per second [Hz]."""

BAND = 5e-3
"""Errors below are settled [rad]."""

AFTER = 1.5
"""Time that is looked at after a motion or a push [s]."""

PUSH = 3e-3
"""Torque on the last link that starts a swing of 0.3 rad [N m]."""

PUSHED = 0.03
"""For how long it acts [s]."""

PUSHED_ROW = 'push while holding'
"""The row in which the arm is pushed where a motion has ended."""

HEALTH = 'flat_tracker: tracking'
"""What the tracker's health is called on `/diagnostics`."""


class Fault(NamedTuple):
    """
    What the model does not know.

    Attributes
    ----------
    factors
        On stiffness, damping and inertia of the true arm [-].
    friction
        Viscous [N m s/rad] and Coulomb [N m], of joint 1.

    """

    factors: dict[str, float]
    friction: tuple[float, float] = (0.0, 0.0)

    @property
    def parameters(self) -> dict[str, str]:
        """Return it as parameters of the plant."""
        found = {f'mismatch.{name}_scale': f'{value}' for name, value in self.factors.items()}
        for name, value in zip(('viscous', 'coulomb'), self.friction, strict=True):
            found[f'friction.{name}'] = f'[{value}]'
        return found

    @property
    def arm(self) -> PlanarArm:
        """Return the true arm."""
        viscous, coulomb = self.friction
        true = arm().scaled(**self.factors)
        return replace(true, viscous_friction=[viscous], coulomb_friction=[coulomb])


FAULTS = {
    'nominal': Fault({}),
    'k, c +10 %': Fault({'stiffness': 1.1, 'damping': 1.1}),
    'k, c -10 %': Fault({'stiffness': 0.9, 'damping': 0.9}),
    'k, c +25 %': Fault({'stiffness': 1.25, 'damping': 1.25}),
    'k, c -25 %': Fault({'stiffness': 0.75, 'damping': 0.75}),
    'inertias +10 %': Fault({'inertia': 1.1}),
    'inertias -10 %': Fault({'inertia': 0.9}),
    'friction': Fault({}, (2e-4, 5e-4)),
    PUSHED_ROW: Fault({}),
}


def sections(options: Namespace) -> Iterator[Section]:
    """Return the table of faults."""
    samples = plan(request(), arm(), PlanningOptions(strategy=Strategy.MIN_CONTROL_EFFORT)).sample(
        0.005
    )
    speed = options.speed
    with listener('bench') as heard:
        rows = [_row(heard, name, samples, speed) for name in FAULTS]
    clock = 'in real time' if speed == 1.0 else f'in a simulated time, {speed:g} of the real one'
    yield Section(
        'Tracked through the nodes: time until swing and position error stay below 5 mrad',
        ['arm', 'settled [s]', 'swing at the end / open loop', 'peak effort / plan']
        + ['oldest joint state [ms]', 'joint states without an answer'],
        rows,
        [
            f"the paper's arm, 0 to pi in 1 s, least effort, {RATE:g} Hz, encoders of 14 bits",
            f'planner, plant and tracker in processes of their own, {clock}',
            'settled after the end of the motion, or of a push that starts a swing of 0.3 rad',
        ],
    )


def _row(heard: Listener, name: str, samples: PlanSamples, speed: float) -> list[str]:
    """Return the row of a fault."""
    fault = FAULTS[name]
    plant = {'input': 'tracker', 'publish_rate': f'{RATE}', **fault.parameters}
    plant['encoder.resolution'] = f'{tau / 2**14}'
    others = {'use_sim_time': 'false' if speed == 1.0 else 'true'}
    if speed != 1.0:
        plant |= {'publish_clock': 'true', 'real_time_factor': f'{speed}'}
    nodes = {
        'plant': NodeProcess('plant', SHIPPED, plant),
        'planner': NodeProcess('planner', SHIPPED, {'start_delay': '0.1', **others}),
        'tracker': NodeProcess('tracker', SHIPPED, others),
    }
    with processes(*nodes.values()), _Record(heard) as seen:
        seen.move()
        seen.wait(seen.end + (0.5 if name == PUSHED_ROW else AFTER))
        since = seen.end
        if name == PUSHED_ROW:
            since = seen.push()
            seen.wait(since + AFTER)
        given_up = [line for line in nodes['tracker'].warnings if 'given up' in line]
        return [
            name,
            'given up' if given_up else seen.settling(since),
            '' if name in ('nominal', PUSHED_ROW) else seen.swing(fault.arm, samples),
            f'{seen.peak() / np.abs(samples.efforts).max():.2f}',
            *seen.health,
        ]


class _Record:
    """What is heard of one run, and what is asked in it."""

    def __init__(self, heard: Listener) -> None:
        """Listen."""
        self._heard, node = heard, heard.node
        self.states: list[JointState] = []
        self._efforts = 0
        self._values: dict[str, str] = {}
        goal = interfaces.topic_of(interfaces.PLANNER, interfaces.GOAL)
        command = interfaces.topic_of(interfaces.PLANNER, interfaces.COMMAND)
        push = interfaces.topic_of(interfaces.PLANT, interfaces.PUSH)
        self._goals = node.create_publisher(JointTrajectory, goal, interfaces.RELIABLE)
        self._pushes = node.create_publisher(Float64MultiArray, push, interfaces.RELIABLE)
        self._commands: list[JointTrajectory] = []
        listen, best = node.create_subscription, interfaces.SENSOR_DATA
        self._opened = [
            listen(JointState, interfaces.JOINT_STATES, self.states.append, best),
            listen(JointTrajectory, command, self._commands.append, interfaces.RELIABLE),
            listen(DiagnosticArray, interfaces.DIAGNOSTICS, self._on_health, interfaces.RELIABLE),
        ]
        self._command_topic = command
        self.end = 0.0

    def __enter__(self) -> '_Record':
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Listen no more."""
        node = self._heard.node
        for subscription in self._opened:
            node.destroy_subscription(subscription)
        for publisher in (self._goals, self._pushes):
            node.destroy_publisher(publisher)

    @property
    def now(self) -> float:
        """Return the time of the last joint state [s]."""
        return stamps.seconds(self.states[-1].header.stamp)

    @property
    def health(self) -> list[str]:
        """Return the oldest joint state [ms], and how many had no answer."""
        self._values.clear()
        self._heard.spin_until(lambda: self._values, "the tracker's health")
        oldest = 1e3 * float(self._values['oldest'])
        return [f'{oldest:.1f}', self._values['unanswered']]

    def wait(self, until: float) -> None:
        """Serve callbacks until a time of the arm [s]."""
        self._heard.spin_until(lambda: self.now >= until, f'time {until:g} s')

    def move(self) -> None:
        """Send the goal when everybody hears, and know when its motion ends."""
        node = self._heard.node
        ready = {'flat_tracker'}
        self._heard.spin_until(
            lambda: (
                self.states
                and self._goals.get_subscription_count()
                and self._pushes.get_subscription_count()
                and ready
                <= {r.node_name for r in node.get_subscriptions_info_by_topic(self._command_topic)}
                and self._values
            ),
            'nodes',
        )
        self.wait(self.now + 0.5)
        goal = JointTrajectory(joint_names=['joint1'])
        point = JointTrajectoryPoint(positions=[pi])
        point.time_from_start.sec = 1
        goal.points = [point]
        self._goals.publish(goal)
        self._heard.spin_until(lambda: self._commands, 'a command')
        self.end = stamps.seconds(self._commands[0].header.stamp) + 1.0

    def push(self) -> float:
        """Push the arm; return when that is over [s]."""
        # A torque on the last link acts at both joints.
        self._pushes.publish(Float64MultiArray(data=[PUSH, PUSH]))
        begin = self.now
        self.wait(begin + PUSHED)
        self._pushes.publish(Float64MultiArray(data=[0.0, 0.0]))
        return begin + PUSHED

    def _on_health(self, msg: DiagnosticArray) -> None:
        """Keep what the tracker says of itself."""
        for status in msg.status:
            if status.name == HEALTH:
                self._values = {pair.key: pair.value for pair in status.values}

    def _table(self) -> tuple[FloatArray, FloatArray]:
        """Return times and errors of the angles, (m,) and (m, 2)."""
        times = np.array([stamps.seconds(state.header.stamp) for state in self.states])
        angles = np.array([state.position for state in self.states])
        return times, angles - [pi, 0.0]

    def settling(self, since: float) -> str:
        """Return the time from then on until errors stay in the band [s]."""
        times, errors = self._table()
        beyond = times[(times >= since) & (np.abs(errors).max(axis=1) > BAND)]
        late = float(beyond[-1]) - since if beyond.size else 0.0
        return f'{late:.2f}' if late < 0.9 * AFTER else f'> {0.9 * AFTER:.2f}'

    def peak(self) -> float:
        """Return the largest effort [N m]."""
        return max(abs(state.effort[0]) for state in self.states)

    def swing(self, true: PlanarArm, samples: PlanSamples) -> str:
        """Return the swing at the end of the motion over that of the effort alone."""
        times, _ = self._table()
        last = self.states[int(np.argmin(np.abs(times - self.end)))]
        profile = EffortProfile(start=0.0, times=samples.times, efforts=samples.efforts[:, :1])
        free = rollout(true, profile, 1.0)
        ends = (last.position, last.velocity), (free.positions[-1], free.velocities[-1])
        mode = true.natural_mode()
        tracked, alone = (
            hypot(q[1], (v[1] + mode.decay_rate * q[1]) / mode.damped_frequency) for q, v in ends
        )
        return f'{tracked:.3f} / {alone:.3f} = {tracked / alone:.2f}'
