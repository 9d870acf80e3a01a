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

"""A report says whether the arm did what was planned, and when: arrival, stretch, unit."""

from dataclasses import replace
from math import pi

from driven_arm import driven, NAMES, reports_on, sampled
from flat_planner_ros.core.arm import InvalidRequest, PlanarArm
from flat_planner_ros.core.monitor import Level, MonitorSettings, VibrationMonitor
import numpy as np
import pytest

SETTINGS = MonitorSettings(window=3.0, expected_frequency=1.557)


def report_on(motion, times, positions, settings=SETTINGS):
    """Return the one report on a motion."""
    (report,) = reports_on(VibrationMonitor(settings), motion, times, positions)
    return report


def arm(scale=1.0, spring=1.0):
    """Return the paper's arm with other inertias and another spring."""
    return PlanarArm.reduced(
        inertia_star=(scale * 6.4e-4, scale * 3.3e-5), stiffness=spring * 3e-3, damping=2e-5
    )


def test_heavier_links_stop_short_of_the_goal(paper_arm):
    motion, times, positions = driven(arm(1.1), paper_arm)
    report = report_on(motion, times, positions)
    # The momentum is that of the plan, the inertia 1.1 times its: so much shorter is the way.
    short = pi * (1.0 - 1.0 / 1.1)
    assert report.final_error[0] == pytest.approx(-short, abs=2e-3)
    assert report.level is Level.ERROR
    assert f'joint1 stopped {short:.3f} rad' in report.message
    assert 'short of its goal, above 0.1 rad: it travelled 0.909 of' in report.message
    assert 'joint2 is' not in report.message
    assert report.course.ratio == pytest.approx(1.0 / 1.1, rel=0.02)


@pytest.mark.parametrize(
    ('bounds', 'level'),
    [((0.01, 0.1), Level.WARN), ((0.05, 0.1), Level.OK), ((0.01, 0.02), Level.ERROR)],
)
def test_the_bounds_of_the_final_error_are_parameters(paper_arm, bounds, level):
    motion, times, positions = driven(paper_arm, paper_arm)
    settings = replace(SETTINGS, final_ok=bounds[0], final_error=bounds[1])
    report = report_on(motion, times, positions + (times >= motion.end)[:, None] * 0.03, settings)
    assert report.level is level
    assert ('joint1 stopped 0.03 rad beyond its goal' in report.message) == (level.value != 'ok')
    assert ('joint2 is 0.03 rad off its goal' in report.message) == (level.value != 'ok')


def test_bounds_that_contradict_each_other_are_refused():
    with pytest.raises(InvalidRequest, match='final_error 0.001 rad is below final_ok 0.01 rad'):
        MonitorSettings(final_error=1e-3)


def test_a_true_motion_is_compared_and_nothing_is_said(paper_arm):
    report = report_on(*driven(paper_arm, paper_arm))
    assert report.level is Level.OK
    assert report.message.startswith('amplitude')
    assert report.course.joint == 'joint1'
    assert report.course.remark == ''
    assert report.course.shift == pytest.approx(0.0, abs=1e-5)
    assert report.course.ratio == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize('spring', [0.5, 0.9, 1.1, 2.0])
def test_a_swing_is_no_other_time(paper_arm, spring):
    report = report_on(*driven(arm(spring=spring), paper_arm))
    assert report.fit.amplitude > 0.05
    assert report.message.startswith('amplitude')
    # Half the stiffness swings so far that the time is not known to a millisecond, and not given.
    assert report.course.shift == (None if spring == 0.5 else pytest.approx(0.0, abs=2e-3))


def test_an_arm_that_never_moved_is_an_error(paper_arm):
    motion, times, positions = driven(paper_arm, paper_arm)
    report = report_on(motion, times, 0.0 * positions)
    assert report.level is Level.ERROR
    assert report.message.startswith('joint1 never moved, 3.14 rad were planned')


def test_an_arm_that_never_moved_there_and_back_is_an_error(paper_arm):
    motion, times, positions = driven(paper_arm, paper_arm)
    back = replace(
        motion, positions=motion.positions * (motion.times[::-1, None] / 0.5), velocities=None
    )
    report = report_on(back, times, 0.0 * positions)
    assert report.final_error == (0.0, 0.0)
    assert report.level is Level.ERROR
    assert 'joint1 never moved' in report.message


@pytest.mark.parametrize('factor', [2.0, 1.3, 0.6])
def test_a_stretched_motion_is_told_from_a_swing(paper_arm, factor):
    motion, times, positions = driven(arm(spring=1.1), paper_arm)
    slow = replace(motion, times=motion.times / factor, velocities=None)
    # The arm does in 1 s what was planned for another time; its swing after that stays what it is.
    report = report_on(slow, times, positions, replace(SETTINGS, window=4.0))
    true = report_on(motion, times, positions, SETTINGS)
    assert report.level is not Level.OK
    expected = f'the arm took 1 s for a motion of {1.0 / factor:.2g} s'
    assert expected in report.message
    assert report.fit.amplitude == pytest.approx(true.fit.amplitude, rel=0.02)
    assert report.end_time == slow.end


def test_a_late_motion_is_said_to_be_late_and_its_swing_is_right(paper_arm):
    motion, times, positions = driven(arm(spring=1.1), paper_arm)
    true = report_on(motion, times, positions)
    report = report_on(motion, times + 0.3, positions, replace(SETTINGS, window=3.3))
    assert 'the arm moved 0.3 s later than planned' in report.message
    assert report.fit.amplitude == pytest.approx(true.fit.amplitude, rel=1e-3)


@pytest.mark.parametrize('rate', [200.0, 50.0])
def test_degrees_are_named(paper_arm, rate):
    motion, times, positions = driven(arm(spring=1.1), paper_arm)
    at = np.arange(times[0], times[-1], 1.0 / rate)
    report = report_on(motion, at, np.degrees(sampled(times, positions, at)))
    assert report.level is Level.ERROR
    assert 'joint1 travelled 57.' in report.message
    assert 'seem to be in degrees' in report.message
    assert report.fit.amplitude is None


def test_a_joint_that_goes_the_other_way_is_named(paper_arm):
    motion, times, positions = driven(paper_arm, paper_arm)
    report = report_on(motion, times, positions * (-1.0, 1.0))
    assert report.level is Level.ERROR
    assert 'joint1 moved the other way round' in report.message
    assert report.course.ratio == pytest.approx(-1.0, abs=1e-5)


def test_a_motion_that_was_not_seen_is_not_compared(paper_arm):
    motion, times, positions = driven(paper_arm, paper_arm)
    late = times > motion.end - 0.1
    report = report_on(motion, times[late], positions[late])
    assert report.course is None
    assert report.level is Level.OK


@pytest.mark.parametrize('noise', [1e-3, 1e-2])
def test_noise_and_encoder_steps_are_no_other_motion(paper_arm, noise):
    motion, times, positions = driven(paper_arm, paper_arm)
    random = np.random.default_rng(0).standard_normal(positions.shape)
    report = report_on(motion, times, noise * np.round((positions + noise * random) / noise))
    assert report.course.remark == ''
    assert report.course.shift == pytest.approx(0.0, abs=2e-3)
    assert all(name not in report.message.partition('effort of')[0] for name in NAMES)
