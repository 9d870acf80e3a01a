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

"""Quadratic costs against the paper's equations, the calculus of variations and bad input."""

import re

from flat_planner_ros.core.arm.errors import InvalidCost
from flat_planner_ros.core.arm.flat_map import flat_map, FlatModel
from flat_planner_ros.core.arm.planar_arm import PlanarArm
from flat_planner_ros.core.motion_law.cost import (
    QuadraticCost,
    Strategy,
    strategy_cost,
)
import numpy as np
from numpy.polynomial import Polynomial
import pytest

CASES = 200


def random_matrix(rng, rank=6):
    """Return a positive-semidefinite Q with Q66 = 1 and no zero entry."""
    rows = rng.normal(size=(rank, 6))
    matrix = rows.T @ rows
    return matrix / matrix[5, 5]


def indexed(matrix):
    """Return Q_ij of the paper's indices, which count from 1."""
    return lambda i, j: matrix[i - 1, j - 1]


def sample_arm(rng):
    """Return an arm of random size with its constants I1, I2, k, c."""
    both = 10.0 ** rng.uniform(-5, 1)
    last = both * rng.uniform(0.05, 0.9)
    k, c = 10.0 ** rng.uniform(-3, 2), 10.0 ** rng.uniform(-6, -1)
    arm = PlanarArm.reduced(inertia_star=(both, last), stiffness=k, damping=c)
    return arm, (both, last, k, c)


def test_characteristic_is_the_papers_equation():
    rng = np.random.default_rng(1)
    checked = 0
    for _ in range(CASES):
        matrix = random_matrix(rng, rng.integers(1, 7))
        q = indexed(matrix)
        expected = [  # eq:ode, from y^(2) to y^(12)
            -q(1, 1),
            q(2, 2) - 2 * q(3, 1),
            -(q(3, 3) + 2 * q(5, 1) - 2 * q(4, 2)),
            q(4, 4) - 2 * q(5, 3) + 2 * q(6, 2),
            -(q(5, 5) - 2 * q(6, 4)),
            1.0,
        ]
        found = QuadraticCost(matrix=matrix).characteristic()
        assert found.shape == (7,)
        assert found[0] == 0.0
        np.testing.assert_allclose(found[1:], expected, rtol=0, atol=1e-14 * np.abs(matrix).max())
        checked += 1
    assert checked == CASES


def test_characteristic_is_the_euler_lagrange_operator_on_exponentials():
    """On exp(b t): sum_k (-d/dt)^k dL/dy^(k), with L = Y^T Q Y / 2 differentiated by hand."""
    rng = np.random.default_rng(2)
    for _ in range(CASES):
        matrix = random_matrix(rng)
        b = complex(*rng.normal(size=2))
        orders = np.arange(1, 7)
        derivative = matrix @ b**orders
        expected = np.sum((-b) ** orders * derivative)
        found = np.polyval(QuadraticCost(matrix=matrix).characteristic()[::-1], b**2)
        scale = np.abs(b**orders) @ np.abs(matrix) @ np.abs(b**orders)
        assert abs(found - expected) <= 1e-13 * scale


def test_characteristic_is_the_first_variation():
    """The cost's slope along an admissible change eta is 2 * integral of eta sum a_k y^(2k)."""
    rng = np.random.default_rng(3)
    bump = Polynomial([1.0, 0.0, -1.0]) ** 6
    for _ in range(20):
        matrix = random_matrix(rng)
        law, change = Polynomial(rng.normal(size=16)), bump * Polynomial(rng.normal(size=3))
        slope = sum(
            matrix[i, j] * integral(law.deriv(i + 1) * change.deriv(j + 1))
            for i in range(6)
            for j in range(6)
        )
        a = QuadraticCost(matrix=matrix).characteristic()
        equation = sum(a[k] * law.deriv(2 * k) for k in range(1, 7))
        scale = sum(
            abs(matrix[i, j] * integral(law.deriv(i + 1) * change.deriv(j + 1)))
            for i in range(6)
            for j in range(6)
        )
        assert abs(integral(change * equation) - slope) <= 1e-11 * scale
        assert abs(slope) > 1e-6 * scale


def integral(polynomial):
    """Return the integral from -1 to 1."""
    antiderivative = polynomial.integ()
    return antiderivative(1.0) - antiderivative(-1.0)


def test_odd_index_sums_cancel():
    """Q_ij with i + j odd integrate to boundary terms; those with an even sum do not."""
    rng = np.random.default_rng(4)
    matrix = random_matrix(rng)
    plain = QuadraticCost(matrix=matrix).characteristic()
    i, j = np.indices((6, 6))
    even_only = QuadraticCost(matrix=np.where((i + j) % 2 == 0, matrix, 0.0)).characteristic()
    np.testing.assert_array_equal(plain, even_only)
    for row in range(6):
        for column in range(row + 2, 6, 2):
            changed = matrix.copy()
            changed[row, column] = changed[column, row] = 0.0
            changed += np.diag([1.0, 1.0, 1.0, 1.0, 1.0, 0.0]) * 100.0
            reference = matrix + np.diag([1.0, 1.0, 1.0, 1.0, 1.0, 0.0]) * 100.0
            found = QuadraticCost(matrix=changed).characteristic()
            expected = QuadraticCost(matrix=reference).characteristic()
            assert np.flatnonzero(found != expected).tolist() == [(row + column + 2) // 2]


def test_min_control_effort_has_the_papers_entries():
    """eq:Min-control-effort, with the minus sign that the y^(5) term of the torque brings."""
    rng = np.random.default_rng(5)
    for _ in range(CASES):
        arm, (i1, i2, k, c) = sample_arm(rng)
        r = rng.uniform(0.1, 100.0)
        weight, difference = r**8, i1 - i2
        expected = np.zeros((6, 6))
        expected[1, 1] = weight * i1**2
        expected[3, 3] = weight * i2**2 * difference**2 / k**2
        expected[4, 4] = weight * c**2 * i2**2 * difference**2 / k**4
        expected[1, 3] = expected[3, 1] = weight * i1 * i2 * difference / k
        expected[1, 4] = expected[4, 1] = -weight * c * i1 * i2 * difference / k**2
        expected[3, 4] = expected[4, 3] = -weight * c * i2**2 * difference**2 / k**3
        expected[5, 5] = 1.0
        cost = strategy_cost(
            Strategy.MIN_CONTROL_EFFORT, flat_map(arm, FlatModel.APPROXIMATE), r=r, p=3.0
        )
        np.testing.assert_allclose(cost.matrix, expected, rtol=1e-13, atol=0.0)


def test_cost_density_is_jerk_effort_and_energy():
    """Y^T Q Y = y6^2 + r^8 tau^2 + p^8 y2^2 (eq:mintau, eq:minpot) for any derivatives."""
    rng = np.random.default_rng(6)
    weights = {
        Strategy.POLYNOMIAL: (0, 0),
        Strategy.MIN_CONTROL_EFFORT: (1, 0),
        Strategy.MIN_POTENTIAL_ENERGY: (0, 1),
        Strategy.MIXED: (1, 1),
    }
    checked = 0
    for _ in range(CASES):
        arm, (i1, i2, k, c) = sample_arm(rng)
        r, p = rng.uniform(0.5, 5.0, 2)
        y = rng.normal(size=7)
        tau = i1 * y[2] + i2 * (i1 - i2) / k * (y[4] - c / k * y[5])
        for strategy, (has_effort, has_energy) in weights.items():
            terms = [y[6] ** 2, has_effort * r**8 * tau**2, has_energy * p**8 * y[2] ** 2]
            matrix = strategy_cost(strategy, flat_map(arm, FlatModel.APPROXIMATE), r=r, p=p).matrix
            scale = np.abs(y[1:]) @ np.abs(matrix) @ np.abs(y[1:])
            assert abs(y[1:] @ matrix @ y[1:] - sum(terms)) <= 1e-13 * scale
            checked += 1
    assert checked == 4 * CASES


def test_min_potential_energy_equation_has_a_plus_sign(paper_arm):
    """y^(12) + p^8 y^(4) = 0: eq:odeminpot, whose printed sign contradicts eq:ode."""
    cost = strategy_cost(
        Strategy.MIN_POTENTIAL_ENERGY, flat_map(paper_arm, FlatModel.APPROXIMATE), r=9.0, p=17.0
    )
    np.testing.assert_array_equal(cost.characteristic(), [0, 0, 17.0**8, 0, 0, 0, 1])


def test_polynomial_equation_has_one_term(paper_arm):
    cost = strategy_cost(
        Strategy.POLYNOMIAL, flat_map(paper_arm, FlatModel.APPROXIMATE), r=9.0, p=17.0
    )
    np.testing.assert_array_equal(cost.characteristic(), [0, 0, 0, 0, 0, 0, 1])


def test_custom_cost_is_kept_as_a_locked_copy(paper_arm):
    matrix = random_matrix(np.random.default_rng(7))
    cost = strategy_cost(
        Strategy.CUSTOM, flat_map(paper_arm, FlatModel.APPROXIMATE), custom=matrix
    )
    np.testing.assert_array_equal(cost.matrix, matrix)
    before = matrix[0, 0]
    matrix[0, 0] = -1.0
    assert cost.matrix[0, 0] == before
    with pytest.raises(ValueError, match='read-only'):
        cost.matrix[0, 0] = 2.0


def with_entries(entries, base=None):
    """Return a Q of ones on the diagonal with some symmetric pairs replaced."""
    matrix = np.eye(6) if base is None else base.copy()
    for (i, j), value in entries.items():
        matrix[i - 1, j - 1] = value
    return matrix


@pytest.mark.parametrize(
    ('entries', 'message'),
    [
        ({(1, 3): 0.5, (3, 1): 0.25}, r'symmetric.*Q13 = 0\.5.*Q31 = 0\.25'),
        ({(2, 5): 1e-11}, r'symmetric.*Q25 = 1e-11.*Q52 = 0'),
        ({(6, 6): 2.0}, r'Q66 must be 1, got 2'),
        ({(6, 6): 0.0}, r'Q66 must be 1, got 0'),
        ({(3, 3): -2.0}, r'Q33 = -2 must not be negative'),
        ({(4, 4): 0.0, (4, 6): 0.1, (6, 4): 0.1}, r'indefinite: Q44 = 0 but row 4'),
        ({(1, 1): 0.0, (1, 2): 1e-30, (2, 1): 1e-30}, r'indefinite: Q11 = 0 but row 1'),
        ({(1, 2): 1.5, (2, 1): 1.5}, r'semidefinite.*eigenvalue -0\.5'),
        ({(2, 4): np.nan}, r'Q24 = nan.*finite'),
        ({(5, 5): np.inf}, r'Q55 = inf.*finite'),
        ({(3, 1): -np.inf}, r'Q31 = -inf.*finite'),
    ],
)
def test_refuses_a_bad_matrix_with_entry_and_value(entries, message):
    with pytest.raises(InvalidCost, match=message):
        QuadraticCost(matrix=with_entries(entries))


@pytest.mark.parametrize('shape', [(36,), (5, 5), (6, 7), (1, 6, 6)])
def test_refuses_another_shape(shape):
    with pytest.raises(InvalidCost, match=r'6 x 6 \(36 numbers\).*shape'):
        QuadraticCost(matrix=np.ones(shape))


def test_definiteness_is_judged_whatever_the_units():
    """Rescaling time scales entries by twenty orders, and changes no verdict."""
    rng = np.random.default_rng(8)
    verdicts = []
    for _ in range(CASES):
        matrix = random_matrix(rng, rng.integers(1, 6))
        bad = matrix.copy()
        row = rng.integers(0, 5)
        bad[row, row] *= 1.0 - 1e-3
        # Rows of a matrix of low rank depend on each other: less of one square is too little.
        is_too_little = np.linalg.eigvalsh(bad)[0] < -1e-9 * np.abs(bad).max()
        units = 10.0 ** (rng.uniform(-2, 2) * np.arange(-5, 1))
        QuadraticCost(matrix=scaled(matrix, units))
        if is_too_little:
            with pytest.raises(InvalidCost, match='semidefinite'):
                QuadraticCost(matrix=scaled(bad, units))
        verdicts.append(is_too_little)
    assert sum(verdicts) > CASES // 2


def scaled(matrix, units):
    """Return a matrix in other units, exactly symmetric."""
    product = matrix * units * units[:, None]
    product = np.triu(product) + np.triu(product, 1).T
    product[5, 5] = 1.0
    return product


@pytest.mark.parametrize('name', ['r', 'p'])
@pytest.mark.parametrize('value', [-1e-9, 1e30, 1e300, np.nan, np.inf])
def test_refuses_a_weight_that_is_none(paper_arm, name, value):
    mapping = flat_map(paper_arm, FlatModel.APPROXIMATE)
    with pytest.raises(InvalidCost, match=re.escape(f'weight {name} = {value:g} is outside')):
        strategy_cost(Strategy.MIXED, mapping, **{name: value})


@pytest.mark.parametrize('value', [0.0, 1000.0, 1e7])
def test_accepts_weights_of_any_arm(paper_arm, value):
    cost = strategy_cost(
        Strategy.MIXED, flat_map(paper_arm, FlatModel.APPROXIMATE), r=value, p=value
    )
    assert np.isfinite(cost.characteristic()).all()


def test_custom_needs_its_matrix(paper_arm):
    with pytest.raises(InvalidCost, match=r'weights\.Q'):
        strategy_cost(Strategy.CUSTOM, flat_map(paper_arm, FlatModel.APPROXIMATE))


@pytest.mark.parametrize('stiffness', [5e-324, 1e-300, 1e-160, 1e-120])
@pytest.mark.parametrize('model', FlatModel)
def test_refuses_arms_with_absurd_numbers_without_a_warning(stiffness, model):
    arm = PlanarArm.reduced(inertia_star=(1.0, 0.5), stiffness=stiffness, damping=1.0)
    with np.errstate(all='ignore'):
        mapping = flat_map(arm, model)
    with np.errstate(over='raise', invalid='raise'), pytest.raises(InvalidCost, match='no arm'):
        strategy_cost(Strategy.MIN_CONTROL_EFFORT, mapping, r=1000.0)


def test_refuses_entries_out_of_range_without_a_warning():
    with np.errstate(over='raise', invalid='raise'):
        for value in (1e201, 1.7e308):
            with pytest.raises(InvalidCost, match='beyond'):
                QuadraticCost(matrix=np.diag([value, 1.0, 1.0, 1.0, 1.0, 1.0]))
        matrix = np.diag([5e-324, 1e-300, 1.0, 1.0, 1.0, 1.0])
        assert np.isfinite(QuadraticCost(matrix=matrix).characteristic()).all()
        matrix[0, 1] = matrix[1, 0] = 1.0
        with pytest.raises(InvalidCost, match='indefinite'):
            QuadraticCost(matrix=matrix)
