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

"""Planner, plant and two monitors on two computers, joined by a wire that does harm."""

from contextlib import suppress
from itertools import count
import json
import os
from pathlib import Path
import subprocess
import sys

from flat_planner_ros.ros.dds_profile import FILES, profiles
import pytest
from ros.conftest import TIMEOUT

HERE = Path(__file__).resolve().parent
PROFILES = HERE.parents[2] / 'config' / 'dds'
PROFILED = profiles()
SUBNET = {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET'}

NO_HARM = (0.0, 0.0, 0.0)

NUMBERS = count()


class Network:
    """
    Two namespaces joined by a wire, `near` with the planner and `far` with the plant.

    Parameters
    ----------
    graph
        To which all programs belong.

    """

    def __init__(self, graph):
        """Join them, or skip the test where that is not allowed."""
        self.graph = graph
        number = next(NUMBERS)
        self.near, self.far = (f'flat{os.getpid()}{side}{number}' for side in 'ab')
        command = [sys.executable, str(HERE / 'wire.py'), self.near, self.far]
        self._wire = self._program(command, {}, stderr=subprocess.DEVNULL)
        self._users = []
        if self._wire.stdout.readline() != 'ready\n':
            self.close()
            pytest.skip('no right to make network namespaces')

    def be(self, delay, jitter, loss):
        """Delay by `delay` to `delay + jitter` [s] and lose a share of the frames."""
        self._wire.stdin.write(f'{delay} {jitter} {loss}\n')
        self._wire.stdin.flush()

    def node(self, namespace, program, *arguments):
        """Start a node on one side; arguments for ROS."""
        inside = ['ip', 'netns', 'exec', namespace, sys.executable, *program]
        given = [word for argument in arguments for word in argument.split()]
        process = self.graph.run([*inside, '--ros-args', *given], **SUBNET, **PROFILED)
        self.graph.expect(lambda: 'ready' in process.stderr or process.exit_code, program[-1])
        assert not process.exit_code, process.stderr
        return process

    def nodes(self):
        """Start all that is needed, planner and one monitor on the near side."""
        monitor = ('-m', 'flat_planner_ros.ros.nodes.monitor_node', '-p window:=1.0')
        self.plant = self.node(self.far, ('-m', 'flat_planner_ros.ros.nodes.plant_node'))
        self.node(
            self.near, ('-m', 'flat_planner_ros.ros.nodes.planner_node'), '-p start_delay:=0.6'
        )
        for side, namespace in (('near', self.near), ('far', self.far)):
            self.node(namespace, monitor[:2], f'-r __node:={side}_monitor', monitor[2])

    def set_clock_of_plant(self, ahead):
        """Start the plant anew, with a clock that is ahead by a time [s]."""
        self.plant.stop()
        self.plant = self.node(self.far, (str(HERE / 'ahead_plant.py'), str(ahead)))

    def user(self, profile=PROFILED):
        """Return how to ask a user on the near side."""
        command = ['ip', 'netns', 'exec', self.near, sys.executable, str(HERE / 'user.py')]
        paths = os.pathsep.join(filter(None, sys.path))
        common = {'ROS_DOMAIN_ID': str(self.graph.domain), 'PYTHONPATH': paths, **SUBNET}
        user = self._program(command, {**common, **profile})
        self._users.append(user)

        def ask(*request):
            user.stdin.write(json.dumps(request) + '\n')
            user.stdin.flush()
            return json.loads(user.stdout.readline())

        return ask

    def close(self):
        """Send the users away and cut the wire."""
        for program in (*self._users, self._wire):
            with suppress(BrokenPipeError):
                program.stdin.close()
            program.stdout.close()
            try:
                program.wait(TIMEOUT)
            except subprocess.TimeoutExpired:
                program.kill()

    def _program(self, command, environment, **options):
        """Start a program that is spoken to, with the middleware's profile only if it is given."""
        bare = {name: text for name, text in os.environ.items() if name not in FILES}
        return subprocess.Popen(
            command,
            env={**bare, **environment},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            **options,
        )
