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

"""
Random cases of the whole admitted range, planned and compared with multiple precision.

Half of them are strategies of random arms with either flat model, half are custom costs of every
rank, some with double roots and with roots on the imaginary axis. A case is determined by its
number and a seed, so that processes can share them.
"""

from functools import reduce
from math import log10, perm
from typing import NamedTuple
import warnings

from flat_planner_ros.core.arm.errors import UncertifiedPlan
from flat_planner_ros.core.arm.flat_map import FlatModel
from flat_planner_ros.core.arm.planar_arm import PlanarArm
from flat_planner_ros.core.motion_law.cost import QuadraticCost, Strategy
from flat_planner_ros.core.planning.certified_plan import Plan
from flat_planner_ros.core.planning.planner import plan
from flat_planner_ros.core.planning.request import MotionRequest, PlanningOptions
import numpy as np
from numpy.polynomial import Polynomial
import oracle

TOLERANCE = 1e-9
"""Largest error of a derivative or the torque, relative to its peak [-]."""

STATIONARITY = 1e-12
"""Largest Euler-Lagrange residual relative to its terms [-]."""

MAX_CUSTOM_RATE = 100.0
"""Largest root of a custom cost in units of 2 / duration; see docs/derivation.md [-]."""

DIGITS = 40
"""Decimal digits of the oracle for roots that are well apart."""

CHECK_EVERY = 100
"""Every so many cases the oracle is solved again with more digits."""

ORACLE_TOLERANCE = 1e-13
"""Largest change of the oracle with more digits, relative to the peak [-]."""

CHANGE = 1e-3
"""Size of a perturbation: square root of its own cost over that of the law [-]."""


MAX_INTERVALS = 3000
"""Most intervals of an even grid."""

BUMP_DEGREE = 8
"""Degree of the random factor of a perturbation."""


class Findings(NamedTuple):
    """
    Worst of some cases.

    Attributes
    ----------
    cases
        How many there were.
    error, case
        Largest error relative to a peak, and the number of its case.
    boundary, stationarity
        Largest residuals at the ends and of the Euler-Lagrange equation.
    grid
        Largest difference between even samples and those at the same times, relative to a peak.
    gain
        Largest share of a perturbation's own cost that it regains; the law is a minimum below 1.
    refused
        What was not planned.

    """

    cases: int
    error: float
    case: int
    boundary: float
    stationarity: float
    grid: float
    gain: float
    refused: tuple[str, ...]

    def joined(self, other: 'Findings') -> 'Findings':
        """Return the worst of both."""
        error, case = max((self.error, self.case), (other.error, other.case))
        return Findings(
            self.cases + other.cases,
            error,
            case,
            *(max(a, b) for a, b in zip(self[3:7], other[3:7], strict=True)),
            self.refused + other.refused,
        )

    def __str__(self) -> str:
        """Return one line."""
        return (
            f'{self.cases} cases, {len(self.refused)} refused, '
            f'worst error {self.error:.2g} (case {self.case}), boundary {self.boundary:.2g}, '
            f'Euler-Lagrange {self.stationarity:.2g}, grid {self.grid:.2g}, gain {self.gain:.2g}'
        )


class Case(NamedTuple):
    """A goal of one radian."""

    arm: PlanarArm
    options: PlanningOptions
    duration: float


def arm_case(rng: np.random.Generator) -> Case:
    """Return a strategy of an arm, both from the whole admitted range."""
    both = 10.0 ** rng.uniform(-6, 1)
    last = both * 10.0 ** rng.uniform(-3, np.log10(0.9))
    frequency = 2.0 * np.pi * 10.0 ** rng.uniform(-1, np.log10(50.0))
    series = last * (both - last) / both
    arm = PlanarArm.reduced(
        inertia_star=(both, last),
        stiffness=frequency**2 * series,
        damping=2.0 * rng.choice([0.0, rng.uniform(0.0, 0.3)]) * frequency * series,
    )
    r, p = (float(rng.choice([0.0, 10.0 ** rng.uniform(-2, 3)])) for _ in range(2))
    model = FlatModel.EXACT if rng.random() < 0.5 else FlatModel.APPROXIMATE
    options = PlanningOptions(strategy=Strategy.MIXED, r=r, p=p, flat_model=model)
    return Case(arm, options, float(np.exp(rng.uniform(np.log(0.05), np.log(60.0)))))


def custom_case(rng: np.random.Generator) -> Case:
    """Return a custom cost of any rank."""
    arm = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
    duration = float(np.exp(rng.uniform(np.log(0.05), np.log(60.0))))
    rate = 2.0 / duration * 10.0 ** rng.uniform(-1.0, np.log10(MAX_CUSTOM_RATE))
    kind = rng.integers(0, 4)
    if kind == 0:
        rows = rng.normal(size=(int(rng.integers(1, 7)), 6)) * rate ** np.arange(5.0, -1.0, -1.0)
        rows /= np.linalg.norm(rows[:, 5])
    else:
        rows = operator(rng, kind, rate)[None]
    matrix = rows.T @ rows
    matrix = 0.5 * (matrix + matrix.T)
    matrix[5, 5] = 1.0
    if rng.random() < 0.2:  # Nearly semidefinite: the roots are nearly double.
        matrix[2, 2] += 10.0 ** rng.uniform(-12.0, -3.0) * rate**6
    return Case(arm, PlanningOptions(strategy=Strategy.CUSTOM, custom=matrix), duration)


def operator(rng: np.random.Generator, kind: int, rate: float) -> np.ndarray:
    """Return a row whose squared product with y', ..., y^(6) has double or imaginary roots."""
    factors = [Polynomial([0.0, 1.0])]
    if kind == 1:  # Double pairs on the imaginary axis, and two real roots or zeros.
        for _ in range(int(rng.integers(1, 3))):
            factors.append(Polynomial([(rate * rng.uniform(0.3, 1.0)) ** 2, 0.0, 1.0]))
    elif kind == 2:  # A double real root.
        factors += [Polynomial([rate * rng.uniform(0.1, 1.0), 1.0])] * 2
    else:  # A double complex pair.
        real, imaginary = rate * rng.uniform(0.1, 0.7, 2)
        factors += [Polynomial([real**2 + imaginary**2, 2.0 * real, 1.0])] * 2
    while sum(f.degree() for f in factors) < 6:
        factors.append(Polynomial([rate * rng.choice([0.0, rng.uniform(0.1, 1.0)]), 1.0]))
    product = Polynomial([1.0])
    for factor in factors:
        product *= factor
    return product.coef[1:]


def exact_equation(case: Case) -> list:
    """Return a_0 ... a_6 without rounding."""
    options = case.options
    if options.custom is None:
        inner, last = case.arm.inertia_star
        return oracle.characteristic(
            both=inner,
            last=last,
            stiffness=case.arm.stiffness,
            damping=case.arm.damping,
            r=options.r,
            p=options.p,
            is_damping_exact=options.flat_model is FlatModel.EXACT,
        )
    sums = [oracle.mp.mpf(0)] * 7
    for i in range(6):
        for j in range(i % 2, 6, 2):
            sums[(i + j + 2) // 2] += (-1) ** (i + 1) * oracle.mp.mpf(options.custom[i, j])
    return sums


def digits_for(squares: np.ndarray) -> int:
    """Return the digits that spread roots, small and near ones use up, and 40 more."""
    moving = np.abs(squares[squares != 0.0])
    smallest = min(1.0, moving.min(initial=1.0))
    largest = max(1.0, moving.max(initial=1.0))
    distances = np.abs(squares[:, None] - squares) / (1.0 + np.abs(squares))
    gap = min(1.0, distances[distances > 0.0].min(initial=1.0))
    return DIGITS + int(3.0 * log10(largest) - 6.0 * log10(smallest) - 4.0 * log10(gap))


def exact_jets(squares: list, places: np.ndarray) -> np.ndarray:
    """
    Return the derivatives in x of the odd law from -1/2 to 1/2, shape (7, m).

    Parameters
    ----------
    squares
        Squared roots in normalised time with their multiplicities.
    places
        Distances from the start, x + 1.

    """
    mp = oracle.mp
    zeros = sum(multiplicity for z, multiplicity in squares if z == 0)
    rates = [mp.sqrt(z) for z, _ in squares if z != 0]

    def derivatives(u):
        """Return the derivatives 0 to 6 of every odd solution at x = u - 1 in columns."""
        x, columns = u - 1, []
        for power in range(1, 2 * zeros, 2):
            columns.append([perm(power, k) * x ** max(power - k, 0) for k in range(7)])
        for beta in rates:
            rise, fall = mp.exp(beta * (u - 2)), mp.exp(-beta * u)
            powers = [beta**k for k in range(7)]
            columns.append(
                [b * (rise + fall if k % 2 else rise - fall) for k, b in enumerate(powers)]
            )
        return columns

    ends = derivatives(mp.mpf(2))
    matrix = mp.matrix(6, 6)
    for i, column in enumerate(ends):
        for k in range(6):
            matrix[k, i] = column[k]
    target = mp.matrix([mp.mpf(1) / 2, 0, 0, 0, 0, 0])
    weights = mp.lu_solve(matrix, target)
    table = np.empty((7, len(places)))
    for j, place in enumerate(places):
        columns = derivatives(mp.mpf(float(place)))
        for k in range(7):
            table[k, j] = float(mp.re(mp.fdot(weights, [column[k] for column in columns])))
    return table


def relative_error(case: Case, found: Plan, is_checked: bool) -> float:
    """Return the largest error of the derivatives 0 to 6 and of the torque."""
    half = 0.5 * case.duration
    squares = oracle.square_roots(exact_equation(case))
    scaled = [(z * oracle.mp.mpf(half) ** 2, multiplicity) for z, multiplicity in squares]
    plain = np.array([complex(z) for z, multiplicity in scaled for _ in range(multiplicity)])
    fastest = np.sqrt(np.abs(plain).max())
    times = half * np.concatenate(
        [[0.0], np.geomspace(0.2 / (1.0 + fastest), 1.0, 5), [0.31, 1.42, 2.0]]
    )
    digits = digits_for(plain)
    with oracle.mp.workdps(digits):
        expected = exact_jets(scaled, times / half)
    peak = np.abs(expected).max(axis=1, keepdims=True)
    if is_checked:
        with oracle.mp.workdps(digits + 60):
            again = exact_jets(scaled, times / half)
        assert (np.abs(again - expected) <= ORACLE_TOLERANCE * peak).all()
    rates = half ** -np.arange(7.0)[:, None]
    jet = found.trajectory.laws[0].jet(times, 6) / rates
    jet[0] -= 0.5
    samples = found.at(times)
    row = found.problem.flat_map.effort
    torque = row @ (rates * expected)[: len(row)]
    scale = np.abs(row[:, None] * (rates * expected)[: len(row)]).sum(axis=0).max()
    return float(
        max(
            np.max(np.abs(jet - expected) / peak),
            np.abs(samples.driving_effort - torque)[1:-1].max() / scale,
        )
    )


def certified(case: Case, found: Plan, rng: np.random.Generator) -> tuple[float, float, float]:
    """Return the residuals of the ends and of the equation, and the most a perturbation gains."""
    duration = case.duration
    a = QuadraticCost(matrix=found.problem.cost.matrix).characteristic()
    x, w = np.polynomial.legendre.leggauss(8)
    edges = np.concatenate([[0.0], np.geomspace(1e-10, 0.5, 24)])
    widths = np.diff(edges)[:, None]
    near = (edges[:-1, None] + 0.5 * widths * (x + 1.0)).ravel()
    fractions = np.concatenate([[0.0], near, 1.0 - near[::-1], [1.0]])
    weights = np.tile((0.5 * widths * w).ravel(), (2, 1))
    weights = np.concatenate([[0.0], weights[0], weights[1, ::-1], [0.0]]) * duration
    jet = found.trajectory.laws[0].jet(fractions * duration, 12)
    terms = a[1:, None] * jet[2::2]
    size = np.abs(terms).sum(axis=0).max() or 1.0  # A polynomial has no terms.
    equation = terms.sum(axis=0)
    ends = jet[:6, [0, -1]].copy()
    ends[0, 1] -= 1.0
    boundary = np.max(np.abs(ends) / np.abs(jet[:6]).max(axis=1, keepdims=True))
    nodes, node_weights = np.polynomial.legendre.leggauss(24)
    rates = (2.0 / duration) ** np.arange(1.0, 7.0)
    gain = 0.0
    for shape in ([1.0], [0.0, 1.0], rng.normal(size=BUMP_DEGREE + 1)):
        # It vanishes at both ends with five derivatives, so that the changed law is admissible.
        bump = Polynomial([1.0, 0.0, -1.0]) ** 6 * Polynomial(shape)
        change = np.array([bump.deriv(k)(nodes) for k in range(1, 7)]) * rates[:, None]
        own = (
            0.5
            * duration
            * np.einsum('im,ij,jm,m->', change, found.problem.cost.matrix, change, node_weights)
        )
        # Integrated by parts, the cost rises by 2 s (v, equation) + s^2 (own cost of v).
        scale = CHANGE * np.sqrt(found.cost_value / own)
        moved = 2.0 * scale * bump(2.0 * fractions - 1.0)
        roundoff = STATIONARITY * (weights @ (np.abs(moved) * np.abs(terms).sum(axis=0)))
        first = max(0.0, abs(weights @ (moved * equation)) - roundoff)
        gain = max(gain, first / (CHANGE**2 * found.cost_value))
    return float(boundary), float(np.abs(equation).max() / size), float(gain)


def grid_difference(found: Plan, intervals: int) -> float:
    """Return how far even samples are from those at the same times, relative to the peaks."""
    samples = found.sample(found.duration / intervals)
    assert len(samples.times) == intervals + 1
    again = found.at(samples.times)
    difference = np.abs(samples.planned - again.planned).max(axis=2)
    return float((difference[0] / found.problem.unit.peaks / found.problem.rates).max())


def findings(seed: int, number: int) -> Findings:
    """Return what there is to say of one case."""
    rng = np.random.default_rng([seed, number])
    case = (arm_case if number % 2 else custom_case)(rng)
    request = MotionRequest(start=[0.0, 0.0], final=[1.0, 0.0], duration=case.duration)
    with np.errstate(all='raise'):
        try:
            found = plan(request, case.arm, case.options)
        except UncertifiedPlan as error:
            return Findings(1, 0.0, number, 0.0, 0.0, 0.0, 0.0, (f'case {number}: {error}',))
    # What is far from a thin layer may underflow.
    with np.errstate(all='raise', under='ignore'):
        grid = grid_difference(found, int(np.exp(rng.uniform(0.0, np.log(MAX_INTERVALS)))))
    error = relative_error(case, found, number % CHECK_EVERY == 0)
    boundary, stationarity, gain = certified(case, found, rng)
    return Findings(1, error, number, boundary, stationarity, grid, gain, ())


def batch_findings(seed: int, first: int, stop: int) -> Findings:
    """Return the worst of some cases; a warning is an error."""
    warnings.simplefilter('error')
    return reduce(Findings.joined, [findings(seed, number) for number in range(first, stop)])
