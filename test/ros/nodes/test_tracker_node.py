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

"""Planner, tracker and plant: a wrong model ends at rest at its goal, and nothing moves untold."""

from math import pi

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
from ros.rig import stamp
from ros.tracked_arm import EFFORTS, ELDER, Tracked
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger


def _let_another_node_send_efforts(graph):
    """Whoever it is has the arm."""
    other = graph.probe.create_publisher(Float64MultiArray, EFFORTS, 10)
    graph.probe.create_timer(0.05, lambda: other.publish(Float64MultiArray(data=[1e-5])))
    graph.expect(lambda: graph.logged('another node sends efforts'), 'an error')


def test_nothing_is_sent_before_a_command_and_wrong_inertias_end_at_the_goal(graph):
    """Without feedback this arm stops 0.29 rad beside its goal, and swings."""
    arm = Tracked(graph, **{'mismatch.inertia_scale': 1.1})
    arm.pass_time(0.3)
    assert not arm.sent
    arm.move(pi)
    arm.wait_until(arm.end + 1.2)
    assert arm.sent
    assert (arm.errors(arm.end + 0.9, pi) < 5e-3).all()
    assert not graph.logged('given up')


def test_after_a_restart_nothing_is_sent_and_nothing_moves(graph):
    """Friction keeps the arm from drifting on with what the last effort gave it."""
    arm = Tracked(graph, **{'friction.coulomb': '[0.0005]'})
    arm.move(1.0)
    arm.wait_until(arm.end + 0.2)
    arm.tracker.kill()
    arm.pass_time(0.3)  # the plant has let go of the last effort
    arm.await_silence()
    arm.start_tracker()
    count, since = len(arm.sent), stamp(arm.states[-1])
    arm.pass_time(0.5)
    assert len(arm.sent) == count
    stands = [state.position[0] for state in arm.states if stamp(state) > since]
    assert np.ptp(stands) < 1e-3
    assert not any(state.effort[0] for state in arm.states if stamp(state) > since)


def test_released_the_arm_is_let_go_until_the_next_command_as_it_is_for_another_sender(graph):
    arm = Tracked(graph)
    arm.move(0.5)
    arm.wait_until(arm.end + 0.1)
    answer = graph.call(Trigger, '/flat_tracker/release')
    assert answer.success
    arm.await_silence()
    count = len(arm.sent)
    arm.pass_time(0.2)
    assert len(arm.sent) == count
    assert arm.sent[-1].data[0] == 0.0
    arm.move(0.0)
    arm.wait_until(arm.end + 0.3)
    assert len(arm.sent) > count
    assert (arm.errors(arm.end + 0.2, 0.0) < 5e-3).all()
    _let_another_node_send_efforts(graph)


def test_a_second_tracker_lets_go_of_an_arm_that_another_one_holds(graph):
    arm = Tracked(graph)
    arm.move(0.5)
    arm.wait_until(arm.end + 0.1)
    arm.start_tracker()
    count = len(arm.sent)
    arm.pass_time(0.3)
    assert len(arm.sent) > count, 'the idle one disturbs nobody'
    position = arm.move_until_rivals_meet(0.0, 0.5, 0.0, 0.5)
    arm.wait_until(arm.end + 0.3)
    assert (arm.errors(arm.end + 0.2, position) < 5e-3).all()
    assert not graph.logged('given up')


def test_of_two_idle_trackers_the_one_that_was_started_first_moves_the_arm(graph):
    """Exactly one: if both let go, an arm in motion would be left to itself."""
    arm = Tracked(graph)
    arm.start_tracker()
    position = arm.move_until_rivals_meet(0.5, 0.0, 0.5, 0.0)
    arm.wait_until(arm.end + 0.3)
    assert (arm.errors(arm.end + 0.2, position) < 5e-3).all()
    assert len(graph.logged(ELDER)) == 1
    assert not graph.logged('another node sends efforts')


def test_the_health_of_a_tracker_is_published(graph):
    arm = Tracked(graph)
    health = arm.hear(DiagnosticArray, '/diagnostics')
    arm.move(0.5)

    def phases():
        ours = [m.status[0] for m in health if m.status[0].name == 'flat_tracker: tracking']
        return [{pair.key: pair.value for pair in status.values} for status in ours]

    graph.expect(lambda: any(v['phase'] == 'tracking' for v in phases()), 'a tracking tracker')
    tracking = next(v for v in phases() if v['phase'] == 'tracking')
    assert float(tracking['error']) < 0.05
    assert float(tracking['margin']) > 0.2


def test_a_motor_too_weak_for_the_motion_ends_in_one_error(graph):
    arm = Tracked(graph, **{'torque.saturation': '[0.003]'})
    arm.move(pi)
    graph.expect(lambda: graph.logged('given up'), 'an error')
    (error,) = graph.logged('given up')
    assert 'rad from its plan' in error


def test_a_tracker_that_is_held_up_again_and_again_lets_go_with_one_error(graph):
    """A machine that is busy does no more to it than these signals."""
    arm = Tracked(graph, **{'friction.coulomb': '[0.0005]'})
    arm.tracker.kill()
    arm.start_tracker(max_age=0.0)
    # A machine may be so busy that it lets go before it has moved the arm. And a tracker in the
    # place of one that was killed may not hear the first command.
    arm.move_until(
        lambda: arm.states[-1].position[0] > 0.01 or graph.logged('given up'),
        'a motion',
        *(0.5, 0.5, 0.5),
    )
    for _ in range(50):
        arm.tracker.pause()
        arm.pass_time(0.08)
        arm.tracker.resume()
        arm.pass_time(0.02)
        if graph.logged('given up'):
            break
    graph.expect(lambda: graph.logged('given up'), 'an error')
    arm.await_silence()
    # On a busy machine one hold-up alone may be too long: 'no joint sample for'.
    (error,) = graph.logged('given up')
    assert 'joint sample' in error
    assert max(abs(state.position[1]) for state in arm.states) < 0.3
    # What the tracker has sent may reach a busy plant later than this test.
    graph.expect(lambda: not any(state.effort[0] for state in arm.states[-10:]), 'no effort')
