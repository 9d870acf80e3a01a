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

"""Steps as products: those of the equations of motion, whoever asks for how many of them."""

from core.conftest import ARM
from core.plant.test_simulation import any_arm
from flat_planner_ros.core.arm.planar_arm import PlanarArm
from flat_planner_ros.core.plant.effort_profile import EffortProfile
from flat_planner_ros.core.plant.simulation import SimulatedArm
from flat_planner_ros.core.plant.steps import linear_steps, runge_kutta
import numpy as np
import pytest
from random_cases import cases

STEP = 1e-3
CHAIN = PlanarArm(
    inertia=np.diag([9e-3, 6e-4, 3.3e-5]),
    static_moment=np.zeros(3),
    carried_mass=np.array([0.5, 0.2, 0.1]),
    stiffness=3e-3,
    damping=2e-5,
    gravity=9.81,
    viscous_friction=np.array([2e-4, 3e-5]),
    coulomb_friction=np.zeros(2),
)
"""Balanced throughout, so that no link pushes another and none has a weight."""


def random_profile(rng, motors, start):
    """Return a command with corners at odd times and a gap before it."""
    times = np.cumsum(rng.uniform(0.003, 0.05, 12))
    efforts = rng.normal(0.0, 3e-3, (12, motors))
    efforts[-1] = 0.0
    return EffortProfile(start=start, times=times, efforts=efforts)


@pytest.mark.parametrize('arm', [ARM, CHAIN], ids=['two joints', 'three'])
@pytest.mark.parametrize('case', range(cases(20)))
def test_products_are_runge_kutta_steps_of_the_equations(arm, case):
    rng = np.random.default_rng(case)
    origin, steps = float(rng.uniform(0.0, 100.0)), 400
    profile = random_profile(rng, arm.n - 1, origin + 0.0107)
    position = rng.normal(0.0, 0.3, arm.n)
    simulated = SimulatedArm(arm, position=position, time=origin, step=STEP)
    simulated.command(profile, origin)
    played = profile.taken_over(origin, np.zeros(arm.n - 1))

    def acceleration(time, q, dq):
        is_over = time > profile.end
        effort = np.zeros(arm.n - 1) if is_over else played.effort(time)
        return np.linalg.solve(
            arm.mass_matrix(q),
            np.append(effort, 0.0) - arm.inverse_dynamics(q, dq, np.zeros(arm.n)),
        )

    grid = [origin + 0.5 * half * STEP for half in range(2 * steps + 1)]
    q, dq = position, np.zeros(arm.n)
    for step in range(steps):
        stages = grid[2 * step : 2 * step + 3]
        q, dq = runge_kutta(acceleration, STEP, q, dq, tuple(stages))
    assert simulated.advance(origin + steps * STEP) == steps
    np.testing.assert_allclose(simulated.position, q, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(simulated.velocity, dq, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize('arm', [ARM, CHAIN], ids=['two joints', 'three'])
def test_a_motion_does_not_depend_on_how_it_is_asked_for(arm):
    rng = np.random.default_rng(5)
    profile = random_profile(rng, arm.n - 1, 0.02)
    whole, cut, sampled = (SimulatedArm(arm, step=STEP) for _ in range(3))
    for each in (whole, cut, sampled):
        each.command(profile, 0.0)
    whole.advance(0.4)
    for end in np.sort(rng.uniform(0.0, 0.4, 60)):
        cut.advance(float(end))
    cut.advance(0.4)
    states = sampled.advance_through([0.0, 0.1, 0.1, 0.25], 0.4)
    assert whole.position.tolist() == cut.position.tolist() == sampled.position.tolist()
    assert whole.velocity.tolist() == cut.velocity.tolist() == sampled.velocity.tolist()
    again = SimulatedArm(arm, step=STEP)
    again.command(profile, 0.0)
    for state in states:
        again.advance(state.time)
        for one, other in zip(state, again.state, strict=True):
            np.testing.assert_array_equal(one, other)


def test_steps_are_products_only_where_the_equations_are_linear():
    assert linear_steps(ARM, STEP) is not None
    assert linear_steps(CHAIN, STEP) is not None
    assert linear_steps(any_arm(3), STEP) is None
    dry = PlanarArm.reduced(
        inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5, coulomb_friction=[1e-4]
    )
    assert linear_steps(dry, STEP) is None


def test_rest_is_rest_to_the_last_bit():
    simulated = SimulatedArm(CHAIN, position=[0.3, -1.1, 0.0], step=STEP)
    simulated.advance(1.0)
    assert simulated.position.tolist() == [0.3, -1.1, 0.0]
    assert not simulated.velocity.any()
