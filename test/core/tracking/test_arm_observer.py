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

"""The estimate against the simulated arm."""

from dataclasses import replace

from core.conftest import ARM, ELBOW
from flat_planner_ros.core.arm import JointSample
from flat_planner_ros.core.plant import SimulatedArm
from flat_planner_ros.core.tracking import ArmObserver
import numpy as np
import pytest

PERIOD = 0.002


def observed(arm, *, efforts, late=0.0, periods=(1,), true=None):
    """Return observer and arm after a second of efforts, sampled at multiples of the period."""
    observer = ArmObserver(arm, PERIOD, 60.0)
    simulated = SimulatedArm(true or arm, step=PERIOD / 2)
    observer.restart(JointSample(time=0.0, positions=np.zeros(arm.n)))
    simulated.hold(np.zeros(arm.n - 1))
    k = 0
    while simulated.time < 1.0:
        wanted = efforts(simulated.time)
        observer.note_efforts(simulated.time + late, wanted)
        simulated.advance(simulated.time + late)
        simulated.hold(wanted)
        simulated.advance(simulated.time - late + PERIOD * periods[k % len(periods)])
        k += 1
        observer.correct(JointSample(time=simulated.time, positions=simulated.position))
    return observer, simulated


def wave(motors):
    """Return efforts that swing the arm."""
    return lambda time: 0.008 * np.sin(9.0 * time + np.arange(motors))


@pytest.mark.parametrize('late', [0.0, PERIOD / 2])
@pytest.mark.parametrize('periods', [(1,), (1, 2, 1, 5)], ids=['even', 'uneven'])
def test_a_known_arm_is_known_exactly(late, periods):
    """No lag: late efforts and uneven samples are all in the model."""
    observer, arm = observed(ARM, efforts=wave(1), late=late, periods=periods)
    estimate = observer.predicted(arm.time)
    assert np.abs(arm.velocity).max() > 0.5
    np.testing.assert_allclose(estimate.positions, arm.position, atol=1e-8)
    np.testing.assert_allclose(estimate.velocities, arm.velocity, atol=1e-6)


def test_joints_before_the_last_two_are_known_nearly():
    """Their accelerations are taken for constant over a period."""
    observer, arm = observed(ELBOW, efforts=wave(2))
    estimate = observer.predicted(arm.time)
    np.testing.assert_allclose(estimate.positions, arm.position, atol=1e-4)
    np.testing.assert_allclose(estimate.velocities, arm.velocity, atol=5e-3)


def test_an_unknown_effort_is_found_and_leaves_no_offset():
    unknown = 1.5e-3
    observer, arm = observed(ARM, efforts=lambda _: np.zeros(1))
    for _ in range(500):
        observer.note_efforts(arm.time, np.zeros(1))
        arm.hold([unknown])
        arm.advance(arm.time + PERIOD)
        observer.correct(JointSample(time=arm.time, positions=arm.position))
    estimate = observer.predicted(arm.time)
    assert estimate.links[4, 0] == pytest.approx(unknown, rel=1e-6)
    np.testing.assert_allclose(estimate.velocities, arm.velocity, atol=1e-6)


def test_known_friction_is_no_disturbance():
    arm = replace(ARM, viscous_friction=[2e-4], coulomb_friction=[0.0])
    known, _ = observed(arm, efforts=wave(1))
    unknown, _ = observed(ARM, efforts=wave(1), true=arm)
    d_known, d_unknown = (o.predicted(1.0).links[4, 0] for o in (known, unknown))
    assert abs(d_known) < 0.1 * abs(d_unknown)


def test_the_future_is_that_of_the_arm():
    observer, arm = observed(ARM, efforts=wave(1))
    observer.note_efforts(arm.time, np.zeros(1))
    observer.note_efforts(arm.time + 0.05, np.array([0.005]))
    start = arm.time
    arm.hold([0.0])
    arm.advance(start + 0.05)
    arm.hold([0.005])
    arm.advance(start + 0.12)
    estimate = observer.predicted(start + 0.12)
    np.testing.assert_allclose(estimate.positions, arm.position, atol=1e-6)
    np.testing.assert_allclose(estimate.velocities, arm.velocity, atol=1e-5)
