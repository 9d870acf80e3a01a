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

"""Four joints in a vertical plane: planned, then simulated by the full dynamics."""

from core.conftest import envelope
from flat_planner_ros.core.arm.counterbalance import displaced_com
from flat_planner_ros.core.arm.planar_arm import PlanarArm
from flat_planner_ros.core.motion_law.cost import Strategy
from flat_planner_ros.core.planning.planner import plan
from flat_planner_ros.core.planning.request import MotionRequest, PlanningOptions
from flat_planner_ros.core.plant.drives import DriveSettings
from flat_planner_ros.core.plant.effort_profile import EffortProfile
from flat_planner_ros.core.plant.rollout import rollout
import numpy as np
import pytest

LINKS = {
    'link_length': [0.30, 0.25, 0.25, 0.20],
    'link_com': [0.256, 0.211, 0.173, 0.1],
    'link_mass': [0.846, 0.655, 0.155, 0.06],
    'link_inertia': [6.14e-3, 3.47e-3, 1.08e-3, 2.0e-4],
    'counterbalance_mass': [0.71815, 0.12],
    'counterbalance_arm': [0.1, 0.05],
}
START, FINAL = np.array([0.4, 0.5, -0.3, 0.0]), np.array([1.6, -0.6, 0.5, 0.0])
DURATION = 1.5
PERIOD = 5e-3
"""Spacing of the command's points [s], as the planner node has it."""

HELD = DriveSettings(feedback_p=(50.0, 50.0, 0.0), feedback_d=(5.0, 5.0, 0.0))
"""Feedback on the joints that carry weight, none on joint n-1."""


def arm_with(imbalance=(0.0, 0.0), **changes):
    """Return the arm, its balance lost by some static moments."""
    links = {**LINKS, 'link_com': displaced_com(LINKS['link_com'], LINKS['link_mass'], imbalance)}
    return PlanarArm.from_links(
        **links, **{'stiffness': 0.25, 'damping': 3.3e-4, 'gravity': 9.81, **changes}
    )


def played(plant, strategy=Strategy.MIN_CONTROL_EFFORT, nominal=None, after=1.0, **feedback):
    """Return the motion of a plant that plays a plan for the nominal arm."""
    options = PlanningOptions(strategy=strategy, r=60.0, compensate_friction=True)
    request = MotionRequest(start=START, final=FINAL, duration=DURATION)
    samples = plan(request, nominal or arm_with(), options).sample(PERIOD)
    profile = EffortProfile(
        start=0.0,
        times=samples.times,
        efforts=samples.efforts[:, :-1],
        positions=samples.positions[:, :-1],
        velocities=samples.velocities[:, :-1],
    )
    return rollout(plant, profile, DURATION + after, position=START, **feedback)


def left(states):
    """Return the amplitude of the elastic joint at the end, and all joints' deviations then."""
    index = int(np.argmin(np.abs(states.times - DURATION)))
    angles, rates = states.positions[index], states.velocities[index]
    return envelope(arm_with(), angles[-1], rates[-1]), np.abs(angles - FINAL)


@pytest.mark.parametrize('strategy', [Strategy.POLYNOMIAL, Strategy.MIN_CONTROL_EFFORT])
def test_a_motion_against_gravity_ends_at_rest(strategy):
    states = played(arm_with(), strategy, drives=HELD)
    amplitude, deviation = left(states)
    assert amplitude < 1e-6
    assert (deviation < 1e-5).all()
    np.testing.assert_allclose(states.positions[-1], FINAL, rtol=0, atol=1e-6)


def test_without_feedback_the_arm_falls_but_its_spring_does_not_notice():
    """The balanced links see neither gravity nor the joints before them."""
    amplitude, deviation = left(played(arm_with()))
    assert deviation[0] > 0.1
    assert amplitude < 1e-6


def test_feedback_at_joint_n_1_brings_the_others_errors_into_the_spring():
    whole = DriveSettings(feedback_p=(50.0, 50.0, 50.0), feedback_d=(5.0, 5.0, 5.0))
    amplitude, _ = left(played(arm_with(), drives=whole))
    without, _ = left(played(arm_with(), drives=HELD))
    assert amplitude > 100.0 * without


def test_friction_is_compensated_and_a_motion_still_ends_at_rest():
    friction = {'viscous_friction': [0.2, 0.1, 2e-3], 'coulomb_friction': [0.3, 0.2, 3e-3]}
    arm = arm_with(**friction)
    amplitude, deviation = left(played(arm, nominal=arm, drives=HELD))
    unaware, _ = left(played(arm, drives=HELD))
    assert amplitude < 1e-5 < 1e-4 < unaware
    # Coulomb friction has changed within a point of the command.
    assert (deviation < 2e-4).all()


@pytest.mark.parametrize('link', [0, 1])
def test_a_small_imbalance_leaves_a_small_residual(link):
    """Ten times the imbalance, ten times the residual; a thousandth of a balanced moment hurts."""
    residuals = []
    for size in (1e-6, 1e-5):
        imbalance = np.zeros(2)
        imbalance[link] = size
        residuals.append(left(played(arm_with(imbalance), after=0.0, drives=HELD))[0])
    assert residuals[1] == pytest.approx(10.0 * residuals[0], rel=0.05)
    assert 1e-5 < residuals[1] < 1e-2
