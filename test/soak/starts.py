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
Starts and stops of nodes, many times: which of them do not start, or do not end after a signal.

Usage: python test/soak/starts.py --times 1000. Each time a node is started, with the time of a
`/clock` that may stand still, hears a goal or none, and gets SIGINT or SIGTERM at a random moment
of its first seconds. With --ready it must have started first, with --killed 0.2 every fifth one is
killed, which leaves its shared memory to the next ones. Exit code 1 if a node never started, ended
by a fault, or did not end by itself; its stacks are printed. --seed N --times 1 repeats one.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
import signal
import subprocess
import sys
from time import monotonic

import numpy as np
from rclpy.qos import QoSProfile

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from flat_planner_ros.ros.wire import stamps  # noqa: E402, I100
from ros.conftest import free_domain, Graph, Process  # noqa: E402  From the directory of tests.
from ros.rig import GOAL, goal, NODES, STATES  # noqa: E402
from rosgraph_msgs.msg import Clock  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from trajectory_msgs.msg import JointTrajectory  # noqa: E402

LATEST = 4.0
"""Time after the start up to which a signal comes [s]."""

STARTED = 60.0
"""Time within which a node must be ready, with --ready [s]."""

ENDED = 4.0
"""Time after a signal within which a node must end; it ends itself by force after 5 s [s]."""

SLOW = 2.0
"""Time from which an end is worth a line [s]."""

SHARED = Path('/dev/shm')
"""Where Fast DDS keeps its shared memory."""

WELL, KILLED = 'ended well', 'killed on purpose'


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """
    What became of a node.

    Attributes
    ----------
    kind
        In two or three words, by which outcomes are counted.
    what
        Which node, which signal and when.
    details
        Stacks and output of one that did not do well.
    ready, ended
        Times that start and end took [s], None where they were not seen.

    """

    kind: str
    what: str
    details: str = ''
    ready: float | None = None
    ended: float | None = None


def stacks(pid: int) -> str:
    """Return the stacks of a process by py-spy or gdb, or where its threads wait in the kernel."""
    spies = (
        ['py-spy', 'dump', '--native', '--pid', str(pid)],
        ['gdb', '-p', str(pid), '-batch', '-ex', 'thread apply all bt'],
    )
    for spy in spies:
        try:
            spied = subprocess.run(spy, capture_output=True, text=True, timeout=60.0)
        except (FileNotFoundError, subprocess.TimeoutExpired):
            continue
        if spied.returncode == 0:
            return spied.stdout
    tasks = Path(f'/proc/{pid}/task').iterdir()
    return '\n'.join(f'{task.name} {(task / "wchan").read_text()}' for task in tasks)


def shared_memory() -> str:
    """Return how much shared memory Fast DDS has on this machine."""
    sizes = [file.stat().st_size for file in SHARED.glob('fastdds_*')]
    sizes += [file.stat().st_size for file in SHARED.glob('fastrtps_*')]
    return f'{len(sizes)} files, {sum(sizes) / 1e6:.0f} MB'


class Starts:
    """
    Starts a node and stops it.

    Parameters
    ----------
    graph
        Where it runs.
    options
        Of the command line.
    seed
        Of the random moments.

    """

    def __init__(self, graph: Graph, options: Namespace, seed: int) -> None:
        self._graph, self._options = graph, options
        self._random = np.random.default_rng(seed)
        probe = graph.probe
        depth = QoSProfile(depth=1)
        self._clock = probe.create_publisher(Clock, '/clock', depth)
        self._goal = probe.create_publisher(JointTrajectory, GOAL, 10)
        self._states = probe.create_publisher(JointState, STATES, depth)
        self._time = 1.0

    def one(self) -> Outcome:
        """Start a node and stop it."""
        name = str(self._random.choice(NODES))
        number = signal.Signals(self._random.choice([signal.SIGINT, signal.SIGTERM]))
        moment = float(LATEST * self._random.random())
        chances = (0.7, 0.5, 0.7, self._options.killed)
        is_simulated, has_goal, has_clock, is_killed = (self._random.random(4) < chances).tolist()
        use = ['--ros-args', '-p', f'use_sim_time:={str(is_simulated).lower()}']
        program = f'from flat_planner_ros.programs import {name}; raise SystemExit({name}())'
        process = self._graph.run([sys.executable, '-c', program, *use])
        what = f'{name} {number.name} after {moment:.2f} s (goal {has_goal}, time {is_simulated})'
        ready = self._spin(process, moment, has_clock, has_goal)
        if self._options.ready and ready is None and process.exit_code is None:
            return self._wrong('never ready', what, process)
        if is_killed:
            process.kill()
            return Outcome(kind=KILLED, what=what, ready=ready)
        return self._ended(process, number, what, ready)

    def _spin(
        self, process: Process, moment: float, has_clock: bool, has_goal: bool
    ) -> float | None:
        """Let a node run until a moment, or until it is ready; return when it was."""
        begin, ready = monotonic(), None
        while process.exit_code is None:
            passed = monotonic() - begin
            if ready is None and ': ready' in process.stderr:
                ready = passed
            is_due = passed > moment and (ready is not None or not self._options.ready)
            if is_due or passed > STARTED:
                break
            self._publish(has_clock, has_goal)
            self._graph.executor.spin_once(timeout_sec=0.02)
        return ready

    def _publish(self, has_clock: bool, has_goal: bool) -> None:
        """Let a moment of simulated time pass."""
        self._time += 0.02
        if has_clock:
            self._clock.publish(Clock(clock=stamps.time_msg(self._time)))
        state = JointState(name=['joint1', 'joint2'], position=[0.0, 0.0], velocity=[0.0, 0.0])
        state.header.stamp = stamps.time_msg(self._time)
        self._states.publish(state)
        if has_goal and self._goal.get_subscription_count():
            self._goal.publish(goal(1.0))

    def _ended(
        self, process: Process, number: signal.Signals, what: str, ready: float | None
    ) -> Outcome:
        """Stop a node."""
        sent = monotonic()
        try:
            code = process.stop(number, ENDED)
        except subprocess.TimeoutExpired:
            return self._wrong('not ended', what, process)
        ended = monotonic() - sent
        before_python = code == -number or 'init_import_site' in process.stderr
        if code and not before_python:
            kind = signal.Signals(-code).name if code < 0 else f'exit code {code}'
            return self._wrong(kind, what, process)
        return Outcome(kind=WELL, what=what, ready=ready, ended=ended)

    def _wrong(self, kind: str, what: str, process: Process) -> Outcome:
        """Return what a node has come to, and end it."""
        spied = stacks(process.pid) if process.exit_code is None else ''
        process.kill()
        return Outcome(kind=kind, what=what, details=f'{spied}\n{process.stderr}')


def report(outcomes: list[Outcome]) -> str:
    """Return all outcomes in a few lines."""
    counted = Counter(outcome.kind for outcome in outcomes)
    lines = [', '.join(f'{number} {kind}' for kind, number in counted.most_common())]
    for name in ('ready', 'ended'):
        times = [getattr(outcome, name) for outcome in outcomes]
        seen = [time for time in times if time is not None]
        if seen:
            lines.append(
                f'{name} after {np.median(seen):.2f} s (median), {max(seen):.2f} s at most'
            )
    return '\n'.join(lines)


def is_wrong(outcome: Outcome) -> bool:
    """Tell outcomes that should not be."""
    return outcome.kind not in (WELL, KILLED)


def main() -> int:
    """Start and stop; return the exit code."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument('--times', type=int, default=1000)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--ready', action='store_true', help='wait for each to be ready')
    parser.add_argument('--killed', type=float, default=0.0, help='share that is killed')
    options = parser.parse_args()
    # A shell's background job ignores it, and so would what it starts.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    print(f'shared memory before: {shared_memory()}', flush=True)
    outcomes: list[Outcome] = []
    with free_domain() as domain:
        for seed in range(options.seed, options.seed + options.times):
            # A graph of its own each time: nothing of the former node is left in it.
            graph = Graph(domain)
            try:
                outcomes.append(Starts(graph, options, seed).one())
            finally:
                graph.close()
            last = outcomes[-1]
            if is_wrong(last) or (last.ended or 0.0) > SLOW:
                print(f'--seed {seed}: {last.kind}, {last.what}\n{last.details}', flush=True)
            if len(outcomes) % 50 == 0:
                print(f'after {len(outcomes)}: {report(outcomes)}', flush=True)
    print(f'{len(outcomes)} starts from --seed {options.seed}\n{report(outcomes)}')
    print(f'shared memory after: {shared_memory()}')
    return int(any(map(is_wrong, outcomes)))


if __name__ == '__main__':
    sys.exit(main())
