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

"""From starting a node's process to the first answer of its service, and what it imports."""

from argparse import Namespace
from compileall import compile_dir
from pathlib import Path
import subprocess
import sys
from time import perf_counter

import flat_planner_ros
from flat_planner_ros.ros.wire import interfaces
from measurement import duration_text, Section, Timing, verdict
from processes import BARE, BARE_ANSWER, listener, NodeProcess, processes, SHIPPED
from std_srvs.srv import Trigger

STARTS = 5
"""Starts of each node."""

SERVICES = {
    BARE: BARE_ANSWER,
    'planner': interfaces.topic_of(interfaces.PLANNER, interfaces.STOP),
    'plant': interfaces.topic_of(interfaces.PLANT, interfaces.RESET),
    'monitor': interfaces.topic_of(interfaces.MONITOR, interfaces.RESET),
}
"""A service of each node that can be called at any time."""

HEAVY = ('matplotlib', 'scipy.optimize', 'scipy.integrate', 'scipy.interpolate', 'scipy.signal')
"""Modules that a node had better do without."""

RCLPY = 'rclpy'
"""The least that any node needs."""

TARGET = 0.4
"""Time from the start to the first answer [s]."""

SHARE = 1.3
"""The same over that of a bare node of rclpy, where that takes too long already [-]."""


def sections(options: Namespace) -> list[Section]:
    """Return the table of this benchmark."""
    del options
    # As an installation is: otherwise each start would compile what has changed since.
    compile_dir(Path(flat_planner_ros.__file__).parent, quiet=1)
    least = Timing.of([_import_time(RCLPY) for _ in range(STARTS)])
    rows = [
        ('import rclpy alone', duration_text(least.median), duration_text(least.worst), '-', '-')
    ]
    # In turn, so that whatever else the machine does meets them all alike.
    rounds = [{node: _start(node) for node in SERVICES} for _ in range(STARTS)]
    started = {node: Timing.of([times[node] for times in rounds]) for node in SERVICES}
    bare, notes = started[BARE].median, []
    for node, timing in started.items():
        heavy = '-' if node == BARE else ', '.join(_heavy(node)) or 'none'
        median, worst = duration_text(timing.median), duration_text(timing.worst)
        rows.append((node, median, worst, f'{timing.median / bare:.2f}', heavy))
        if node != BARE:
            allowed = max(TARGET, SHARE * bare)
            notes.append(
                f'{node}, {TARGET:g} s or {SHARE:g} times the bare node: '
                f'{verdict(timing.median <= allowed)}'
            )
    return [
        Section(
            'From the start of the process to the first answer of a service',
            ('node', 'median', 'worst', 'over the bare node', 'heavy imports'),
            rows,
            notes,
        )
    ]


def _import_time(module: str) -> float:
    """Return the time of a process that imports one module [s]."""
    start = perf_counter()
    subprocess.run([sys.executable, '-c', f'import {module}'], check=True)
    return perf_counter() - start


def _start(node: str) -> float:
    """Return the time to the first answer [s]."""
    with listener('start_up_listener') as ours:
        client = ours.node.create_client(Trigger, SERVICES[node])
        start = perf_counter()
        process = NodeProcess(node, SHIPPED, {})
        with processes(process):
            ours.spin_until(client.service_is_ready, f'the service of the {node}')
            future = client.call_async(Trigger.Request())
            ours.spin_until(future.done, f'an answer of the {node}')
            elapsed = perf_counter() - start
            assert future.result().message
    return elapsed


def _heavy(node: str) -> list[str]:
    """Return the heavy modules that a node's module imports."""
    code = f'import sys, flat_planner_ros.ros.nodes.{node}_node; print(*sys.modules)'
    run = subprocess.run([sys.executable, '-c', code], check=True, capture_output=True, text=True)
    return [name for name in HEAVY if name in run.stdout.split()]
