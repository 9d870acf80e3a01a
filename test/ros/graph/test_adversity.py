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
from time import monotonic

from flat_planner_ros.ros.wire import stamps
import numpy as np
import pytest
from ros.world import ANSWERS, goal, stamp, values, World
from rosgraph_msgs.msg import Clock


def test_a_burst_of_200_goals_gets_200_verdicts_in_order(graph):
    world = World(graph)
    world.move(0.1, 0.3)
    world.wait_until(world.end)
    count = len(world.answers())
    for number in range(200):
        graph.publish('/flat_planner/goal', goal(0.01 * number))
    graph.expect(lambda: len(world.answers()) >= count + 200, '200 verdicts')
    graph.spin_until(lambda: False, 0.3)  # and none too many
    burst = world.answers()[count:]
    asked = [json.loads(v['goal.positions'])[0] for v in burst]
    assert asked == pytest.approx([0.01 * number for number in range(200)])
    accepted = [v for v in burst if v['state'] == 'ACCEPTED']
    assert accepted
    assert {v['error_name'] for v in burst} <= {'SUCCESSFUL', 'BUSY', 'START_STATE_STALE'}
    last = accepted[-1]
    end = float(last['start_time']) + float(last['duration'])
    world.wait_until(end + 0.1)
    if not world.is_said_to_be_late():
        wanted = json.loads(last['goal.positions'])[0]
        assert world.states[-1].position[0] == pytest.approx(wanted, abs=1e-3)
    assert not world.efforts(end + 0.02).any()


def test_parameters_changed_in_a_motion_are_for_the_next_one(graph):
    world = World(graph)
    world.move(1.5, 5.0)
    world.wait_until(world.begin + 0.5)
    changes = {
        'strategy': 'polynomial',
        'weights.r': 10.0,
        'sampling.period': 0.002,
        'model.stiffness': 3.3e-3,
        'flat_model': 'approximate',
        'replan.lookahead': 0.5,
        'stream_effort': True,
    }
    results = graph.set_parameters('flat_planner', **changes)
    assert all(result.successful for result in results), results
    assert graph.set_parameters('flat_plant', start_tolerance=0.001)[0].successful
    command = world.commands[-1]
    assert world.amplitude() < 1e-5 or world.is_said_to_be_late()
    assert world.commands[-1] is command
    at = [stamp(command) + stamps.seconds(p.time_from_start) for p in command.points]
    planned = [p.effort[0] for p in command.points]
    for state in world.states:
        if world.begin <= stamp(state) <= world.end and not world.is_said_to_be_late():
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


def burn(until):
    """Keep a core busy."""
    while monotonic() < until:
        sum(range(10_000))


def test_a_busy_machine_leaves_nothing_to_swing_or_the_plant_says_why(graph):
    world = World(graph)
    spawn = multiprocessing.get_context('spawn')
    busy = [spawn.Process(target=burn, args=(monotonic() + 8.0,)) for _ in range(2)]
    for process in busy:
        process.start()
    try:
        world.move(np.pi)
        amplitude = world.amplitude()
        assert amplitude < 1e-5 or world.is_said_to_be_late()
        assert not world.efforts(world.end + 0.02).any()
    finally:
        for process in busy:
            process.kill()
            process.join()


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
    graph.spin_until(lambda: False, 0.5)  # what is on its way
    count = len(world.states)
    assert world.states[-1].effort[0] != 0.0
    graph.spin_until(lambda: False, 1.5)
    assert len(world.states) == count, 'the arm stands still'
    assert world.ask(2.0, 1.0)['state'] in ANSWERS
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
