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

"""The nodes of the paper's experiment in processes, with the plant owning the time."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from math import tau
import signal
import subprocess
import sys
from typing import Any

from flat_planner_ros.child_process import end_with_parent
from flat_planner_ros.core.arm import Drive
from flat_planner_ros.figures.paper_example import Scenario

WINDOW = 3.0
"""Time after the motion from which the monitor takes the amplitude [s]."""

TRACKED_WINDOW = 1.2
"""The same with feedback, which needs less than a second [s]."""

PLANNED_RATE = 100.0
"""Joint states per second without feedback [Hz]: 65 of a swing, and half the messages."""

SILENCE = 5.0
"""Real time for which a busy machine may be silent [s]."""

TERMINATION = 10.0
"""Time that a node is given to end by itself [s]: twice what it takes to end for certain."""

TRACKING_RATE = 500.0
"""Joint states, and efforts of the tracker, per second [Hz]."""

ENCODER = tau / 2**14
"""Step of the encoders that the tracker sees [rad]."""

TRACKING_TIMEOUT = 0.2
"""Simulated silence at which the tracker gives up; a busy machine is late [s]."""

Parameters = Mapping[str, Mapping[str, Any]]
"""Values by node and name."""


def planned_nodes(speed: float, drive: Drive) -> Parameters:
    """Return the parameters of planner, plant and monitor at a speed of the simulated time."""
    return {
        'planner': {
            'use_sim_time': 'true',
            'reference_rate': '10.0',
            'drive': drive.value,
            # Given, and checked against the measured one, which may be from before a reset.
            'start.source': 'parameter',
            'start.position': '[0.0, 0.0]',
            'start.joint_state_timeout': SILENCE * speed,
        },
        'plant': {
            'publish_clock': 'true',
            'real_time_factor': speed,
            'publish_rate': PLANNED_RATE,
            'drive': drive.value,
        },
        'monitor': {
            'use_sim_time': 'true',
            'window': WINDOW,
            'timeout': SILENCE * speed,
            'drive': drive.value,
        },
    }


def tracked_nodes(speed: float, scenario: Scenario) -> Parameters:
    """Return the same with a tracker, for an arm with the friction of a scenario."""
    three = planned_nodes(speed, Drive.EFFORT)
    plant = {
        'input': 'tracker',
        'publish_rate': TRACKING_RATE,
        'encoder.resolution': ENCODER,
        'friction.viscous': f'[{scenario.viscous_friction}]',
        'friction.coulomb': f'[{scenario.coulomb_friction}]',
    }
    return {
        **three,
        'plant': {**three['plant'], **plant},
        'monitor': {**three['monitor'], 'window': TRACKED_WINDOW},
        'tracker': {'use_sim_time': 'true', 'timeout': TRACKING_TIMEOUT, 'rate': TRACKING_RATE},
    }


@contextmanager
def node_processes(parameters: Parameters) -> Iterator[list[subprocess.Popen[bytes]]]:
    """Run nodes with their parameters, each in a process of its own."""
    processes = []
    try:
        for node, values in parameters.items():
            module = f'flat_planner_ros.ros.nodes.{node}_node'
            command = [sys.executable, '-m', module, '--ros-args', '--log-level', 'fatal']
            for name, value in values.items():
                command += ['-p', f'{name}:={value}']
            # Its own session: Ctrl-C reaches this process alone, which ends the nodes in order.
            processes.append(
                subprocess.Popen(
                    command,
                    start_new_session=True,
                    preexec_fn=partial(end_with_parent, signal.SIGTERM),
                )
            )
        yield processes
    finally:
        for process in processes:
            process.terminate()
        for process in processes:
            try:
                process.wait(TERMINATION)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
