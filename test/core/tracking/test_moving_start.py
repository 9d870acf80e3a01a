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

"""A swinging arm is caught by an ordinary motion."""

from math import tau

from core.conftest import ARM, ELBOW, envelope
from core.tracking.closed_loop import samples_of
from flat_planner_ros.core.arm import flat_map, JointSample
from flat_planner_ros.core.plant import EffortProfile, SimulatedArm
from flat_planner_ros.core.tracking import ArmObserver, moving_start
import numpy as np
import pytest

PERIOD = 0.005
AHEAD = 0.02
"""From the last sample to the start of the motion [s]."""

ONE_SWING = tau / ARM.natural_mode().damped_frequency


class Swinging:
    """An arm that swings by 0.3 rad, with its joint free, and what is known of it."""

    def __init__(self, true):
        """Kick it."""
        self.arm, self.random = SimulatedArm(true), np.random.default_rng(2)
        for effort, until in ((0.012, 0.16), (-0.012, 0.32), (0.0, 0.33)):
            self.arm.hold([effort])
            self.arm.advance(until)

    @property
    def amplitude(self):
        """Return the envelope of the passive joint [rad]."""
        return envelope(self.arm.arm, self.arm.position[1], self.arm.velocity[1])

    def look(self, duration=0.5):
        """Return the estimate from samples at 200 Hz with 0.1 mrad of noise."""
        observer = ArmObserver(ARM, PERIOD, 60.0)
        observer.restart(self.sample())
        end = self.arm.time + duration
        while self.arm.time < end - PERIOD / 2:
            self.arm.advance(self.arm.time + PERIOD)
            observer.correct(self.sample())
        return observer.predicted(self.arm.time)

    def sample(self):
        """Return what the sensors show."""
        angles = self.arm.position + 1e-4 * self.random.standard_normal(2)
        return JointSample(time=self.arm.time, positions=angles)

    def catch(self):
        """Bring it to rest within one swing; return the amplitude after it over that before."""
        state, before = self.look(), self.amplitude
        start = moving_start(ARM, state.positions, state.velocities, AHEAD)
        samples = samples_of(final=start.rest, duration=ONE_SWING, start_jets=start.jets)
        at = self.arm.time
        profile = EffortProfile(
            start=at + AHEAD, times=samples.times, efforts=samples.efforts[:, :1]
        )
        self.arm.command(profile, at)
        self.arm.advance(at + AHEAD + ONE_SWING)
        return self.amplitude / before


def test_a_known_arm_is_at_rest_after_one_swing():
    swinging = Swinging(ARM)
    assert swinging.amplitude > 0.3
    assert swinging.catch() < 0.01


@pytest.mark.parametrize('factor', [0.9, 1.1])
def test_an_arm_that_is_off_by_a_tenth_needs_two(factor):
    swinging = Swinging(ARM.scaled(stiffness=factor, damping=factor))
    before = swinging.amplitude
    assert before > 0.25
    assert swinging.catch() < 0.17
    swinging.catch()
    assert swinging.amplitude < 0.03 * before


def test_the_start_is_that_of_the_simulated_arm():
    """Carried forward, the first joint of three with it."""
    arm = SimulatedArm(ELBOW, step=1e-4)
    arm.hold([0.0, 0.01])
    arm.advance(0.2)
    q, dq = arm.position, arm.velocity
    state = moving_start(ELBOW, q, dq, 0.0)
    rows = flat_map(ELBOW)
    assert rows.output @ state.jets[0, : rows.output.size] == pytest.approx(q.sum())
    assert rows.deflection @ state.jets[0, : rows.deflection.size] == pytest.approx(q[2])
    np.testing.assert_allclose(state.jets[1, :3], [q[0], dq[0], 0.0], rtol=1e-12)
    arm.hold([0.0, 0.0])
    arm.advance(0.25)
    later = moving_start(ELBOW, q, dq, 0.05).jets[0]
    now = moving_start(ELBOW, arm.position, arm.velocity, 0.0).jets[0]
    np.testing.assert_allclose(later, now, rtol=1e-6)


def test_a_swing_under_servos_keeps_their_joints():
    q, dq = np.array([0.4, 0.2]), np.array([0.0, 1.0])
    start = moving_start(ARM, q, dq, 0.1, held=True)
    rows = flat_map(ARM)
    assert start.rest == pytest.approx([0.4, 0.0])
    for order in range(3):  # link n-1 stands still: theta_(n-1) and its derivatives
        jet = start.jets[0, order:]
        angle = rows.output @ jet[:2] - rows.deflection @ jet[:3]
        assert angle == pytest.approx(0.4 if order == 0 else 0.0, abs=1e-9)


def test_a_free_swing_dies_away_about_its_centre():
    """Against a long simulation."""
    arm = SimulatedArm(ARM.scaled(damping=20.0))
    arm.hold([0.012])
    arm.advance(0.05)
    arm.hold([-0.012])
    arm.advance(0.1)
    model = arm.arm
    start = moving_start(model, arm.position, arm.velocity, 0.0)
    assert abs(arm.position[1]) > 0.02
    arm.hold([0.0])
    arm.advance(6.0)
    np.testing.assert_allclose(arm.position, start.rest, atol=1e-5)
