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
Goals of a planner in a process of its own, beside a plant and a monitor: how soon, how many.

Single goals from rest to rest, and goals streamed to a target that moves. Times are those of a
client in another process: from its publishing the goal to its hearing the command and the verdict,
both ways through the middleware. A node that answers with messages made beforehand, and works on
nothing, shows what of it is the middleware's and the executor's (`bare_planner.py`); the same node
shows what it takes besides to read the goal and to make the messages of ready arrays.
`python benchmarks/run.py goal_stream` runs this alone.
"""

from argparse import Namespace
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import hypot, pi, sin
from time import perf_counter

from diagnostic_msgs.msg import DiagnosticArray
from flat_planner_ros.core.arm import PlanarArm
from flat_planner_ros.ros.wire import interfaces, stamps
from measurement import duration_text, Section, verdict
import numpy as np
import problem
from processes import (
    AS_BYTES,
    AS_MESSAGES,
    BARE_PLANNER,
    Listener,
    listener,
    NodeProcess,
    processes,
    SHIPPED,
)
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

POINTS = 201
"""Of each command."""

DURATION = 0.5
"""Of each streamed motion [s]."""

SINGLE, PAUSE, SINGLES = 0.2, 0.3, 100
"""
Of single goals: duration, from one to the next [s], and the fewest of them.

The pause holds the motion and the time until it starts. Of fewer, the 99th percentile would be the
first one, which runs code for the first time.
"""

TARGETS = (
    ('command, median,', 0, 50.0, 1e-3),
    ('command, 99th percentile,', 0, 99.0, 2e-3),
    ('verdict, median,', 1, 50.0, 2e-3),
)
"""From a single goal to its command (0) or its verdict (1): percentile, target [s]."""

NODES = {
    '': 'planner',
    ', a bare node': BARE_PLANNER,
    ', one that makes messages': AS_MESSAGES,
    ', one that makes bytes': AS_BYTES,
}
"""What answers single goals, by what is said of it."""

RATES = (50.0, 200.0)
"""Of the streams [Hz]."""

FLOOR = 1.3
"""Times over those of the bare node that do where a target is out of its reach already [-]."""

PATIENCE = 5.0
"""Time after the last goal in which all are to be answered [s]."""

LONGEST = 20.0
"""Longest stream [s]."""

SHARE = 0.5
"""Share of one core that the planner may take for the fastest stream [-]."""

AMPLITUDE, FREQUENCY = 0.5, 0.2
"""Of the target that goals follow [rad], [Hz]."""

SETTLING = 1.0
"""Time after the last motion in which the passive joint is watched [s]."""


def sections(options: Namespace) -> Iterator[Section]:
    """Return the tables of this benchmark."""
    yield _single_section(max(SINGLES, int(options.seconds / PAUSE)))
    yield _stream_section(min(options.seconds, LONGEST))


class _Client:
    """
    Who sends goals and notes when he hears what.

    Parameters
    ----------
    ours
        Node by which it is done.
    duration
        Of the motions [s].

    """

    def __init__(self, ours: Listener, duration: float) -> None:
        self.ours = ours
        self._duration = duration
        self.sent: list[float] = []
        self.commanded: list[float] = []
        self.judged: list[tuple[float, bytes]] = []
        self._states: list[bytes] = []
        node, planner = ours.node, interfaces.PLANNER
        self._goals = node.create_publisher(
            JointTrajectory, interfaces.topic_of(planner, interfaces.GOAL), interfaces.RELIABLE
        )
        # As bytes: reading them would be this process's work.
        for kind, topic, heard, quality in (
            (JointTrajectory, interfaces.COMMAND, self._on_command, interfaces.BURST),
            (DiagnosticArray, interfaces.STATUS, self._on_verdict, interfaces.VERDICTS),
        ):
            name = interfaces.topic_of(planner, topic)
            node.create_subscription(kind, name, heard, quality, raw=True)
        ours.spin_until(self._goals.get_subscription_count, 'the planner')
        self._watched = node.create_subscription(
            JointState, interfaces.JOINT_STATES, self._states.append, 10, raw=True
        )
        ours.spin_until(lambda: self._states, 'the plant')
        node.destroy_subscription(self._watched)

    def _on_command(self, _: bytes) -> None:
        self.commanded.append(perf_counter())

    def _on_verdict(self, data: bytes) -> None:
        if b'ACCEPTED' in data or b'REJECTED' in data:
            self.judged.append((perf_counter(), data))

    @property
    def accepted(self) -> int:
        """Return how many goals have been accepted."""
        return sum(b'ACCEPTED' in data for _, data in self.judged)

    def send(self, position: float) -> None:
        """Send a goal of joint 1 [rad]."""
        point = JointTrajectoryPoint(
            positions=[position], time_from_start=stamps.duration_msg(self._duration)
        )
        goal = JointTrajectory(joint_names=['joint1'], points=[point])
        self.sent.append(perf_counter())
        self._goals.publish(goal)

    def at_rate(self, rate: float, count: int, course: Callable[[float], float]) -> None:
        """Send goals at a rate [Hz] to where a target is over time [s], and hear the answers."""
        begin = perf_counter()
        for number in range(count):
            due = number / rate
            self.send(course(due))
            self.ours.spin(max(begin + due + 1.0 / rate - perf_counter(), 0.0))
        # A planner that is too slow loses goals: they count as not accepted.
        end = perf_counter() + PATIENCE
        while perf_counter() < end and min(len(self.judged), len(self.commanded)) < count:
            self.ours.spin(0.05)

    def delays(self, arrivals: list[float]) -> np.ndarray | None:
        """Return the times from goals to what answers them, one each [s]; None if any is lost."""
        return np.subtract(arrivals, self.sent) if len(arrivals) == len(self.sent) else None

    def residual(self, arm: PlanarArm) -> float:
        """Return the largest amplitude of the passive joint after all motions [rad]."""
        self.ours.spin(self._duration + SETTLING)
        self._states.clear()
        self.ours.node.create_subscription(
            JointState, interfaces.JOINT_STATES, self._states.append, 10, raw=True
        )
        self.ours.spin(SETTLING)
        mode, found = arm.natural_mode(), []
        for data in self._states:
            state = deserialize_message(data, JointState)
            angle, rate = state.position[-1], state.velocity[-1]
            speed = (rate + mode.decay_rate * angle) / mode.damped_frequency
            found.append(hypot(angle, speed))
        return max(found)


@contextmanager
def _nodes(name: str, duration: float) -> Iterator[tuple[NodeProcess, _Client]]:
    """Let a planner, a plant and a monitor live for a while, and a client beside them."""
    planner = NodeProcess(name, SHIPPED, {'sampling.period': f'{duration / (POINTS - 1):g}'})
    others = NodeProcess('plant', SHIPPED, {}), NodeProcess('monitor', SHIPPED, {})
    with processes(planner, *others), listener('goals_client') as ours:
        client = _Client(ours, duration)
        # Libraries that are loaded soon after the start are loaded.
        ours.spin(2.0)
        planner.look()
        yield planner, client
        assert planner.is_running(), planner.log


def _single_delays(name: str, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the times from goals that come at rest to commands and to verdicts [s]."""
    with _nodes(name, SINGLE) as (planner, client):
        client.at_rate(1.0 / PAUSE, count, lambda time: 0.3 + 0.1 * sin(1e3 * time))
        assert client.accepted == count, planner.warnings[:3]
    command = client.delays(client.commanded)
    judged = client.delays([time for time, _ in client.judged])
    assert command is not None, 'one command for each goal'
    assert judged is not None, 'one verdict for each goal'
    return command, judged


def _single_section(count: int) -> Section:
    """Measure goals that come while the arm rests."""
    found = {label: _single_delays(name, count) for label, name in NODES.items()}
    ours, bare, _, making = found.values()
    notes = []
    for name, index, share, target in TARGETS:
        value, least, made = (
            float(np.percentile(delays[index], share)) for delays in (ours, bare, making)
        )
        notes.append(
            f'{name} within {duration_text(target)} or {FLOOR:g} times the bare node: '
            f'{verdict(value <= max(target, FLOOR * least))}, {value / least:.2f} times; '
            f'{value / made:.2f} times the one that makes bytes'
        )
    return Section(
        f'Single goals, planner, plant and monitor at work, {POINTS} points',
        (f'from the goal to, {count} goals', 'median', 'p99', 'worst'),
        [
            _delay_row(f'{what}{label}', delays[index])
            for index, what in enumerate(('the command', 'the verdict'))
            for label, delays in found.items()
        ],
        notes,
    )


def _stream_section(seconds: float) -> Section:
    """Measure goals that follow a moving target."""
    rows, notes = [], []
    for name, rate in [*(('planner', rate) for rate in RATES), (BARE_PLANNER, max(RATES))]:
        count = round(rate * seconds)
        with _nodes(name, DURATION) as (planner, client):
            client.at_rate(rate, count, lambda time: AMPLITUDE * sin(2.0 * pi * FREQUENCY * time))
            usage, accepted = planner.look(), client.accepted
            left = client.residual(problem.arm()) if name != BARE_PLANNER else None
        label, *delays = _delay_row(f'{rate:g} Hz', client.delays(client.commanded))
        rows.append(
            (
                label if left is not None else f'{label}, a bare node',
                f'{accepted} of {count}',
                f'{100.0 * usage.share:.0f} %',
                *delays,
                '-' if left is None else f'{left:.1e}',
            )
        )
        if left is not None and rate == max(RATES):
            is_met = accepted == count and usage.share <= SHARE
            notes.append(
                f'{rate:g} Hz, all accepted with at most {100.0 * SHARE:.0f} % of a core: '
                f'{verdict(is_met)}'
            )
    return Section(
        f'Goals streamed to a target that moves at up to '
        f'{AMPLITUDE * 2.0 * pi * FREQUENCY:.2g} rad/s, for {seconds:g} s',
        ('rate', 'accepted', 'CPU', 'to the command: median', 'p99', 'worst', 'left [rad]'),
        rows,
        notes,
    )


def _delay_row(name: str, delays: np.ndarray | None) -> tuple[str, ...]:
    """Return a name, and median, 99th percentile and maximum of delays [s] as text."""
    if delays is None:
        return name, '-', '-', '-'
    return name, *(duration_text(float(value)) for value in np.percentile(delays, (50, 99, 100)))
