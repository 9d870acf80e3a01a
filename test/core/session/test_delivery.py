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

"""Starts wait as long as commands are on their way; a clock that jumps ends what was planned."""

from dataclasses import replace

from core.session.test_session import BACK, ended, GOAL, NOW, sample, session
from flat_planner_ros.core.planning.request import Reason
from flat_planner_ros.core.session.delivery import AUTO_MARGIN, AUTO_TRIPS
from flat_planner_ros.core.session.execution import clock_fault, Outcome
import numpy as np
import pytest


def delayed(delay, **changes):
    """Return a session that hears joint states so much after their stamps [s]."""
    planner = session(**changes)
    for time in np.arange(NOW - 1.0, NOW, 0.01).tolist():
        planner.measure(sample(time=time), time + delay)
    return planner


@pytest.mark.parametrize('delay', [0.0, 0.02, 0.1, -0.1])
def test_an_automatic_start_leaves_a_command_its_way(delay):
    planner = delayed(delay, start_delay=0.0)
    wanted = AUTO_MARGIN + AUTO_TRIPS * abs(delay)
    motion = planner.submit(GOAL, NOW)
    assert motion.start == pytest.approx(NOW + wanted, abs=1e-9)
    assert planner.lateness == ''
    middle = motion.start + 0.4
    again = planner.submit(BACK, middle)
    assert again.start >= middle + wanted - 1e-9


def test_an_automatic_start_before_any_joint_state_has_its_margin():
    motion = session(start_delay=0.0).submit(GOAL, NOW)
    assert motion.start == pytest.approx(NOW + AUTO_MARGIN, abs=1e-12)


def test_a_fixed_delay_that_is_too_short_is_said_with_one_that_would_do():
    assert delayed(0.1).lateness.startswith('start_delay 0.05 s is less than the 0.100 s')
    assert '0.35 s would do' in delayed(0.1).lateness
    assert delayed(0.1, start_delay=0.2).lateness == ''
    assert delayed(0.02).lateness == ''
    slow = delayed(0.15, start_delay=0.2)  # the lookahead is 0.1 s
    assert slow.lateness.startswith('replan.lookahead 0.1 s')


def test_a_few_late_joint_states_are_not_the_way_of_commands():
    planner = delayed(0.001, start_delay=0.0)
    for late in (0.3, 0.4, 0.5):
        planner.measure(sample(time=NOW), NOW + late)
    assert planner.submit(GOAL, NOW).start < NOW + AUTO_MARGIN + 0.01


def test_a_clock_that_jumps_fails_what_is_under_way_and_what_waits():
    planner = session()
    first = planner.submit(GOAL, NOW)
    second = planner.submit(replace(BACK, stamp=first.end + 1.0), NOW + 0.2)
    assert planner.drop(clock_fault('the clock was set back by 99.000 s', -99.0)) == 2
    (one, other) = planner.take_ended(1.0)
    assert (one.motion, other.motion) == (first, second)
    assert one.outcome is other.outcome is Outcome.FAILED
    assert one.shortfall.reason is Reason.CLOCK_JUMPED
    assert one.shortfall.value == -99.0
    assert planner.take_ended(1.0) == []
    assert not planner.moves(1.0, 1000.0)
    assert planner.stop(1.0) is None
    assert planner.reference(1.0) is None


def test_the_goal_after_a_jump_begins_from_what_is_measured_then():
    planner = session()
    planner.submit(GOAL, NOW)
    planner.drop(clock_fault('the clock was set back by 99.000 s', -99.0))
    assert planner.measured is None
    planner.measure(sample(position=(0.8, 0.0), time=1.0))
    motion = planner.submit(GOAL, 1.0)
    assert motion.plan_id == 2
    assert motion.start == pytest.approx(1.0 + planner.settings.start_delay)
    assert motion.samples.positions[0] == pytest.approx([0.8, 0.0])


def test_a_jump_at_rest_fails_nothing():
    planner = session()
    motion = planner.submit(GOAL, NOW)
    planner.measure(sample(position=(motion.samples.positions[-1]), time=motion.end + 0.1))
    assert ended(planner, motion.end + 0.1) == [(motion, Outcome.FINISHED)]
    assert planner.drop(clock_fault('the clock was set back by 99.000 s', -99.0)) == 0
    assert planner.take_ended(1.0) == []
