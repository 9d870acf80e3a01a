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

"""Messages lost, doubled, out of order and up to 0.2 s late: whole motions or none, all told."""

import json
from math import pi
import re

from flat_planner_ros.ros.wire import stamps
import numpy as np
import pytest
from ros.relay import Faults, Relay
from ros.rig import COMMAND, GOAL, goal, not_verified, stamp, STATES, values, World
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

BAD = Faults(loss=0.2, duplication=0.3, reordering=0.3, delay=(0.0, 0.2))
DELAYS = ((0.19, 0.2), (0.0, 0.02), (0.0, 0.2))
"""Of a command [s]; a motion starts 0.05 s after its verdict."""

LONGER_DELAY = 2.0
"""From a verdict to the start where a machine is too busy for the planner's own delay [s]."""

EXACT, STEP_LATE = 1e-5, 2e-5
"""
What a whole motion leaves at most, and one whose command came within the plant's first step [rad].

A step is 1 ms, which leaves 1.85e-5 rad; the plant takes it for in time.
"""

REFUSED, LATE = 'trajectory ignored', 'ms after its start'


class Lossy(World):
    """The three nodes, what the plant hears or says through a relay."""

    def __init__(self, graph, *, source, target, kind, remap='', seed=1, **plant):
        """Start them; `remap` puts a node at the other end of the relay."""
        parameters = {
            'flat_planner:use_sim_time': True,
            'flat_monitor:use_sim_time': True,
            'flat_plant:publish_clock': True,
            'flat_plant:publish_rate': 100.0,
            'flat_planner:reference_rate': 10.0,
            'flat_planner:report_advice': False,
            'flat_planner:replan.lookahead': 0.4,
            'flat_monitor:window': 1.0,
            'flat_monitor:timeout': 1.0,
            **{f'flat_plant:{name}': value for name, value in plant.items()},
        }
        arguments = [
            word for name, value in parameters.items() for word in ('-p', f'{name}:={value}')
        ]
        arguments += ['-r', remap] if remap else []
        super().__init__(graph, arguments=arguments, delay=None)
        self.relay = graph.add(
            Relay(
                kind, source, target, seed=seed, context=graph.context, use_global_arguments=False
            )
        )
        if kind is JointState:
            self.states = self.hear(JointState, source)
        graph.expect(self.relay.target.get_subscription_count, 'a reader of the relay')
        if source != '/goals':  # that one the test publishes
            graph.expect(self.relay.source.get_publisher_count, 'a source of the relay')
        graph.expect(lambda: self.states, 'joint states')

    def between(self, start, end):
        """Return times, last joint's angles and first joint's efforts of a time [s]."""
        self.wait_until(end)
        chosen = [s for s in self.states if start <= stamp(s) <= end]
        rows = [(stamp(s), s.position[-1], s.effort[0]) for s in chosen]
        return np.array(rows).T


def played(command, times):
    """Return the efforts of joint 1 that a command asks for [N m]."""
    at = [stamp(command) + stamps.seconds(p.time_from_start) for p in command.points]
    return np.interp(times, at, [p.effort[0] for p in command.points], left=0.0, right=0.0)


def assert_honest(report, angles):
    """Compare a reported amplitude with the largest deflection that was really there."""
    amplitude, peak = float(values(report)['amplitude']), np.abs(angles).max()
    assert np.isfinite(amplitude)
    if max(amplitude, peak) > 2e-5:
        # A tenth of it decays until the peak, which need not be the first one either.
        assert 0.95 * peak < amplitude < 1.3 * peak


def test_every_goal_that_arrives_gets_one_verdict_in_the_order_of_arrival(graph):
    lossy = Lossy(graph, source='/goals', target=GOAL, kind=JointTrajectory)
    lossy.relay.faults = BAD
    for number in range(80):
        asked = goal(0.01 * number, 0.8)
        if number % 5 == 0:
            asked.points[0].velocities = [1.0]
        graph.publish('/goals', asked)
    relay = lossy.relay
    graph.expect(lambda: len(relay.received) == 80, 'all goals')
    relay.faults = Faults()
    graph.expect(lambda: relay.is_idle, 'what is on its way')
    sent = [m.points[0].positions[0] for m in relay.received]
    arrived = [m.points[0].positions[0] for m in relay.delivered]
    assert len(set(arrived)) < len(arrived), 'some came twice'
    assert set(arrived) < set(sent), 'some were lost'
    assert arrived != sorted(arrived), 'some came out of order'
    graph.publish('/goals', JointTrajectory())  # its verdict is the last one
    graph.expect(lambda: len(lossy.answers()) > len(arrived), 'all verdicts')
    *verdicts, last = lossy.answers()
    assert last['error_name'] == 'EMPTY_GOAL'
    assert [json.loads(v['goal.positions'])[0] for v in verdicts] == pytest.approx(arrived)
    moving = [v for m, v in zip(relay.delivered, verdicts, strict=False) if m.points[0].velocities]
    assert moving
    assert {verdict['state'] for verdict in moving} == {'REJECTED'}


def said(graph, text):
    """Return how often a complaint was made: of a kind one line a second is said, with a count."""
    counts = [re.search(r'the last of (\d+) like it', line) for line in graph.logged(text)]
    return sum(1 if count is None else int(count[1]) for count in counts)


def test_a_command_is_played_by_its_stamp_to_the_end_or_not_at_all(graph):
    lossy = Lossy(
        graph,
        source=COMMAND,
        target='/bad/joint_trajectory',
        kind=JointTrajectory,
        remap='flat_plant:flat_planner/joint_trajectory:=/bad/joint_trajectory',
        seed=4,
        start_tolerance=0.002,
    )
    kinds = []
    while len(kinds) < 8 or ('whole' not in kinds and len(kinds) < 20):
        if len(kinds) == 8:
            (longer,) = graph.set_parameters('flat_planner', start_delay=LONGER_DELAY)
            assert longer.successful
        graph.call(Trigger, '/flat_plant/reset')
        lossy.wait_until(stamp(lossy.states[-1]) + 0.1)  # the planner has heard of it
        lossy.relay.faults = Faults(loss=0.2, duplication=0.5, delay=DELAYS[len(kinds) % 3])
        del lossy.reports[:], lossy.relay.delivered[:], lossy.relay.received[:]
        refusals, delays = said(graph, REFUSED), len(graph.logged(LATE))
        verdict = lossy.move(pi, 0.8)
        start = float(verdict['start_time'])
        end = start + float(verdict['duration'])
        graph.expect(lambda: lossy.reports, 'a report')
        times, _, efforts = lossy.between(start, end + 1.0)
        wanted = played(lossy.relay.received[0], times)
        if not efforts.any():
            kinds.append('not played')
            heard = refusals + len(lossy.relay.delivered)
            graph.expect(lambda heard=heard: said(graph, REFUSED) == heard, 'all refusals')
        else:
            begun = int(np.argmax(efforts != 0.0))
            np.testing.assert_allclose(efforts[begun:], wanted[begun:], rtol=0.0, atol=1e-9)
            kinds.append('late' if len(graph.logged(LATE)) > delays else 'whole')
        assert not efforts[times > end].any()
        _, angles, _ = lossy.between(end, end + 1.0)
        assert_honest(lossy.reports[-1], angles)
        if kinds[-1] == 'whole' and np.abs(angles).max() > EXACT:
            assert np.abs(angles).max() < STEP_LATE
            kinds[-1] = 'a step late'
    assert 'not played' in kinds, kinds
    if 'whole' not in kinds:
        assert 'a step late' not in kinds
        not_verified(f'none of {len(kinds)} motions was played from its start')


def test_a_command_that_was_overtaken_does_not_take_over_again(graph):
    lossy = Lossy(
        graph,
        source=COMMAND,
        target='/bad/joint_trajectory',
        kind=JointTrajectory,
        remap='flat_plant:flat_planner/joint_trajectory:=/bad/joint_trajectory',
        # The third command goes on from the second, which the plant has not heard of yet.
        start_tolerance=10.0,
    )
    # Slow ones: neither is over, nor the arm far from both, when the next one is on its way.
    first = lossy.move(2.0, 20.0)
    lossy.wait_until(float(first['start_time']) + 0.3)
    lossy.relay.faults = Faults(reordering=1.0)
    lossy.move(1.0, 20.0)
    graph.expect(lambda: not lossy.relay.is_idle, 'the second command, held back')
    lossy.wait_until(stamp(lossy.states[-1]) + 0.05)
    last = lossy.move(3.0, 1.5)
    graph.expect(lambda: len(lossy.relay.delivered) == 3, 'the second command after the third')
    delivered = [m.points[-1].positions[0] for m in lossy.relay.delivered]
    assert delivered == pytest.approx([2.0, 3.0, 1.0])
    graph.expect(lambda: graph.logged('trajectory ignored: it was overtaken'), 'a refusal')
    end = float(last['start_time']) + float(last['duration'])
    lossy.wait_until(end + 0.5)
    # Where the arm ends depends on what it has missed of the second command.
    _, _, efforts = lossy.between(end + 0.01, end + 0.5)
    assert not efforts.any()


def test_residuals_are_reported_honestly_from_joint_states_that_come_badly(graph):
    lossy = Lossy(
        graph,
        source='/true_states',
        target=STATES,
        kind=JointState,
        remap='flat_plant:joint_states:=/true_states',
        # Few enough that a busy relay does not fall behind more and more.
        publish_rate=50.0,
        **{'mismatch.stiffness_scale': 1.1, 'mismatch.damping_scale': 1.1},
    )
    lossy.relay.faults = BAD
    for position in (pi, -1.0):
        graph.call(Trigger, '/flat_plant/reset')
        del lossy.reports[:]
        heard = len(lossy.relay.delivered)
        graph.expect(lambda heard=heard: len(lossy.relay.delivered) > heard + 60, 'the reset')
        verdict = lossy.move(position, 0.8)
        end = float(verdict['start_time']) + float(verdict['duration'])
        graph.expect(lambda: lossy.reports, 'a report')
        _, angles, _ = lossy.between(end, end + 1.0)
        assert np.abs(angles).max() > 1e-3
        assert_honest(lossy.reports[-1], angles)
