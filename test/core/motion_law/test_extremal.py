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

"""Extremals against multiple precision, the calculus of variations and a quadratic programme."""

from equations import equation_of_speed
from flat_planner_ros.core.arm.flat_map import flat_map, FlatModel
from flat_planner_ros.core.arm.planar_arm import PlanarArm
from flat_planner_ros.core.motion_law.basis import SERIES_LENGTH
from flat_planner_ros.core.motion_law.boundary_solver import BoundarySolver
from flat_planner_ros.core.motion_law.certificate import UNIT_ENDS
from flat_planner_ros.core.motion_law.cost import QuadraticCost, Strategy, strategy_cost
from flat_planner_ros.core.motion_law.extremal import (
    BoundaryConditions,
    by_roots,
    costate,
    extremals,
    stationarity_residual,
    unit_motion,
)
from flat_planner_ros.core.motion_law.roots import Spectrum
from flat_planner_ros.core.motion_law.series_basis import speeds, TERMS
from flat_planner_ros.core.motion_law.series_sum import SeriesSum
from flat_planner_ros.core.motion_law.spectra import known_spectrum
from flat_planner_ros.core.motion_law.term_sum import ascending_powers, term_sum
import numpy as np
from numpy.polynomial import legendre, Polynomial
import pytest
from random_cases import cases
from scipy.special import jacobi

TOLERANCE = 1e-9
"""Largest error of a derivative, relative to its peak [-]."""

ORDERS = np.arange(1, 7)

POINTS = np.unique(np.concatenate([np.linspace(0, 1, 7), 10.0 ** -np.arange(1.0, 8.0)]))
FRACTIONS = np.unique(np.concatenate([POINTS, 1.0 - POINTS]))
"""Times over the duration, crowded towards both ends."""

PLACES = np.array([FRACTIONS, 1.0 - FRACTIONS]) * 2.0
"""The same as distances from both ends in normalised time."""


def from_row(*row):
    """Return the Q of one squared combination of y', y'', ..., y^(6)."""
    vector = np.array(row, dtype=float)
    return np.outer(vector, vector)


def random_semidefinite(rng, rank):
    """Return a Q of some rank with rates around 20 / s and Q66 = 1."""
    rows = rng.normal(size=(rank, 6)) * rng.uniform(2.0, 30.0) ** np.arange(5, -1, -1)
    rows[:, 5] /= np.linalg.norm(rows[:, 5])
    matrix = rows.T @ rows
    matrix[5, 5] = 1.0
    return (matrix + matrix.T) / 2.0


def named_matrices():
    """Return the Q of the strategies and of roots that are hard to tell apart."""
    arm = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
    mapping = flat_map(arm, FlatModel.APPROXIMATE)
    rng = np.random.default_rng(1)
    return {
        'polynomial': strategy_cost(Strategy.POLYNOMIAL, mapping).matrix,
        'effort': strategy_cost(Strategy.MIN_CONTROL_EFFORT, mapping, r=60.0).matrix,
        'energy': strategy_cost(Strategy.MIN_POTENTIAL_ENERGY, mapping, p=17.0).matrix,
        'energy, soft': strategy_cost(Strategy.MIN_POTENTIAL_ENERGY, mapping, p=0.3).matrix,
        'mixed': strategy_cost(Strategy.MIXED, mapping, r=50.0, p=12.0).matrix,
        # D^2 (D^2 + w^2)^2: two fourfold roots on the imaginary axis.
        'fourfold imaginary, w = 2': from_row(0, 16, 0, 8, 0, 1),
        'fourfold imaginary, w = 12': from_row(0, 12**4, 0, 2 * 12**2, 0, 1),
        # D^4 (D^2 + w^2): double ones.
        'double imaginary, w = 25': from_row(0, 0, 0, 25**2, 0, 1),
        # D^2 (D^2 - 49)^2 and D (D + 6)^5: multiple real roots.
        'fourfold real': from_row(0, 49**2, 0, -2 * 49, 0, 1),
        'fivefold real': from_row(*(Polynomial([6, 1]) ** 5).coef),
        # D^4 (D^2 + w^2) plus 1e-9 of itself: an imaginary pair that is nearly double.
        'nearly double imaginary': from_row(0, 0, 0, 625, 0, 1)
        + 1e-9 * np.diag([0, 0, 0, 9, 0, 0]),
        'rank 1': random_semidefinite(rng, 1),
        'rank 2': random_semidefinite(rng, 2),
        'full rank': random_semidefinite(rng, 6),
    }


MATRICES = named_matrices()

EXACT_ROOTS = {
    'fourfold imaginary, w = 2': [(0, 2), (-4, 4)],
    'fourfold imaginary, w = 12': [(0, 2), (-144, 4)],
    'double imaginary, w = 25': [(0, 4), (-625, 2)],
    'fourfold real': [(0, 2), (49, 4)],
    'fivefold real': [(0, 1), (36, 5)],
}
"""Roots z of the costs with multiple roots away from zero; their coefficients are integers."""


def random_jets(rng, rate):
    """Return jets at both ends whose derivatives grow like powers of a rate."""
    size = rate ** np.arange(6.0)
    return BoundaryConditions(start=size * rng.normal(size=6), end=size * rng.normal(size=6))


def extremal(coefficients, duration, conditions):
    """Return the law of one pair of ends."""
    return extremals(coefficients, duration, [conditions])[0]


def rest_to_rest(start, end):
    """Return jets without motion at the ends."""
    return BoundaryConditions(
        start=np.array([start, 0, 0, 0, 0, 0.0]), end=np.array([end, 0, 0, 0, 0, 0.0])
    )


def relative_error(found, expected):
    """Return the largest error of each row relative to the row's peak."""
    return np.max(np.abs(found - expected).max(axis=1) / np.abs(expected).max(axis=1))


def lagrangian(matrix, jet, other=None):
    """Return Y^T Q Y, or the bilinear form of two jets."""
    return np.einsum('im,ij,jm->m', jet[1:7], matrix, (jet if other is None else other)[1:7])


def quadrature(duration, panels=60, nodes=16):
    """Return Gauss-Legendre times and weights."""
    x, w = legendre.leggauss(nodes)
    edges = np.linspace(0.0, duration, panels + 1)
    width = np.diff(edges)[:, None]
    return (edges[:-1, None] + 0.5 * width * (x + 1.0)).ravel(), (0.5 * width * w).ravel()


@pytest.mark.parametrize(
    'roots',
    [
        [(0, 6)],
        [(0, 2), (-4, 2), (9, 2)],
        [(0, 2), (-400, 2), (900, 2)],
        [(0, 1), (16, 3), (400, 2)],
        [(0, 2), (-4, 4)],
        [(0, 2), (-900, 4)],
        [(0, 2), (3 + 4j, 2), (3 - 4j, 2)],
        [(0, 2), (300 + 400j, 2), (300 - 400j, 2)],
        [(0, 1), (900, 5)],
        [(0, 3), (-2500, 2), (1, 1)],
        [(0, 1), (100, 1), (10000, 1), (1000000, 1), (300 + 400j, 1), (300 - 400j, 1)],
    ],
)
@pytest.mark.parametrize('duration', [0.25, 2.0])
def test_general_ends_with_exact_multiplicities(oracle, roots, duration):
    """Integer roots, so that the coefficients carry no rounding and multiplicity is exact."""
    rng = np.random.default_rng(2)
    jets = random_jets(rng, 4.0 / duration)
    coefficients = np.array([float(a) for a in oracle.polynomial(roots)])
    law = extremal(coefficients, duration, jets)
    times = FRACTIONS * duration
    expected = oracle.solve(roots, duration, jets.start, jets.end).jet(times, 6)
    assert relative_error(law.jet(times, 6), expected) <= TOLERANCE


@pytest.mark.parametrize('name', MATRICES)
def test_general_ends_of_every_cost(oracle, name):
    rng = np.random.default_rng(3)
    coefficients = QuadraticCost(matrix=MATRICES[name]).characteristic()
    roots = EXACT_ROOTS.get(name) or oracle.square_roots(coefficients)
    np.testing.assert_allclose(
        np.array(oracle.polynomial(roots), dtype=float), coefficients, rtol=1e-15, atol=1e-99
    )
    for duration in (0.3, 1.0, 4.0):
        jets = random_jets(rng, 3.0 / duration)
        law = extremal(coefficients, duration, jets)
        times = FRACTIONS * duration
        reference = oracle.solve(roots, duration, jets.start, jets.end)
        assert relative_error(law.jet(times, 6), reference.jet(times, 6)) <= TOLERANCE


def test_general_ends_of_random_costs(oracle):
    rng = np.random.default_rng(4)
    checked = 0
    for _ in range(cases(40)):
        matrix = random_semidefinite(rng, int(rng.integers(1, 7)))
        coefficients = QuadraticCost(matrix=matrix).characteristic()
        duration = 10.0 ** rng.uniform(-2, 1)
        jets = random_jets(rng, 10.0 ** rng.uniform(-1, 1) / duration)
        law = extremal(coefficients, duration, jets)
        times = FRACTIONS[::3] * duration
        reference = oracle.solve(oracle.square_roots(coefficients), duration, jets.start, jets.end)
        assert relative_error(law.jet(times, 6), reference.jet(times, 6)) <= TOLERANCE
        checked += 1
    assert checked == cases(40)


@pytest.mark.parametrize('name', MATRICES)
def test_meets_its_jets_and_its_equation(name):
    rng = np.random.default_rng(5)
    coefficients = QuadraticCost(matrix=MATRICES[name]).characteristic()
    for duration in (0.2, 1.0, 5.0):
        jets = random_jets(rng, 3.0 / duration)
        law = extremal(coefficients, duration, jets)
        times = FRACTIONS * duration
        jet = law.jet(times, 12)
        peak = np.abs(jet[:6]).max(axis=1)
        assert (np.abs(jet[:6, 0] - jets.start) <= 1e-10 * peak).all()
        assert (np.abs(jet[:6, -1] - jets.end) <= 1e-10 * peak).all()
        terms = coefficients[:, None] * jet[::2]
        size = np.abs(terms).sum(axis=0).max()
        worst = np.abs(terms.sum(axis=0)).max() / size if size else 0.0
        assert worst <= 1e-10
        assert stationarity_residual(coefficients, law.jet(times, 12)) == pytest.approx(
            worst, abs=1e-12
        )


def test_the_residual_sees_another_equation():
    """The law of one weight is far from stationary for another."""
    energy = np.array([0.0, 0, 17.0**8, 0, 0, 0, 1])
    law = extremal(energy, 1.0, rest_to_rest(0.0, 1.0))
    assert stationarity_residual(1.1 * energy - 0.1 * np.eye(7)[6], law.jet(FRACTIONS, 12)) > 1e-3
    assert stationarity_residual(energy, law.jet(FRACTIONS, 12)) < 1e-11


def test_a_constant_has_no_residual():
    energy = np.array([0.0, 0, 17.0**8, 0, 0, 0, 1])
    law = extremal(energy, 1.0, rest_to_rest(3.0, 3.0))
    np.testing.assert_array_equal(law.jet(FRACTIONS, 0), 3.0)
    assert stationarity_residual(energy, law.jet(FRACTIONS, 12)) == 0.0


@pytest.mark.parametrize('name', MATRICES)
def test_costate_is_constant_and_times_the_distance_the_cost(name):
    matrix = MATRICES[name]
    coefficients = QuadraticCost(matrix=matrix).characteristic()
    for duration in (0.3, 1.0, 3.0):
        law = extremal(coefficients, duration, rest_to_rest(0.4, 1.9))
        found = costate(coefficients, law.jet(FRACTIONS * duration, 11))
        terms = np.abs(coefficients[1:, None] * law.jet(FRACTIONS * duration, 11)[1::2])
        assert np.ptp(found) <= 1e-9 * terms.sum(axis=0).max()
        middle = costate(coefficients, law.jet(0.5 * duration, 11))[0]
        times, weights = quadrature(duration)
        cost = weights @ lagrangian(matrix, law.jet(times, 6))
        assert middle * 1.5 == pytest.approx(cost, rel=1e-9)


def bumps(times, duration, count=6):
    """Return the derivatives of changes that vanish with five derivatives at both ends."""
    x, orders = 2.0 * times / duration - 1.0, np.arange(7)
    bump = Polynomial([1.0, 0.0, -1.0]) ** 6
    changes = [bump * Polynomial.basis(n) for n in range(count)]
    rates = (2.0 / duration) ** orders[:, None]
    return [rates * [c.deriv(k)(x) if k else c(x) for k in orders] for c in changes]


@pytest.mark.parametrize('name', MATRICES)
def test_no_admissible_change_is_cheaper(name):
    """The cost's first variation vanishes and its second is the cost of the change."""
    matrix, duration = MATRICES[name], 0.8
    rng = np.random.default_rng(6)
    coefficients = QuadraticCost(matrix=matrix).characteristic()
    jets = random_jets(rng, 3.0)
    law = extremal(coefficients, duration, jets)
    times, weights = quadrature(duration)
    jet = law.jet(times, 6)
    cost = weights @ lagrangian(matrix, jet)
    basis = bumps(times, duration)
    checked = 0
    for _ in range(25):
        change = np.tensordot(rng.normal(size=len(basis)), basis, axes=1)
        own = weights @ lagrangian(matrix, change)
        change *= 1e-2 * np.sqrt(cost / own)
        slope = weights @ lagrangian(matrix, jet, change)
        scale = weights @ lagrangian(np.abs(matrix), np.abs(jet), np.abs(change))
        assert abs(slope) <= 1e-11 * scale
        changed = weights @ lagrangian(matrix, jet + change)
        assert changed > cost * (1.0 + 0.99e-4)
        checked += 1
    assert checked == 25


def galerkin(matrix, duration, jets, modes):
    """
    Solve the same problem as a quadratic programme.

    y^(6) is a Legendre series in x. The lowest six terms follow from the ends; the others are
    the sixth derivatives of (1 - x^2)^6 P_n^(6,6), which leave the ends alone, and are free.
    Returns the Legendre coefficients of y, y', ..., y^(6) in physical time.
    """
    half = 0.5 * duration
    size = modes + 6
    powers = half ** np.arange(7.0)
    start, end = jets.start * powers[:6], jets.end * powers[:6]
    series = [np.eye(size)]  # from y^(6) down, without the contribution of the start
    drift = [np.zeros(size + 6)]
    for order in range(5, -1, -1):
        series.insert(0, legendre.legint(series[0], lbnd=-1.0, axis=0))
        rest = legendre.legint(drift[0], lbnd=-1.0)[: size + 6]
        rest[0] += start[order]
        drift.insert(0, rest)
    series = [np.pad(s, ((0, size + 6 - len(s)), (0, 0))) for s in series]
    ones = np.ones(size + 6)  # P_n(1) = 1
    ends = np.array([ones @ series[k] for k in range(6)])
    assert np.abs(ends[:, 6:]).max() < 1e-12
    low = np.linalg.solve(ends[:, :6], end - [ones @ drift[k] for k in range(6)])
    base = [s[:, :6] @ low + d for s, d in zip(series, drift, strict=True)]
    free = [s[:, 6:] for s in series]
    norms = half * 2.0 / (2.0 * np.arange(size + 6) + 1.0)
    hessian, gradient, constant = np.zeros((modes, modes)), np.zeros(modes), 0.0
    for i in ORDERS:
        for j in ORDERS:
            weight = matrix[i - 1, j - 1] / powers[i] / powers[j]
            hessian += weight * (free[i].T * norms) @ free[j]
            gradient += weight * (free[i].T * norms) @ base[j]
            constant += weight * (base[i] * norms) @ base[j]
    scale = 1.0 / np.sqrt(np.diag(hessian))
    best = -scale * np.linalg.solve(scale[:, None] * hessian * scale, scale * gradient)
    cost = constant + gradient @ best
    return cost, [
        (b + f @ best) / powers[k] for k, (b, f) in enumerate(zip(base, free, strict=True))
    ]


def test_the_basis_of_the_programme_is_that_of_jacobi():
    """The sixth derivative of (1 - x^2)^6 P_n^(6,6) is a multiple of the Legendre P_(n + 6)."""
    for n in range(6):
        function = Polynomial([1.0, 0.0, -1.0]) ** 6 * Polynomial(jacobi(n, 6, 6).coef[::-1])
        series = legendre.poly2leg(function.deriv(6).coef)
        others = np.delete(series, n + 6)
        assert np.abs(others).max() <= 1e-10 * abs(series[n + 6])


@pytest.mark.parametrize('name', MATRICES)
@pytest.mark.parametrize('is_general', [False, True])
def test_a_quadratic_programme_finds_the_same_law(name, is_general):
    matrix, duration = MATRICES[name], 1.0
    jets = rest_to_rest(0.0, np.pi)
    if is_general:
        jets = random_jets(np.random.default_rng(7), 3.0)
    law = extremal(QuadraticCost(matrix=matrix).characteristic(), duration, jets)
    cost, series = galerkin(matrix, duration, jets, 70)
    times, weights = quadrature(duration)
    jet = law.jet(times, 6)
    expected = np.array([legendre.legval(2.0 * times / duration - 1.0, s) for s in series])
    assert weights @ lagrangian(matrix, jet) == pytest.approx(cost, rel=1e-9)
    assert relative_error(jet, expected) <= TOLERANCE


@pytest.mark.parametrize('name', MATRICES)
def test_stretching_time_stretches_the_law(name):
    """Weights of other units of time: y(t / s) is the extremal over s times the duration."""
    rng = np.random.default_rng(8)
    coefficients = QuadraticCost(matrix=MATRICES[name]).characteristic()
    jets = random_jets(rng, 3.0)
    reference = extremal(coefficients, 1.0, jets).jet(FRACTIONS, 6)
    orders = np.arange(7.0)
    for stretch in (0.013, 3.7, 240.0):
        powers = stretch**-orders
        law = extremal(
            coefficients * stretch ** (2.0 * orders - 12.0),
            stretch,
            BoundaryConditions(start=jets.start * powers[:6], end=jets.end * powers[:6]),
        )
        found = law.jet(FRACTIONS * stretch, 6) / powers[:, None]
        assert relative_error(found, reference) <= TOLERANCE


@pytest.mark.parametrize('name', MATRICES)
def test_laws_are_linear_in_their_ends(name):
    rng = np.random.default_rng(9)
    coefficients = QuadraticCost(matrix=MATRICES[name]).characteristic()
    one, two = random_jets(rng, 3.0), random_jets(rng, 3.0)
    combined = BoundaryConditions(start=2.0 * one.start - two.start, end=2.0 * one.end - two.end)
    laws = [extremal(coefficients, 1.0, jets).jet(FRACTIONS, 6) for jets in (one, two, combined)]
    assert relative_error(2.0 * laws[0] - laws[1], laws[2]) <= TOLERANCE


@pytest.mark.parametrize('name', MATRICES)
def test_swapped_ends_run_the_law_backwards(name):
    rng = np.random.default_rng(10)
    coefficients = QuadraticCost(matrix=MATRICES[name]).characteristic()
    jets, signs = random_jets(rng, 3.0), (-1.0) ** np.arange(7)
    forward = extremal(coefficients, 1.0, jets).jet(FRACTIONS, 6)
    swapped = BoundaryConditions(start=signs[:6] * jets.end, end=signs[:6] * jets.start)
    backward = extremal(coefficients, 1.0, swapped).jet(FRACTIONS, 6)
    assert relative_error(signs[:, None] * backward[:, ::-1], forward) <= TOLERANCE


def test_polynomial_cost_gives_the_polynomial_of_degree_eleven():
    """From rest to rest: a multiple of the integral of (1 - x^2)^5."""
    law = extremal(np.array([0.0, 0, 0, 0, 0, 0, 1]), 2.0, rest_to_rest(0.0, 1.0))
    speed = Polynomial([1.0, 0.0, -1.0]) ** 5
    place = speed.integ(lbnd=-1.0)
    place /= place(1.0)
    times = np.linspace(0.0, 2.0, 21)
    expected = np.array(
        [place.deriv(k)(times - 1.0) if k else place(times - 1.0) for k in range(7)]
    )
    assert relative_error(law.jet(times, 6), expected) <= 1e-13
    np.testing.assert_allclose(law.jet(times, 12)[12], 0.0)


@pytest.mark.parametrize('name', MATRICES)
@pytest.mark.parametrize('half', [0.05, 0.7, 3.0])
def test_roots_known_from_another_duration_give_the_same_unit_motion(name, half):
    coefficients = QuadraticCost(matrix=MATRICES[name]).characteristic()
    spectrum = known_spectrum(coefficients.tobytes())
    equation = coefficients * half ** np.arange(12.0, -1.0, -2.0)
    units = by_roots(equation), by_roots(equation, lambda: spectrum.clusters(half))
    anew, found = (unit.jet(*PLACES) for unit in units)
    assert relative_error(found, anew) <= 1e-11


@pytest.mark.parametrize('speed', [*np.nextafter(list(TERMS.values())[1:], 0.0), 0.01, 1.5, 20.0])
def test_a_motion_is_the_same_as_a_series_and_by_its_roots(speed):
    """Neither form knows of the other: one solves for Legendre coefficients, one has clusters."""
    rng = np.random.default_rng(int(100 * speed))
    for _ in range(cases(40)):
        equation = equation_of_speed(rng, speed)
        assert float(speeds(equation)) == pytest.approx(speed)
        found, other = unit_motion(equation), by_roots(equation)
        assert isinstance(found.law.total, SeriesSum)
        assert relative_error(found.jet(*PLACES), other.jet(*PLACES)) <= 1e-10
        assert found.costate == pytest.approx(other.costate, rel=1e-10)
        assert found.optimality_residual <= (1e-12 if speed <= 12.0 else 1e-10)
        assert found.boundary_residual <= 1e-12


def test_a_sum_of_exponentials_is_that_of_their_terms():
    rng = np.random.default_rng(8)
    for _ in range(20):
        equation = equation_of_speed(rng, rng.uniform(9.0, 60.0))
        solver = BoundarySolver(Spectrum(equation).clusters(), -1.0)
        total = solver.total(UNIT_ENDS[:, 1])
        expected = term_sum(solver.terms(UNIT_ENDS[:, 1])).at(PLACES, 12)
        error = np.abs(total.at(PLACES, 12) - expected).max(axis=1)
        assert (error <= 1e-14 * np.abs(expected).max(axis=1)).all()
        powers = ascending_powers(PLACES, SERIES_LENGTH)
        np.testing.assert_array_equal(total.at(PLACES, 12, powers), total.at(PLACES, 12))
