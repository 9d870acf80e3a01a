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

"""Optimal paths through via points, against other routes to the same optimum."""

from functools import partial

from flat_planner_ros.core.arm.errors import InvalidRequest, UncertifiedPlan
from flat_planner_ros.core.arm.flat_map import flat_map, FlatModel
from flat_planner_ros.core.motion_law.cost import QuadraticCost, Strategy, strategy_cost
from flat_planner_ros.core.motion_law.extremal import BoundaryConditions, extremals
from flat_planner_ros.core.motion_law.optimal_path import optimal_path, PathConditions
from flat_planner_ros.core.motion_law.path_cost import PathCost
from flat_planner_ros.core.motion_law.segment_bases import known_kind
import numpy as np
from path_programme import programmed_path
import pytest

TOLERANCE = 1e-9
"""What a plan demands of both residuals."""

RELAXATION = 2e-5 / 3e-3
"""Of the paper's arm with the exact flat model [s]."""

STRATEGIES = ('polynomial', 'effort', 'energy', 'mixed', 'custom')
"""Names of the costs below."""

AT_REST = np.zeros(6)
"""Start at zero."""

MOVING = np.array([0.3, 1.0, -5.0, 20.0, -100.0, 3000.0])
"""Derivatives of a start in motion [rad/s^k]."""

DEPTHS = 0.5 ** np.arange(24.0, 0.0, -1.0)
FRACTIONS = np.concatenate([[0.0], DEPTHS, 1.0 - DEPTHS[-2::-1], [1.0]])
"""Of a segment: they crowd towards its ends as boundary layers do."""


def custom_matrix():
    """Return a Q of rank four with all its entries occupied."""
    factors = np.random.default_rng(7).normal(size=(4, 6)) * 12.0 ** np.arange(5.0, -1.0, -1.0)
    factors[0, 5] = np.sqrt(max(0.0, 1.0 - (factors[1:, 5] ** 2).sum() * 0.01))
    factors[1:, 5] *= 0.1
    matrix = factors.T @ factors
    matrix[5, 5] = 1.0
    return matrix


@pytest.fixture(scope='module')
def costs():
    """Return one cost of each kind for the paper's arm."""
    from flat_planner_ros.core.arm.planar_arm import PlanarArm

    arm = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
    named = partial(strategy_cost, flat_map=flat_map(arm, FlatModel.APPROXIMATE))
    return {
        'polynomial': named(Strategy.POLYNOMIAL),
        'effort': named(Strategy.MIN_CONTROL_EFFORT, r=150.0),
        'energy': named(Strategy.MIN_POTENTIAL_ENERGY, p=17.0),
        'mixed': named(Strategy.MIXED, r=30.0, p=3.0),
        'custom': QuadraticCost(matrix=custom_matrix()),
        'extreme': named(Strategy.MIXED, r=1000.0, p=1000.0),
    }


def path(edges, values, start=AT_REST, relaxation=0.0):
    """Return a path of one variable."""
    return PathConditions(
        edges=np.array(edges, dtype=float),
        start=np.array([start]),
        values=np.array([values], dtype=float),
        relaxations=np.array([relaxation]),
    )


def certified(cost, wanted):
    """Return an optimal path that a plan would accept."""
    found = optimal_path(cost, wanted)
    assert found.boundary_residual <= TOLERANCE
    assert found.optimality_residual <= TOLERANCE
    return found


def segment_jets(law, order):
    """Return the derivatives of a piecewise law on every segment, shape (p, order + 1, m)."""
    return np.array([part.jet(part.duration * FRACTIONS, order) for part in law.laws])


def worst(found, expected):
    """Return the largest difference of derivatives, relative to their peaks on the path."""
    difference = np.abs(np.subtract(found, expected)).max(axis=(0, 2))
    return (difference / np.abs(expected).max(axis=(0, 2))).max()


def cost_of(cost, law):
    """Return the integral of Y^T Q Y by quadrature on fine panels."""
    nodes, weights = np.polynomial.legendre.leggauss(20)
    total = 0.0
    for part in law.laws:
        panels = np.linspace(0.0, part.duration, 101)
        step = panels[1] / 2.0
        times = (panels[:-1, None] + step * (nodes + 1.0)).ravel()
        vector = part.jet(times, 6)[1:]
        density = np.einsum('im,ij,jm->m', vector, cost.matrix, vector)
        total += density @ np.tile(step * weights, 100)
    return total


@pytest.mark.parametrize('start', [AT_REST, MOVING], ids=['rest', 'moving'])
@pytest.mark.parametrize('relaxation', [0.0, RELAXATION])
@pytest.mark.parametrize('name', STRATEGIES)
def test_equals_the_quadratic_programme(costs, name, relaxation, start):
    edges, values = np.array([0.0, 0.25, 0.7, 1.0]), np.array([1.0, 0.5, 2.0])
    cost = costs[name]
    found = certified(cost, path(edges, values, start, relaxation))
    programmed = programmed_path(cost.matrix, edges, values, start, relaxation)
    assert found.cost_value == pytest.approx(programmed.cost_value, rel=1e-9)
    expected = [programmed.jet(segment, FRACTIONS) for segment in range(3)]
    # What rounding costs the programme, not the path: it grows with the programme's size.
    assert worst(segment_jets(found.laws[0], 6), expected) < 2e-8


@pytest.mark.parametrize('relaxation', [0.0, RELAXATION])
@pytest.mark.parametrize('name', [*STRATEGIES, 'extreme'])
@pytest.mark.parametrize(
    'edges',
    [(0.0, 0.3, 0.6, 1.0), (0.0, 1.0, 1.001, 2.0), (0.0, 1e-3, 1.0, 1.001)],
    ids=['even', 'inner', 'ends'],
)
def test_equals_the_solution_in_many_digits(costs, oracle, name, relaxation, edges):
    import path_oracle

    values = (1.0, 1.0 + 5.0 * (edges[2] - edges[1]), 2.0)
    cost = costs[name]
    found = certified(cost, path(edges, values, MOVING, relaxation))
    roots = oracle.square_roots(cost.characteristic())
    reference = path_oracle.solve_path(roots, np.array(edges), values, MOVING, relaxation)
    sparse = slice(None, None, 6)
    expected = [
        reference.jet(i, law.duration * FRACTIONS[sparse], 6)
        for i, law in enumerate(found.laws[0].laws)
    ]
    got = segment_jets(found.laws[0], 6)[:, :, sparse]
    # Boundary layers of the extreme weights and the relaxation nearly tie two conditions.
    assert worst(got, expected) < (1e-9 if name == 'extreme' else 1e-11)


@pytest.mark.parametrize('relaxation', [0.0, RELAXATION])
@pytest.mark.parametrize('name', STRATEGIES)
def test_no_admissible_change_is_cheaper(costs, name, relaxation):
    edges, values = np.array([0.0, 0.4, 0.9, 1.3]), np.array([1.0, 0.2, -0.5])
    cost = costs[name]
    law = certified(cost, path(edges, values, MOVING, relaxation)).laws[0]
    nodes, weights = np.polynomial.legendre.leggauss(200)
    rng = np.random.default_rng(3)
    legendre = partial(np.polynomial.Legendre, domain=[0.0, edges[-1]])
    # Double zeros: neither the value nor the first derivative changes at a via point.
    variation = legendre([1.0])
    for root in [*np.repeat(edges[[0, -1]], 6), *np.repeat(edges[1:-1], 2)]:
        variation *= legendre([0.5 * edges[-1] - root, 0.5 * edges[-1]])
    for factor in rng.normal(size=(6, 4)):
        change = variation * legendre(factor)
        change, product, square, own = change / abs(change(0.6)), 0.0, 0.0, 0.0
        for begin, end in zip(edges[:-1], edges[1:], strict=True):
            times = begin + (end - begin) * (nodes + 1.0) / 2.0
            weight = weights * (end - begin) / 2.0
            vector = law.jet(times, 6)[1:]
            varied = np.array([change.deriv(order)(times) for order in range(1, 7)])
            product += weight @ np.einsum('im,ij,jm->m', vector, cost.matrix, varied)
            square += weight @ np.einsum('im,ij,jm->m', varied, cost.matrix, varied)
            own += weight @ np.einsum('im,ij,jm->m', vector, cost.matrix, vector)
        assert square > 0.0
        assert abs(product) < 1e-9 * np.sqrt(square * own)


@pytest.mark.parametrize('name', [*STRATEGIES, 'extreme'])
def test_fifty_points_of_three_variables(costs, name):
    rng = np.random.default_rng(5)
    edges = np.concatenate([[0.0], np.cumsum(rng.uniform(0.1, 1.0, 51))])
    start = np.zeros((3, 6))
    values = rng.normal(size=(3, 51))
    found = certified(
        costs[name],
        PathConditions(
            edges=edges, start=start, values=values, relaxations=np.array([RELAXATION, 0, 0])
        ),
    )
    for index, (law, passed) in enumerate(zip(found.laws, values, strict=True)):
        jet = law.jet(edges[1:], 1)
        reached = jet[0] + (RELAXATION if index == 0 else 0.0) * jet[1]
        assert np.abs(reached - passed).max() < 1e-12
        alone = certified(
            costs[name], path(edges, passed, start[index], RELAXATION if index == 0 else 0.0)
        )
        assert worst(segment_jets(law, 6), segment_jets(alone.laws[0], 6)) < 1e-11


@pytest.mark.parametrize('name', STRATEGIES)
def test_the_cost_alone_is_that_of_the_laws(costs, name):
    edges, values = np.array([0.0, 0.5, 0.9, 2.6]), np.array([1.0, 0.4, 2.0])
    conditions = path(edges, values, MOVING, RELAXATION)
    found = certified(costs[name], conditions)
    alone = PathCost(costs[name], conditions)
    assert alone.value == pytest.approx(found.cost_value, rel=1e-9)
    assert alone.slopes == pytest.approx(found.time_slopes, rel=1e-8)


@pytest.mark.parametrize('start', [AT_REST, MOVING], ids=['rest', 'moving'])
@pytest.mark.parametrize('name', STRATEGIES)
def test_curvatures_of_the_cost(costs, name, start):
    """The slopes' own slopes, of two variables of which one is relaxed, by differences."""
    edges = np.array([0.0, 0.4, 0.9, 1.6, 2.1])

    def cost_at(shifts):
        return PathCost(
            costs[name],
            PathConditions(
                edges=edges + np.array([0.0, *shifts, 0.0]),
                start=np.array([start, AT_REST]),
                values=np.array([[1.0, 0.2, -0.5, 0.1], [0.3, 0.8, 0.2, -0.4]]),
                relaxations=np.array([RELAXATION, 0.0]),
            ),
        )

    step = 1e-5
    expected = np.array(
        [(cost_at(row).slopes - cost_at(-row).slopes) / (2.0 * step) for row in step * np.eye(3)]
    )
    found = cost_at(np.zeros(3)).curvatures()
    assert np.abs(found - expected).max() < 1e-6 * np.abs(expected).max()


def test_segments_alike_are_evaluated_together(costs):
    """How many sets of solutions a path asks for does not grow with its segments."""

    def sets_of(edges, values):
        before = known_kind.cache_info()
        certified(costs['effort'], path(edges, values))
        after = known_kind.cache_info()
        return after.hits + after.misses - before.hits - before.misses

    rng = np.random.default_rng(2)
    for count in (10, 20, 40):
        edges = np.concatenate([[0.0], np.cumsum(rng.uniform(0.3, 1.0, count))])
        assert sets_of(edges, rng.normal(size=count)) <= 4
    assert sets_of(np.arange(41.0), rng.normal(size=40)) == 1


@pytest.mark.parametrize('name', STRATEGIES)
def test_a_path_continues_itself(costs, name):
    """From any place of an optimal path on, its rest is optimal."""
    edges, values = np.array([0.0, 0.5, 0.9, 1.6]), np.array([1.0, 0.4, 2.0])
    law = certified(costs[name], path(edges, values, MOVING, RELAXATION)).laws[0]
    for switch in (0.2, 0.7, 1.1):
        later = edges[1:] > switch
        rest = np.concatenate([[0.0], edges[1:][later] - switch])
        jet = law.jet(switch, 5)[:, 0]
        found = certified(costs[name], path(rest, values[later], jet, RELAXATION)).laws[0]
        times = np.linspace(0.0, rest[-1], 200)
        expected = law.jet(switch + times, 6)
        assert worst([found.jet(times, 6)], [expected]) < 1e-9


@pytest.mark.parametrize('name', STRATEGIES)
def test_a_point_on_the_way_changes_nothing(costs, name):
    ends = BoundaryConditions(start=AT_REST, end=np.array([1.0, 0, 0, 0, 0, 0]))
    [direct] = extremals(costs[name].characteristic(), 1.0, [ends])
    edges = np.array([0.0, 0.3, 0.55, 1.0])
    jet = direct.jet(edges[1:], 1)
    found = certified(
        costs[name], path(edges, jet[0] + RELAXATION * jet[1], relaxation=RELAXATION)
    )
    times = np.linspace(0.0, 1.0, 300)
    assert worst([found.laws[0].jet(times, 6)], [direct.jet(times, 6)]) < 1e-10
    assert np.abs(found.time_slopes).max() < 1e-8 * found.cost_value


@pytest.mark.parametrize('name', STRATEGIES)
def test_a_path_from_rest_to_rest_can_be_run_backwards(costs, name):
    edges, values = np.array([0.0, 0.5, 0.8, 1.6]), np.array([1.0, 0.4, 2.0])
    law = certified(costs[name], path(edges, values)).laws[0]
    back = certified(costs[name], path(edges[-1] - edges[::-1], [-1.6, -1.0, -2.0])).laws[0]
    times = np.linspace(0.0, 1.6, 200)
    signs = (-1.0) ** np.arange(7)[:, None]
    mirrored = signs * back.jet(1.6 - times, 6)
    mirrored[0] += 2.0
    assert worst([law.jet(times, 6)], [mirrored]) < 1e-10


@pytest.mark.parametrize('name', [*STRATEGIES, 'extreme'])
@pytest.mark.parametrize('relaxation', [0.0, RELAXATION])
@pytest.mark.parametrize('gap', 10.0 ** -np.arange(2.0, 13.0))
def test_nearly_coincident_times_are_right_or_refused(costs, oracle, name, relaxation, gap):
    """Times are refused only where rounding has the better of them."""
    import path_oracle

    edges, values = (0.0, 1.0, 1.0 + gap, 2.0), (1.0, 1.0 + 3.0 * gap, 2.0)
    try:
        found = optimal_path(costs[name], path(edges, values, relaxation=relaxation))
    except (ArithmeticError, UncertifiedPlan):
        assert gap < 1e-4
        return
    if max(found.boundary_residual, found.optimality_residual) > TOLERANCE:
        # Another LAPACK (NumPy 1.26) rounds worse by a decade than that of NumPy 2.4.
        assert gap < 2e-4
        return
    roots = oracle.square_roots(costs[name].characteristic())
    reference = path_oracle.solve_path(
        roots, np.array(edges), values, AT_REST, relaxation, digits=200
    )
    sparse = slice(None, None, 8)
    expected = [
        reference.jet(i, law.duration * FRACTIONS[sparse], 6)
        for i, law in enumerate(found.laws[0].laws)
    ]
    assert worst(segment_jets(found.laws[0], 6)[:, :, sparse], expected) < 1e-9


@pytest.mark.parametrize('name', STRATEGIES)
def test_equal_values(costs, name):
    found = certified(costs[name], path([0.0, 0.5, 0.7, 1.5], [1.0, 1.0, 1.0]))
    assert found.laws[0].jet([0.5, 0.7, 1.5], 0)[0] == pytest.approx(1.0, abs=1e-13)
    still = certified(costs[name], path([0.0, 0.5, 0.7, 1.5], [0.0, 0.0, 0.0]))
    assert not still.laws[0].jet(np.linspace(0.0, 1.5, 50), 11).any()
    assert still.cost_value == 0.0


@pytest.mark.parametrize('name', STRATEGIES)
def test_a_distant_place_costs_no_digits(costs, name):
    values = np.array([1.0, 0.5, 2.0])
    near = certified(costs[name], path([0.0, 0.5, 0.7, 1.5], values))
    start = AT_REST + 2.0**20 * np.eye(6)[0]
    far = certified(costs[name], path([0.0, 0.5, 0.7, 1.5], values + 2.0**20, start))
    assert far.cost_value == near.cost_value
    times = np.linspace(0.0, 1.5, 100)
    np.testing.assert_array_equal(near.laws[0].jet(times, 6)[1:], far.laws[0].jet(times, 6)[1:])


@pytest.mark.parametrize('start', [AT_REST, MOVING], ids=['rest', 'moving'])
@pytest.mark.parametrize('relaxation', [0.0, RELAXATION])
@pytest.mark.parametrize('name', STRATEGIES)
def test_cost_and_its_slopes(costs, name, relaxation, start):
    edges, values = np.array([0.0, 0.4, 0.9, 1.3]), [1.0, 0.2, -0.5]
    found = certified(costs[name], path(edges, values, start, relaxation))
    assert found.cost_value == pytest.approx(cost_of(costs[name], found.laws[0]), rel=1e-11)
    for index, slope in enumerate(found.time_slopes):

        def cost_at(shift, index=index):
            moved = edges.copy()
            moved[1 + index] += shift
            return optimal_path(costs[name], path(moved, values, start, relaxation)).cost_value

        # Five points: the error falls with the fourth power of the step.
        step = 2e-4
        near, far = cost_at(step) - cost_at(-step), cost_at(2 * step) - cost_at(-2 * step)
        assert slope == pytest.approx((8.0 * near - far) / (12.0 * step), rel=1e-7)


def test_times_in_any_order(costs):
    edges = np.array([0.0, 0.5, 0.7, 1.5])
    law = certified(costs['effort'], path(edges, [1.0, 0.5, 2.0])).laws[0]
    times = np.concatenate([edges, np.linspace(0.0, 1.5, 40)])
    shuffled = np.random.default_rng(0).permutation(times)
    expected = np.column_stack([law.jet(time, 6) for time in shuffled])
    np.testing.assert_allclose(law.jet(shuffled, 6), expected, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(law.jet(times, 2)[2], law.jet(times, 6)[2], rtol=1e-12, atol=1e-12)
    assert law.duration == 1.5


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'edges': [0.0, 0.5, 0.5, 1.0]}, 'ascend'),
        ({'edges': [0.1, 0.5, 0.7, 1.0]}, 'ascend'),
        ({'edges': [0.0, 0.5, 1.0]}, 'fit'),
        ({'values': [[1.0, np.nan, 0.0]]}, 'finite'),
        ({'start': [[0.0] * 5]}, 'fit'),
        ({'relaxations': [0.0, 0.0]}, 'fit'),
    ],
)
def test_impossible_paths_are_refused(change, message):
    valid = {
        'edges': [0.0, 0.5, 0.7, 1.0],
        'start': [[0.0] * 6],
        'values': [[1.0, 2.0, 0.0]],
        'relaxations': [0.0],
    }
    PathConditions(**valid)
    with pytest.raises(InvalidRequest, match=message):
        PathConditions(**{**valid, **change})
