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

"""SIGINT, SIGTERM and a shutdown of the context end every program in every state: 0, no word."""

import os
from pathlib import Path
import signal
import sys

import numpy as np
import pytest
from sensor_msgs.msg import JointState

CODE = 'import sys; from flat_planner_ros.programs import {0}; sys.exit({0}())'
"""What an installed console script does."""

PROGRAMS = ('planner_node', 'plant_node', 'monitor_node', 'demo')

STAGES = {
    'signals are caught': '',
    'NumPy is loaded': '_multiarray_umath',
    'rclpy is loaded': '_rclpy_pybind11',
    'the middleware is loaded': 'librmw_dds_common',
    'messages are loaded': 'libsensor_msgs__rosidl_typesupport',
    'the node is on the graph': None,
    'it is ready': None,
}
"""What a program has come to when it is ended, and the library that shows it."""

SHUTDOWN = """
import sys, threading
from flat_planner_ros.ros.nodes.plant_node import main
import rclpy

def shut_down():
    if rclpy.ok():  # before there is a context it would do nothing
        threading.Timer({delay}, rclpy.try_shutdown).start()
    else:
        threading.Timer(0.001, shut_down).start()

shut_down()
sys.exit(main())
"""

OVERTAKEN = """
import sys
from flat_planner_ros.ros.nodes.guarded_callbacks import GuardedNode
from flat_planner_ros.ros.nodes.node_runner import run
import rclpy
from std_msgs.msg import String

class Overtaken(GuardedNode):
    def __init__(self):
        super().__init__('overtaken')
        self.topic = self.create_publisher(String, 'topic', 1)
        self.create_timer(0.01, self.on_tick)

    def on_tick(self):
        rclpy.shutdown()
        self.topic.publish(String())

sys.exit(run([Overtaken]))
"""


STUCK = """
import sys, time
from flat_planner_ros.ros.nodes.guarded_callbacks import GuardedNode
from flat_planner_ros.ros.nodes.node_runner import run

class Stuck(GuardedNode):
    def __init__(self):
        super().__init__('stuck')
        self.create_timer(0.01, self.on_tick)

    def on_tick(self):
        print('stuck', flush=True)
        time.sleep(1000.0)  # goes on after a signal

    def rest(self):
        print('at rest', flush=True)

sys.exit(run([Stuck]))
"""


def start(graph, name, *arguments):
    """Start a program as its console script does, and wait until it catches signals."""
    process = graph.run([sys.executable, '-c', CODE.format(name), *arguments])
    graph.expect(lambda: catches(process.pid, signal.SIGTERM), 'a handler of signals')
    return process


def signals(pid: int, kind: str) -> int:
    """Return a set of signals of a process as bits: SigCgt are caught, ShdPnd are on their way."""
    for line in Path(f'/proc/{pid}/status').read_text().splitlines():
        if line.startswith(f'{kind}:'):
            return int(line.split()[1], 16)
    return 0


def catches(pid: int, number: int) -> bool:
    """Return whether a process has a handler for a signal."""
    return bool(signals(pid, 'SigCgt') >> (number - 1) & 1)


def has_loaded(process, library: str) -> bool:
    """Return whether a process has loaded a library, or has ended."""
    if process.exit_code is not None:
        return True
    return library in Path(f'/proc/{process.pid}/maps').read_text()


def await_stage(graph, process, stage: str) -> None:
    """Wait until a program has come so far."""
    if STAGES[stage] is not None:
        graph.expect(lambda: has_loaded(process, STAGES[stage]), stage)
    elif stage == 'it is ready':
        graph.expect(lambda: 'ready' in process.stderr, stage)
    else:
        graph.expect(lambda: len(graph.probe.get_node_names()) > 1, stage)  # the probe is one


def assert_clean(process) -> None:
    """Look at what a process leaves behind."""
    assert process.wait() == 0, process.stderr
    words = [line for line in process.stderr.splitlines() if '[INFO]' not in line]
    assert words == []
    with pytest.raises(ProcessLookupError):
        os.killpg(process.pid, 0)


@pytest.mark.parametrize('stage', STAGES)
@pytest.mark.parametrize('name', PROGRAMS)
def test_a_signal_at_any_moment_ends_a_program(graph, name, stage):
    index = list(STAGES).index(stage) + PROGRAMS.index(name)
    numbers = [(signal.SIGINT,), (signal.SIGTERM,), (signal.SIGINT, signal.SIGTERM)][index % 3]
    process = start(graph, name)
    await_stage(graph, process, stage)
    for number in numbers:
        if process.exit_code is None:
            os.kill(process.pid, number)
        if index % 2:  # the second one comes when the first one has been taken
            graph.expect(
                lambda: process.exit_code is not None or not signals(process.pid, 'ShdPnd'),
                'a signal taken',
            )
    assert_clean(process)


@pytest.mark.parametrize('stage', ['signals are caught', 'rclpy is loaded', 'it is ready'])
def test_a_hail_of_signals_does_no_more_than_one(graph, stage):
    index = list(STAGES).index(stage)
    process = start(graph, PROGRAMS[index % 3])
    await_stage(graph, process, stage)
    number = signal.SIGINT if index else signal.SIGTERM
    while not graph.spin_until(lambda: process.exit_code is not None, 0.005):
        os.kill(process.pid, number)
    assert_clean(process)


@pytest.mark.parametrize('delay', [0.0, 0.03, 0.06, 0.1, 0.15, 1.0])
def test_a_shutdown_of_the_context_ends_a_node(graph, delay):
    process = graph.run([sys.executable, '-c', SHUTDOWN.format(delay=delay)])
    assert_clean(process)


@pytest.mark.parametrize('executor', ['events', 'single'])
def test_a_callback_that_a_shutdown_overtakes_says_nothing(graph, executor):
    process = graph.run([sys.executable, '-c', OVERTAKEN], FLAT_PLANNER_EXECUTOR=executor)
    assert_clean(process)


def test_a_signal_ends_a_node_that_does_not_come_back(graph):
    command = [sys.executable, '-c', STUCK]
    # Both at once: that they do not come back takes seconds to show.
    processes = [graph.run(command, FLAT_PLANNER_EXECUTOR=name) for name in ('events', 'single')]
    for process in processes:
        graph.expect(lambda p=process: 'stuck' in p.stdout, 'a callback that lasts')
    for process in processes:
        os.kill(process.pid, signal.SIGTERM)
    for process in processes:
        assert process.wait() == 1
        assert 'ended by force, 5 s after SIGTERM' in process.stderr
        assert 'at rest' in process.stdout


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_tool_that_is_interrupted_ends_with_130_and_no_word(graph, number):
    many = ['--stretch', *map(str, np.linspace(1.0, 3.0, 500))]
    process = start(graph, 'tradeoff', 'joint1=3.14', '--duration', '1', *many)
    graph.expect(lambda: has_loaded(process, 'scipy'), 'a program at work')
    assert process.stop(number) == 130
    assert process.stderr == ''


def test_a_tool_whose_reader_goes_away_says_nothing(graph):
    program = f"{sys.executable} -c '{CODE.format('flat_plan')}' joint1=1 --duration 1"
    process = graph.run(['bash', '-c', f'{program} | head -c 10'])
    assert process.wait() == 0
    assert process.stderr == ''
    assert len(process.stdout) == 10


def test_a_program_says_that_it_is_ready_once(graph):
    parameters = Path(__file__).resolve().parents[3] / 'config' / 'arm_2dof.yaml'
    process = start(graph, 'plant_node', '--ros-args', '--params-file', str(parameters))
    graph.expect(lambda: '[flat_plant]: ready' in process.stderr, 'a word')
    states = graph.collect(JointState, '/joint_states', matched=False)
    graph.expect(lambda: len(states) > 50, 'a plant that goes on')
    assert process.stop() == 0
    assert process.stderr.count('ready') == 1
    # What it is, where its parameters come from, and that it is ready.
    assert len(process.stderr.splitlines()) == 3


BROKEN = {
    'missing': (None, 'no such file'),
    'no YAML': ('a: [1, 2\n b', 'params file'),
    'no block': ('flat_plant:\n  publish_rate: 3.0\n', 'ros__parameters'),
    'mixed list': ('/**:\n  ros__parameters:\n    joints: [a, 1]\n', 'same type'),
}
"""Parameter files and what is said of them."""


@pytest.mark.parametrize('name', BROKEN)
def test_a_parameter_file_that_cannot_be_read_ends_a_program_with_one_line(graph, tmp_path, name):
    content, text = BROKEN[name]
    file = tmp_path / 'parameters.yaml'
    if content is not None:
        file.write_text(content)
    process = graph.run(
        [sys.executable, '-c', CODE.format('demo'), '--ros-args', '--params-file', str(file)]
    )
    assert process.wait() == 1
    (line,) = process.stderr.splitlines()
    assert line.startswith('cannot start: ')
    assert text in line
    assert '.c:' not in line
