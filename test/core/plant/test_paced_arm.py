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

"""The paced arm keeps in time, samples evenly and never hides that it could not."""

from dataclasses import replace

from flat_planner_ros.core.arm.errors import InvalidCommand, InvalidModel
from flat_planner_ros.core.arm.planar_arm import PlanarArm
from flat_planner_ros.core.plant.drives import DriveSettings
from flat_planner_ros.core.plant.effort_profile import EffortProfile
from flat_planner_ros.core.plant.paced_arm import (
    BATCH,
    FAR_AHEAD,
    MAX_BACKWARD,
    MAX_CATCH_UP,
    PacedArm,
)
from flat_planner_ros.core.plant.rollout import rollout
from flat_planner_ros.core.plant.settings import Sensing, SimulationSettings
import numpy as np
import pytest

PAPER = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
SETTINGS = SimulationSettings(arm=PAPER, position=(0.0, 0.0))
EPOCH = 1.8e9
"""A present time of day [s]; floating-point numbers resolve 0.24 microseconds there."""


def swing(start=1.25, duration=2.0, **options):
    """Return one sine wave of effort."""
    times = np.linspace(0.0, duration, 201)
    efforts = 1e-3 * np.sin(2 * np.pi * times / duration)[:, None]
    efforts[-1] = 0.0
    return EffortProfile(start=start, times=times, efforts=efforts, **options)


def moving(until=2.0, settings=SETTINGS, **options):
    """Return an arm in the middle of a swing, led there from time 1."""
    arm = PacedArm(settings, 1.0)
    arm.command(swing(**options))
    lead_to(arm, until)
    return arm


def lead_to(arm, until):
    """Lead an arm to a time, batch by batch; return the samples."""
    samples = []
    while arm.time < until - 1e-9:
        samples += arm.lead(0.0, 0.0)
    return samples


def last(samples):
    """Return the last of some samples as numbers."""
    return np.concatenate(samples[-1][1:3])


def test_samples_lie_on_an_even_grid_however_the_clock_is_read():
    rng = np.random.default_rng(4)
    arm, samples, now = PacedArm(SETTINGS), [], EPOCH
    while now < EPOCH + 5.0:
        samples += arm.follow(now)
        now += rng.choice([0.0, 1e-4, 4e-3, 7e-3, 0.3])
    times = np.array([sample.time for sample in samples])
    assert np.diff(times) == pytest.approx(1.0 / SETTINGS.rate, abs=3e-7)
    assert times[0] == pytest.approx(EPOCH, abs=1.0 / SETTINGS.rate)
    assert times[-1] <= now
    assert arm.take_warnings() == []


def test_the_motion_does_not_depend_on_how_the_clock_is_read():
    def final(steps):
        arm, now, samples = PacedArm(SETTINGS, 1.0), 1.0, []
        arm.command(swing())
        for step in steps:
            now += step
            samples += arm.follow(now)
        return last([s for s in samples if s.time < 3.5])

    ticks = final([0.005] * 600)
    rng = np.random.default_rng(5)
    assert np.array_equal(final(rng.uniform(0.0, 0.02, 300)), ticks)
    assert np.array_equal(final([0.9] * 3), ticks)


@pytest.mark.parametrize('start', [1.25, EPOCH + 0.25])
def test_a_command_is_played_as_the_rollout_plays_it(start):
    arm = PacedArm(SETTINGS, start - 0.25)
    arm.command(swing(start))
    samples = lead_to(arm, start + 3.0)
    expected = rollout(PAPER, swing(0.0), 3.0, step=1e-3)
    shown = np.array([s.position for s in samples if s.time >= start - 1e-6])
    index = np.arange(len(shown)) * SETTINGS.steps_per_sample
    index = index[index < len(expected.times)]
    tolerance = 1e-12 if start < 10 else 1e-6
    assert shown[: len(index)] == pytest.approx(expected.positions[index], abs=tolerance)
    assert np.abs(shown).max() > 0.1


@pytest.mark.parametrize(
    ('rate', 'step', 'steps'), [(200.0, 1e-3, 5), (300.0, 1e-3, 4), (1000.0, 1e-3, 1)]
)
def test_a_whole_number_of_steps_lies_between_samples(rate, step, steps):
    settings = replace(SETTINGS, rate=rate, step=step)
    assert settings.steps_per_sample == steps
    samples = lead_to(PacedArm(settings, 1.0), 2.0)
    assert np.diff([s.time for s in samples]) == pytest.approx(1.0 / rate, abs=1e-12)


def test_steps_are_never_longer_than_asked():
    for rate in np.linspace(1.0, 1000.0, 400):
        settings = replace(SETTINGS, rate=rate)
        assert 1.0 / (rate * settings.steps_per_sample) <= settings.step * (1 + 1e-5)


def test_a_clock_that_has_not_begun_is_waited_for():
    arm = PacedArm(SETTINGS)
    assert arm.follow(0.0) == []
    with pytest.raises(InvalidCommand, match='no time yet'):
        arm.command(swing())
    assert len(arm.follow(0.5)) == 1
    assert arm.time == pytest.approx(0.5, abs=1.0 / SETTINGS.rate)


def test_a_short_lag_is_made_up_for():
    ticks, lagging = moving(), moving()
    for _ in range(180):
        expected = ticks.follow(ticks.time + 0.005)
    samples = lagging.follow(lagging.time + 0.9)
    assert len(samples) == 180
    assert np.array_equal(last(samples), last(expected))
    assert lagging.take_warnings() == []


def test_a_long_lag_is_skipped_and_told():
    arm = moving(2.0, start=1.5, duration=20.0)
    before = arm.follow(2.2)[-1]
    now = 2.2 + MAX_CATCH_UP + 7.0
    after = arm.follow(now)
    assert len(after) <= 2
    assert arm.time == pytest.approx(now, abs=SETTINGS.step)
    grid = (after[-1].time - before.time) * SETTINGS.rate
    assert grid == pytest.approx(round(grid), abs=1e-6)
    # Frozen but for the one period that was integrated.
    assert after[-1].position == pytest.approx(
        before.position + before.velocity / SETTINGS.rate, abs=1e-4
    )
    assert before.effort[0] != 0.0
    assert {sample.effort[0] for sample in after + arm.follow(now + 1.0)} == {0.0}
    (trouble,) = arm.take_warnings()
    assert 's skipped' in trouble
    assert 'dropped' in trouble
    assert float(trouble.split()[0]) == pytest.approx(MAX_CATCH_UP + 7.0, abs=0.006)
    assert arm.take_warnings() == []


def test_nothing_is_applied_after_a_command_that_ended_in_a_skipped_time():
    arm = moving(2.0)
    assert arm.follow(2.1)[-1].effort[0] != 0.0
    samples = arm.follow(60.0) + arm.follow(60.1)
    assert {sample.effort[0] for sample in samples} == {0.0}
    arm.command(swing(61.0))  # and the next command works
    arm.follow(60.9)
    assert arm.follow(61.5)[-1].effort[0] == pytest.approx(swing(61.0).effort(61.5)[0])


def test_a_resting_arm_does_not_notice_a_skip():
    arm = PacedArm(SETTINGS)
    arm.follow(EPOCH)
    samples = arm.follow(EPOCH + 1e5) + arm.follow(EPOCH + 1e5 + 0.1)
    assert np.array_equal(last(samples), np.zeros(4))


def test_a_clock_set_back_keeps_the_state_and_drops_the_command():
    arm = moving(2.0)
    before = arm.follow(2.1)[-1]
    after = arm.follow(0.5)
    assert arm.time == pytest.approx(0.5, abs=SETTINGS.step)
    samples = after + arm.follow(1.45)
    assert samples[0].position == pytest.approx(before.position, abs=0.05)
    assert {sample.effort[0] for sample in samples} == {0.0}
    assert 'set back by 1.600 s' in arm.take_warnings()[0]


def test_a_clock_that_hesitates_is_waited_for():
    arm = moving(2.0)
    arm.follow(2.1)
    assert arm.follow(2.1 - 0.9 * MAX_BACKWARD) == []
    samples = arm.follow(2.11)
    assert [s.time for s in samples] == pytest.approx([2.105, 2.11])
    assert samples[-1].effort[0] == pytest.approx(swing().effort(2.11)[0])
    assert arm.take_warnings() == []


@pytest.mark.parametrize('factor', [0.5, 1.0, 5.0])
def test_a_leading_arm_keeps_its_speed(factor):
    arm, walls = PacedArm(SETTINGS, 1.0), 100.0 + np.linspace(0.0, 2.0, 401)
    samples = [s for wall in walls for s in arm.lead(wall, factor)]
    assert samples[0].time == 1.0
    assert arm.time == pytest.approx(1.0 + 2.0 * factor, abs=2 * SETTINGS.step)
    assert np.diff([s.time for s in samples]) == pytest.approx(1.0 / SETTINGS.rate, abs=1e-12)
    assert arm.take_warnings() == []


def test_a_leading_arm_makes_up_for_a_pause_little_by_little():
    arm = PacedArm(SETTINGS, 1.0)
    arm.lead(0.0, 1.0)
    for wall in 0.8 + np.linspace(0.0, 0.2, 41):
        assert len(arm.lead(wall, 1.0)) <= BATCH * SETTINGS.rate + 1
    assert arm.time == pytest.approx(2.0, abs=2 * SETTINGS.step)
    assert arm.take_warnings() == []


def test_a_leading_arm_that_is_too_slow_lets_time_run_slower_and_says_so():
    arm = PacedArm(SETTINGS, 1.0)
    for wall in np.arange(0.0, 10.0, 1.0):
        arm.lead(wall, 1.0)
    assert arm.time == pytest.approx(1.0 + 9 * BATCH, abs=1e-9)
    (trouble,) = arm.take_warnings()
    assert 'behind its real_time_factor' in trouble
    assert float(trouble.split()[4]) == pytest.approx(9.0 - 9 * BATCH - MAX_CATCH_UP, abs=1e-3)
    assert arm.take_warnings() == []


@pytest.mark.parametrize('factor', [0.1, 1.0, 5.0, 20.0, 1000.0])
def test_calls_are_frequent_enough_for_the_speed(factor):
    arm = PacedArm(replace(SETTINGS, rate=1.0), 1.0)
    assert arm.call_rate(factor) * BATCH > factor
    assert arm.call_rate(factor) >= 100.0
    assert arm.call_rate(0.0) >= arm.call_rate(factor) or factor > 100.0


def test_as_fast_as_it_can_is_a_batch_per_call():
    arm = PacedArm(SETTINGS, 1.0)
    for k in range(1, 4):
        arm.lead(0.0, 0.0)
        assert arm.time == pytest.approx(1.0 + k * BATCH)
    assert arm.take_warnings() == []


def test_a_late_command_is_played_from_the_present_and_remarked():
    arm = PacedArm(SETTINGS, 1.5)
    assert arm.command(swing(1.25)).startswith('it arrived 250.0 ms after its start')
    samples = lead_to(arm, 2.0)
    assert samples[0].effort[0] == pytest.approx(swing(1.25).effort(1.5)[0])


def test_a_command_of_another_clock_is_remarked():
    arm = PacedArm(SETTINGS, 1.0)
    assert 'same clock' in arm.command(swing(EPOCH))
    assert arm.command(swing(1.0 + 0.9 * FAR_AHEAD)) == ''


def test_a_command_that_has_ended_is_refused_and_the_present_one_goes_on():
    arm, undisturbed = moving(), moving()
    with pytest.raises(InvalidCommand, match=r'ended at 1\.900000 s, 0\.100 s before'):
        arm.command(swing(-0.1))
    with pytest.raises(InvalidCommand, match='motors'):
        arm.command(EffortProfile(start=3.0, times=[1.0], efforts=[[0.0, 0.0]]))
    assert np.array_equal(last(lead_to(arm, 4.0)), last(lead_to(undisturbed, 4.0)))


def test_a_command_that_was_overtaken_is_refused_and_the_running_one_goes_on():
    arm, undisturbed = moving(), moving()
    with pytest.raises(InvalidCommand, match=r'overtaken: it starts 0\.050000 s before'):
        arm.command(swing(1.2))
    assert arm.command(swing(1.25)) == ''  # the same once more is no matter
    assert np.array_equal(last(lead_to(arm, 4.0)), last(lead_to(undisturbed, 4.0)))
    arm = PacedArm(SETTINGS, 1.0)
    arm.command(swing(5.0))
    assert arm.command(swing(2.0)) == '', 'one that waits gives way to an earlier one'


def test_a_command_that_begins_after_a_skipped_time_is_kept():
    arm, start = PacedArm(SETTINGS), 10.0
    arm.follow(1.0)
    arm.command(swing(start))
    arm.follow(9.0)
    assert 'dropped' not in arm.take_warnings()[0]
    samples = arm.follow(9.9) + arm.follow(10.5)
    assert samples[-1].effort[0] == pytest.approx(swing(start).effort(samples[-1].time)[0])


def located(start, position, *, turn=0.3, duration=2.0):
    """Return a command with positions that turns joint 1 from one."""
    profile = swing(start, duration)
    course = position + turn * (1 - np.cos(np.pi * profile.times / duration))[:, None] / 2
    return replace(profile, positions=course)


@pytest.mark.parametrize('start', [1.5, 2.0, 100.0])
def test_a_command_that_starts_elsewhere_is_refused_and_not_jumped_to(start):
    arm = PacedArm(replace(SETTINGS, position=(0.2, 0.0)), 1.5)
    with pytest.raises(InvalidCommand, match=r'joint 1 .* at 0\.2\d* rad'):
        arm.command(located(start, 0.2 + 1.02 * SETTINGS.start_tolerance))
    assert {sample.effort[0] for sample in lead_to(arm, 4.0)} == {0.0}
    arm.command(located(arm.time, 0.2 + 0.98 * SETTINGS.start_tolerance))
    arm.command(located(arm.time, 0.2 - 0.98 * SETTINGS.start_tolerance))


def test_the_distance_that_is_allowed_can_be_chosen():
    arm = PacedArm(replace(SETTINGS, start_tolerance=np.inf), 1.0)
    arm.command(located(1.0, 30.0))
    arm.settings = replace(arm.settings, start_tolerance=0.0)
    with pytest.raises(InvalidCommand, match='tolerance 0 rad'):
        arm.command(located(1.0, 1e-9))


def test_a_late_command_is_refused_once_it_should_have_come_too_far():
    for delay, is_played in ((0.1, True), (1.0, False)):
        arm = PacedArm(SETTINGS, 10.0)
        if is_played:
            assert 'after its start' in arm.command(located(10.0 - delay, 0.0))
        else:
            with pytest.raises(InvalidCommand, match='should be at 0.15 rad by now, but is at 0'):
                arm.command(located(10.0 - delay, 0.0))


def test_a_command_may_continue_the_running_one_wherever_the_arm_has_come():
    heavy = replace(SETTINGS, arm=PAPER.scaled(inertia=20.0))
    arm = PacedArm(heavy, 1.0)
    first = located(1.0, 0.0, turn=3.0)
    arm.command(first)
    lead_to(arm, 2.0)
    assert first.reference(2.0).position - arm._simulated.position[0] > 1.0
    arm.command(located(1.0, 0.0, turn=3.0))
    with pytest.raises(InvalidCommand, match='should be at'):
        arm.command(located(1.0, 1.0, turn=3.0))
    lead_to(arm, 3.5)  # The running one has ended: now the arm itself counts.
    with pytest.raises(InvalidCommand, match='should be at 3 rad'):
        arm.command(located(3.5, 3.0))


@pytest.mark.parametrize('effort', [1e-300, 1.0, 1e6])
def test_efforts_without_measure_stop_the_arm_in_finite_numbers(effort):
    times, efforts = [0.0, 1.0, 1.5], [[effort], [-effort], [0.0]]
    arm = PacedArm(SETTINGS, 1.0)
    arm.command(EffortProfile(start=1.0, times=times, efforts=efforts))
    samples = lead_to(arm, 3.0)
    assert np.isfinite([np.concatenate(sample[1:]) for sample in samples]).all()
    if effort < 1e3:
        assert arm.take_warnings() == []
        return
    assert not samples[-1].velocity.any()
    assert samples[-1].effort[0] == 0.0
    for _ in range(2):  # said again until something is done about it
        (trouble,) = arm.take_warnings()
        assert 'has been stopped until it is reset: joint' in trouble
    for act in (lambda: arm.command(swing(4.0)), lambda: arm.hold([0.0])):
        with pytest.raises(InvalidCommand, match='stopped until it is reset'):
            act()
    arm.reset()
    assert arm.take_warnings() == []
    arm.command(swing(4.0))
    assert lead_to(arm, 5.0)[-1].position[0] != 0.0


def test_gains_or_friction_too_large_for_the_step_stop_the_arm_too():
    stiff = replace(SETTINGS, drives=DriveSettings(feedback_p=(1e6,), feedback_d=(1e6,)))
    arm = PacedArm(stiff, 1.0)
    arm.command(located(1.0, 1e-3))
    assert np.isfinite([np.concatenate(s[1:]) for s in lead_to(arm, 2.0)]).all()
    assert 'gains for steps of 0.001 s' in arm.take_warnings()[0]


def test_a_stream_of_efforts_is_applied_as_it_comes():
    arm = PacedArm(SETTINGS, 1.0)
    for effort in (1e-3, -2e-3, 0.0):
        arm.hold([effort])
        samples = lead_to(arm, arm.time + 0.05)
        assert {sample.effort[0] for sample in samples[1:]} == {effort}
    lead_to(arm, 3.0)
    assert arm.take_warnings() == []  # it ended with zeros


def test_a_stream_that_breaks_ends_in_no_effort_and_one_complaint():
    arm = PacedArm(replace(SETTINGS, input_timeout=0.1), 1.0)
    arm.hold([2e-3])
    samples = lead_to(arm, 2.0)
    applied = [sample.time for sample in samples if sample.effort[0]]
    assert max(applied) == pytest.approx(1.095)
    (trouble,) = arm.take_warnings()
    assert 'none came for 0.1 s' in trouble
    lead_to(arm, 3.0)
    assert arm.take_warnings() == []
    expected = rollout(
        PAPER,
        EffortProfile(start=0.0, times=[0.0, 0.1, 0.1 + 1e-9], efforts=[[2e-3], [2e-3], [0.0]]),
        1.0,
    )
    assert samples[-1].position == pytest.approx(expected.positions[-1], abs=2e-3)


def test_efforts_are_held_until_the_next_command():
    arm = moving()
    arm.hold([2e-3])
    arm.settings = replace(SETTINGS, input_timeout=10.0)
    arm.hold([2e-3])
    samples = lead_to(arm, 3.0)
    assert {sample.effort[0] for sample in samples[1:]} == {2e-3}
    with pytest.raises(InvalidCommand, match='entries'):
        arm.hold([0.0, 0.0])
    arm.command(swing(2.5))
    assert lead_to(arm, 3.1)[-1].effort[0] == pytest.approx(swing(2.5).effort(arm.time)[0])


def test_a_reset_brings_the_arm_back_to_rest_and_ends_the_command():
    settings = replace(SETTINGS, position=(0.5, 0.1))
    arm = moving(2.0, settings)
    assert last(lead_to(arm, 2.2))[2] != 0.0
    time = arm.time
    arm.reset()
    assert arm.time == time
    samples = lead_to(arm, 2.5)
    assert {sample.effort[0] for sample in samples[1:]} == {0.0}
    # The spring was let go at 0.1 rad: it oscillates, and no further than that.
    assert np.abs(np.array([sample.position[1] for sample in samples[1:]])).max() <= 0.1


def test_another_arm_takes_over_the_state():
    arm, same = moving(), moving()
    arm.settings = replace(SETTINGS, arm=PAPER.scaled(stiffness=1.1))
    first, second = lead_to(arm, 3.0), lead_to(same, 3.0)
    assert first[0].position == pytest.approx(second[0].position, abs=1e-4)
    assert np.abs(last(first) - last(second)).max() > 1e-3


def test_other_sensors_take_effect_at_once():
    arm = PacedArm(SETTINGS, 1.0)
    arm.settings = replace(SETTINGS, sensing=Sensing(position_std=1e-3))
    assert lead_to(arm, 1.1)[-1].position[0] != 0.0
    arm.settings = SETTINGS
    assert lead_to(arm, 1.2)[-1].position[0] == 0.0


def test_changes_that_keep_the_sensors_go_on_with_their_noise():
    noisy = replace(SETTINGS, sensing=Sensing(position_std=1e-3))
    arm, same = PacedArm(noisy, 1.0), PacedArm(noisy, 1.0)
    lead_to(arm, 1.1), lead_to(same, 1.1)
    arm.settings = replace(noisy, arm=PAPER.scaled(stiffness=1.1))
    assert np.array_equal(last(lead_to(arm, 1.2)), last(lead_to(same, 1.2)))


@pytest.mark.parametrize('change', [{'rate': 100.0}, {'position': (1.0, 0.0)}, {'step': 1e-4}])
def test_the_rest_cannot_change(change):
    arm = PacedArm(SETTINGS, 1.0)
    with pytest.raises(InvalidModel, match='only the arm'):
        arm.settings = replace(SETTINGS, **change)


@pytest.mark.parametrize('change', [{'rate': 0.0}, {'rate': np.nan}, {'step': -1e-3}])
def test_settings_without_meaning_are_refused(change):
    with pytest.raises(InvalidModel, match='above 0'):
        replace(SETTINGS, **change)


def test_clipped_steps_are_counted():
    arm = moving(1.0, replace(SETTINGS, drives=DriveSettings(saturation=(5e-4,))))
    samples = lead_to(arm, 3.5)
    assert max(abs(sample.effort[0]) for sample in samples) == 5e-4
    (trouble,) = arm.take_warnings()
    assert trouble.startswith('effort clipped')
    # The sine is above half its peak for two thirds of its two seconds.
    assert int(trouble.split()[-2]) == pytest.approx(2000 * 2 / 3, abs=5)


def test_a_command_that_repeats_the_running_one_until_now_is_no_loss():
    arm = moving(until=2.0)
    efforts = np.array(swing().efforts)
    efforts[90:] *= 0.5  # from 2.15 s on
    assert arm.command(replace(swing(), efforts=efforts)) == ''


def test_a_command_that_should_have_begun_otherwise_is_a_loss():
    other = replace(swing(), efforts=1.01 * swing().efforts)
    assert 'after its start; that part is left out' in moving(until=2.0).command(other)
    assert 'after its start' in PacedArm(SETTINGS, 1.5).command(swing())


def test_what_asks_for_nothing_yet_is_no_loss():
    times = np.linspace(0.0, 2.0, 201)
    efforts = np.where(times < 1.0, 0.0, 1e-3 * np.sin(2 * np.pi * times))[:, None]
    efforts[-1] = 0.0
    profile = EffortProfile(start=1.25, times=times, efforts=efforts)
    assert PacedArm(SETTINGS, 1.5).command(profile) == ''
    moved = replace(profile, positions=1e-3 * times[:, None])
    assert 'after its start' in PacedArm(SETTINGS, 1.5).command(moved)
