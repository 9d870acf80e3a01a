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

"""New goals, stops and streams while the arm moves, through the three nodes."""

from math import pi

from flat_planner_ros.ros.wire import stamps
import numpy as np
import pytest
from ros.rig import Late, on_time, stamp, Suite, values
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

SPEED = 0.5
"""
Simulated seconds per second.

What is handed over in motion must arrive within the lookahead, however busy the machine is.
"""

LOOKAHEAD = 0.25
"""Time between a goal in motion and its start [s], half a second of real time."""


class Arm(Suite):
    """The three nodes, the planner quick to re-plan."""

    def __init__(self, graph, planner=None, plant=None):
        """Start them."""
        quick = {'reference_rate': 20.0, 'start_delay': 0.2, 'replan.lookahead': LOOKAHEAD}
        super().__init__(graph, {**quick, **(planner or {})}, plant, speed=SPEED, window=1.0)

    def residual(self):
        """Return the amplitude that the last motion has left, from the monitor [rad]."""
        self.graph.expect(lambda: self.reports, 'a report')
        return float(values(self.reports[-1])['amplitude'])


@pytest.mark.timeout(240)
def test_ten_goals_at_random_moments_of_motion_leave_no_more_than_one(graph):
    random = np.random.default_rng(7)
    arm = Arm(graph)
    verdict = arm.send(pi)
    for _ in range(10):
        arm.wait_until(float(verdict['start_time']) + random.uniform(0.05, 0.6))
        verdict = arm.send(random.uniform(-pi, pi), random.uniform(0.8, 1.2))
        assert verdict['state'] == 'ACCEPTED'
    arm.wait_until(float(verdict['start_time']) + float(verdict['duration']) + 0.1)
    graph.expect(lambda: arm.verdicts('FINISHED'), 'the end')
    assert len(arm.verdicts('PREEMPTED')) == 10
    ids = [verdict['plan_id'] for verdict in arm.verdicts('PREEMPTED')]
    assert ids == [str(number) for number in range(1, 11)]
    assert arm.verdicts('FINISHED')[0]['plan_id'] == '11'
    assert arm.residual() < 1e-5
    last = arm.states[-1]
    assert last.position[0] == pytest.approx(arm.commands[-1].points[-1].positions[0], abs=1e-3)


def test_the_command_goes_on_as_it_was_until_the_new_motion_takes_over(graph):
    arm = Arm(graph)
    first = arm.send(pi)
    arm.wait_until(float(first['start_time']) + 0.3)
    second = arm.send(0.0)
    graph.expect(lambda: len(arm.commands) == 2, 'both commands')
    old, new = arm.commands
    splice = float(second['start_time'])
    played = {time: point.effort[0] for time, point in points(old)}
    kept = [(time, point.effort[0]) for time, point in points(new) if time < splice - 1e-6]
    assert len(kept) >= int(LOOKAHEAD / 0.005)
    for time, effort in kept:
        nearest = min(played, key=lambda other, time=time: abs(other - time))
        assert abs(nearest - time) < 1e-6
        assert played[nearest] == effort
    after = next(point.effort[0] for time, point in points(new) if time >= splice - 1e-6)
    nearest = min(played, key=lambda other: abs(other - splice))
    assert after == pytest.approx(played[nearest], abs=1e-7)


def test_a_stop_brings_the_arm_to_rest_without_oscillation(graph):
    arm = Arm(graph)
    first = arm.send(2.0 * pi, 2.0)
    arm.wait_until(float(first['start_time']) + 0.5)
    response = graph.call(Trigger, '/flat_planner/stop')
    assert response.success
    assert 'comes to rest' in response.message
    graph.expect(lambda: arm.verdicts('STOPPED'), 'the stop')
    assert arm.verdicts('STOPPED')[0]['plan_id'] == first['plan_id']
    assert arm.residual() < 1e-5
    stop = arm.verdicts('STOPPED')[0]
    assert float(stop['start_time']) + float(stop['duration']) < float(first['start_time']) + 2.0
    assert 0.3 < arm.states[-1].position[0] < 2.0 * pi - 0.3
    assert graph.call(Trigger, '/flat_planner/stop').message.startswith('nothing to stop')


def test_efforts_are_streamed_while_the_arm_moves_and_end_with_zeros(graph):
    arm = Arm(graph, planner={'stream_effort': True})
    stream = graph.collect(Float64MultiArray, '/flat_planner/effort_commands')

    def streamed():
        """Return the verdict of a motion to the other side, and its efforts."""
        stream.clear()
        here = arm.states[-1].position[0]
        first = arm.send(pi if here < 1.0 else 0.0)
        arm.wait_until(float(first['start_time']) + 1.2)
        efforts = np.array([list(message.data) for message in stream])
        if np.count_nonzero(efforts) < 190:  # periods may be merged on a busy machine
            raise Late(f'{np.count_nonzero(efforts)} efforts of 200')
        return first, efforts

    first, efforts = on_time(streamed)
    assert efforts.shape[1] == 1
    moving = np.flatnonzero(efforts[:, 0])
    assert 100 < len(moving) <= 202
    assert np.abs(efforts).max() == pytest.approx(float(first['peak_effort.joint1']), rel=0.02)
    # Ten, and one where the last of the motion comes just when it ends.
    assert len(efforts) - 1 - moving[-1] in (10, 11)
    assert not efforts[-1].any()


def test_a_stream_of_efforts_moves_the_arm_as_well_as_its_jitter_allows(graph):
    arm = Arm(
        graph,
        planner={'stream_effort': True},
        plant={'input': 'effort', 'input_timeout': 0.5, 'real_time_factor': 0.2},
    )
    verdict = arm.send(pi)
    arm.wait_until(float(verdict['start_time']) + float(verdict['duration']) + 0.05)
    # Loose, because a busy machine has any jitter; benchmarks/stream.py says what it costs.
    assert arm.states[-1].position[0] == pytest.approx(pi, abs=0.5)
    assert arm.residual() < 0.05
    assert arm.states[-1].effort[0] == 0.0


def points(command: JointTrajectory):
    """Yield absolute times [s] and points."""
    for point in command.points:
        yield stamp(command) + stamps.seconds(point.time_from_start), point
