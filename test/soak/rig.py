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

"""One arm of the soak test: three nodes in processes, relays with faults, random episodes."""

from __future__ import annotations

from collections import Counter
from datetime import datetime
from pathlib import Path
import sys
from time import monotonic, time

import numpy as np
import pytest
from rclpy.qos import QoSProfile
from ros.conftest import Graph, Process
from ros.relay import Faults, Relay
from ros.rig import COMMAND, goal, LATE, NODES, Rig, stamp, values
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

CONFIG = Path(__file__).resolve().parents[2] / 'config'

NEWEST = QoSProfile(depth=1)
"""Joint states: what the driver is too slow for need not be seen."""

EXACT = 1e-5
"""Largest amplitude on an arm like the model [rad]."""

NOISE = 1e-4
"""Standard deviation of noisy joint angles [rad]."""

FEIGNED = 4.0 * NOISE
"""
Largest amplitude that they feign [rad].

Where nothing stands out of the noise, the monitor reports what fits best, at most half of the
distance between the extreme samples. Of 150 samples of noise alone 95 % give less than 1.0, 99 %
less than 1.8 standard deviations; three and more are rare.
"""

UNEVEN = Faults(loss=0.1, duplication=0.3, delay=(0.0, 0.2))
"""What goes wrong between the nodes in an episode of bad transport."""

DISTURBED = (*LATE, 'set back')
"""What the plant says of commands that it could not play, or not with that clock."""

DEADLINE = 60.0
"""Time within which anything must happen [s]."""

MOST_FAILURES = 11
"""After so many a run ends."""

KINDS = ('plain', 'mismatch', 'noise', 'replan', 'stop', 'transport', 'invalid')
"""What may happen to a motion; in real time the nodes may be killed, too."""

MEMORY_PERIOD = 2.0
"""Time between two looks at the memory of the nodes [s]."""


class Endurance:
    """
    Episodes that follow each other, what must not happen in them, and the memory of processes.

    Attributes
    ----------
    counts
        How often anything happened.
    failures
        What must not happen, a sentence each.
    memory
        Resident memory of each process, (node, process id) to lists of (seconds, bytes).
    offsets
        How far joint states are behind the time of day, (seconds, seconds).
    processes
        Those that have to live, by their nodes' names.

    """

    kinds: tuple[str, ...]

    def __init__(self, graph: Graph, seed: int, **given) -> None:
        """Start to count; what is given is for the nodes' class."""
        self.random = np.random.default_rng(seed)
        self.counts: Counter[str] = Counter()
        self.failures: list[str] = []
        self.memory: dict[tuple[str, int], list[tuple[float, float]]] = {}
        self.offsets: list[tuple[float, float]] = []
        self.processes: dict[str, Process] = {}
        self._born, self._looked = monotonic(), 0.0
        super().__init__(graph, **given)

    def run(self, seconds: float) -> None:
        """Let episodes follow each other for a time [s]; a failure is told when it happens."""
        until = monotonic() + seconds
        while monotonic() < until and len(self.failures) < MOST_FAILURES:
            kind = str(self.random.choice(self.kinds))
            try:
                self._episode(kind)
            except (AssertionError, pytest.fail.Exception) as error:
                self.failures.append(f'{kind}: {error}')
                print(f'{datetime.now():%H:%M:%S} {self.failures[-1]}', file=sys.stderr)
                self._start_afresh()
        self.counts['seconds'] = round(monotonic() - self._born)

    def _start_afresh(self) -> None:
        """Undo what an episode that failed has left."""

    def watch(self, name: str, process: Process) -> None:
        """Look after a process from now on."""
        self.processes[name] = process
        self.memory[name, process.pid] = []

    def _look(self) -> None:
        """Note the memory of the nodes, and that they live."""
        if monotonic() - self._looked < MEMORY_PERIOD:
            return
        self._looked = monotonic()
        for name, process in self.processes.items():
            assert process.exit_code is None, f'{name} has ended: {process.stderr[-2000:]}'
            pages = int(Path(f'/proc/{process.pid}/statm').read_text().split()[1])
            self.memory[name, process.pid].append((monotonic() - self._born, pages * 4096))


class Soak(Endurance, Rig):
    """
    Three nodes of one arm and what is done to them.

    Parameters
    ----------
    graph
        A graph of its own.
    file
        Parameter file of the arm.
    speed
        Simulated seconds per second, the plant owning the time; None for real time.
    seed
        Of all that is random.

    """

    def __init__(self, graph: Graph, file: str, speed: float | None, seed: int) -> None:
        """Start the nodes."""
        super().__init__(graph, seed)
        self.speed = speed
        self.kinds = KINDS if speed is not None else (*KINDS, *(f'kill {name}' for name in NODES))
        self._parameters = {
            'flat_planner:start_delay': 0.3,
            'flat_planner:replan.lookahead': 0.6,
            'flat_planner:reference_rate': 10.0,
            'flat_monitor:window': 1.5,
            'flat_plant:publish_rate': 100.0,
        }
        if speed is not None:
            self._parameters |= {
                'flat_planner:use_sim_time': True,
                'flat_monitor:use_sim_time': True,
                'flat_plant:publish_clock': True,
                'flat_plant:real_time_factor': speed,
            }
        self._file = str(CONFIG / file)
        own = {'context': graph.context, 'use_global_arguments': False}
        self.to_planner, self.to_plant = (
            graph.add(Relay(JointTrajectory, source, target, seed=seed + 1, **own))
            for source, target in (
                ('/goals', '/flat_planner/goal'),
                (COMMAND, '/late/joint_trajectory'),
            )
        )
        self.state: JointState | None = None
        graph.probe.create_subscription(JointState, '/joint_states', self._on_state, NEWEST)
        self.hear_planner(matched=False)
        self.hear_monitor(matched=False)
        for name in NODES:
            self.start(name)
        self._expect(lambda: self.state, 'joint states')
        self.joints = len(self.state.name) - 1

    def start(self, name: str) -> None:
        """Start a node and wait until it is ready and found."""
        ready = len(self.graph.logged('ready'))
        words = ['--ros-args', '--params-file', self._file]
        for key, value in self._parameters.items():
            words += ['-p', f'{key}:={value}']
        words += ['-r', 'flat_plant:flat_planner/joint_trajectory:=/late/joint_trajectory']
        process = self.graph.start(name, *words)
        self.watch(name, process)
        self._expect(lambda: len(self.graph.logged('ready')) > ready, f'{name}')

    def kill(self, name: str) -> None:
        """End a node by SIGKILL."""
        self.processes.pop(name).kill()
        self.counts['kills'] += 1

    def _episode(self, kind: str) -> None:
        """Move once, with whatever happens."""
        self.counts['episodes'] += 1
        del self.status[:], self.reports[:], self.graph.log[:]
        for relay in (self.to_planner, self.to_plant):
            relay.faults = Faults()
            del relay.received[:], relay.delivered[:]
        self._prepare(kind)
        self.graph.call(Trigger, '/flat_plant/reset')
        self._wait(0.5)
        if kind == 'transport':
            self.to_planner.faults = self.to_plant.faults = UNEVEN
        if kind == 'invalid':
            self._send([float('nan')] * self.joints)
        verdict = self._move()
        if kind == 'replan':
            for _ in range(int(self.random.integers(1, 4))):
                self._wait(float(self.random.uniform(0.05, 0.4)))
                self._send(self._pose())
                self.counts['re-plans'] += 1
            self._expect(lambda: self._answered() >= len(self.to_planner.delivered), 'verdicts')
        elif kind == 'stop':
            self._wait_until(float(verdict['start_time']) + float(self.random.uniform(0.0, 0.5)))
            self.graph.call(Trigger, '/flat_planner/stop')
            self.counts['stops'] += 1
        elif kind.startswith('kill'):
            self._wait_until(float(verdict['start_time']) + float(self.random.uniform(0.0, 0.8)))
            self._kill_and_restart(kind.split()[1])
            return
        self._finish(kind)

    def _prepare(self, kind: str) -> None:
        """Make the arm and its sensors what the episode wants."""
        scales = self.random.uniform(0.9, 1.1, 2) if kind == 'mismatch' else (1.0, 1.0)
        values_ = {
            'mismatch.stiffness_scale': float(scales[0]),
            'mismatch.damping_scale': float(scales[1]),
            'noise.position_std': NOISE if kind == 'noise' else 0.0,
        }
        results = self.graph.set_parameters('flat_plant', **values_)
        assert all(result.successful for result in results), results

    def _finish(self, kind: str) -> None:
        """Wait for the last motion's report and look at everything."""
        self._expect(lambda: self.to_planner.is_idle and self.to_plant.is_idle, 'idle relays')
        delivered = len(self.to_planner.delivered)
        self._expect(lambda: self._answered() >= delivered, 'all verdicts')
        accepted = [v for v in self.answers() if v['state'] == 'ACCEPTED']
        self.counts['goals'] += len(self.to_planner.received)
        self.counts['goals lost or doubled'] += abs(delivered - len(self.to_planner.received))
        self.counts['goals arrived'] += delivered
        if accepted:
            self._expect(lambda: self._ended(accepted[-1]), 'the end of the last motion')
            last = self._ended(accepted[-1])[0]
            end = float(last['start_time']) + float(last['duration'])
            self._wait_until(end + 1.7)
            self._expect(lambda: self._report_of(end), f'a report of the motion until {end}')
            self._judge(kind, accepted[-1], self._report_of(end)[-1])
        self._wait(0.1)
        answered = self._answered()
        self.counts['verdicts'] += answered
        self.counts['accepted'] += len(accepted)
        assert answered == delivered, f'{answered} verdicts on {delivered} goals'

    def _judge(self, kind: str, verdict: dict[str, str], report: dict[str, str]) -> None:
        """Compare what was left with what had to be."""
        self.counts['motions reported'] += 1
        late = 'motions late or refused, said by the plant'
        if self._is_disturbed():
            self.counts[late] += 1
            return
        if kind == 'transport' and len(self.to_plant.delivered) < len(self.to_plant.received):
            self.counts['motions not played, command lost'] += 1
            return
        if self._ended(verdict)[0]['state'] == 'FAILED':
            # A command that is held up longer than its motion takes is refused after it.
            said = self.graph.logged('was not carried out')
            self._expect(self._is_disturbed, f'why a motion has failed: {said}')
            self.counts[late] += 1
            return
        if 'amplitude' not in report:
            self._expect(lambda: self.graph.logged('amplitude unknown'), f'why in {report}')
            self.counts['residuals withheld, said by the monitor'] += 1
            return
        bound = {
            'mismatch': 1.2 * float(verdict['predicted_residual_worst']) + EXACT,
            'noise': FEIGNED,
        }.get(kind, EXACT)
        amplitude = float(report['amplitude'])
        self.counts['residuals checked'] += 1
        assert amplitude <= bound, f'amplitude {amplitude:.2e} rad above {bound:.2e} rad'
        # Feedback balances what weight the model has wrong; without it nothing is applied.
        if self.joints == 1:
            assert not self.state.effort[0], f'effort {self.state.effort[0]} N m at rest'

    def _is_disturbed(self) -> bool:
        """Return whether the plant has said that it could not play a command as planned."""
        return any(self.graph.logged(word) for word in DISTURBED)

    def _kill_and_restart(self, name: str) -> None:
        """End a node in the midst of a motion; nothing moves by itself, the next goal works."""
        self.kill(name)
        killed = time()
        self.start(name)
        if name == 'plant_node':
            self._expect(lambda: self.state and stamp(self.state) > killed, 'a new plant')
            still = list(self.state.position)
            self._wait(1.0)
            moved = np.abs(np.subtract(self.state.position, still)).max()
            assert moved < 1e-9, f'the restarted plant has moved by {moved} rad'
        self._wait(2.5)
        del self.status[:], self.reports[:], self.graph.log[:]
        for relay in (self.to_planner, self.to_plant):
            del relay.received[:], relay.delivered[:]
        self.graph.call(Trigger, '/flat_plant/reset')
        self._wait(0.5)
        self._move()
        self._finish('plain')

    def _pose(self) -> list[float]:
        """Return a random pose of the actuated joints [rad]."""
        return [float(angle) for angle in self.random.uniform(-1.2, 1.2, self.joints)]

    def _send(self, pose: list[float]) -> None:
        """Send a goal through the relay."""
        message = goal(pose, self.random.uniform(1.2, 2.0))
        received = len(self.to_planner.received)
        self.graph.publish('/goals', message)
        self._expect(lambda: len(self.to_planner.received) > received, 'the goal at the relay')

    def _move(self) -> dict[str, str]:
        """Send goals until one is accepted; return its verdict."""
        for _ in range(30):
            delivered = len(self.to_planner.delivered)
            self._send(self._pose())
            self._expect(lambda: self.to_planner.is_idle, 'an idle relay')
            if len(self.to_planner.delivered) > delivered:
                self._expect(
                    lambda: self._answered() >= len(self.to_planner.delivered), 'a verdict'
                )
                accepted = [v for v in self.answers() if v['state'] == 'ACCEPTED']
                if accepted:
                    return accepted[-1]
                self._wait(0.3)
        raise AssertionError('no goal is accepted: ' + self.answers()[-1]['error_name'])

    def _all(self) -> list[dict[str, str]]:
        """Return the values of all statuses."""
        return [values(message) for message in self.status]

    def _answered(self) -> int:
        """Return the number of verdicts on goals."""
        return len(self.answers())

    def _ended(self, verdict: dict[str, str]) -> list[dict[str, str]]:
        """Return how an accepted goal has ended."""
        plan_id = verdict['plan_id']
        # FAILED: its command was lost or late, which is looked at after its report.
        states = ('FINISHED', 'STOPPED', 'FAILED')
        return [v for v in self._all() if v['state'] in states and v['plan_id'] == plan_id]

    def _report_of(self, end: float) -> list[dict[str, str]]:
        """Return the reports on the motion with an end [s]."""
        found = map(values, self.reports)
        return [v for v in found if abs(float(v.get('end_time', 0.0)) - end) < 5e-3]

    def _on_state(self, state: JointState) -> None:
        """Keep the newest joint state and how far it is behind the time of day."""
        self.state = state
        if self.speed is None:
            self.offsets.append((monotonic() - self._born, time() - stamp(state)))

    def _wait(self, seconds: float) -> None:
        """Wait for a time of the plant."""
        self._wait_until(stamp(self.state) + seconds)

    def _wait_until(self, moment: float) -> None:
        """Wait for a joint state stamped then or later."""
        self._expect(lambda: stamp(self.state) >= moment, f'the time {moment:.3f} s')

    def _expect(self, condition, what: str) -> None:
        """Wait for a condition, and look at the memory meanwhile."""

        def holds() -> object:
            self._look()
            return condition()

        self.graph.expect(holds, what, DEADLINE)
