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

"""Stiffness and damping come back from the oscillation, with honest errors, or not at all."""

from dataclasses import replace

from flat_planner_ros.core.arm.errors import InvalidRequest, NotFlat
from flat_planner_ros.core.arm.planar_arm import PlanarArm
from flat_planner_ros.core.monitor.identification import (
    ActuatedJoints,
    identify,
    oscillating_inertia,
    STIFFNESS_ERROR,
    StiffnessEstimate,
)
from flat_planner_ros.core.monitor.oscillation import fit_oscillation
from flat_planner_ros.core.plant.drives import DriveSettings
from flat_planner_ros.core.plant.effort_profile import EffortProfile
from flat_planner_ros.core.plant.rollout import rollout
import numpy as np
import pytest
from random_cases import cases
from scipy.signal import lfilter

BOTH, LAST = 6.4e-4, 3.3e-5
"""Reduced inertias of the paper's arm [kg m^2]."""

INERTIA = {
    ActuatedJoints.FREE: LAST * (BOTH - LAST) / BOTH,
    ActuatedJoints.HELD: LAST,
}
"""J of (47a), written out [kg m^2]."""

RATIO = {ActuatedJoints.FREE: -LAST / BOTH, ActuatedJoints.HELD: 0.0}
"""Motion of link n-1 per motion of the passive joint, (47b), written out [-]."""

RATE, WINDOW = 200.0, 3.0
"""Samples per second [Hz] and length of the samples [s]."""

NOISE = 1e-4
"""Standard deviation of noise [rad]."""

CASES = (ActuatedJoints.FREE, ActuatedJoints.HELD)


def plant_of(scale: float) -> PlanarArm:
    """Return an arm whose spring and damper differ from the paper's by a factor."""
    return PlanarArm.reduced(
        inertia_star=(BOTH, LAST), stiffness=scale * 3e-3, damping=scale * 2e-5
    )


def swing(plant, case, amplitude=0.05, *, window=WINDOW, phase=0.4, ratio=None):
    """Return times [s] and positions [rad] of a free oscillation by (41) or (42)."""
    t = np.arange(0.0, window, 1.0 / RATE)
    decay = plant.damping / (2 * INERTIA[case])
    omega = np.sqrt(plant.stiffness / INERTIA[case] - decay**2)
    last = amplitude * np.exp(-decay * t) * np.cos(omega * t - phase)
    return t, np.stack(((RATIO[case] if ratio is None else ratio) * last, last), axis=-1)


def estimate_of(t, q, arm, joints=ActuatedJoints.AUTO) -> StiffnessEstimate:
    """Return the estimate from samples."""
    return identify(t, q, fit_oscillation(t, q[:, -1], 0.0), arm, joints)


def encoded(q, step, pose=0.0):
    """Return positions as an encoder shows them, from a pose that is no multiple of its step."""
    return step * np.round((q + pose) / step) - pose


def pushed(plant, *, held: bool):
    """Return what the true dynamics do after a pulse of torque on a free or held joint 1."""
    end = 0.3
    times = np.linspace(0.0, end, 61)
    pulse = 5e-3 * np.sin(2 * np.pi * times / end)[:, None]
    pulse[-1] = 0.0
    reference = 0.05 * (1.0 - np.cos(np.pi * times / end))[:, None]
    profile = EffortProfile(start=0.0, times=times, efforts=pulse, positions=reference)
    gains = DriveSettings(feedback_p=(20.0,), feedback_d=(0.3,)) if held else DriveSettings()
    step = 2.5e-4 if held else 1e-3
    states = rollout(plant, profile, end + WINDOW, step=step, drives=gains)
    after = states.times >= end - step / 2
    stride = round(1.0 / (RATE * step))
    return states.times[after][::stride] - end, states.positions[after][::stride]


@pytest.mark.parametrize('case', CASES)
@pytest.mark.parametrize('scale', [0.75, 0.9, 1.0, 1.1, 1.25])
@pytest.mark.parametrize('amplitude', [1e-6, 0.05])
def test_exact_samples_give_back_the_arm(paper_arm, case, scale, amplitude):
    plant = plant_of(scale)
    t, q = swing(plant, case, amplitude)
    estimate = estimate_of(t, q + np.array((2.0, -0.01)) + 0.02 * t[:, None], paper_arm)
    assert (estimate.is_trustworthy, estimate.reason) == (True, '')
    assert estimate.case is case
    assert estimate.inertia == pytest.approx(INERTIA[case], rel=1e-12)
    assert estimate.stiffness == pytest.approx(plant.stiffness, rel=1e-6)
    assert estimate.damping == pytest.approx(plant.damping, rel=1e-5)


@pytest.mark.parametrize('held', [False, True])
@pytest.mark.parametrize('scale', [0.75, 0.9, 1.1, 1.25])
def test_the_simulated_arm_is_identified(paper_arm, scale, held):
    plant = plant_of(scale)
    estimate = estimate_of(*pushed(plant, held=held), paper_arm)
    assert estimate.reason == ''
    assert estimate.case is (ActuatedJoints.HELD if held else ActuatedJoints.FREE)
    # A stiff motor still gives way a little.
    assert estimate.stiffness == pytest.approx(plant.stiffness, rel=1e-3 if held else 1e-7)
    assert estimate.damping == pytest.approx(plant.damping, rel=1e-2 if held else 1e-5)


@pytest.mark.parametrize('is_given', [False, True])
def test_the_last_two_links_of_a_longer_arm_are_identified(is_given):
    nominal = PlanarArm.reduced(
        inertia_star=(BOTH, LAST),
        stiffness=3e-3,
        damping=2e-5,
        link_length=[0.3],
        link_com=[0.1],
        link_mass=[0.5],
        link_inertia=[2e-3],
        tip_mass=0.3,
    )
    plant = nominal.scaled(stiffness=1.2, damping=1.2)
    zero = np.zeros((2, 2))
    rest = EffortProfile(start=0.0, times=np.array((0.0, 1e-3)), efforts=zero)
    states = rollout(plant, rest, WINDOW, position=[0.3, -0.5, 0.04])
    t, q = states.times[::5], states.positions[::5]
    joints = ActuatedJoints.FREE if is_given else ActuatedJoints.AUTO
    estimate = estimate_of(t, q, nominal, joints)
    assert estimate.case is ActuatedJoints.FREE
    assert estimate.stiffness == pytest.approx(plant.stiffness, rel=1e-6)
    assert estimate.damping == pytest.approx(plant.damping, rel=1e-5)


@pytest.mark.parametrize('case', CASES)
@pytest.mark.parametrize('missing', [0.0, 0.5])
def test_standard_errors_are_those_of_many_trials(paper_arm, case, missing):
    plant, rng = plant_of(1.1), np.random.default_rng(7)
    t, q = swing(plant, case)
    runs, scores = cases(200, 4), []
    for _ in range(runs):
        kept = rng.random(t.size) >= missing
        noisy = q[kept] + NOISE * rng.standard_normal(q[kept].shape)
        estimate = estimate_of(t[kept], noisy, paper_arm)
        assert estimate.is_trustworthy, estimate.reason
        assert estimate.case is case
        scores.append(
            (
                (estimate.stiffness - plant.stiffness) / estimate.stiffness_std,
                (estimate.damping - plant.damping) / estimate.damping_std,
            )
        )
    # Of 200 scores the mean has a spread of 0.07, the standard deviation one of 0.05.
    assert np.mean(scores, axis=0) == pytest.approx([0.0, 0.0], abs=3.5 / np.sqrt(runs))
    assert np.std(scores, axis=0) == pytest.approx([1.0, 1.0], abs=2.5 / np.sqrt(runs))


def test_noise_that_changes_slowly_is_given_its_due(paper_arm):
    memory, plant, rng = 0.7, plant_of(1.1), np.random.default_rng(9)
    t, q = swing(plant, ActuatedJoints.FREE)
    scores = []
    for _ in range(cases(100, 3)):
        noise = lfilter([1.0], [1.0, -memory], rng.standard_normal(q.shape), axis=0)
        estimate = estimate_of(t, q + NOISE * noise, paper_arm)
        assert estimate.is_trustworthy, estimate.reason
        scores.append((estimate.stiffness - plant.stiffness) / estimate.stiffness_std)
    # Taken for white, this noise would give 2.4.
    assert np.std(scores) == pytest.approx(1.0, abs=0.25)


@pytest.mark.parametrize('case', CASES)
@pytest.mark.parametrize('step', [1e-4, 1e-3, 2 * np.pi / 4096])
def test_encoder_steps_do_no_harm(paper_arm, case, step):
    scores = []
    for number in range(12):
        plant = plant_of(0.8 + 0.04 * number)
        t, q = swing(plant, case, amplitude=0.07, phase=0.5 * number)
        estimate = estimate_of(t, encoded(q, step, 0.3 + 0.1 * number), paper_arm)
        assert estimate.is_trustworthy, estimate.reason
        assert estimate.case is case
        assert estimate.stiffness == pytest.approx(plant.stiffness, rel=2e-3)
        assert estimate.damping == pytest.approx(plant.damping, rel=0.03)
        scores.append((estimate.stiffness - plant.stiffness) / estimate.stiffness_std)
    # Their errors are no white noise: the standard errors are wide enough all the same.
    assert np.sqrt(np.mean(np.square(scores))) < 2.0


def test_coarse_encoders_are_never_taken_for_a_held_joint(paper_arm):
    plant = plant_of(1.1)
    cases = []
    for amplitude in (5e-3, 0.01, 0.02, 0.04, 0.08):
        for phase in (0.0, 0.7, 1.5, 2.3):
            t, q = swing(plant, ActuatedJoints.FREE, amplitude, phase=phase)
            for pose in (0.3, 0.3005):
                cases.append(estimate_of(t, encoded(q, 1e-3, pose), paper_arm).case)
    assert len(cases) == 40
    assert ActuatedJoints.HELD not in cases
    assert ActuatedJoints.FREE in cases
    assert None in cases


@pytest.mark.parametrize(
    ('amplitude', 'reason'),
    [(0.0, 'no oscillation above noise'), (2e-5, 'no oscillation above'), (4e-4, 'noise')],
)
def test_below_the_noise_nothing_is_claimed(paper_arm, amplitude, reason):
    rng = np.random.default_rng(3)
    t, q = swing(plant_of(1.1), ActuatedJoints.FREE, amplitude)
    for _ in range(20):
        estimate = estimate_of(t, q + NOISE * rng.standard_normal(q.shape), paper_arm)
        assert not estimate.is_trustworthy
        assert reason in estimate.reason


@pytest.mark.parametrize('joints', CASES)
def test_a_given_case_is_not_doubted(paper_arm, joints):
    plant, rng = plant_of(1.1), np.random.default_rng(4)
    t, q = swing(plant, joints, amplitude=2e-3)
    q = q + np.array((1e-3, 1e-5)) * rng.standard_normal(q.shape)
    assert 'noise hides' in estimate_of(t, q, paper_arm).reason
    estimate = estimate_of(t, q, paper_arm, joints)
    assert estimate.is_trustworthy
    assert estimate.case is joints
    assert estimate.stiffness == pytest.approx(plant.stiffness, abs=4 * estimate.stiffness_std)


@pytest.mark.parametrize('share', [-0.5, 0.4, 0.6, 2.0])
def test_a_joint_that_is_neither_free_nor_held_is_not_guessed(paper_arm, share):
    ratio = share * RATIO[ActuatedJoints.FREE]
    t, q = swing(plant_of(1.1), ActuatedJoints.FREE, ratio=ratio)
    estimate = estimate_of(t, q, paper_arm)
    assert not estimate.is_trustworthy
    assert estimate.case is None
    assert 'neither free nor held' in estimate.reason


def test_where_the_cases_agree_noise_does_not_matter():
    nominal = PlanarArm.reduced(inertia_star=(1.0, 1e-3), stiffness=0.1, damping=1e-3)
    t, rng = np.arange(0.0, WINDOW, 1.0 / RATE), np.random.default_rng(5)
    last = 0.02 * np.exp(-0.5 * t) * np.cos(10.0 * t)
    q = np.stack((-1e-3 * last, last), axis=-1) + 1e-3 * rng.standard_normal((t.size, 2))
    estimate = estimate_of(t, q, nominal)
    assert estimate.is_trustworthy, estimate.reason
    assert estimate.stiffness == pytest.approx(0.1, rel=0.01)


def decaying_otherwise(t):
    """Return an oscillation that friction stops: its envelope is a straight line."""
    return 0.05 * np.maximum(1.0 - t / 2.0, 0.0) * np.cos(10.0 * t)


@pytest.mark.parametrize(
    ('signal', 'reason'),
    [
        (lambda t: 0.05 * np.exp(0.1 * t) * np.cos(10.0 * t), 'grows'),
        (lambda t: 0.05 * np.exp(-0.3 * t) * np.cos(30.0 * t), 'times the nominal one'),
        (lambda t: 0.05 * np.exp(-0.3 * t) * np.cos(4.0 * t), 'fewer than 2'),
        (decaying_otherwise, 'differs regularly'),
        (lambda t: 0.0 * t, 'no oscillation'),
    ],
)
def test_what_is_no_such_oscillation_is_refused(paper_arm, signal, reason):
    t = np.arange(0.0, WINDOW, 1.0 / RATE)
    q = np.stack((np.zeros_like(t), signal(t)), axis=-1)
    estimate = estimate_of(t, q, paper_arm)
    assert not estimate.is_trustworthy
    assert reason in estimate.reason


def test_too_uncertain_values_are_refused(paper_arm):
    rng = np.random.default_rng(6)
    t, q = swing(plant_of(1.1), ActuatedJoints.HELD, amplitude=1e-3)
    few = slice(None, None, 38)
    estimates = [
        estimate_of(t[few], (q + NOISE * rng.standard_normal(q.shape))[few], paper_arm, case)
        for case in 20 * [ActuatedJoints.HELD]
    ]
    errors = [estimate.stiffness_std / estimate.stiffness for estimate in estimates]
    assert min(errors) < STIFFNESS_ERROR < max(errors)
    for estimate, error in zip(estimates, errors, strict=True):
        assert ('error of the stiffness' in estimate.reason) is (error > STIFFNESS_ERROR)


@pytest.mark.parametrize('case', CASES)
def test_an_undamped_arm_has_no_negative_damping(paper_arm, case):
    plant, rng = replace(plant_of(1.1), damping=0.0), np.random.default_rng(8)
    t, q = swing(plant, case)
    estimates = [
        estimate_of(t, q + noise * rng.standard_normal(q.shape), paper_arm)
        for noise in [0.0] + 20 * [NOISE]
    ]
    assert all(estimate.is_trustworthy for estimate in estimates)
    assert min(estimate.damping for estimate in estimates) == 0.0
    assert all(e.damping <= 4 * e.damping_std + 1e-12 for e in estimates)


def test_no_samples_give_no_estimate(paper_arm):
    fit = fit_oscillation([], [], 0.0)
    estimate = identify(np.empty(0), np.empty((0, 2)), fit, paper_arm)
    assert estimate == StiffnessEstimate(reason='no samples')


def test_what_makes_no_sense_is_refused(paper_arm):
    t, q = swing(paper_arm, ActuatedJoints.FREE)
    fit = fit_oscillation(t, q[:, -1], 0.0)
    with pytest.raises(InvalidRequest, match='positions of 2 joints'):
        identify(t, q[:, :1], fit, paper_arm)
    with pytest.raises(InvalidRequest, match='positions of 2 joints'):
        identify(t[1:], q, fit, paper_arm)
    unbalanced = replace(paper_arm, carried_mass=[1.0, 1.0], static_moment=[0.0, 1e-3])
    with pytest.raises(NotFlat):
        identify(t, q, fit, unbalanced)
    assert oscillating_inertia(paper_arm, ActuatedJoints.FREE) == pytest.approx(
        INERTIA[ActuatedJoints.FREE]
    )
