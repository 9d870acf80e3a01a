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

"""A swinging arm through the nodes: a goal catches it, and so does ~/settle."""

from core.conftest import ARM, envelope
from ros.rig import stamp, Suite
from std_srvs.srv import Trigger

SWING = 0.3
"""Amplitude when a goal comes [rad]."""

LET_GO = 0.44
"""Angle of the passive joint at the start [rad]."""

ONE_SWING = 0.8
"""Time of more than one period, in which the planner sees what is left [s]."""

SLOWLY = {'speed': 0.5, 'window': 1.0}


class Swinging(Suite):
    """The three nodes, and an arm that has swung for one and a half periods."""

    def __init__(self, graph, planner=None, spring=1.0):
        """Let it go; stiffness and damping are other than believed by a factor."""
        quick = {'replan.lookahead': 0.2, **(planner or {})}
        noisy = {'initial_position': [0.0, LET_GO], 'noise.position_std': 1e-4}
        noisy |= {'mismatch.stiffness_scale': spring, 'mismatch.damping_scale': spring}
        self.true = ARM.scaled(stiffness=spring, damping=spring)
        super().__init__(graph, quick, noisy, **SLOWLY)
        self.wait_until(2.0)
        assert self.amplitude > SWING

    @property
    def amplitude(self):
        """Return what the passive joint swings by now, from the true velocity [rad]."""
        state = self.states[-1]
        return envelope(self.true, state.position[1], state.velocity[1])


def test_a_goal_catches_a_swinging_arm(graph):
    arm = Swinging(graph)
    verdict = arm.send(1.0, 0.7)
    assert verdict['state'] == 'ACCEPTED', verdict
    assert float(verdict['swing']) > 0.9 * SWING
    arm.wait_until(float(verdict['start_time']) + 0.7 + 0.02)
    assert arm.amplitude < 0.01 * SWING
    assert abs(arm.states[-1].position[0] - 1.0) < 0.01


def test_two_calls_settle_an_arm_that_is_softer_than_believed(graph):
    arm = Swinging(graph, spring=0.9)
    before = arm.amplitude
    for calls, share in ((1, 0.15), (2, 0.03)):
        response = graph.call(Trigger, '/flat_planner/settle')
        assert response.success, response.message
        graph.expect(lambda count=calls: len(arm.verdicts('STOPPED')) == count, 'the end')
        arm.wait_until(stamp(arm.states[-1]) + ONE_SWING)
        assert arm.amplitude < share * before


def test_settle_ends_a_swing_and_then_has_nothing_to_do(graph):
    arm = Swinging(graph)
    response = graph.call(Trigger, '/flat_planner/settle')
    assert response.success, response.message
    graph.expect(lambda: arm.verdicts('STOPPED'), 'the end')
    assert arm.amplitude < 0.01 * SWING
    assert graph.call(Trigger, '/flat_planner/settle').message.startswith('nothing to settle')


def test_a_swing_is_refused_where_that_is_wanted(graph):
    arm = Swinging(graph, {'start.moving': 'refuse'})
    assert arm.send(1.0)['error_name'] in ('NOT_AT_REST', 'START_STATE_MISMATCH')
