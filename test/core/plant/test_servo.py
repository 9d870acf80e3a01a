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

"""An arm under position servos: it is where it should be, and takes what effort that needs."""

from core.conftest import ARM, ELBOW, envelope
from flat_planner_ros.core.arm.errors import InvalidCommand, InvalidModel
from flat_planner_ros.core.arm.planar_arm import Drive
from flat_planner_ros.core.motion_law.cost import Strategy
from flat_planner_ros.core.planning.planner import plan
from flat_planner_ros.core.planning.request import MotionRequest, PlanningOptions
from flat_planner_ros.core.planning.tradeoff import residual_of_plan
from flat_planner_ros.core.plant.drives import DriveSettings
from flat_planner_ros.core.plant.effort_profile import EffortProfile
from flat_planner_ros.core.plant.rollout import rollout
from flat_planner_ros.core.plant.settings import SimulationSettings
from flat_planner_ros.core.plant.simulation import SimulatedArm
import numpy as np
import pytest
from scipy.integrate import solve_ivp


def planned(arm, strategy=Strategy.INSENSITIVE):
    """Return a plan for servos over 1 s, its samples and the command of them."""
    final = np.zeros(arm.n)
    final[-2] = 2.0
    request = MotionRequest(start=np.zeros(arm.n), final=final, duration=1.0)
    result = plan(
        request,
        arm,
        PlanningOptions(strategy=strategy, drive=Drive.POSITION),
    )
    samples = result.sample(0.005)
    motors = arm.n - 1
    profile = EffortProfile(
        start=0.0,
        times=samples.times,
        efforts=np.zeros((len(samples.times), motors)),
        positions=samples.positions[:, :motors],
        velocities=samples.velocities[:, :motors],
    )
    return result, samples, profile


@pytest.mark.parametrize('arm', [ARM, ELBOW], ids=['2', '3'])
def test_an_ideal_servo_is_where_it_should_be_and_leaves_nothing(arm):
    _, samples, profile = planned(arm)
    motion = rollout(arm, profile, 1.5, drives=DriveSettings(drive=Drive.POSITION))
    every = round((len(motion.times) - 1) / 1.5 * 0.005)
    reached = motion.positions[: 201 * every : every]
    assert reached[:, :-1] == pytest.approx(samples.positions[:, :-1], abs=1e-6)
    assert reached[:, -1] == pytest.approx(samples.positions[:, -1], abs=1e-5)
    assert np.abs(motion.positions[1001:, -1]).max() < 1e-5


@pytest.mark.parametrize('factors', [(1.1, 1.1), (0.9, 0.9), (0.9, 1.1)])
@pytest.mark.parametrize('arm', [ARM, ELBOW], ids=['2', '3'])
def test_another_arm_swings_as_predicted(arm, factors):
    result, _, profile = planned(arm, Strategy.MIN_POTENTIAL_ENERGY)
    other = arm.scaled(stiffness=factors[0], damping=factors[1])
    motion = rollout(other, profile, 1.0, step=5e-4, drives=DriveSettings(drive=Drive.POSITION))
    swung = envelope(other, motion.positions[-1, -1], motion.velocities[-1, -1], held=True)
    left = residual_of_plan(result)
    assert 1e-3 < swung <= left.worst * 1.001
    if factors == (left.stiffness_factor, left.damping_factor):
        assert swung == pytest.approx(left.worst, rel=1e-3)


def test_a_servo_takes_the_effort_of_the_plan():
    _, samples, profile = planned(ARM)
    simulated = SimulatedArm(ARM, drives=DriveSettings(drive=Drive.POSITION))
    simulated.command(profile, 0.0)
    shown = []
    for time in samples.times:
        simulated.advance(time)
        shown.append(simulated.applied_effort[0])
    size = np.abs(samples.driving_effort).max()
    # At the points themselves the acceleration of the joined cubics jumps.
    assert np.array(shown[5:]) == pytest.approx(samples.driving_effort[5:], abs=0.02 * size)


@pytest.mark.parametrize('bandwidth', [2.0, 20.0])
def test_a_slow_servo_follows_as_a_critically_damped_oscillator(bandwidth):
    _, _, profile = planned(ARM)
    motion = rollout(
        ARM, profile, 2.0, drives=DriveSettings(drive=Drive.POSITION, servo_bandwidth=bandwidth)
    )
    own = 2.0 * np.pi * bandwidth

    def rates(t, state):
        goal = profile.reference(t).position[0]
        return state[1], own**2 * (goal - state[0]) - 2.0 * own * state[1]

    solution = solve_ivp(
        rates, (0.0, 2.0), (0.0, 0.0), 'DOP853', motion.times, rtol=1e-9, atol=1e-11, max_step=0.01
    )
    assert motion.positions[:, 0] == pytest.approx(solution.y[0], abs=1e-5)
    # An exact plan stays exact: what a filter does to the motion, it does to nothing, too.
    late = motion.times > 1.0 + 12.0 / own
    assert np.abs(motion.positions[late, 1]).max() < 2e-3


def test_servos_hold_an_arm_that_is_told_nothing():
    simulated = SimulatedArm(ARM, position=[0.3, 0.2], drives=DriveSettings(drive=Drive.POSITION))
    simulated.advance(0.5)
    assert simulated.position[0] == pytest.approx(0.3, abs=1e-9)
    assert simulated.velocity[0] == pytest.approx(0.0, abs=1e-9)
    mode = ARM.natural_mode(held=True)
    phase = np.exp(complex(-mode.decay_rate, mode.damped_frequency) * 0.5)
    swing = 0.2 * (phase.real + mode.decay_rate / mode.damped_frequency * phase.imag)
    assert simulated.position[1] == pytest.approx(swing, abs=1e-6)


def test_servos_take_positions_only():
    _, samples, profile = planned(ARM)
    simulated = SimulatedArm(ARM, drives=DriveSettings(drive=Drive.POSITION))
    efforts = EffortProfile(start=0.0, times=profile.times, efforts=profile.efforts)
    with pytest.raises(InvalidCommand, match='needs a command with positions'):
        simulated.command(efforts, 0.0)
    with pytest.raises(InvalidCommand, match='takes no efforts'):
        simulated.hold([0.0])


def test_a_bandwidth_needs_steps_that_resolve_it():
    with pytest.raises(InvalidModel, match='shorter steps'):
        SimulationSettings(
            arm=ARM,
            position=(0.0, 0.0),
            drives=DriveSettings(drive=Drive.POSITION, servo_bandwidth=100.0),
        )
    SimulationSettings(
        arm=ARM,
        position=(0.0, 0.0),
        step=1e-4,
        drives=DriveSettings(drive=Drive.POSITION, servo_bandwidth=100.0),
    )
