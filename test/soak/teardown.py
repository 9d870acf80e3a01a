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
Nodes started and stopped many times in one process: which order of destruction ends it badly.

Usage: python test/soak/teardown.py --times 1000. Each round makes the three nodes in a context of
their own, lets them talk for a moment, and takes nodes, executor and context down in one of six
orders. Rounds of an order run in a process of their own, so that one that dies tells its order;
exit code 1 if one did.
"""

from __future__ import annotations

from argparse import ArgumentParser
from itertools import permutations
from math import ceil
from pathlib import Path
import signal
import subprocess
import sys
from time import monotonic

import rclpy
from rclpy.executors import SingleThreadedExecutor

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from flat_planner_ros.ros.nodes.monitor_node import MonitorNode  # noqa: E402, I100
from flat_planner_ros.ros.nodes.planner_node import PlannerNode  # noqa: E402
from flat_planner_ros.ros.nodes.plant_node import PlantNode  # noqa: E402
from ros.conftest import free_domain  # noqa: E402  From the directory of tests.
from ros.rig import GOAL, goal  # noqa: E402
from trajectory_msgs.msg import JointTrajectory  # noqa: E402

PARTS = ('nodes', 'executor', 'context')
"""What is taken down, in any order."""

TALKING = 0.5
"""Time for which the nodes run in a round [s]."""

PATIENCE = 20.0
"""Time that a round may take before its process is taken for hanging [s]."""


def rounds(order: tuple[str, ...], times: int, domain: int) -> None:
    """Make nodes and take them down in an order, saying how far it has come."""
    for number in range(times):
        context = rclpy.Context()
        rclpy.init(args=[], context=context, domain_id=domain)
        executor = SingleThreadedExecutor(context=context)
        nodes = [kind(context=context) for kind in (PlannerNode, PlantNode, MonitorNode)]
        for node in nodes:
            executor.add_node(node)
        publisher = nodes[0].create_publisher(JointTrajectory, GOAL, 10)
        until = monotonic() + TALKING
        while monotonic() < until:
            executor.spin_once(timeout_sec=0.01)
            if publisher.get_subscription_count():
                publisher.publish(goal(0.1))
        take_down = {
            'nodes': lambda nodes=nodes: [node.destroy_node() for node in nodes],
            'executor': executor.shutdown,
            'context': context.try_shutdown,
        }
        for part in order:
            print(number, part, flush=True)
            take_down[part]()


def outcome(order: tuple[str, ...], times: int, domain: int) -> str:
    """Return what became of a process that takes nodes down in an order."""
    given = ['--order', ','.join(order), '--times', str(times), '--domain', str(domain)]
    command = [sys.executable, '-X', 'faulthandler', __file__, *given]
    try:
        run = subprocess.run(
            command, capture_output=True, text=True, timeout=PATIENCE * times, check=False
        )
    except subprocess.TimeoutExpired as hanging:
        said = (hanging.stdout or b'').decode().split('\n')
        return f'hangs, last: {said[-2:]}'
    if run.returncode == 0:
        return f'{times} rounds'
    name = signal.Signals(-run.returncode).name if run.returncode < 0 else run.returncode
    return f'{name} after {run.stdout.splitlines()[-1:]}\n{run.stderr[-4000:]}'


def main() -> int:
    """Try all orders; return the exit code."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument('--times', type=int, default=1000, help='rounds, of all orders together')
    parser.add_argument('--order', help='one order alone, in this process')
    parser.add_argument('--domain', type=int, default=0)
    options = parser.parse_args()
    if options.order:
        rounds(tuple(options.order.split(',')), options.times, options.domain)
        return 0
    orders = list(permutations(PARTS))
    times, is_wrong = ceil(options.times / len(orders)), False
    with free_domain() as domain:
        for order in orders:
            said = outcome(order, times, domain)
            is_wrong |= said != f'{times} rounds'
            print(f'{", ".join(order)}: {said}', flush=True)
    return int(is_wrong)


if __name__ == '__main__':
    sys.exit(main())
