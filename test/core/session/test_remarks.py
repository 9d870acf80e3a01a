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

"""What looks like a mistake about a goal is said, and only that."""

from dataclasses import replace
from math import inf, pi

from core.session.test_session import GOAL, NOW, reason_of, session, SETTINGS
from flat_planner_ros.core.motion_law.cost import Strategy
from flat_planner_ros.core.planning.limits import JointLimits
from flat_planner_ros.core.planning.request import Reason
from flat_planner_ros.core.session.goal import GoalPoint
from flat_planner_ros.core.session.session import PlannerSession
import numpy as np
import pytest

HALF_TURN = GOAL.points[0]


def final(angle, time=1.0):
    """Return a goal with one point."""
    return replace(GOAL, points=(GoalPoint(time=time, positions=(angle,)),))


@pytest.mark.parametrize('ahead', [0.0, 59.0])
def test_a_stamp_soon_is_not_remarked(ahead):
    assert not session().submit(replace(GOAL, stamp=NOW + ahead), NOW).remarks


def test_a_stamp_far_ahead_is_remarked_and_one_of_another_clock_refused():
    (remark,) = session().submit(replace(GOAL, stamp=NOW + 61.0), NOW).remarks
    assert '61 s' in remark
    assert not session(far_ahead=100.0).submit(replace(GOAL, stamp=NOW + 61.0), NOW).remarks
    error = reason_of(session().submit, replace(GOAL, stamp=NOW + 3601.0), NOW)
    assert error.reason is Reason.INVALID_GOAL
    assert 'use_sim_time' in str(error)


def test_a_start_as_measured_is_left_out_in_silence():
    present = GoalPoint(time=0.0, positions=(0.505,))
    motion = session().submit(replace(GOAL, points=(present, HALF_TURN)), NOW)
    plain = session().submit(GOAL, NOW)
    assert not motion.remarks
    assert np.array_equal(motion.samples.positions, plain.samples.positions)


def test_another_start_is_remarked_and_does_not_count():
    present = GoalPoint(time=0.0, positions=(0.7,))
    asked = session()
    (remark,) = asked.submit(replace(GOAL, points=(present, HALF_TURN)), NOW).remarks
    assert '0.7 rad' in remark
    assert '0.5 rad' in remark
    assert asked.last_goal.points == (HALF_TURN,)


def test_degrees_for_radians_are_remarked():
    assert not session().submit(final(0.5 + 2.0 * pi), NOW).remarks
    (remark,) = session().submit(final(0.5 + 90.0), NOW).remarks
    assert '14.3 turns' in remark
    assert 'radians' in remark


def test_degrees_beyond_a_limit_are_remarked_in_the_refusal():
    limits = JointLimits.of(2, effort=np.array([0.05, inf]))
    error = reason_of(session(limits=limits).submit, final(90.5), NOW)
    assert error.reason is Reason.EFFORT_LIMIT
    assert error.duration_min > 1.0
    assert '14.3 turns' in str(error)


def test_many_turns_within_position_limits_are_meant():
    limits = JointLimits.of(
        2, position_min=np.array([-100.0, -inf]), position_max=np.array([100.0, inf])
    )
    assert not session(limits=limits).submit(final(0.5 + 30.0, 5.0), NOW).remarks


def test_the_topic_without_joint_states_is_named():
    unmeasured = PlannerSession(session().settings)
    unmeasured.source = '/left/joint_states'
    assert '/left/joint_states' in str(reason_of(unmeasured.submit, GOAL, NOW))
    assert 'joint_states' in str(reason_of(session().submit, GOAL, NOW + 10.0))


def test_a_duration_out_of_range_names_its_parameter():
    assert 'above duration.max = 600 s' in str(reason_of(session().submit, final(1.0, 1e3), NOW))
    assert 'below duration.min = 0.05 s' in str(reason_of(session().submit, final(1.0, 0.01), NOW))


def test_gentle_motions_take_a_multiple_of_the_shortest():
    limits = JointLimits.of(2, effort=np.array([0.05, inf]))
    shortest = session(limits=limits).submit(final(pi, 0.0), NOW)
    gentle = session(limits=limits, duration_factor=2.0).submit(final(pi, 0.0), NOW)
    assert shortest.is_shortest
    assert not gentle.is_shortest
    assert gentle.plan.duration == pytest.approx(2.0 * shortest.plan.duration)
    assert gentle.plan.peak_effort[0] < 0.5 * shortest.plan.peak_effort[0]
    prescribed = session(limits=limits, duration_factor=2.0).submit(GOAL, NOW)
    assert prescribed.plan.duration == 1.0


def test_a_weight_that_the_command_cannot_play_is_remarked():
    options = SETTINGS.options
    assert not session().submit(GOAL, NOW).remarks
    (remark,) = session(options=replace(options, r=1000.0)).submit(GOAL, NOW).remarks
    assert '100 % of its peak within one sample of 0.005 s' in remark
    # Steep by purpose, and said elsewhere.
    steep = replace(options, strategy=Strategy.INSENSITIVE)
    assert not session(options=steep).submit(final(1.0, 0.5), NOW).remarks
