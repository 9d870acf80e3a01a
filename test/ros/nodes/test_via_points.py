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

"""Via points through the nodes: plan and plant pass them, and nothing is left swinging."""

from flat_planner_ros.ros.wire import stamps
import numpy as np
import pytest
from ros.rig import goal, stamp, Suite, values
from trajectory_msgs.msg import JointTrajectory

TIMES = (0.4, 1.0, 1.6, 2.2)
"""Of three via points and the end, all on the grid of the command [s]."""

ANGLES = (1.0, 0.2, 1.5, 2.0)
"""Of the last link there [rad]."""


def through(times):
    """Return a goal with all points at some times [s]."""
    message = goal(ANGLES[0])
    message.points = [goal(a, t).points[0] for a, t in zip(ANGLES, times, strict=True)]
    return message


def last_link(plan: JointTrajectory) -> tuple[np.ndarray, np.ndarray]:
    """Return the times of a plan [s] and the angle of the last link, the sum of all joints'."""
    times = [stamps.seconds(point.time_from_start) for point in plan.points]
    return np.array(times), np.array([sum(point.positions) for point in plan.points])


@pytest.mark.parametrize('strategy', ['polynomial', 'min_control_effort'])
def test_a_goal_with_three_via_points(graph, strategy):
    suite = Suite(graph, planner={'strategy': strategy})
    verdict = suite.ask(through(TIMES))
    assert verdict['state'] == 'ACCEPTED'
    assert float(verdict['duration']) == TIMES[-1]
    graph.expect(lambda: suite.plans, 'the plan')
    times, angle = last_link(suite.plans[0])
    for time, expected in zip(TIMES, ANGLES, strict=True):
        index = int(np.argmin(np.abs(times - time)))
        assert times[index] == pytest.approx(time, abs=1e-9)
        assert angle[index] == pytest.approx(expected, abs=1e-9)
    # All that a joint_trajectory_controller asks of a command holds with via points, too.
    assert np.ptp(np.diff(times)) < 2e-9
    start = float(verdict['start_time'])
    graph.expect(lambda: suite.reports, 'a report')
    report = values(suite.reports[0])
    assert float(report['amplitude']) < 1e-5
    # Linear effort every 5 ms: it costs more of the place than of the rest.
    assert float(report['final_error.joint1']) == pytest.approx(0.0, abs=1e-4)
    measured = np.array([(stamp(s) - start, sum(s.position)) for s in suite.states])
    # A busy machine loses some states; those that come are as planned.
    planned = np.interp(measured[:, 0], times, angle)
    np.testing.assert_allclose(measured[:, 1], planned, rtol=0.0, atol=1e-3)


def test_via_points_without_times(graph):
    suite = Suite(graph, planner={'duration.default': 2.2, 'strategy': 'min_control_effort'})
    verdict = suite.ask(through([0.0] * len(TIMES)))
    assert verdict['state'] == 'ACCEPTED'
    prescribed_cost = float(verdict['cost'])
    graph.expect(lambda: suite.plans, 'the plan')
    times, angle = last_link(suite.plans[0])
    assert times[-1] == pytest.approx(2.2)
    # There and back: the angle turns near the first two points and passes all of them.
    for expected in ANGLES[:-1]:
        assert angle.min() <= expected <= angle.max()
    assert angle.max() > ANGLES[0]
    graph.expect(lambda: suite.reports, 'a report')
    assert float(values(suite.reports[0])['amplitude']) < 1e-5
    assert prescribed_cost > 0.0


def test_velocities_at_via_points_are_refused(graph):
    suite = Suite(graph)
    message = goal(1.0)
    message.points[0].velocities = [0.5]
    message.points += goal(2.0, 2.0).points
    verdict = suite.ask(message)
    assert verdict['error_name'] == 'INVALID_GOAL'
    assert verdict['joint'] == 'joint1'
    assert 'via points' in suite.status[0].status[0].message
