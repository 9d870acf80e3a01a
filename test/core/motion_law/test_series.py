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

"""Laws as series: the basis against closed forms and quadrature, laws against their roots."""

from equations import equation_of_speed
from flat_planner_ros.core.motion_law.certificate import relative_sum
from flat_planner_ros.core.motion_law.chebyshev_series import chebyshev_values, from_legendre
from flat_planner_ros.core.motion_law.extremal import by_roots, LONG, unit_motion
from flat_planner_ros.core.motion_law.legendre_series import integration
from flat_planner_ros.core.motion_law.series_basis import probed, series_basis, solved, TERMS
from flat_planner_ros.core.motion_law.series_sum import SeriesSum
from flat_planner_ros.core.motion_law.unit_series import UnitSeries
import numpy as np
from numpy.polynomial import chebyshev, legendre, Polynomial
import pytest

SIZES = [terms for terms in TERMS if terms]

SPEEDS = [*np.nextafter(list(TERMS.values())[1:], 0.0), 0.01, 1.5, 25.0]
"""The fastest of each number of terms, and some between."""

PLACES = np.array([np.linspace(0.0, 2.0, 41), np.linspace(2.0, 0.0, 41)])
"""Distances from both ends."""


def test_legendre_polynomials_as_chebyshev_series():
    for n in (0, 1, 2, 7, 30):
        expected = legendre.Legendre.basis(n).convert(kind=chebyshev.Chebyshev).coef
        np.testing.assert_allclose(from_legendre(31)[: n + 1, n], expected, rtol=0, atol=1e-15)


@pytest.mark.parametrize('size', [2, 3, 4, 5, 17, 33, 100])
def test_chebyshev_polynomials_are_cosines(size):
    angles = np.linspace(0.0, np.pi, 57)
    found = chebyshev_values(np.cos(angles), size)
    expected = np.cos(np.outer(np.arange(size), angles))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-16 * (size + 4) ** 2)


@pytest.mark.parametrize('terms', SIZES)
def test_the_basis_leaves_the_ends_alone(terms):
    """Each order is the derivative of the one below, and all but the place are zero at the end."""
    table = series_basis(terms).derivatives
    for lower, higher in zip(table[:-1], table[1:], strict=True):
        found = legendre.legder(lower, axis=0)
        size = np.abs(higher).max(axis=0)
        assert (np.abs(found - higher[:-1]).max(axis=0) <= 1e-10 * size).all()
    ends = legendre.legval(1.0, table[6:12].transpose(1, 0, 2))
    expected = np.zeros((6, terms + 1))
    expected[0, -1] = 0.5
    sizes = np.abs(table[6:12]).max(axis=(1, 2))[:, None]
    np.testing.assert_allclose(ends / sizes, expected / sizes, rtol=0, atol=1e-15)


def test_the_law_of_least_degree():
    """Its velocity is a multiple of (1 - x^2)^5."""
    velocity = Polynomial([1.0, 0.0, -1.0]) ** 5
    velocity /= 2.0 * velocity.integ()(1.0)
    table = series_basis(6).derivatives[..., -1]
    for order in range(1, 7):
        expected = legendre.poly2leg(
            velocity.deriv(order - 1).coef if order > 1 else velocity.coef
        )
        found = table[6 + order]
        np.testing.assert_allclose(
            found[: len(expected)], expected, rtol=0, atol=1e-13 * np.abs(expected).max()
        )
        np.testing.assert_array_equal(found[len(expected) :], 0.0)


@pytest.mark.parametrize('terms', SIZES)
def test_the_energy_is_an_integral(terms):
    basis = series_basis(terms)
    nodes, weights = legendre.leggauss(2 * terms + 20)
    for k in range(7):
        values = legendre.legval(nodes, basis.derivatives[6 + k])
        expected = (-1.0) ** k * (values * weights) @ values.T
        scale = np.sqrt(np.abs(np.diag(expected)))
        error = np.abs(basis.energy[k] - expected) / np.outer(scale, scale)
        assert error.max() <= 1e-12  # of the quadrature
    np.testing.assert_allclose(basis.energy[6, :terms, :terms], np.eye(terms), atol=1e-15)


@pytest.mark.parametrize('speed', SPEEDS)
def test_all_twelve_derivatives_are_those_of_the_roots(speed):
    """Beyond the sixth they follow from the equation alone."""
    rng = np.random.default_rng(int(10 * speed))
    for _ in range(5):
        equation = equation_of_speed(rng, speed)
        unit = unit_motion(equation)
        assert isinstance(unit.law.total, SeriesSum)
        expected = by_roots(equation).law.total.at(PLACES, 12)
        peaks = np.abs(expected).max(axis=1, keepdims=True)
        error = np.abs(unit.law.total.at(PLACES, 12) - expected) / peaks
        assert error.max() <= 1e-9
        series = UnitSeries.of(np.array([equation]), len(unit.law.total.amplitudes) - 1)
        ends = np.abs(series.certificates.ends[0] - expected[6:12, -1]) / peaks[6:12, 0]
        assert ends.max() <= 1e-9


@pytest.mark.parametrize('speed', SPEEDS)
def test_many_laws_together_are_those_found_alone(speed):
    rng = np.random.default_rng(int(10 * speed))
    equations = np.array([equation_of_speed(rng, speed) for _ in range(4)])
    units = [unit_motion(equation) for equation in equations]
    together = UnitSeries.of(equations, len(units[0].law.total.amplitudes) - 1)
    for row, unit in enumerate(units):
        alone = unit.law.total.amplitudes
        np.testing.assert_allclose(
            together.amplitudes[row], alone, rtol=0, atol=1e-10 * np.abs(alone).max()
        )
        assert together.certificates.costate[row] == pytest.approx(unit.costate, rel=1e-10)


@pytest.mark.parametrize('terms', SIZES)
def test_no_law_needs_more_terms(terms):
    """At its fastest: what more terms would change is below the tolerance a thousand times."""
    rng = np.random.default_rng(terms)
    equations = np.array([equation_of_speed(rng, TERMS[terms]) for _ in range(40)])
    few, many = (solved(equations, count) for count in (terms, terms + 14))
    values = probed(few.amplitudes).jets, probed(many.amplitudes).jets
    peaks = np.abs(values[1]).max(axis=-1, keepdims=True)
    assert (np.abs(values[0] - values[1]) / peaks).max() <= 1e-12
    np.testing.assert_allclose(few.cost, many.cost, rtol=1e-13)


def test_the_residual_is_that_of_the_equation_six_times_integrated():
    """w^(2k - 6) by repeated integration, less low degrees."""
    equation = equation_of_speed(np.random.default_rng(4), 8.0)
    amplitudes = solved(equation, 16).amplitudes
    table = series_basis(16).derivatives
    parts = [table[6 + order] @ amplitudes for order in (6, 4, 2, 0)]
    once = integration(len(parts[0]))
    for _ in range(3):
        parts.append(once @ once @ parts[-1])
    nodes = PLACES[0] - 1.0
    values = np.array([legendre.legval(nodes, [0] * 6 + list(p[6:])) for p in parts[::-1]])
    total = np.abs(equation @ values).max() / (np.abs(equation) @ np.abs(values)).max()
    assert total <= 1e-13
    assert float(relative_sum(equation[1:], probed(amplitudes).parts)) <= 1e-13
    other = equation * (1.0 + 1e-6 * np.arange(7.0))
    assert 1e-8 < float(relative_sum(other[1:], probed(amplitudes).parts)) < 1e-5


@pytest.mark.parametrize('speed', [0.0, 1.5, 8.0, 25.0, 50.0])
def test_a_long_table_is_the_law_at_its_times(speed):
    """By exponentials, where roots are apart, or in parts."""
    rng = np.random.default_rng(int(speed))
    for _ in range(3):
        equation = equation_of_speed(rng, speed) if speed else np.eye(7)[6]
        unit = unit_motion(equation)
        intervals = 2 * LONG + 3
        table = np.empty((7, intervals + 1))
        unit.fill_grid(table, np.ones(7))
        some = np.array([0, 1, 77, 2050, intervals // 2, LONG, intervals - 1, intervals])
        after_start = 2.0 * some / intervals
        expected = unit.jet(after_start, 2.0 - after_start)
        error = np.abs(table[:, some] - expected) / unit.peaks[:, None]
        assert error.max() <= 1e-11


def test_many_times_are_taken_in_parts():
    unit = unit_motion(equation_of_speed(np.random.default_rng(1), 25.0))
    after_start = np.linspace(0.0, 2.0, LONG + 5)
    found = unit.jet(after_start, 2.0 - after_start)
    for part in (slice(0, 30), slice(LONG // 2 - 20, LONG // 2 + 20), slice(-30, None)):
        expected = unit.jet(after_start[part], 2.0 - after_start[part])
        error = np.abs(found[:, part] - expected) / unit.peaks[:, None]
        assert error.max() <= 1e-14
