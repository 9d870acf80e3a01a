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

"""Predicted residual: against the simulated arm, and its largest value on the box's boundary."""

from core.conftest import ARM, ELBOW, envelope
from flat_planner_ros.core.arm.errors import InvalidRequest
from flat_planner_ros.core.arm.planar_arm import PlanarArm
from flat_planner_ros.core.insensitive.insensitivity import UncertaintyBox
from flat_planner_ros.core.insensitive.oscillator import Oscillator
from flat_planner_ros.core.insensitive.residual import (
    predict_residual,
    residual_amplitude,
)
from flat_planner_ros.core.plant.effort_profile import EffortProfile
from flat_planner_ros.core.plant.rollout import rollout
import numpy as np
import pytest

FACTORS = [(1.0, 1.0), (1.1, 1.1), (0.9, 0.9), (1.1, 0.9), (0.5, 1.8), (1.7, 0.0)]


def bump(duration, points=101):
    """Return times and an effort that is zero at both ends and nothing that a planner would do."""
    times = np.linspace(0.0, duration, points)
    x = 2.0 * times / duration - 1.0
    effort = 0.01 * (1.0 - x**2) ** 2 * (np.sin(4.0 * x) + 0.3 * np.cos(9.0 * x))
    effort[0] = effort[-1] = 0.0
    return times, effort


def simulated_amplitude(arm, times, effort, *, position=None, motors=1):
    """Return the envelope of the passive joint at the end, from the simulated arm."""
    efforts = np.zeros((len(times), motors))
    efforts[:, -1] = effort
    step = (times[1] - times[0]) / 8.0
    profile = EffortProfile(start=0.0, times=times, efforts=efforts)
    motion = rollout(arm, profile, times[-1], step=step, position=position)
    assert motion.times[-1] == pytest.approx(times[-1], abs=1e-9)
    return envelope(arm, motion.positions[-1, -1], motion.velocities[-1, -1])


@pytest.mark.parametrize('factors', FACTORS)
@pytest.mark.parametrize('duration', [0.4, 1.0, 3.0])
def test_the_prediction_is_what_the_simulated_arm_does(factors, duration):
    times, effort = bump(duration)
    oscillator = Oscillator.of(ARM)
    poles = oscillator.poles(np.array([factors]))
    (predicted,) = residual_amplitude(oscillator, effort, duration, poles)
    other = ARM.scaled(stiffness=factors[0], damping=factors[1])
    assert predicted == pytest.approx(simulated_amplitude(other, times, effort), rel=1e-6)


def test_the_passive_joint_may_swing_at_the_start():
    times, effort = bump(1.0)
    effort[0] = 0.004
    oscillator = Oscillator.of(ARM)
    poles = oscillator.poles(np.array([[1.1, 0.8]]))
    (predicted,) = residual_amplitude(oscillator, effort, 1.0, poles, (0.2, 0.0))
    other = ARM.scaled(stiffness=1.1, damping=0.8)
    simulated = simulated_amplitude(other, times, effort, position=[0.0, 0.2])
    assert predicted == pytest.approx(simulated, rel=1e-6)


def test_links_before_the_last_two_do_not_matter():
    times, effort = bump(1.0)
    oscillator = Oscillator.of(ELBOW)
    poles = oscillator.poles(np.array([[0.9, 1.1]]))
    (predicted,) = residual_amplitude(oscillator, effort, 1.0, poles)
    other = ELBOW.scaled(stiffness=0.9, damping=1.1)
    assert predicted == pytest.approx(
        simulated_amplitude(other, times, effort, motors=2), rel=1e-6
    )


@pytest.mark.parametrize('duration', [0.5, 1.0, 4.0])
@pytest.mark.parametrize(
    'box', [UncertaintyBox(), UncertaintyBox(stiffness=0.4, damping=0.8)], ids=['10 %', 'wide']
)
def test_the_worst_of_the_box_is_on_its_boundary(duration, box):
    _, effort = bump(duration)
    oscillator = Oscillator.of(ARM)
    k, c = np.meshgrid(
        1.0 + box.stiffness * np.linspace(-1.0, 1.0, 201),
        1.0 + box.damping * np.linspace(-1.0, 1.0, 21),
    )
    poles = oscillator.poles(np.column_stack([k.ravel(), c.ravel()]))
    everywhere = residual_amplitude(oscillator, effort, duration, poles)
    predicted = predict_residual(ARM, effort, duration, box)
    assert predicted.worst == pytest.approx(everywhere.max(), rel=1e-3)
    assert predicted.worst >= everywhere.max() * (1.0 - 1e-4)


def test_the_place_of_the_worst_is_named():
    _, effort = bump(1.0)
    predicted = predict_residual(ARM, effort, 1.0, UncertaintyBox(stiffness=0.2))
    oscillator = Oscillator.of(ARM)
    place = np.array([[predicted.stiffness_factor, predicted.damping_factor], [1.0, 1.0]])
    worst, nominal = residual_amplitude(oscillator, effort, 1.0, oscillator.poles(place))
    assert worst == pytest.approx(predicted.worst, rel=1e-4)
    assert nominal == pytest.approx(predicted.nominal, rel=1e-12)


def test_predictions_in_turn_do_not_mix():
    """What is remembered of one arm, box, duration or number of samples serves no other."""
    soft = ARM.scaled(stiffness=0.7, damping=1.0)
    box, wide = UncertaintyBox(), UncertaintyBox(stiffness=0.3)
    cases = [
        (ARM, box, 1.0, 101),
        (soft, box, 1.0, 101),
        (ARM, wide, 1.0, 101),
        (ARM, box, 1.5, 101),
        (ARM, box, 1.0, 140),
    ]
    for arm, around, duration, points in [*cases, *reversed(cases)]:
        _, effort = bump(duration, points)
        found = predict_residual(arm, effort, duration, around)
        oscillator = Oscillator.of(arm)
        factors = np.concatenate([np.ones((1, 3)), *oscillator.edges(around, duration)])
        poles = oscillator.poles(factors)
        nominal, *others = residual_amplitude(oscillator, effort, duration, poles)
        assert found.nominal == pytest.approx(nominal, rel=1e-12)
        assert max(others) <= found.worst * (1.0 + 1e-12)
        assert found.worst == pytest.approx(max(others), rel=2e-3)


def test_a_box_without_size_is_the_nominal_arm():
    _, effort = bump(1.0)
    predicted = predict_residual(ARM, effort, 1.0, UncertaintyBox(stiffness=0.0, damping=0.0))
    assert predicted.worst == predicted.nominal


def test_nothing_is_predicted_for_an_arm_that_does_not_oscillate():
    stiff = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3.0e-3, damping=6.2e-4)
    with pytest.raises(InvalidRequest, match='does not oscillate'):
        predict_residual(stiff, bump(1.0)[1], 1.0, UncertaintyBox())


@pytest.mark.parametrize('width', [-0.1, 0.95, np.nan])
def test_a_box_stays_within_arms(width):
    with pytest.raises(InvalidRequest, match='half-width'):
        UncertaintyBox(stiffness=width)
