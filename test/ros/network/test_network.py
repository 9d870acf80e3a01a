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

import os
from pathlib import Path
import subprocess
import sys
from time import monotonic

from flat_planner_ros.ros.dds_profile import FILES, OWN_FILES, profile_environment
import pytest
from ros.conftest import Graph, TIMEOUT
from ros.network.two_computers import Network, NO_HARM, PROFILED, PROFILES

DURATION = 0.5

MISS = 1e-3
"""Distance from its goal up to which an arm has played its command [rad]."""

THERE = 0.1
"""Distance from its goal up to which an arm is there, `finish.position_tolerance` [rad]."""

APART = 0.2
"""By how much the clocks differ [s]."""

ATTEMPTS = 3
"""How often a motion is repeated on a machine that is too busy to play it in time."""

PARTITION = 3.0
"""Time for which nothing gets through [s]."""

SETTLED = 1.0
"""Time after a motion in which both monitors have reported it [s]."""

OK, STALE = 0, 3

ANSWERS = ('ACCEPTED', 'REJECTED')


@pytest.fixture(scope='module')
def graph_of_all(ros_domain):
    """Return a graph for all tests: nodes take seconds to start."""
    graph = Graph(ros_domain)
    try:
        yield graph
    finally:
        graph.close()


@pytest.fixture(scope='module')
def network(graph_of_all):
    """Return a network with all nodes."""
    network = Network(graph_of_all)
    try:
        network.nodes()
        yield network
    finally:
        network.close()


@pytest.fixture(scope='module')
def user(network):
    """Return how to ask a user."""
    return network.user()


HARM = {
    'delay': (0.02, 0.01, 0.0),
    'loss of 1 %': (0.02, 0.01, 0.01),
    'loss of 5 %': (0.02, 0.01, 0.05),
    'loss of 20 %': (0.02, 0.01, 0.2),
}
"""Delay [s], what is added to it at random [s], by which frames overtake each other, and loss."""


def told_truly(known, ends):
    """Say what a user has heard that is not so, or not heard once."""
    answers = [v for v in known['verdicts'] if v.get('state') in ANSWERS]
    false = [] if len(answers) == known['sent'] else [f'{answers} for {known["sent"]} goals']
    if any(known['effort']):
        false.append(f'an effort of {known["effort"]} after the end')
    missed = {end['start_time'] for end in ends if end['miss'] >= MISS}
    for side in ('near', 'far'):
        for level, message, *start in known[side]:
            if level == OK and missed.intersection(start):
                false.append(f'{side}: {message}')
    return false


@pytest.mark.parametrize(('harm', 'count'), [*zip(HARM, (2, 3, 3, 4), strict=True)])
def test_every_accepted_goal_is_played_or_failed(network, user, harm, count):
    network.be(*HARM[harm])
    may_fail = harm == 'loss of 20 %'  # a command of 14 frames: 0.2 ** 5 each
    for _ in range(ATTEMPTS):
        ends = user('goals', count, DURATION)
        played = [end for end in ends if end['miss'] < MISS]
        assert all(end['state'] == 'FAILED' for end in ends if end not in played), ends
        if len(played) >= count - may_fail:
            break
    assert len(played) >= count - may_fail, ends
    assert not told_truly(user('wait', SETTLED), ends)


def test_what_is_late_lost_and_overtaken_at_once_is_played_or_failed(network, user):
    network.be(0.1, 0.1, 0.2)
    ends = user('goals', 2, DURATION)
    assert all(end['state'] == 'FAILED' for end in ends if end['miss'] >= THERE), ends
    assert not told_truly(user('wait', SETTLED), ends)


@pytest.mark.parametrize('delay', [0.1, 0.2])
def test_delays_that_the_start_waits_for_cost_nothing(network, user, delay):
    network.be(delay, 0.0, 0.0)
    for _ in range(ATTEMPTS):
        ends = user('goals', 2, DURATION)
        is_played = all(end['state'] == 'FINISHED' and end['miss'] < MISS for end in ends)
        if is_played:
            break
    assert is_played, ends


def test_nodes_with_the_profile_hear_those_without(network, user):
    network.be(*NO_HARM)
    names = ['noise.position_std'] * 200
    assert user('ask', names) == len(names)
    assert network.user(profile={})('ask', names) == len(names)


def parted(network, user, share, takeover=()):
    """Cut the network in a motion to 2 rad; return both verdicts and what is new."""
    for _ in range(ATTEMPTS):
        network.be(*NO_HARM)
        before = user('wait', 0.3)
        first = user('start', 2.0, 1.0, share)
        network.be(0.0, 0.0, 1.0)
        second = user('add', *takeover) if takeover else first
        user('wait', PARTITION)
        network.be(*NO_HARM)
        after = user('wait', 1.0)
        new = {side: after[side][len(before[side]) :] for side in ('near', 'far', 'verdicts')}
        if after['state'] == pytest.approx([2.0, 0.0, 0.0, 0.0], abs=5e-3):
            break
    assert after['state'] == pytest.approx([2.0, 0.0, 0.0, 0.0], abs=5e-3)
    return first, second, new


def test_a_partition_in_a_motion_ends_neither_it_nor_what_follows(network, user):
    verdict, _, new = parted(network, user, 0.5)
    (near,), (far,) = new['near'], new['far']
    assert near[0] == STALE
    assert far[0] != STALE
    assert near[2] == far[2] == verdict['start_time']
    assert user('goals', 1, DURATION)[0]['state'] == 'FINISHED'


def test_a_takeover_into_a_partition_leaves_the_motion_that_it_was_to_replace(network, user):
    """The clock of the plant is behind, too; the second command comes after its end."""
    network.set_clock_of_plant(-APART)
    first, second, new = parted(network, user, 0.3, (1.0, 0.8))
    (near,), (far,) = new['near'], new['far']
    assert near[0] == STALE
    assert first['start_time'] < near[2] <= second['start_time']
    assert (far[0] == STALE, far[2]) == (False, first['start_time'])
    said = [each for each in new['verdicts'] if each.get('plan_id') == second['plan_id']]
    assert said[-1]['message'].endswith('no joint state tells whether the arm is there')
    assert user('goals', 1, DURATION)[0]['state'] == 'FINISHED'


def test_an_arm_whose_clock_is_ahead_is_refused_and_rests(network, user):
    network.be(*NO_HARM)
    network.set_clock_of_plant(APART)
    until = monotonic() + TIMEOUT
    verdict = user('add', 1.0, DURATION)
    while 'ahead' not in verdict['message'] and monotonic() < until:
        verdict = user('add', 1.0, DURATION)
    assert (verdict['error_name'], 'ahead' in verdict['message']) == ('START_STATE_STALE', True)
    known = user('wait', DURATION)
    assert known['state'] == pytest.approx([0.0] * 4, abs=1e-6)
    assert not any(known['effort'])


def test_the_profiles_are_added_unless_the_user_has_some(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = profile_environment({})
    assert len(found) == 1
    assert set(found) <= set(FILES)
    for file in map(Path, found.values()):
        assert file.read_text('utf-8') == (PROFILES / file.name).read_text('utf-8')
    for variable in FILES:
        assert profile_environment({variable: 'mine.xml'}) == {}
    (tmp_path / OWN_FILES[0]).write_text('<dds/>', 'utf-8')
    assert profile_environment({}) == {}


def test_the_middleware_reads_its_profile_without_a_complaint(ros_domain):
    """Fast DDS gives up a whole file for one element that it does not know, and goes on."""
    program = 'import rclpy; rclpy.init(); rclpy.create_node("alone"); rclpy.shutdown()'
    given = {**os.environ, **PROFILED, 'ROS_DOMAIN_ID': str(ros_domain)}
    command = [sys.executable, '-c', program]
    ended = subprocess.run(command, env=given, capture_output=True, text=True, timeout=TIMEOUT)
    assert (ended.returncode, ended.stdout + ended.stderr) == (0, '')


def test_both_profiles_say_the_same():
    """Fast DDS 3 has other names for the periods of heartbeats."""
    older, newer = ((PROFILES / file).read_text('utf-8').lower() for file in FILES.values())
    settings = [text[text.index('<dds') :].replace('_', '') for text in (older, newer)]
    assert settings[0] == settings[1]
