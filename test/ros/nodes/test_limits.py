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

"""Limits through the planner node: refusals with numbers, stretching, automatic duration."""

from math import inf, pi

from diagnostic_msgs.msg import DiagnosticStatus
from flat_planner_ros.ros.wire import stamps
import numpy as np
import pytest
from ros.rig import Planner, table
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

EFFORT, VELOCITY = 0.015, 7.0
"""Limits of joint 1 [N m, rad/s]."""

LIMITED = {
    'strategy': 'polynomial',
    'execute': False,
    'start.joint_state_timeout': 60.0,
    'limits.effort': [EFFORT, inf],
    'limits.velocity': [VELOCITY, inf],
}

DURATION_MIN = 1.0041
"""Shortest half turn of the polynomial law within both limits, to 0.1 % [s]."""


class Limited(Planner):
    """A planner with limits, whose arm rests at 0."""

    def __init__(self, graph, **parameters):
        """Start it and let it see the arm."""
        super().__init__(graph, {**LIMITED, **parameters})
        self.measure()

    def send(self, angle=pi, duration=0.0):
        """Send a goal; return its verdict."""
        return super().send(angle, duration)

    def exact_plan(self):
        """Return the continuous plan that was accepted last, sampled 100 001 times."""
        planned = self.node._session.motion.plan
        return planned.at(np.linspace(0.0, planned.duration, 100_001))


def assert_obeys(planner):
    """Check the continuous plan and what was published."""
    samples = planner.exact_plan()
    assert np.abs(samples.efforts[:, 0]).max() <= EFFORT * (1.0 + 1e-9)
    assert np.abs(samples.velocities[:, 0]).max() <= VELOCITY * (1.0 + 1e-9)
    published = planner.plans[-1]
    assert np.abs(table(published, 'effort')[:, 0]).max() <= EFFORT * (1.0 + 1e-9)
    assert np.abs(table(published, 'velocities')[:, 0]).max() <= VELOCITY * (1.0 + 1e-9)


def test_a_motion_too_fast_is_refused_with_numbers_that_can_be_used(graph):
    planner = Limited(graph)
    verdict = planner.send(duration=0.8)
    assert verdict['level'] == DiagnosticStatus.ERROR
    assert (verdict['state'], verdict['error_name']) == ('REJECTED', 'EFFORT_LIMIT')
    assert verdict['error_code'] == '-112'
    assert verdict['joint'] == 'joint1'
    assert abs(float(verdict['value'])) > EFFORT
    assert abs(float(verdict['limit'])) == EFFORT
    assert 0.0 < float(verdict['time']) < 0.8
    assert float(verdict['duration_min']) == pytest.approx(DURATION_MIN, rel=1e-3)
    assert f'shortest feasible duration is {verdict["duration_min"]} s' in verdict['message']
    assert not planner.plans
    verdict = planner.send(duration=float(verdict['duration_min']))
    assert (verdict['state'], verdict['level']) == ('ACCEPTED', DiagnosticStatus.OK)
    assert 'duration_min' not in verdict
    graph.expect(lambda: planner.plans, 'the plan')
    assert_obeys(planner)


def test_a_velocity_limit_has_its_own_code(graph):
    planner = Limited(graph, **{'limits.velocity': [4.5, inf]})
    verdict = planner.send(duration=1.1)
    assert (verdict['error_name'], verdict['error_code']) == ('VELOCITY_LIMIT', '-111')
    assert 'rad/s' in verdict['message']


def test_a_final_pose_out_of_range_is_refused_at_once(graph):
    planner = Limited(graph, **{'limits.position_max': [3.0, 1.0]})
    for duration in (0.0, 2.0):
        verdict = planner.send(duration=duration)
        assert (verdict['error_name'], verdict['error_code']) == ('POSITION_LIMIT', '-110')
        assert 'the final position 3.14159 rad of joint1' in verdict['message']
        assert 'duration_min' not in verdict


def test_a_motion_too_fast_is_stretched_with_a_warning(graph):
    planner = Limited(graph, **{'limits.on_violation': 'scale'})
    verdict = planner.send(duration=0.8)
    assert verdict['level'] == DiagnosticStatus.WARN
    assert verdict['state'] == 'ACCEPTED'
    assert verdict['duration'] == verdict['duration_min']
    assert float(verdict['duration']) == pytest.approx(DURATION_MIN, rel=1e-3)
    assert verdict['joint'] == 'joint1'
    assert abs(float(verdict['value'])) > abs(float(verdict['limit'])) == EFFORT
    assert 'stretched' in verdict['message']
    graph.expect(lambda: planner.plans, 'the plan')
    assert_obeys(planner)
    verdict = planner.send(duration=2.0)
    assert (verdict['level'], verdict['duration']) == (DiagnosticStatus.OK, '2')


def test_a_goal_without_times_takes_the_shortest_duration(graph):
    planner = Limited(graph)
    verdict = planner.send()
    assert (verdict['state'], verdict['level']) == ('ACCEPTED', DiagnosticStatus.OK)
    assert verdict['duration'] == verdict['duration_min']
    duration = float(verdict['duration'])
    assert duration == pytest.approx(DURATION_MIN, rel=1e-3)
    graph.expect(lambda: planner.plans, 'the plan')
    assert_obeys(planner)
    last = planner.plans[-1].points[-1].time_from_start
    assert stamps.seconds(last) == pytest.approx(duration, abs=1e-9)
    verdict = planner.send(duration=duration * (1.0 - 1e-3))
    assert verdict['error_name'] in ('EFFORT_LIMIT', 'VELOCITY_LIMIT')
    pose = JointState(name=['joint1'], position=[1.0])
    verdict = planner.ask(pose, '/flat_planner/goal_state')
    assert verdict['state'] == 'ACCEPTED'
    assert float(verdict['duration']) < duration
    graph.expect(lambda: len(planner.plans) == 2, 'the second plan')
    assert_obeys(planner)


def test_without_limits_a_goal_without_times_is_told_what_to_set(graph):
    planner = Limited(graph, **{'limits.effort': [inf, inf], 'limits.velocity': [inf, inf]})
    verdict = planner.send()
    assert verdict['error_name'] == 'DURATION_OUT_OF_RANGE'
    for name in ('time_from_start', 'duration.default', 'limits.velocity', 'limits.effort'):
        assert name in verdict['message']


def test_limits_changed_at_run_time_hold_for_the_next_goal(graph):
    planner = Limited(graph)
    verdict = planner.send(duration=1.1)
    assert verdict['state'] == 'ACCEPTED'
    changes = {'limits.effort': [0.5 * EFFORT, inf], 'limits.on_violation': 'scale'}
    for result in graph.set_parameters('flat_planner', **changes):
        assert result.successful, result.reason
    response = graph.call(Trigger, '/flat_planner/replan')
    assert response.success  # accepted, though with a warning
    assert 'stretched' in response.message
