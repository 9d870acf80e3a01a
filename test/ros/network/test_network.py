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

"""Planner and plant on two computers: a network that loses, delays and reorders packets."""

from contextlib import suppress
import json
import os
from pathlib import Path
import subprocess
import sys

from flat_planner_ros.ros.dds_profile import OWN_FILES, profile_environment, VARIABLES
import pytest
from ros.conftest import TIMEOUT

HERE = Path(__file__).resolve().parent
PROFILES = HERE.parents[2] / 'config' / 'dds' / 'fastdds.xml'
PROFILED = dict.fromkeys(VARIABLES, str(PROFILES))

GOALS, DURATION = 4, 0.5

MISS = 1e-3
"""Distance from its goal up to which an arm has played its command [rad]."""


class Network:
    """Two namespaces, `near` with the planner and `far` with the plant."""

    def __init__(self, graph):
        """Join them, or skip the test where that is not allowed."""
        self.graph = graph
        self.near, self.far = (f'flat{os.getpid()}{side}' for side in 'ab')
        self._wire = subprocess.Popen(
            [sys.executable, str(HERE / 'wire.py'), self.near, self.far],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        if self._wire.stdout.readline() != 'ready\n':
            self.close()
            pytest.skip('no right to make network namespaces')

    def be(self, delay, jitter, loss):
        """Delay by `delay` to `delay + jitter` [s] and lose a share of the frames."""
        self._wire.stdin.write(f'{delay} {jitter} {loss}\n')
        self._wire.stdin.flush()

    def start(self, namespace, *command, **environment):
        """Start a program of Python on one side."""
        inside = ['ip', 'netns', 'exec', namespace, sys.executable, *command]
        common = {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET', **environment}
        return self.graph.run(inside, **common)

    def node(self, namespace, name, *arguments, **environment):
        """Start a node on one side."""
        module = f'flat_planner_ros.ros.nodes.{name}'
        given = [word for argument in arguments for word in ('-p', argument)]
        process = self.start(namespace, '-m', module, '--ros-args', *given, **environment)
        self.graph.expect(lambda: 'ready' in process.stderr, name)
        return process

    def goals(self, count, duration, **environment):
        """Send goals from the near side; return what became of them."""
        user = self.start(
            self.near, str(HERE / 'user.py'), str(count), str(duration), **environment
        )
        assert user.wait(5.0 * TIMEOUT) == 0, user.stderr
        return [json.loads(line) for line in user.stdout.splitlines()]

    def close(self):
        """Cut the wire."""
        with suppress(BrokenPipeError):
            self._wire.stdin.close()
        self._wire.stdout.close()
        self._wire.wait(TIMEOUT)


@pytest.fixture
def network(graph):
    """Return two namespaces joined by a wire."""
    network = Network(graph)
    try:
        yield network
    finally:
        network.close()


def carried_out(network, delay, jitter, loss, start_delay, **environment):
    """Return what becomes of goals on such a network."""
    network.node(network.far, 'plant_node', **environment)
    network.node(network.near, 'planner_node', f'start_delay:={start_delay}', **environment)
    network.be(delay, jitter, loss)
    return network.goals(GOALS, DURATION, **environment)


@pytest.mark.parametrize('loss', [0.0, 0.01, 0.05, 0.2])
def test_every_accepted_goal_is_played_or_failed(network, loss):
    ends = carried_out(network, 0.02, 0.01, loss, 0.5, **PROFILED)
    assert len(ends) == GOALS
    played = [end for end in ends if end['miss'] < MISS]
    assert len(played) >= GOALS - (loss > 0.1), ends  # a command of 14 frames: 0.2 ** 5 each
    assert all(end['state'] == 'FAILED' for end in ends if end not in played), ends


@pytest.mark.parametrize('delay', [0.1, 0.2])
def test_delays_that_the_start_waits_for_cost_nothing(network, delay):
    ends = carried_out(network, delay, 0.0, 0.0, 0.6, **PROFILED)
    assert all(end['state'] == 'FINISHED' and end['miss'] < MISS for end in ends), ends


def test_the_profiles_are_added_unless_the_user_has_some(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert set(profile_environment({})) == set(VARIABLES)
    (file,) = set(profile_environment({}).values())
    assert Path(file).read_text('utf-8') == PROFILES.read_text('utf-8')
    assert profile_environment({VARIABLES[0]: 'mine.xml'}) == {}
    (tmp_path / OWN_FILES[0]).write_text('<dds/>', 'utf-8')
    assert profile_environment({}) == {}
