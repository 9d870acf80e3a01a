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

"""Many arms at once: what they do is what the plant integrates for each of them."""

from flat_planner_ros.core.arm import ArmStack, Drive, InvalidModel, PlanarArm
from flat_planner_ros.core.plant import (
    CommandTable,
    DriveSettings,
    EffortProfile,
    exact_ends,
    integrated_ends,
    SimulatedArm,
    States,
)
import numpy as np
import pytest

LINK = {'link_length': [0.2], 'link_com': [0.1], 'link_mass': [0.3], 'link_inertia': [1e-3]}


def random_arms(rng, count, **more):
    """Return arms that swing a few times per second."""
    return [
        PlanarArm.reduced(
            inertia_star=(6.4e-4, rng.uniform(3e-5, 2e-4)),
            stiffness=rng.uniform(2e-3, 4e-3),
            damping=rng.uniform(0.0, 1e-4),
            **more,
        )
        for _ in range(count)
    ]


def random_commands(rng, count, motors=1):
    """Return smooth commands of different lengths that end at rest and without effort."""
    intervals = rng.integers(20, 60, count)
    spacing = rng.uniform(0.004, 0.01, count)
    points = int(intervals.max()) + 1
    efforts, positions, velocities = np.zeros((3, count, points, motors))
    for row, (n, step) in enumerate(zip(intervals, spacing, strict=True)):
        x = np.arange(n + 1.0) / n
        for motor in range(motors):
            # Without an effort at the end, exactly.
            efforts[row, :n, motor] = 0.02 * rng.normal() * (np.sin(np.pi * x) ** 2 * x)[:-1]
            positions[row, : n + 1, motor] = 6.0 * x**5 - 15.0 * x**4 + 10.0 * x**3
            velocities[row, : n + 1, motor] = 30.0 * (x**4 - 2.0 * x**3 + x**2) / (n * step)
    return CommandTable(
        spacing=spacing,
        intervals=intervals,
        efforts=efforts,
        positions=positions,
        velocities=velocities,
    )


def played(arm, commands, row, step, **drives):
    """Return position and velocity at the end of a command that the plant integrates."""
    spacing, n = commands.spacing[row], commands.intervals[row]
    profile = EffortProfile(
        start=0.0,
        times=spacing * np.arange(n + 1.0),
        efforts=commands.efforts[row, : n + 1],
        positions=commands.positions[row, : n + 1],
        velocities=commands.velocities[row, : n + 1],
    )
    fine = spacing / np.ceil(spacing / step)
    simulated = SimulatedArm(arm, step=fine, drives=DriveSettings(**drives))
    simulated.command(profile, 0.0)
    simulated.advance(profile.end + 1e-3 * fine)
    return simulated.position, simulated.velocity


@pytest.mark.parametrize(
    ('drive', 'bandwidth', 'tolerance'),
    [(Drive.EFFORT, 0.0, 1e-8), (Drive.POSITION, 20.0, 1e-6), (Drive.POSITION, 0.0, 1e-3)],
)
def test_exact_steps_are_what_the_plant_integrates(drive, bandwidth, tolerance):
    rng = np.random.default_rng(24)
    arms, commands = random_arms(rng, 6, viscous_friction=[2e-5]), random_commands(rng, 6)
    rest = States(np.zeros((6, 2)), np.zeros((6, 2)))
    ends = exact_ends(ArmStack.of(arms), commands, rest, drive=drive, bandwidth=bandwidth)
    for row, arm in enumerate(arms):
        found = played(arm, commands, row, 5e-4, drive=drive, servo_bandwidth=bandwidth)
        assert ends.positions[row] == pytest.approx(found[0], abs=tolerance)
        assert ends.velocities[row] == pytest.approx(found[1], abs=tolerance)
    assert np.abs(ends.velocities[:, 1]).min() > 1e-3  # they do swing


@pytest.mark.parametrize(
    ('saturation', 'gravity'), [(None, 0.0), ((0.004, 0.004), 0.0), (None, 9.81)]
)
def test_longer_arms_go_side_by_side_as_they_go_alone(saturation, gravity):
    rng = np.random.default_rng(25)
    more = {**LINK, 'coulomb_friction': [1e-3, 1e-4], 'gravity': gravity}
    arms, commands = random_arms(rng, 4, **more), random_commands(rng, 4, motors=2)
    rest = States(np.zeros((4, 3)), np.zeros((4, 3)))
    limit = None if saturation is None else np.array(saturation)
    ends = integrated_ends(ArmStack.of(arms), commands, rest, step=1e-3, saturation=limit)
    for row, arm in enumerate(arms):
        step = commands.spacing[row] / np.ceil(commands.spacing.max() / 1e-3)
        found = played(arm, commands, row, step * (1.0 + 1e-9), saturation=saturation)
        assert ends.positions[row] == pytest.approx(found[0], rel=1e-9, abs=1e-12)
        # Behind its command, by rounding, the plant carries the weight where it is.
        if gravity == 0.0:
            assert ends.velocities[row] == pytest.approx(found[1], rel=1e-9, abs=1e-11)


def test_the_swing_is_that_of_the_free_arm():
    rng = np.random.default_rng(26)
    arms = random_arms(rng, 3)
    q, dq = rng.normal(size=(2, 3, 2))
    for held in (False, True):
        found = ArmStack.of(arms).swing(q, dq, held=held)
        for row, arm in enumerate(arms):
            mode = arm.natural_mode(held=held)
            rate = (dq[row, 1] + mode.decay_rate * q[row, 1]) / mode.damped_frequency
            assert found[row] == pytest.approx(np.hypot(q[row, 1], rate), rel=1e-12)


def test_exact_steps_are_refused_where_the_arm_is_not_linear():
    rng = np.random.default_rng(27)
    arms = ArmStack.of(random_arms(rng, 2, coulomb_friction=[1e-4]))
    rest = States(np.zeros((2, 2)), np.zeros((2, 2)))
    with pytest.raises(InvalidModel, match='Coulomb friction'):
        exact_ends(arms, random_commands(rng, 2), rest)
