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
Starts and stops of nodes, many times: which of them do not end after a signal.

Usage: python test/soak/starts.py --times 1000. Each time a node is started, with the time of a
`/clock` that may stand still, hears a goal or none, and gets SIGINT or SIGTERM at a random moment
of its first seconds. Exit code 1 if one did not end by itself; its stacks are printed then.
"""

from __future__ import annotations

from argparse import ArgumentParser
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

ENDED = 10.0
"""Time after a signal within which a node must end; it ends itself by force after 5 s [s]."""

SLOW = 2.0
"""Time from which an end is worth a line [s]."""


def stacks(pid: int) -> str:
    """Return the stacks of a process by py-spy, where that is not installed by the kernel."""
    try:
        spied = subprocess.run(['py-spy', 'dump', '--pid', str(pid)], capture_output=True)
        return spied.stdout.decode()
    except FileNotFoundError:
        tasks = Path(f'/proc/{pid}/task').iterdir()
        return '\n'.join(f'{task.name} {(task / "wchan").read_text()}' for task in tasks)


class Starts:
    """
    Starts nodes and stops them.

    Parameters
    ----------
    graph
        Where they run.
    seed
        Of the random moments.

    """

    def __init__(self, graph: Graph, seed: int) -> None:
        self._graph = graph
        self._random = np.random.default_rng(seed)
        probe = graph.probe
        depth = QoSProfile(depth=1)
        self._clock = probe.create_publisher(Clock, '/clock', depth)
        self._goal = probe.create_publisher(JointTrajectory, GOAL, 10)
        self._states = probe.create_publisher(JointState, STATES, depth)
        self._time = 1.0

    def one(self) -> str:
        """Start a node and stop it; return what was wrong, empty for nothing."""
        name = str(self._random.choice(NODES))
        number = signal.Signals(self._random.choice([signal.SIGINT, signal.SIGTERM]))
        moment = float(LATEST * self._random.random())
        is_simulated, has_goal, has_clock = (self._random.random(3) < (0.7, 0.5, 0.7)).tolist()
        use = ['--ros-args', '-p', f'use_sim_time:={str(is_simulated).lower()}']
        program = f'from flat_planner_ros.programs import {name}; raise SystemExit({name}())'
        process = self._graph.run([sys.executable, '-c', program, *use])
        until = monotonic() + moment
        while monotonic() < until and process.exit_code is None:
            self._publish(has_clock, has_goal)
            self._graph.executor.spin_once(timeout_sec=0.02)
        what = f'{name} {number.name} after {moment:.2f} s (goal {has_goal}, time {is_simulated})'
        return self._ended(process, number, what)

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

    def _ended(self, process: Process, number: signal.Signals, what: str) -> str:
        """Stop a node; return what was wrong with its end."""
        sent = monotonic()
        try:
            code = process.stop(number, ENDED / 2 - 1.0)
        except subprocess.TimeoutExpired:
            return f'{what}: not ended\n{stacks(process.pid)}\n{process.stderr}'
        finally:
            elapsed = monotonic() - sent
            if elapsed > SLOW:
                print(f'{what}: took {elapsed:.1f} s to end', flush=True)
            process.kill()
        if code == -number or 'init_import_site' in process.stderr:
            return ''  # before Python has read the first line
        return '' if code == 0 else f'{what}: exit code {code}\n{process.stderr}'


def main() -> int:
    """Start and stop; return the exit code."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument('--times', type=int, default=1000)
    parser.add_argument('--seed', type=int, default=1)
    options = parser.parse_args()
    # A shell's background job ignores it, and so would what it starts.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    with free_domain() as domain:
        wrong = []
        for count in range(options.times):
            # A graph of its own each time: nothing of the former node is left in it.
            graph = Graph(domain)
            try:
                wrong += filter(None, [Starts(graph, options.seed + count).one()])
            finally:
                graph.close()
            if wrong and wrong[-1]:
                print(wrong[-1], flush=True)
                wrong[-1] = ''
            if (count + 1) % 50 == 0:
                print(f'{count + 1} starts, {len(wrong)} wrong', flush=True)
    print(f'{options.times} starts, {len(wrong)} wrong')
    return 1 if wrong else 0


if __name__ == '__main__':
    sys.exit(main())
