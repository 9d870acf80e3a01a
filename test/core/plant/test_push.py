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

"""Pushes from outside: by conservation laws, and what servos and brakes do against them."""

from core.plant.test_simulation import any_arm, PAPER, vertical_arm
from flat_planner_ros.core.arm.errors import InvalidCommand
from flat_planner_ros.core.arm.planar_arm import Drive
from flat_planner_ros.core.plant.drives import DriveSettings
from flat_planner_ros.core.plant.simulation import SimulatedArm
import numpy as np
import pytest

DURATION = 0.1
"""Time for which the arm is pushed [s]."""


def pushed(arm, effort, until=0.5, **options):
    """Return an arm that was pushed from rest, some time later."""
    simulated = SimulatedArm(arm, **options)
    simulated.push(effort, DURATION)
    simulated.advance(until)
    return simulated


@pytest.mark.parametrize('n', [2, 3])
def test_a_push_gives_the_base_joint_its_angular_momentum_and_ends(n):
    """Joint 1 is free and no effort acts at it but the push: what turns with it all is kept."""
    arm = any_arm(n)
    effort = np.linspace(0.05, -0.02, n)
    for until in (0.2, 0.5):
        simulated = pushed(arm, effort, until, step=2.5e-4)
        momentum = arm.mass_matrix(simulated.position) @ simulated.velocity
        assert momentum[0] == pytest.approx(effort[0] * DURATION, rel=3e-3)  # a step more or less


def test_the_first_acceleration_is_that_of_the_equation_of_motion():
    arm, effort, step = any_arm(3), np.array([0.1, -0.2, 0.3]), 1e-6
    simulated = pushed(arm, effort, step, step=step, position=[0.1, 0.4, 0.0])
    acceleration = simulated.velocity / step
    needed = arm.inverse_dynamics(simulated.position, np.zeros(3), acceleration)
    assert needed == pytest.approx(effort, rel=1e-5)


def test_what_is_commanded_goes_on_and_a_push_does_not_show_as_effort():
    simulated, alone = SimulatedArm(PAPER), SimulatedArm(PAPER)
    simulated.push([5e-4, 1e-3], DURATION)
    for arm in (simulated, alone):
        arm.hold([1e-3])
        arm.advance(0.05)
    assert simulated.applied_effort[0] == 1e-3
    assert simulated.velocity[1] > alone.velocity[1] + 0.5


def test_a_reset_ends_a_push():
    simulated = SimulatedArm(PAPER)
    simulated.push([1e-3, 1e-3], DURATION)
    simulated.reset([0.0, 0.0])
    simulated.advance(0.05)
    assert not simulated.velocity.any()


def test_servos_hold_their_joints_and_brakes_the_arm():
    servos = pushed(PAPER, [1e-2, 1e-3], 0.05, drives=DriveSettings(drive=Drive.POSITION))
    assert abs(servos.position[0]) < 1e-9
    assert servos.position[1] > 1e-2
    braked = pushed(vertical_arm(3), [0.1, 0.1, 0.1], 0.05)
    assert not braked.velocity.any()


@pytest.mark.parametrize('effort', [[1.0], [1.0, np.nan], [1e7, 0.0]])
def test_a_push_that_does_not_suit_the_arm_is_refused(effort):
    with pytest.raises(InvalidCommand, match='push'):
        SimulatedArm(PAPER).push(effort, DURATION)
