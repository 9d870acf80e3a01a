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

"""The flat map against the true dynamics, which know nothing of it."""

from flat_planner_ros.core.arm.errors import NotFlat
from flat_planner_ros.core.arm.flat_map import apply_row, flat_map, FlatModel
from flat_planner_ros.core.arm.planar_arm import PlanarArm
import numpy as np
import pytest

PAPER = FlatModel.APPROXIMATE
CASES = 60
SAMPLES = 41


def sinusoids(rng, orders, frequency):
    """Return the derivatives of a random smooth function at random times, (orders, samples)."""
    times = rng.uniform(0.0, 10.0, SAMPLES)
    rates = rng.uniform(0.1, 2.0, 4) * frequency
    amplitudes, phases = rng.normal(size=4), rng.uniform(0.0, 2.0 * np.pi, 4)
    order = np.arange(orders)[:, None, None]
    angles = rates * times[:, None] + phases + order * np.pi / 2
    return (amplitudes * rates**order * np.sin(angles)).sum(axis=-1)


def flat_arm(rng, n, damping_ratio):
    """Return a flat arm of n joints with friction-free motors under gravity."""
    both = 10.0 ** rng.uniform(-5, 1)
    last = both * rng.uniform(0.02, 0.9)
    k = 10.0 ** rng.uniform(-3, 2)
    return PlanarArm.reduced(
        inertia_star=(both, last),
        stiffness=k,
        damping=2.0 * damping_ratio * np.sqrt(k * last),
        link_length=rng.uniform(0.2, 0.5, n - 2),
        link_com=rng.uniform(0.1, 0.2, n - 2),
        link_mass=rng.uniform(0.1, 1.0, n - 2),
        link_inertia=rng.uniform(1e-3, 1e-2, n - 2),
        tip_mass=0.3,
        gravity=9.81,
    )


def motion(arm, rng, jet, model=PAPER):
    """Return q, dq, ddq of a jet of y1; the other flat outputs move at random."""
    mapping = flat_map(arm, model)
    others = [sinusoids(rng, 3, 1.0) for _ in range(arm.n - 2)]
    passive = np.array([apply_row(mapping.deflection, jet, k) for k in range(3)])
    angle = np.array([apply_row(mapping.output, jet, k) for k in range(3)])
    inner = angle - passive - sum(others, np.zeros_like(angle))
    return np.stack([*others, inner, passive], axis=-1)


@pytest.mark.parametrize('n', [2, 3, 4])
def test_an_undamped_arm_follows_the_map_exactly(n):
    """Inverse dynamics asks for the mapped effort, and for none at the passive joint."""
    rng = np.random.default_rng(n)
    checked = 0
    for _ in range(CASES):
        arm = flat_arm(rng, n, 0.0)
        frequency = np.sqrt(arm.stiffness / arm.inertia_star.last)
        jet = sinusoids(rng, 9, frequency)
        effort = arm.inverse_dynamics(*motion(arm, rng, jet))
        expected = apply_row(flat_map(arm, PAPER).effort, jet)
        scale = np.abs(effort).max()
        np.testing.assert_allclose(effort[:, -2], expected, rtol=0, atol=1e-12 * scale)
        np.testing.assert_allclose(effort[:, -1], 0.0, rtol=0, atol=1e-12 * scale)
        assert np.abs(expected).max() > 1e-9 * scale
        checked += 1
    assert checked == CASES


@pytest.mark.parametrize('n', [2, 3, 4])
def test_the_exact_map_holds_for_any_damping(n):
    """Even an overdamped spring asks for no effort at the passive joint."""
    rng = np.random.default_rng(20 + n)
    checked = 0
    for _ in range(CASES):
        arm = flat_arm(rng, n, 10.0 ** rng.uniform(-2.0, 0.5))
        frequency = np.sqrt(arm.stiffness / arm.inertia_star.last)
        jet = sinusoids(rng, 9, frequency)
        effort = arm.inverse_dynamics(*motion(arm, rng, jet, FlatModel.EXACT))
        expected = apply_row(flat_map(arm, FlatModel.EXACT).effort, jet)
        terms = np.abs(arm.passive_effort(*motion(arm, rng, jet, FlatModel.EXACT)[:2, :, -1]))
        scale = np.abs(effort).max() + terms.max()
        np.testing.assert_allclose(effort[:, -2], expected, rtol=0, atol=1e-12 * scale)
        np.testing.assert_allclose(effort[:, -1], 0.0, rtol=0, atol=1e-12 * scale)
        assert np.abs(expected).max() > 1e-9 * scale
        checked += 1
    assert checked == CASES


def test_both_maps_are_one_without_damping(paper_arm):
    arm = paper_arm.scaled(damping=0.0)
    approximate, exact = (flat_map(arm, model) for model in FlatModel)
    jet = np.random.default_rng(1).normal(size=(7, 5))
    for row in ('output', 'deflection', 'effort'):
        assert apply_row(getattr(approximate, row), jet) == pytest.approx(
            apply_row(getattr(exact, row), jet), rel=1e-15
        )


@pytest.mark.parametrize('n', [2, 3])
def test_damping_leaves_an_error_of_second_order(n):
    """Only the passive joint misses its balance, by c (I_n c / k^2) y^(4): half c, a quarter."""
    rng = np.random.default_rng(10 + n)
    checked = 0
    for _ in range(CASES):
        ratio = rng.uniform(0.01, 0.2)
        damped = flat_arm(rng, n, ratio)
        frequency = np.sqrt(damped.stiffness / damped.inertia_star.last)
        jet = sinusoids(rng, 9, frequency)
        residuals = []
        for arm in (damped, damped.scaled(damping=0.5)):
            effort = arm.inverse_dynamics(*motion(arm, np.random.default_rng(0), jet))
            scale = np.abs(effort).max()
            expected = apply_row(flat_map(arm, PAPER).effort, jet)
            np.testing.assert_allclose(effort[:, -2], expected, rtol=0, atol=1e-12 * scale)
            residuals.append(effort[:, -1])
        full, half = residuals
        spring = damped.inertia_star.last * np.abs(jet[2]).max()
        np.testing.assert_allclose(full, 4.0 * half, rtol=0, atol=1e-11 * spring)
        assert 1e-5 < np.abs(full).max() / spring < 100.0 * ratio**2
        checked += 1
    assert checked == CASES


def test_rows_have_the_papers_entries(paper_arm):
    """eq:qn and eq:tau on the paper's numbers."""
    i1, i2, k, c = 6.4e-4, 3.3e-5, 3e-3, 2e-5
    mapping = flat_map(paper_arm, PAPER)
    np.testing.assert_array_equal(mapping.output, [1.0])
    np.testing.assert_allclose(mapping.deflection, [0, 0, -i2 / k, i2 * c / k**2], rtol=1e-14)
    effort = [0, 0, i1, 0, i2 * (i1 - i2) / k, -i2 * (i1 - i2) * c / k**2]
    np.testing.assert_allclose(mapping.effort, effort, rtol=1e-14)


def test_apply_row_differentiates():
    """The order-th derivative of a row's quantity is the finite difference of the one before."""
    row, step = np.array([0.3, -1.2, 0.0, 2.0]), 1e-4
    rates = np.array([0.7, 1.3])

    def quantity(t, order):
        orders = np.arange(8)[:, None, None]
        jet = (rates**orders * np.cos(rates * t[:, None] + orders * np.pi / 2)).sum(axis=-1)
        return apply_row(row, jet, order)

    times = np.linspace(-2.0, 2.0, 9)
    for order in range(1, 5):
        after, before = quantity(times + step, order - 1), quantity(times - step, order - 1)
        slope = (after - before) / (2.0 * step)
        np.testing.assert_allclose(quantity(times, order), slope, rtol=0, atol=1e-6)


def test_rows_are_locked(paper_arm):
    mapping = flat_map(paper_arm, PAPER)
    for row in (mapping.output, mapping.deflection, mapping.effort):
        with pytest.raises(ValueError, match='read-only'):
            row[0] = 5.0


@pytest.mark.parametrize('excess', [0.0, 1e-3])
def test_refuses_an_unbalanced_arm(excess):
    """With the counterbalances of the definition there is a map, with a little more none."""
    links = {
        'link_length': (0.3, 0.2),
        'link_com': (0.1, 0.08),
        'link_mass': (0.2, 0.1),
        'link_inertia': (1e-3, 4e-4),
        'stiffness': 0.1,
        'damping': 0.0,
    }
    last = 0.1 * 0.08 / 0.16
    inner = (0.2 * 0.1 + (0.1 + 0.16) * 0.3) / 0.8
    arm = PlanarArm.from_links(
        **links, counterbalance_mass=(0.8, 0.16), counterbalance_arm=(inner, last + excess)
    )
    if excess == 0.0:
        assert flat_map(arm, PAPER).output == 1.0
        return
    with pytest.raises(NotFlat) as caught:
        flat_map(arm)
    assert caught.value.link == 2
    assert caught.value.static_moment == pytest.approx(-0.16 * excess)
