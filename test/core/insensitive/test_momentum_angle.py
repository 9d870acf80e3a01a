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

"""Laws shaped by their effort: basis, response of the planned variable, by independent routes."""

from flat_planner_ros.core.arm.flat_map import flat_map, FlatModel
from flat_planner_ros.core.arm.planar_arm import PlanarArm
from flat_planner_ros.core.insensitive.momentum_angle import (
    momentum_basis,
    UNIT_COURSE,
)
from flat_planner_ros.core.insensitive.oscillator import Oscillator
from flat_planner_ros.core.insensitive.response import (
    CONTACT,
    Normalised,
    responses,
    SPLIT_TURN,
)
import numpy as np
from numpy.polynomial import legendre
import pytest
from scipy.integrate import quad, solve_ivp

ARM = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3.0e-3, damping=2.0e-5)
TURN_RATE = ARM.natural_mode().frequency / 2.0


def random_law(modes=16, seed=0):
    """Return Legendre coefficients of sigma^(4) and sigma'' of a random member of the basis."""
    basis, c = momentum_basis(modes), np.random.default_rng(seed).normal(size=modes)
    return (
        basis.start + basis.directions @ c,
        basis.second_start + basis.second_directions @ c,
        basis.least + c @ c,
    )


def response(fourth, second, duration, start=UNIT_COURSE.start):
    """Return the planned variable that follows one sigma."""
    equation = Normalised.of(Oscillator.of(ARM), duration)
    (law,) = responses(fourth[:, None], second[:, None], equation, duration, start)
    return law


@pytest.mark.parametrize('modes', [6, 16, 48])
def test_the_basis_moves_from_rest_to_rest(modes):
    fourth, second, square = random_law(modes)
    size = np.abs(second).max()
    assert legendre.legder(second, 2) == pytest.approx(fourth[: modes + 4], abs=1e-9 * size)
    sigma = legendre.legint(second, 2, lbnd=-1)
    assert legendre.legval(1.0, sigma) == pytest.approx(1.0, abs=1e-12 * size)
    for order in range(1, CONTACT + 1):
        ends = legendre.legval([-1.0, 1.0], legendre.legder(sigma, order))
        assert ends == pytest.approx(0.0, abs=1e-9 * size * modes ** (2 * order - 2))
    integral, _ = quad(lambda x: legendre.legval(x, second) ** 2, -1, 1, epsabs=0, limit=200)
    assert square == pytest.approx(integral, rel=1e-9)


@pytest.mark.parametrize('modes', [16, 40])
@pytest.mark.parametrize('share', [0.01, 0.2, 0.99, 1.01, 3.0])
def test_the_planned_variable_answers_like_an_oscillator(modes, share):
    fourth, second, _ = random_law(modes)
    duration = share * SPLIT_TURN * len(fourth) / TURN_RATE
    mapping = flat_map(ARM, FlatModel.EXACT)
    law = response(fourth, second, duration)
    half = duration / 2.0
    inner, damped, coupled = mapping.effort[2:]
    sigma = legendre.legint(second, 2, lbnd=-1)

    def rates(x, state):
        force = legendre.legval(x, sigma) - state[0] - damped / inner / half * state[1]
        return state[1], force * inner / coupled * half**2

    x = np.linspace(-1.0, 1.0, 41)
    solution = solve_ivp(rates, (-1, 1), (0, 0), 'DOP853', x, rtol=1e-11, atol=1e-13)
    jet = law.jet(half * (x + 1.0), 6)
    assert jet[0] + 0.5 == pytest.approx(solution.y[0], abs=1e-9 * np.abs(solution.y[0]).max())
    # The effort of the flat map is that of the momentum angle.
    effort = mapping.effort @ jet[:5]
    expected = inner / half**2 * legendre.legval(x, second)
    assert effort == pytest.approx(expected, abs=1e-10 * np.abs(expected).max())
    # At rest at the start.
    for order in range(6):
        start = jet[order, 0] + (0.5 if order == 0 else 0.0)
        assert abs(start) < 1e-12 * np.abs(jet[order]).max()


@pytest.mark.parametrize('share', [0.01, 0.2, 0.99, 1.01, 3.0])
def test_a_start_in_motion_answers_like_an_oscillator(share):
    fourth, second, _ = random_law()
    duration = share * SPLIT_TURN * len(fourth) / TURN_RATE
    half = duration / 2.0
    delta, epsilon = Normalised.of(Oscillator.of(ARM), duration)
    # Any place and velocity; what follows from them and from sigma at the start is the jet.
    sigma = legendre.legint(second, 2, lbnd=-1) + np.array([0.3, 0.8] + [0.0] * len(second))
    jet = np.array([0.2, 0.5, 0.0, 0.0, 0.0, 0.0])
    for order in range(4):
        value = legendre.legval(-1.0, legendre.legder(sigma, order))
        jet[order + 2] = (value - jet[order] - delta * jet[order + 1]) / epsilon
    law = response(fourth, second, duration, jet)

    def rates(x, state):
        force = legendre.legval(x, sigma) - state[0] - delta * state[1]
        return state[1], force / epsilon

    x = np.linspace(-1.0, 1.0, 41)
    solution = solve_ivp(rates, (-1, 1), jet[:2], 'DOP853', x, rtol=1e-11, atol=1e-13)
    found = law.jet(half * (x + 1.0), 5)
    assert found[0] == pytest.approx(solution.y[0], abs=1e-9 * np.abs(solution.y[0]).max())
    for order in range(6):
        miss = abs(found[order, 0] * half**order - jet[order])
        assert miss < 1e-11 * np.abs(found[order]).max() * half**order


@pytest.mark.parametrize('share', [0.2, 2.0])
def test_derivatives_are_derivatives(share):
    fourth, second, _ = random_law(8)
    duration = share * SPLIT_TURN * len(fourth) / TURN_RATE
    law = response(fourth, second, duration).transformed(2.0, 0.3)
    t, h = np.linspace(0.1, 0.9, 9) * duration, 1e-5 * duration
    jet, after, before = law.jet(t, 8), law.jet(t + h, 8), law.jet(t - h, 8)
    slope = (after - before) / (2.0 * h)
    for order in range(8):
        size = np.abs(slope[order]).max()
        assert jet[order + 1] == pytest.approx(slope[order], abs=1e-5 * size)
