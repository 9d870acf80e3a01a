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

"""What was not carried out is not said to be: ends and deviations, by what is measured."""

from dataclasses import replace
from math import nan, pi

from core.session.test_session import BACK, GOAL, NOW, reason_of, sample, session, SETTINGS
from flat_planner_ros.core.planning import Reason
from flat_planner_ros.core.session import Outcome
import numpy as np
import pytest

PATIENCE, TOLERANCE = SETTINGS.finish_patience, SETTINGS.finish_tolerance


def followed(planner, motion, until, *, off=0.0, period=0.01):
    """Measure what is planned for joint 1, `off` by an angle [rad], from its start on."""
    for time in np.arange(motion.start, until, period).tolist():
        wanted = planner.reference(time)
        position = wanted.positions[0] + [off, 0.0]
        planner.measure(sample(position, wanted.velocities[0], time))


def at_the_end(planner, motion, position=(pi, 0.0), velocity=(0.0, 0.0), *, after=0.01):
    """Measure a state shortly after the end; return what is said of it then, if anything."""
    planner.measure(sample(position, velocity, motion.end + after))
    return planner.take_ended(motion.end + after)


@pytest.fixture
def under_way():
    """Return a session whose arm follows a motion until shortly before its end, and the motion."""
    planner = session()
    motion = planner.submit(GOAL, NOW)
    followed(planner, motion, motion.end - 0.005)
    return planner, motion


def test_a_motion_is_finished_when_the_arm_is_seen_there(under_way):
    planner, motion = under_way
    assert planner.take_ended(motion.end) == []
    (end,) = at_the_end(planner, motion)
    assert (end.outcome, end.shortfall, end.remark) == (Outcome.FINISHED, None, '')
    assert planner.take_ended(motion.end + 9.0) == []


@pytest.mark.parametrize(
    ('position', 'velocity'),
    [((pi - 0.05, 0.0), (0.05, 0.0)), ((pi + 0.09, 0.3), (0.0, 5.0)), ((pi, nan), (0.0, nan))],
)
def test_actuated_joints_within_the_tolerances_are_there(under_way, position, velocity):
    planner, motion = under_way
    assert at_the_end(planner, motion, position, velocity)[0].outcome is Outcome.FINISHED


def test_an_arm_that_takes_its_time_is_waited_for(under_way):
    planner, motion = under_way
    assert not at_the_end(planner, motion, (pi - 0.3, 0.0), (1.0, 0.0))
    assert not at_the_end(planner, motion, (pi, 0.0), (0.2, 0.0), after=0.4)
    assert at_the_end(planner, motion, after=0.5)[0].outcome is Outcome.FINISHED


def test_an_arm_that_stops_short_has_failed(under_way):
    planner, motion = under_way
    assert not at_the_end(planner, motion, (pi - 0.285, 0.0), after=PATIENCE - 0.01)
    (end,) = at_the_end(planner, motion, (pi - 0.285, 0.0), after=PATIENCE)
    assert end.outcome is Outcome.FAILED
    assert end.shortfall.message == (
        'joint1 is at 2.857 rad, not at 3.142 rad (finish.position_tolerance 0.1 rad)'
    )
    assert end.shortfall.reason is Reason.GOAL_TOLERANCE_VIOLATED
    assert (end.shortfall.joint, end.shortfall.limit) == ('joint1', TOLERANCE)
    assert end.shortfall.value == pytest.approx(pi - 0.285)


def test_an_arm_that_never_moved_has_failed():
    planner = session(replan_tolerance=0.0)
    motion = planner.submit(GOAL, NOW)
    (end,) = at_the_end(planner, motion, (0.5, 0.0), after=PATIENCE)
    assert end.outcome is Outcome.FAILED
    assert end.shortfall.message.endswith(
        '(finish.position_tolerance 0.1 rad): the arm has not moved'
    )


@pytest.mark.parametrize('is_stop', [True, False])
def test_a_joint_that_coasts_is_not_at_rest(is_stop):
    planner = session()
    motion = planner.submit(GOAL, NOW)
    if is_stop:
        motion = planner.stop(motion.start + 0.3)
    final = motion.samples.positions[-1]
    for after in (0.0, 0.5):
        assert not at_the_end(planner, motion, final, (3.0, 0.0), after=after)
    (end,) = at_the_end(planner, motion, final, (3.0, 0.0), after=PATIENCE)
    assert end.outcome is Outcome.FAILED
    assert 'joint1 does not come to rest: it moves at 3 rad/s' in end.shortfall.message


@pytest.mark.parametrize(('rate', 'outcome'), [(0.05, Outcome.FINISHED), (0.15, Outcome.FAILED)])
def test_without_velocities_rest_is_seen_over_a_while(rate, outcome):
    planner = session(finish_patience=0.5)
    motion = planner.submit(GOAL, NOW)
    ends = []
    for after in np.arange(0.0, 0.52, 0.01).tolist():
        state = sample((pi + rate * (after - 0.25), 0.0), time=motion.end + after)
        planner.measure(replace(state, velocities=None))
        assert not (ends and outcome is Outcome.FINISHED and after < 0.09)
        ends += planner.take_ended(motion.end + after)
    assert [end.outcome for end in ends] == [outcome]


def test_an_end_that_nobody_sees_is_said_by_the_plan_and_that_it_is():
    planner = session()
    motion = planner.submit(GOAL, NOW)
    (end,) = planner.take_ended(motion.end)
    assert end.outcome is Outcome.FINISHED
    assert end.remark == 'no joint state tells whether the arm is there'


def test_an_arm_that_falls_silent_at_the_end_is_waited_for_and_then_unseen(under_way):
    planner, motion = under_way
    assert planner.take_ended(motion.end + PATIENCE - 0.01) == []
    (end,) = planner.take_ended(motion.end + PATIENCE)
    assert end.outcome is Outcome.FINISHED
    assert end.remark


def test_the_plan_alone_tells_if_that_is_asked_for():
    planner = session(finish_tolerance=0.0)
    motion = planner.submit(GOAL, NOW)
    (end,) = at_the_end(planner, motion, (0.5, 0.0), after=0.0)
    assert (end.outcome, end.remark) == (Outcome.FINISHED, '')


def test_the_next_goal_from_rest_tells_how_the_last_one_ended():
    planner = session(replan_tolerance=0.0)
    first = planner.submit(GOAL, NOW)
    now = first.end + 0.1
    planner.measure(sample(time=now))
    second = planner.submit(BACK, now)
    (end,) = planner.take_ended(now)
    assert (end.motion, end.outcome) == (first, Outcome.FAILED)
    assert 'not at 3.142 rad' in end.shortfall.message
    (end,) = at_the_end(planner, second, (0.0, 0.0))
    assert (end.motion, end.outcome) == (second, Outcome.FINISHED)


def test_an_arm_that_goes_on_with_the_next_motion_has_finished_the_first():
    planner = session()
    first = planner.submit(GOAL, NOW)
    second = planner.submit(replace(BACK, stamp=first.end), NOW)
    followed(planner, first, first.end + 0.4)
    (end,) = planner.take_ended(first.end + 0.4)
    assert (end.motion, end.outcome) == (first, Outcome.FINISHED)
    followed(planner, second, second.end + 0.05)
    (end,) = planner.take_ended(second.end + 0.05)
    assert (end.motion, end.outcome) == (second, Outcome.FINISHED)


def test_an_arm_that_leaves_the_plan_is_told_once_and_soon():
    planner = session()
    motion = planner.submit(GOAL, NOW)
    followed(planner, motion, motion.start + 0.3)
    assert planner.take_astray() == []
    followed(planner, motion, motion.start + 0.5, off=-0.51)
    (astray,) = planner.take_astray()
    assert astray.motion is motion
    assert astray.shortfall.reason is Reason.PATH_TOLERANCE_VIOLATED
    assert 'rad (replan.tolerance 0.5 rad)' in astray.shortfall.message
    refusal = reason_of(planner.submit, BACK, motion.start + 0.5)
    assert refusal.reason is Reason.START_STATE_MISMATCH
    followed(planner, motion, motion.end, off=-0.6)
    assert planner.take_astray() == []
    again = session(replan_tolerance=0.0)
    followed(again, again.submit(GOAL, NOW), motion.end, off=-0.6)
    assert again.take_astray() == []
