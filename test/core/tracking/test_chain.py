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

"""Chains against the arm's own dynamics."""

from core.conftest import ARM, ELBOW
from flat_planner_ros.core.arm import flat_map
from flat_planner_ros.core.tracking.chain import last_links, linearised_joint
import numpy as np
import pytest
from scipy.integrate import solve_ivp


@pytest.mark.parametrize('arm', [ARM, ELBOW], ids=['two', 'three'])
def test_rows_are_those_of_the_arm_in_any_pose(arm):
    chain, random = last_links(arm), np.random.default_rng(3)
    for _ in range(5):
        q, dq = random.normal(size=(2, arm.n))
        effort = random.normal(size=arm.n - 1) * 0.01
        ddq = arm.forward_dynamics(q, dq, effort)
        state = np.array([q[:-1].sum(), q[-1], dq[:-1].sum(), dq[-1]])
        rates = chain.dynamics @ state + chain.input_effect * effort[-1]
        expected = [*state[2:], ddq[:-1].sum(), ddq[-1]]
        np.testing.assert_allclose(rates, expected, rtol=1e-9, atol=1e-9)


def test_held_rows_are_a_spring_on_a_moving_base():
    chain = last_links(ARM, held=True)
    state, acceleration = np.array([0.3, 0.2, -1.0, 0.7]), 5.0
    _, last = ARM.inertia_star
    spring = ARM.passive_effort(0.2, 0.7) / last - acceleration
    rates = chain.dynamics @ state + chain.input_effect * acceleration
    np.testing.assert_allclose(rates, [-1.0, 0.7, acceleration, spring], rtol=1e-12)


def test_a_step_is_the_solution_of_the_differential_equation():
    chain, time, effort = last_links(ARM), 0.3, 0.004
    start = np.array([0.1, 0.2, 0.5, -1.0])
    disturbance = 1e-3

    def rate(_, state):
        return chain.dynamics @ state + chain.input_effect * (effort + disturbance)

    end = solve_ivp(rate, (0.0, time), start, rtol=1e-10, atol=1e-12).y[:, -1]
    flow, effect = chain.over(time)
    found = flow @ np.append(start, disturbance) + effect * effort
    np.testing.assert_allclose(found, [*end, disturbance], rtol=1e-7)


def test_jets_are_the_flat_output_of_the_free_arm():
    """Each derivative against a difference of the one before, and all against the flat map."""
    chain, state, h = last_links(ARM), np.array([0.1, 0.2, 0.5, -1.0]), 1e-4
    forward, back = (chain.over(step)[0][:4, :4] @ state for step in (h, -h))
    jet, rows = chain.jet(state, 6), flat_map(ARM)
    slope = (chain.jet(forward, 6) - chain.jet(back, 6)) / (2 * h)
    np.testing.assert_allclose(jet[1:], slope[:-1], rtol=1e-5)
    assert rows.deflection @ jet[: rows.deflection.size] == pytest.approx(0.2)
    assert rows.output @ jet[: rows.output.size] == pytest.approx(0.3)
    assert rows.effort @ jet[: rows.effort.size] == pytest.approx(0.0, abs=1e-12)


def test_a_linearised_joint_is_a_double_integrator():
    flow, effect = linearised_joint(2.0).over(0.5)
    np.testing.assert_allclose(effect, [0.0625, 0.25, 0.0], atol=1e-15)
    np.testing.assert_allclose(flow @ [1.0, 2.0, 4.0], [2.25, 3.0, 4.0], rtol=1e-14)
