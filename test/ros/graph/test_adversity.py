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

"""Floods of goals, changed parameters, stopped clocks, full disks, busy machines: all goes on."""

import json
import multiprocessing
from pathlib import Path
import resource
import signal

from diagnostic_msgs.msg import DiagnosticArray
from flat_planner_ros.ros.wire import stamps
import numpy as np
import pytest
from ros.rig import ANSWERS, GOAL, goal, NODES, stamp, START_DELAY, values, World
from rosgraph_msgs.msg import Clock
from trajectory_msgs.msg import JointTrajectory


def test_a_burst_of_200_goals_gets_200_verdicts_in_order(graph):
    world = World(graph, *NODES)  # in one process the plant would have to wait for all of them

    def burst():
        """Send the goals; return where the arm is at the end, and where it was to go last."""
        world.move(0.1, 0.3)
        world.wait_until(world.end)
        world.status.clear()
        for number in range(200):
            graph.publish(GOAL, goal(0.01 * number))
        graph.publish(GOAL, JointTrajectory())  # its verdict is the last one
        graph.expect(lambda: len(world.answers()) > 200, 'all verdicts')
        *verdicts, last = world.answers()
        assert last['error_name'] == 'EMPTY_GOAL'
        asked = [json.loads(v['goal.positions'])[0] for v in verdicts]
        assert asked == pytest.approx([0.01 * number for number in range(200)])
        accepted = [v for v in verdicts if v['state'] == 'ACCEPTED']
        assert accepted
        assert {v['error_name'] for v in verdicts} <= {'SUCCESSFUL', 'BUSY', 'START_STATE_STALE'}
        last = accepted[-1]
        end = float(last['start_time']) + float(last['duration'])
        world.wait_until(end + 0.1)
        assert not world.efforts(end + 0.02).any()
        return world.states[-1].position[0], json.loads(last['goal.positions'])[0]

    reached, wanted = world.in_time(burst, allowed=START_DELAY)
    assert reached == pytest.approx(wanted, abs=1e-3)


def test_parameters_changed_in_a_motion_are_for_the_next_one(graph):
    world = World(graph, arguments=['-p', 'flat_planner:weights.r:=5.0'])
    changes = {
        'strategy': 'polynomial',
        'weights.r': 10.0,
        'sampling.period': 0.002,
        'model.stiffness': 3.3e-3,
        'flat_model': 'approximate',
        'replan.lookahead': 0.6,
        'stream_effort': True,
    }
    before = dict(zip(changes, graph.get_parameters('flat_planner', *changes), strict=True))

    def move_and_change():
        """Change all parameters in a motion; return its command and what it leaves [rad]."""
        graph.set_parameters('flat_planner', **before)
        world.move(1.5, 5.0)
        world.wait_until(world.begin + 0.5)
        results = graph.set_parameters('flat_planner', **changes)
        assert all(result.successful for result in results), results
        assert graph.set_parameters('flat_plant', start_tolerance=0.001)[0].successful
        command = world.commands[-1]
        amplitude = world.amplitude()
        assert world.commands[-1] is command
        return command, amplitude

    command, amplitude = world.in_time(move_and_change)
    assert amplitude < 1e-5
    at = [stamp(command) + stamps.seconds(p.time_from_start) for p in command.points]
    planned = [p.effort[0] for p in command.points]
    played = [s for s in world.states if world.begin <= stamp(s) <= world.end]
    assert len(played) > 100
    for state in played:
        assert state.effort[0] == pytest.approx(np.interp(stamp(state), at, planned), abs=1e-8)
    assert world.move(0.0)['strategy'] == 'polynomial'


@pytest.fixture
def no_directory(tmp_path):
    """Return the path of a directory that cannot be made, not by root either."""
    file = tmp_path / 'file'
    file.touch()
    return str(file / 'log')


def test_nodes_run_without_a_log_file_where_none_can_be_written(graph, no_directory):
    world = World(graph, ROS_LOG_DIR=no_directory)
    world.assert_next_goal_works(0.5)
    demo = world.processes['demo']
    assert demo.stop() == 0
    assert 'no log file: ' in demo.stderr
    assert 'Traceback' not in demo.stderr


def test_nodes_go_on_when_the_disk_is_full(graph, tmp_path):
    world = World(graph, ROS_LOG_DIR=str(tmp_path))
    demo = world.processes['demo']
    log = next(tmp_path.rglob('*.log'))
    assert log.stat().st_size == 0, 'nothing has been written so far'
    # Every write fails from now on, on the console too.
    resource.prlimit(demo.pid, resource.RLIMIT_FSIZE, (0, 0))
    world.assert_next_goal_works(0.5)
    world.assert_next_goal_works(-0.5)
    assert demo.stop(signal.SIGTERM) == 0
    assert log.stat().st_size == 0


def burn():
    """Keep a core busy."""
    while True:
        sum(range(10_000))


@pytest.fixture
def busy_machine():
    """Keep two cores busy during a test."""
    spawn = multiprocessing.get_context('spawn')
    processes = [spawn.Process(target=burn, daemon=True) for _ in range(2)]
    for process in processes:
        process.start()
    yield
    for process in processes:
        process.kill()
        process.join()


@pytest.mark.usefixtures('busy_machine')
def test_a_busy_machine_leaves_nothing_to_swing_or_the_plant_says_why(graph):
    world = World(graph)

    def turn():
        """Return what half a turn leaves [rad]."""
        world.move(np.pi)
        amplitude = world.amplitude()
        assert not world.efforts(world.end + 0.02).any()
        return amplitude

    assert world.in_time(turn) < 1e-5


def test_a_clock_that_stops_stops_the_motion_and_ends_it_when_it_goes_on(graph):
    world = World(graph, arguments=['-p', 'use_sim_time:=true'])

    def show(now):
        """Publish a time until the arm has followed."""

        def has_followed():
            # Again and again: nodes hear a clock by best effort, and the first of it may be lost.
            graph.publish('/clock', Clock(clock=stamps.time_msg(now)), readers=3)
            return world.states and stamp(world.states[-1]) > now - 0.03

        graph.expect(has_followed, f'the arm at {now}')

    def run(until):
        """Let time go on, no faster than the arm follows."""
        since = stamp(world.states[-1]) if world.states else 100.0
        for now in np.arange(since + 0.05, until + 0.05, 0.05):
            show(now)

    run(100.5)
    world.move(2.0)
    run(world.begin + 0.4)
    # The monitor says once a second of real time how it is.
    health = graph.collect(DiagnosticArray, '/diagnostics')
    graph.expect(lambda: health, 'what is on its way')
    count = len(world.states)
    assert world.states[-1].effort[0] != 0.0
    graph.expect(lambda: len(health) >= 3, 'two seconds')
    assert len(world.states) == count, 'the arm stands still'
    assert world.send(2.0, 1.0)['state'] in ANSWERS
    run(float(world.answers()[-1]['start_time']) + 1.0 + 4.0)
    assert world.states[-1].position[0] == pytest.approx(2.0, abs=1e-3)
    last = values(world.reports[-1])
    assert float(last['amplitude']) < 1e-5


def test_nobody_writes_files_but_the_log(graph, tmp_path):
    world = World(graph, ROS_LOG_DIR=str(tmp_path / 'log'), HOME=str(tmp_path / 'home'))
    world.assert_next_goal_works(0.3)
    pid = world.processes['demo'].pid
    written = set()
    for descriptor in Path(f'/proc/{pid}/fd').iterdir():
        flags = Path(f'/proc/{pid}/fdinfo/{descriptor.name}').read_text()
        mode = int(flags.split('flags:')[1].split()[0], 8) & 3
        target = str(descriptor.readlink())
        if mode and target.startswith('/') and not target.startswith(('/dev/', '/tmp/#')):
            written.add(target)
    assert all('/log/' in path or '(deleted)' in path for path in written), written
    assert not (tmp_path / 'home').exists()
