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

"""What swings under feedback is not taken for the arm: the loop's damping is nobody's model."""

from dataclasses import replace

from core.conftest import ARM
from core.tracking.closed_loop import ClosedLoop, motion_of, samples_of
from flat_planner_ros.core.arm import JointSample
from flat_planner_ros.core.monitor import (
    ActuatedJoints,
    FeedbackTimes,
    MonitorSettings,
    PlannedMotion,
    VibrationMonitor,
)
from flat_planner_ros.core.tracking import Phase, Tracker, TrackerSettings
import numpy as np
import pytest

START, DURATION, WINDOW = 0.02, 1.0, 2.5
SOFTER = replace(ARM, stiffness=0.75 * ARM.stiffness, damping=0.75 * ARM.damping)
SETTINGS = MonitorSettings(
    window=WINDOW,
    arm=ARM,
    fits_model=True,
    actuated_joints=ActuatedJoints.FREE,
    expected_frequency=ARM.natural_mode().frequency / (2 * np.pi),
    expected_damping_ratio=0.033,
)


@pytest.fixture(scope='module')
def samples():
    """Return the samples of 0 to pi in 1 s."""
    return samples_of()


def carried_out(samples, *, hold):
    """Return the report on a motion that a tracker has carried out on a softer arm."""
    tracker = Tracker(ARM, TrackerSettings(delay=0.002, hold=hold))
    loop = ClosedLoop(tracker, SOFTER)
    monitor = VibrationMonitor(SETTINGS)
    planned = PlannedMotion(
        joint_names=('joint1', 'joint2'),
        start=START,
        times=samples.times,
        positions=samples.positions,
        velocities=samples.velocities,
        efforts=samples.efforts,
    )
    monitor.watch(planned)
    loop.run(START)
    tracker.follow(motion_of(samples, start=START), START)
    reports = []
    while not reports:
        time, seen = loop.arm.time, loop.sample()
        loop.run(loop.period)
        monitor.feedback.hear(time, is_active=tracker.phase is not Phase.IDLE)
        reports = monitor.add(replace(seen, efforts=np.append(loop.acting, 0.0)))
    return reports[0]


def assert_told(model):
    """Check that the whole motion tells the true arm, whatever moved it."""
    assert not model.reason
    assert model.values.stiffness == pytest.approx(SOFTER.stiffness, rel=5e-3)
    assert model.values.damping == pytest.approx(SOFTER.damping, rel=2e-2)


def test_what_feedback_damps_gives_no_stiffness_but_measured_efforts_do(samples):
    report = carried_out(samples, hold=True)
    assert report.is_tracked
    assert not report.estimate.is_trustworthy
    assert 'carried out with feedback' in report.message
    assert 'feedback damps what is left' in report.message
    # Three and more times the arm's own damping ratio: what the loop was made for.
    assert report.fit.damping_ratio > 0.1
    assert report.frequency_expected is report.damping_expected is None
    assert 'expected' not in report.message
    assert_told(report.model)


def test_an_arm_that_is_let_go_after_its_motion_tells_what_it_is(samples):
    report = carried_out(samples, hold=False)
    assert report.is_tracked
    assert 'carried out with feedback' in report.message
    assert report.estimate.is_trustworthy
    assert report.estimate.stiffness == pytest.approx(SOFTER.stiffness, rel=5e-3)
    assert report.frequency_expected is not None
    assert_told(report.model)


def test_feedback_is_remembered_from_its_first_to_its_last_word():
    feedback = FeedbackTimes()
    assert not feedback.has_acted(0.0)
    feedback.hear(10.0, is_active=True)
    feedback.hear(11.0, is_active=True)
    feedback.hear(11.5, is_active=False)
    assert feedback.has_acted(9.0, 10.1)
    assert feedback.has_acted(11.4, 20.0)
    assert not feedback.has_acted(0.0, 10.0)
    assert not feedback.has_acted(11.5)
    feedback.hear(12.5, is_active=False)
    assert not feedback.has_acted(11.5)
    feedback.hear(20.0, is_active=True)
    assert feedback.has_acted(10.0, 11.0)
    assert feedback.has_acted(20.5, 21.0)


def test_who_falls_silent_is_taken_to_go_on_for_three_seconds():
    feedback = FeedbackTimes()
    feedback.hear(10.0, is_active=True)
    assert feedback.has_acted(12.9, 13.5)
    assert not feedback.has_acted(13.0)
    feedback.hear(30.0, is_active=False)
    assert not feedback.has_acted(13.0)


def test_of_two_the_idle_one_does_not_speak_for_the_other():
    feedback = FeedbackTimes()
    feedback.hear(10.0, is_active=True, sender='elder')
    feedback.hear(10.1, is_active=False, sender='younger')
    assert feedback.has_acted(10.5, 11.0)


def test_a_clock_that_is_set_back_begins_anew():
    feedback = FeedbackTimes()
    feedback.hear(100.0, is_active=True)
    feedback.hear(1.0, is_active=True)
    assert feedback.has_acted(0.0, 2.0)
    assert not feedback.has_acted(50.0, 60.0)


def test_a_monitor_that_is_reset_knows_of_no_feedback():
    monitor = VibrationMonitor(SETTINGS)
    monitor.feedback.hear(1.0, is_active=True)
    monitor.reset()
    assert not monitor.feedback.has_acted(0.0)
    assert not monitor.add(JointSample(time=0.0, positions=np.zeros(2)))
