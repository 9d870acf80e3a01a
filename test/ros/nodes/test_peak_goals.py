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

"""Motions of least peak effort through the planner node: what it says and what is played."""

from math import pi

from core.conftest import ARM, envelope
from diagnostic_msgs.msg import DiagnosticStatus
from flat_planner_ros.core import EffortProfile, rollout
import numpy as np
import pytest
from ros.rig import Planner
from std_srvs.srv import Trigger

PARAMETERS = {
    'strategy': 'min_peak_effort',
    'start.source': 'parameter',
    'start.position': [0.0, 0.0],
    'execute': False,
    'limits.effort': [0.015, np.inf],
}
BANG_BANG = 0.832479
"""Least time over pi within 0.015 N m [s]."""


class Resting(Planner):
    """A planner that starts from given rest."""

    def __init__(self, graph, **parameters):
        """Start it."""
        super().__init__(graph, {**PARAMETERS, **parameters})

    def send(self, angle=pi, duration=0.0):
        """Send a goal for joint 1, without a time unless there is one; return its verdict."""
        return super().send(angle, duration)

    def command(self):
        """Return times and efforts of the last plan."""
        self.graph.expect(lambda: self.plans, 'a plan')
        points = self.plans[-1].points
        times = [p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in points]
        return np.array(times), np.array([[point.effort[0]] for point in points])


@pytest.mark.parametrize('period', [0.0005, 0.005, 0.01])
def test_the_command_is_time_optimal_and_leaves_nothing(graph, period):
    planner = Resting(graph, **{'sampling.period': period})
    verdict = planner.send()
    assert verdict['state'] == 'ACCEPTED', verdict['message']
    duration = float(verdict['duration'])
    assert BANG_BANG < duration < 1.02 * BANG_BANG
    assert 0.995 * BANG_BANG < float(verdict['duration_bound']) < BANG_BANG * (1.0 + 1e-6)
    times, efforts = planner.command()
    assert np.diff(times).max() <= period + 1e-9
    assert np.abs(efforts).max() <= 0.015
    motion = rollout(ARM, EffortProfile(start=0.0, times=times, efforts=efforts), times[-1] + 0.3)
    left = envelope(ARM, motion.positions[-1, 1], motion.velocities[-1, 1])
    assert left < 1e-5
    assert abs(motion.positions[-1, 0] - pi) < 1e-4


def test_insensitive_motions_take_longer_and_leave_less(graph):
    planner = Resting(graph)
    plain = planner.send(duration=1.1)
    graph.set_parameters('flat_planner', **{'peak.insensitive': True})
    robust = planner.send(duration=1.1)
    worst = [float(verdict['predicted_residual_worst']) for verdict in (plain, robust)]
    assert worst[1] < 0.5 * worst[0]
    assert float(planner.send()['duration']) < 1.03 * 1.022530


def test_other_strategies_are_told_what_time_it_would_save(graph):
    planner = Resting(graph, strategy='polynomial')
    verdict = planner.send()
    assert 'strategy min_peak_effort takes 0.84' in verdict['advice']
    assert float(verdict['duration']) > 1.1 * 0.845
    assert 'duration_bound' not in verdict
    assert 'min_peak_effort' not in planner.send(duration=2.0).get('advice', '')


def test_takes_over_and_stops_in_motion(graph):
    planner = Resting(graph, execute=True, **{'replan.lookahead': 1.0})
    verdict = planner.send(duration=4.0)
    assert verdict['level'] == DiagnosticStatus.OK
    verdict = planner.send(angle=1.0)
    assert verdict['strategy'] == 'min_peak_effort', verdict['message']
    assert verdict['level'] == DiagnosticStatus.OK
    assert float(verdict['peak_effort.joint1']) <= 0.015 * (1.0 + 1e-6)
    assert graph.call(Trigger, '/flat_planner/stop').success


def test_a_residual_is_kept_on_any_arm_and_costs_time(graph):
    planner = Resting(graph, **{'peak.max_residual': 0.02})
    verdict = planner.send()
    assert verdict['level'] == DiagnosticStatus.OK, verdict['message']
    assert float(verdict['predicted_residual_worst']) <= 0.02
    assert BANG_BANG * 1.2 < float(verdict['duration']) < BANG_BANG * 1.26
    assert float(verdict['duration_bound']) > 0.97 * float(verdict['duration'])
    refused = planner.send(duration=0.2)
    assert refused['state'] == 'REJECTED'


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [
        ({'flat_model': 'approximate'}, 'flat_model: exact'),
        ({'peak.intervals': 10}, 'must be in [16, 256]'),
        ({'model.damping': 2.0e-3}, 'oscillates'),
    ],
)
def test_settings_that_make_no_sense_are_refused(graph, changes, reason):
    Resting(graph)
    (result,) = graph.set_parameters('flat_planner', **changes)
    assert not result.successful
    assert reason in result.reason
