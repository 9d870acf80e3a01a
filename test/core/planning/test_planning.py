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

"""Plans against multiple precision, reference numbers, dense sampling and the simulated arm."""

from importlib import import_module
import json
from pathlib import Path

from flat_planner_ros.core.arm.errors import InvalidCost, InvalidRequest, NotFlat, UncertifiedPlan
from flat_planner_ros.core.arm.flat_map import FlatModel
from flat_planner_ros.core.arm.planar_arm import PlanarArm
from flat_planner_ros.core.motion_law.cost import Strategy
from flat_planner_ros.core.planning import certified_plan
from flat_planner_ros.core.planning.motion_problem import problem_of
from flat_planner_ros.core.planning.planner import plan
from flat_planner_ros.core.planning.request import MotionRequest, PlanningOptions
from flat_planner_ros.core.plant.effort_profile import EffortProfile
from flat_planner_ros.core.plant.rollout import rollout
import numpy as np
import pytest
from random_cases import cases
from scipy.integrate import trapezoid

extremals = import_module('flat_planner_ros.core.motion_law.extremal')

REFERENCE = json.loads(
    (Path(__file__).parents[2] / 'reference' / 'motion_laws.json').read_text('utf-8')
)

TOLERANCE = 1e-9
"""Largest error of a derivative, relative to its peak [-]."""

RANDOM_CASES = cases(250)

PAPER = FlatModel.APPROXIMATE
"""The reference numbers are those of the paper's torque."""

STRATEGIES = {
    'polynomial': PlanningOptions(strategy=Strategy.POLYNOMIAL, flat_model=PAPER),
    'effort': PlanningOptions(strategy=Strategy.MIN_CONTROL_EFFORT, r=150.0, flat_model=PAPER),
    'energy': PlanningOptions(strategy=Strategy.MIN_POTENTIAL_ENERGY, p=17.0, flat_model=PAPER),
    'mixed': PlanningOptions(strategy=Strategy.MIXED, r=150.0, p=17.0, flat_model=PAPER),
    'custom': PlanningOptions(
        strategy=Strategy.CUSTOM,
        custom=np.diag([1e4, 0.0, 3e8, 0.0, 0.0, 1.0]),
        flat_model=PAPER,
    ),
}

RMS = {
    ('polynomial', 0.0): 0.008246,
    ('effort', 0.0): 0.007406,
    ('energy', 0.0): 0.008692,
    ('polynomial', 2e-5): 0.008297,
    ('effort', 2e-5): 0.007444,
    ('energy', 2e-5): 0.008761,
}
"""Root mean square of the effort [N m] of strategy and damping on the paper's motion."""


def arm_of(both, last, stiffness, damping):
    """Return an arm of two joints."""
    return PlanarArm.reduced(inertia_star=(both, last), stiffness=stiffness, damping=damping)


def paper_arm_with(damping):
    """Return the paper's arm with another damper."""
    return arm_of(6.4e-4, 3.3e-5, 3e-3, damping)


def half_turn(duration=1.0):
    """Return the motion of the paper."""
    return MotionRequest(start=[0.0, 0.0], final=[np.pi, 0.0], duration=duration)


def mixed(r, p):
    """Return the options whose special cases are three of the named strategies."""
    return PlanningOptions(strategy=Strategy.MIXED, r=float(r), p=float(p), flat_model=PAPER)


def assert_close(found, expected):
    """Compare relative to the peak."""
    np.testing.assert_allclose(found, expected, rtol=0, atol=TOLERANCE * np.abs(expected).max())


def gauss(duration, panels=400, nodes=12):
    """Return times and weights of a quadrature that is even, not fitted to the law."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    starts = np.arange(panels)[:, None] / panels
    return (
        duration * (starts + 0.5 * (x + 1.0) / panels).ravel(),
        duration * np.tile(0.5 * w / panels, panels),
    )


@pytest.mark.parametrize('case', REFERENCE, ids=lambda case: case['name'])
def test_reference_motion_laws(case):
    duration, distance = case['T'], case['delta']
    found = plan(
        MotionRequest(start=[0.5, 0.0], final=[0.5 + distance, 0.0], duration=duration),
        arm_of(case['I1'], case['I2'], case['k'], case['c']),
        mixed(case['r'], case['p']),
    )
    times = np.array(case['s']) * duration
    samples, jet = found.at(times), found.trajectory.laws[0].jet(times, 6)
    jet[0] -= 0.5
    for derivative, expected in zip(jet, case['y'], strict=True):
        assert_close(derivative, expected)
    for derivative, expected in zip(samples.flat[0, 1:], case['y'][1:6], strict=True):
        assert_close(derivative, expected)
    assert_close(samples.efforts[:, 0], case['tau'])
    assert_close(samples.positions[:, 1], case['q2'])
    assert_close(samples.positions.sum(axis=1) - 0.5, case['y'][0])
    np.testing.assert_array_equal(samples.efforts[:, 1], 0.0)
    assert found.rms_effort[0] == pytest.approx(case['rms'], rel=1e-9)
    assert found.cost_value == pytest.approx(case['cost'], rel=1e-9)


@pytest.mark.parametrize(('strategy', 'damping'), RMS)
def test_effort_of_the_papers_example(strategy, damping):
    found = plan(half_turn(), paper_arm_with(damping), STRATEGIES[strategy])
    assert found.rms_effort[0] == pytest.approx(RMS[strategy, damping], abs=0.51e-6)


@pytest.mark.parametrize('damping', [0.0, 2e-5])
def test_each_strategy_wins_its_own_discipline(damping):
    """The least effort, the least potential energy and the least y^(6) of the four."""
    times, weights = gauss(1.0)
    score = {}
    for name in ('polynomial', 'effort', 'energy', 'mixed'):
        found = plan(half_turn(), paper_arm_with(damping), STRATEGIES[name])
        jet = found.trajectory.laws[0].jet(times, 6)
        score[name] = [weights @ jet[6] ** 2, found.rms_effort[0], weights @ jet[2] ** 2]
    jerk, effort, energy = np.array([score[n] for n in ('polynomial', 'effort', 'energy')]).T
    assert np.argmin(jerk) == 0
    assert np.argmin(effort) == 1
    assert np.argmin(energy) == 2
    assert energy[2] < score['mixed'][2] < energy[1]


def random_case(rng):
    """Return both, last, stiffness, damping, r, p, duration over the whole admitted range."""
    both = 10.0 ** rng.uniform(-6, 1)
    last = both * 10.0 ** rng.uniform(-3, np.log10(0.9))
    frequency = 2.0 * np.pi * np.exp(rng.uniform(np.log(0.1), np.log(50.0)))
    series = last * (both - last) / both
    stiffness = frequency**2 * series
    damping = 2.0 * rng.choice([0.0, rng.uniform(0.0, 0.3)]) * frequency * series
    r, p = (rng.choice([0.0, 10.0 ** rng.uniform(-2, 3)]) for _ in range(2))
    duration = np.exp(rng.uniform(np.log(0.05), np.log(60.0)))
    return (both, last, stiffness, damping), float(r), float(p), float(duration)


def test_random_motions_of_the_whole_range(oracle):
    rng = np.random.default_rng(1)
    start, end = np.zeros(6), np.eye(6)[0]
    worst, checked, residuals = 0.0, 0, []
    for _ in range(RANDOM_CASES):
        data, r, p, duration = random_case(rng)
        both, last, stiffness, damping = data
        found = plan(
            MotionRequest(start=[0.0, 0.0], final=[1.0, 0.0], duration=duration),
            arm_of(*data),
            mixed(r, p),
        )
        residuals.append((found.boundary_residual, found.optimality_residual))
        roots = oracle.square_roots(
            oracle.characteristic(
                both=both, last=last, stiffness=stiffness, damping=damping, r=r, p=p
            )
        )
        fastest = float(max(abs(oracle.mp.sqrt(z)) for z, _ in roots)) * duration
        layer = np.geomspace(0.1 / (1.0 + fastest), 0.5, 6)
        fractions = np.concatenate([[0.0, 0.25], layer, [0.71, 1.0]])
        times = fractions * duration
        expected = oracle.solve(roots, duration, start, end).jet(times, 6)
        peak = np.abs(expected).max(axis=1, keepdims=True)
        worst = max(
            worst, float(np.max(np.abs(found.trajectory.laws[0].jet(times, 6) - expected) / peak))
        )
        samples = found.at(times[1:-1])
        coupling = last * (both - last) / stiffness
        terms = [
            both * expected[2],
            coupling * expected[4],
            -coupling * damping / stiffness * expected[5],
        ]
        size = np.abs(terms).sum(axis=0).max()
        miss = np.abs(samples.efforts[:, 0] - np.sum(terms, axis=0)[1:-1]).max()
        assert miss <= TOLERANCE * size
        checked += 1
    assert worst <= TOLERANCE
    assert checked == RANDOM_CASES
    # Plans promise 1e-9; a nearly double imaginary root beside very fast ones comes closest.
    assert (np.max(residuals, axis=0) <= [5e-10, 1e-12]).all()
    assert (np.quantile(residuals, 0.9, axis=0) <= 1e-12).all()


def test_the_oracle_has_digits_to_spare(oracle, monkeypatch):
    """The hardest corner, roots of 1e-6 in number twelve, comes out the same with more digits."""
    data = {'both': 1e-6, 'last': 5e-7, 'stiffness': 1e-7, 'damping': 0.0, 'r': 0.01, 'p': 0.0}
    times, laws = np.linspace(0.0, 0.05, 7), []
    for digits in (140, 220):
        monkeypatch.setattr(oracle, 'DIGITS', digits)
        roots = oracle.square_roots(oracle.characteristic(**data))
        laws.append(oracle.solve(roots, 0.05, np.zeros(6), np.eye(6)[0]).jet(times, 6))
    np.testing.assert_allclose(laws[0], laws[1], rtol=1e-15, atol=1e-15)


@pytest.mark.parametrize('name', STRATEGIES)
def test_a_plan_states_what_it_was_asked(name, paper_arm):
    request = half_turn()
    found = plan(request, paper_arm, STRATEGIES[name])
    assert found.request is request
    assert found.options is STRATEGIES[name]
    assert 0.0 <= found.boundary_residual <= 1e-12
    assert 0.0 <= found.optimality_residual <= 1e-12


@pytest.mark.parametrize('name', STRATEGIES)
def test_cost_value_is_the_integral(name, paper_arm):
    found = plan(half_turn(), paper_arm, STRATEGIES[name])
    times, weights = gauss(1.0)
    jet = found.trajectory.laws[0].jet(times, 6)[1:]
    density = np.einsum('im,ij,jm->m', jet, found.problem.cost.matrix, jet)
    assert found.cost_value == pytest.approx(weights @ density, rel=1e-9)


@pytest.mark.parametrize(
    ('constant', 'quantity'),
    [
        ('BOUNDARY_TOLERANCE', 'boundary residual'),
        ('OPTIMALITY_TOLERANCE', 'optimality residual'),
    ],
)
def test_refuses_a_law_that_misses_its_certificate(monkeypatch, paper_arm, constant, quantity):
    options = STRATEGIES['mixed']
    plan(half_turn(), paper_arm, options)
    monkeypatch.setattr(certified_plan, constant, 0.0)
    with pytest.raises(UncertifiedPlan, match=quantity) as caught:
        plan(half_turn(), paper_arm, options)
    assert caught.value.quantity == quantity
    assert 0.0 < caught.value.residual < 1e-12
    assert caught.value.tolerance == 0.0


@pytest.fixture
def no_known_units():
    """Forget what other tests planned, and what this one plans."""
    extremals.kept_units.cache_clear()
    yield
    extremals.kept_units.cache_clear()


@pytest.mark.parametrize('damage', ['boundary', 'optimality'])
@pytest.mark.parametrize('form', ['series', 'roots'])
def test_certificates_see_a_law_that_is_wrong(monkeypatch, no_known_units, form, damage):
    """A law for other ends misses the boundary, one for another cost the optimality."""
    solved, solver = extremals.solved, extremals.BoundarySolver

    def wrong_series(coefficients, terms):
        if damage == 'optimality':
            return solved(coefficients * [1, 1, 1 + 1e-6, 1, 1, 1, 1], terms)
        found = solved(coefficients, terms)
        return found._replace(amplitudes=found.amplitudes * (1.0 + 1e-8))

    class WrongSolver(solver):
        """Meets other ends."""

        def total(self, target):
            return super().total(target * (1.0 + 1e-8))

    def wrong_roots(clusters, parity):
        if damage == 'boundary':
            return WrongSolver(clusters, parity)
        return solver([c._replace(centre=c.centre * (1.0 + 1e-6)) for c in clusters], parity)

    if form == 'roots':
        monkeypatch.setattr(extremals, 'FASTEST', 0.0)
        monkeypatch.setattr(extremals, 'BoundarySolver', wrong_roots)
    else:
        monkeypatch.setattr(extremals, 'solved', wrong_series)
    with pytest.raises(UncertifiedPlan, match=damage):
        plan(half_turn(), paper_arm_with(2e-5), STRATEGIES['energy'])


@pytest.mark.parametrize(('distance', 'duration'), [(1e308, 1e-3), (1.0, 1e-70)])
def test_refuses_what_leaves_double_precision(paper_arm, distance, duration):
    request = MotionRequest(start=[0.0, 0.0], final=[distance, 0.0], duration=duration)
    with pytest.raises(UncertifiedPlan):
        plan(request, paper_arm, STRATEGIES['polynomial'])


@pytest.mark.parametrize('weight', [0.0, 1.0, 1000.0])
@pytest.mark.parametrize('duration', [np.float64(600.0), np.float64(1e5)])
def test_costs_of_long_motions_do_not_overflow(paper_arm, duration, weight):
    """A warning of NumPy would fail the test; the cost of 1 rad is far below 1e-8."""
    for name in Strategy:
        if name in (Strategy.CUSTOM, Strategy.INSENSITIVE):
            continue
        options = PlanningOptions(strategy=name, r=weight, p=weight)
        with np.errstate(all='raise', under='ignore'):
            problem = problem_of(paper_arm, options, duration)
            assert 0.0 < problem.reach < np.inf
        if weight == 0.0:
            assert problem.cost_value < 1e-8


def test_lost_roots_are_a_refusal():
    """Roots that differ by 17 orders of magnitude, some of them next to the imaginary axis."""
    arm = PlanarArm.reduced(inertia_star=(1.0, 0.5), stiffness=0.001, damping=0.02)
    request = MotionRequest(start=np.zeros(2), final=np.array([1.0, 0.0]), duration=600.0)
    options = PlanningOptions(
        strategy=Strategy.MIN_CONTROL_EFFORT, r=1000.0, flat_model=FlatModel.APPROXIMATE
    )
    with pytest.raises(UncertifiedPlan):
        plan(request, arm, options)


@pytest.mark.parametrize('name', STRATEGIES)
@pytest.mark.parametrize('duration', [0.3, 1.0, 4.0])
def test_effort_and_peaks_are_those_of_dense_samples(name, duration, paper_arm):
    found = plan(half_turn(duration), paper_arm, STRATEGIES[name])
    samples = found.sample(duration / 40000)
    mean_square = trapezoid(samples.efforts**2, samples.times, axis=0) / duration
    np.testing.assert_allclose(found.rms_effort, np.sqrt(mean_square), rtol=1e-8)
    for peak, dense in (
        (found.peak_effort, samples.efforts),
        (found.peak_velocity, samples.velocities),
    ):
        expected = np.abs(dense).max(axis=0)
        assert peak.shape == (2,)
        assert (peak <= expected * (1.0 + 1e-6)).all()
        assert (peak >= expected * (1.0 - 2e-3)).all()
    assert found.rms_effort[1] == found.peak_effort[1] == 0.0


def assert_effort_is_the_integral(found, edges):
    """Compare with a quadrature on given fractions of the duration, the same from either end."""
    duration = found.request.duration
    x, w = np.polynomial.legendre.leggauss(12)
    width = np.diff(edges)[:, None]
    times = duration * (edges[:-1, None] + 0.5 * width * (x + 1.0)).ravel()
    weights = (0.5 * width * w).ravel()
    halves = (weights @ found.at(t).efforts[:, 0] ** 2 for t in (times, duration - times))
    assert found.rms_effort[0] == pytest.approx(np.sqrt(sum(halves)), rel=1e-9)


def test_effort_of_random_motions_of_the_whole_range():
    """Boundary layers of any thickness, on a logarithmic scale of time."""
    rng = np.random.default_rng(3)
    checked = 0
    for _ in range(60):
        data, r, p, duration = random_case(rng)
        found = plan(half_turn(duration), arm_of(*data), mixed(r, p))
        assert_effort_is_the_integral(found, np.append(0.0, np.geomspace(1e-9, 0.5, 1000)))
        checked += 1
    assert checked == 60


@pytest.mark.parametrize(
    ('data', 'r', 'p', 'duration'),
    [
        ((3.62, 0.0587, 37.7, 0.0805), 284.7, 0.0, 26.66),
        ((6.42e-3, 2.97e-3, 0.237, 0.0), 88.05, 0.706, 48.14),
        ((2.99, 0.648, 9.51e3, 0.0), 601.7, 1.58, 42.98),
        ((0.86, 0.392, 151.0, 1.57), 51.34, 0.0, 44.33),
    ],
)
def test_effort_of_layers_that_oscillate_many_times(data, r, p, duration):
    """Ten to two thousand radians while the amplitude falls to 1/e."""
    found = plan(half_turn(duration), arm_of(*data), mixed(r, p))
    layers = np.geomspace(1e-9, 1e-3, 400)
    assert_effort_is_the_integral(found, np.concatenate([[0], layers, np.arange(2, 501) * 1e-3]))


def test_samples_cover_the_motion_on_a_fine_enough_grid(paper_arm):
    rng = np.random.default_rng(2)
    checked = 0
    for _ in range(60):
        duration = float(np.exp(rng.uniform(np.log(0.05), np.log(20.0))))
        start, final = (np.array([rng.uniform(-4, 4), 0.0]) for _ in range(2))
        found = plan(
            MotionRequest(start=start, final=final, duration=duration),
            paper_arm,
            STRATEGIES['mixed'],
        )
        divisor = rng.choice([1.0, 2.0, 7.0, 50.0, rng.uniform(0.3, 90.0)])
        samples = found.sample(duration / divisor)
        steps = np.diff(samples.times)
        assert samples.times[0] == 0.0
        assert samples.times[-1] == duration
        assert (steps <= duration / divisor * (1.0 + 1e-8)).all()
        assert np.ptp(steps) <= 1e-12 * duration
        assert len(steps) == max(1, np.ceil(divisor - 1e-6))
        for row, angles in ((0, start), (-1, final)):
            np.testing.assert_array_equal(samples.positions[row], angles)
            np.testing.assert_array_equal(samples.velocities[row], 0.0)
            np.testing.assert_array_equal(samples.accelerations[row], 0.0)
            np.testing.assert_array_equal(samples.efforts[row], 0.0)
        count = len(samples.times)
        for table in (samples.positions, samples.velocities, samples.accelerations):
            assert table.shape == (count, 2)
        assert samples.efforts.shape == (count, 2)
        assert samples.flat.shape == (1, 6, count)
        checked += 1
    assert checked == 60


@pytest.mark.parametrize(('duration', 'period', 'intervals'), [(0.07, 0.005, 14), (0.07, 0.01, 7)])
def test_a_whole_number_of_periods_needs_no_extra_point(duration, period, intervals, paper_arm):
    """Though their ratio, rounded, exceeds the whole number."""
    assert duration / period > intervals
    samples = plan(half_turn(duration), paper_arm, STRATEGIES['energy']).sample(period)
    assert len(samples.times) == intervals + 1


@pytest.mark.parametrize('name', STRATEGIES)
def test_pinned_ends_are_the_limits_of_the_law(name, paper_arm):
    """Setting the ends exactly moves no sample by more than the certificate allows."""
    found = plan(half_turn(), paper_arm, STRATEGIES[name])
    near = 1e-9
    for end, inside in ((0.0, near), (1.0, 1.0 - near)):
        at, beside = found.at(np.array([end])), found.at(np.array([inside]))
        for table, peak in (
            ('positions', np.pi),
            ('velocities', found.peak_velocity.max()),
            ('efforts', found.peak_effort.max()),
        ):
            step = np.abs(getattr(at, table) - getattr(beside, table)).max()
            assert step <= 1e-6 * peak


def test_times_outside_the_motion_are_at_rest(paper_arm):
    found = plan(half_turn(), paper_arm, STRATEGIES['mixed'])
    samples = found.at(np.array([-5.0, -1e-300, 1.0 + 1e-15, 70.0]))
    np.testing.assert_array_equal(samples.positions[:, 0], [0.0, 0.0, np.pi, np.pi])
    for table in (samples.velocities, samples.accelerations, samples.efforts):
        np.testing.assert_array_equal(table, 0.0)


@pytest.mark.parametrize('name', STRATEGIES)
def test_velocities_and_accelerations_are_the_slopes(name, paper_arm):
    found = plan(half_turn(), paper_arm, STRATEGIES[name])
    times, step = np.linspace(0.01, 0.99, 50), 1e-5
    samples = found.at(times)
    before, after = found.at(times - step), found.at(times + step)
    for value, slope in (('positions', 'velocities'), ('velocities', 'accelerations')):
        difference = (getattr(after, value) - getattr(before, value)) / (2.0 * step)
        expected = getattr(samples, slope)
        scale = np.abs(expected).max(axis=0)
        assert (np.abs(difference - expected) <= 2e-7 * scale).all()
    flat = (after.flat - before.flat)[0, :5] / (2.0 * step)
    scale = np.abs(samples.flat[0, 1:]).max(axis=1, keepdims=True)
    assert (np.abs(flat - samples.flat[0, 1:]) <= 2e-7 * scale).all()


@pytest.mark.parametrize('name', STRATEGIES)
def test_a_motion_to_the_same_place_rests(name, paper_arm):
    place = [1.3, 0.0]
    found = plan(
        MotionRequest(start=place, final=place, duration=2.0), paper_arm, STRATEGIES[name]
    )
    samples = found.sample(0.05)
    np.testing.assert_array_equal(samples.positions, np.tile(place, (41, 1)))
    for table in (samples.velocities, samples.accelerations, samples.efforts):
        np.testing.assert_array_equal(table, 0.0)
    assert found.cost_value == found.rms_effort[0] == found.peak_effort[0] == 0.0
    assert found.boundary_residual == found.optimality_residual == 0.0


@pytest.mark.parametrize('name', STRATEGIES)
def test_plans_are_linear_in_the_distance(name, paper_arm):
    one = plan(half_turn(), paper_arm, STRATEGIES[name])
    two = plan(
        MotionRequest(start=[2.0, 0.0], final=[2.0 - 1e-3 * np.pi, 0.0], duration=1.0),
        paper_arm,
        STRATEGIES[name],
    )
    np.testing.assert_allclose(two.rms_effort, 1e-3 * one.rms_effort, rtol=1e-9)
    np.testing.assert_allclose(two.peak_velocity, 1e-3 * one.peak_velocity, rtol=1e-9)
    assert two.cost_value == pytest.approx(1e-6 * one.cost_value, rel=1e-9)


@pytest.mark.parametrize('name', STRATEGIES)
def test_an_even_grid_is_the_law_at_its_times(name, paper_arm):
    """Grids of one and of several chunks, short layers included."""
    for duration, intervals in ((0.3, 7), (1.0, 1000), (4.0, 9001), (40.0, 10000)):
        found = plan(half_turn(duration), paper_arm, STRATEGIES[name])
        samples = found.sample(duration / intervals)
        assert len(samples.times) == intervals + 1
        expected = found.at(samples.times)
        for table in ('planned', 'driving_effort', 'flat', 'positions', 'efforts'):
            one, other = getattr(samples, table), getattr(expected, table)
            axis = -1 if table in ('planned', 'driving_effort', 'flat') else 0
            scale = np.abs(other).max(axis=axis, keepdims=True)
            assert (np.abs(one - other) <= 1e-11 * scale).all()


def test_samples_are_locked(paper_arm):
    samples = plan(half_turn(), paper_arm, STRATEGIES['mixed']).sample(0.1)
    for table in ('times', 'planned', 'driving_effort', 'positions', 'efforts', 'flat'):
        with pytest.raises(ValueError, match='read-only'):
            getattr(samples, table)[...] = 0.0


def test_another_distance_and_a_scaled_arm_share_a_unit_motion():
    """Weights scale with the arm: r^8 tau^2 is the same for k times the arm and r / k^(1/4)."""
    one = plan(half_turn(), paper_arm_with(2e-5), STRATEGIES['effort'])
    shared = 0
    for scale in 2.0 ** np.arange(-8.0, 17.0, 4.0):
        arm = arm_of(*(scale * np.array([6.4e-4, 3.3e-5, 3e-3, 2e-5])))
        options = PlanningOptions(
            strategy=Strategy.MIN_CONTROL_EFFORT,
            r=150.0 / scale**0.25,
            p=0.0,
            flat_model=PAPER,
        )
        request = MotionRequest(start=[0.3, 0.0], final=[0.8, 0.0], duration=1.0)
        other = plan(request, arm, options)
        shared += other.problem.unit is one.problem.unit
        expected = scale * 0.5 / np.pi * one.sample(0.01).driving_effort
        assert_close(other.sample(0.01).driving_effort, expected)
    assert shared >= 5


def test_rounding_of_coefficients_is_bounded():
    values = np.random.default_rng(5).normal(size=1000) * 1e7
    error = np.abs(extremals.rounded(values) - values)
    assert (error <= 2.0**-extremals.KEY_BITS * np.abs(values)).all()
    assert error.max() > 0.0
    assert len(np.unique(extremals.rounded(1.0 + np.arange(32) * 2.0**-52))) <= 3


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'start': [np.nan, 0.0]}, 'start angles must be a finite'),
        ({'final': [np.inf, 0.0]}, 'final angles must be a finite'),
        ({'start': [[0.0, 0.0]]}, 'start angles must be a finite vector'),
        ({'final': 1.0}, 'final angles must be a finite vector'),
        ({'final': [1.0, 0.0, 0.0]}, 'start has 2 joints, final has 3'),
        ({'duration': 0.0}, r'duration must be positive and finite, got 0\.0 s'),
        ({'duration': -1.5}, r'got -1\.5 s'),
        ({'duration': np.nan}, 'got nan s'),
        ({'duration': np.inf}, 'got inf s'),
    ],
)
def test_refuses_a_request_without_meaning(change, message):
    good = {'start': [0.0, 0.0], 'final': [1.0, 0.0], 'duration': 1.0}
    MotionRequest(**good)
    with pytest.raises(InvalidRequest, match=message):
        MotionRequest(**{**good, **change})


def test_a_request_keeps_locked_copies():
    start = np.array([0.3, 0.0])
    request = MotionRequest(start=start, final=[1.0, 0.0], duration=1.0)
    start[0] = 9.0
    assert request.start[0] == 0.3
    with pytest.raises(ValueError, match='read-only'):
        request.final[0] = 2.0


@pytest.mark.parametrize(
    ('start', 'final', 'message'),
    [
        ([0.0, 0.01], [1.0, 0.0], r'start angle of the passive joint is 0\.01 rad'),
        ([0.0, 0.0], [1.0, -0.02], r'final angle of the passive joint is -0\.02 rad'),
        ([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 'the arm has 2 joints, the request 3 angles'),
    ],
)
def test_refuses_a_request_that_does_not_fit_the_arm(paper_arm, start, final, message):
    request = MotionRequest(start=start, final=final, duration=1.0)
    with pytest.raises(InvalidRequest, match=message):
        plan(request, paper_arm, PlanningOptions(strategy=Strategy.POLYNOMIAL))


def test_refuses_an_arm_or_a_weight_that_defines_no_problem(paper_arm):
    unbalanced = PlanarArm.from_links(
        link_length=(0.3, 0.2),
        link_com=(0.1, 0.08),
        link_mass=(0.2, 0.1),
        link_inertia=(1e-3, 4e-4),
        stiffness=0.1,
        damping=0.0,
    )
    with pytest.raises(NotFlat):
        plan(half_turn(), unbalanced, PlanningOptions(strategy=Strategy.POLYNOMIAL))
    with pytest.raises(InvalidCost, match='r = -1'):
        plan(half_turn(), paper_arm, PlanningOptions(strategy=Strategy.MIXED, r=-1.0))


def residual(found, plant):
    """Play a plan's efforts on a true arm; return its final state's amplitude and position."""
    samples = found.sample(1e-3)
    profile = EffortProfile(start=0.0, times=samples.times, efforts=samples.efforts[:, :1])
    duration = found.request.duration
    states = rollout(plant, profile, duration, step=1e-3, position=found.request.start)
    assert states.times[-1] == pytest.approx(duration)
    both, last = plant.inertia_star
    free = both * last - last**2
    square, decay = plant.stiffness * both / free, plant.damping * both / (2.0 * free)
    angle, rate = states.positions[-1, 1], states.velocities[-1, 1]
    envelope = np.hypot(angle, (rate + decay * angle) / np.sqrt(square - decay**2))
    return envelope, states.positions[-1].sum()


@pytest.mark.parametrize('name', STRATEGIES)
def test_an_undamped_arm_ends_at_rest(name):
    arm = paper_arm_with(0.0)
    amplitude, angle = residual(plan(half_turn(), arm, STRATEGIES[name]), arm)
    assert amplitude < 1e-5
    assert angle == pytest.approx(np.pi, abs=1e-5)


@pytest.mark.parametrize(
    ('name', 'nominal', 'mismatched'),
    [
        ('polynomial', 0.00449, 0.0980),
        ('effort', 0.00358, 0.0758),
        ('energy', 0.00299, 0.0609),
    ],
)
def test_the_approximate_map_leaves_the_papers_residuals(name, nominal, mismatched):
    """Scenario 2, and scenario 3 with ten per cent more stiffness and damping."""
    arm = paper_arm_with(2e-5)
    found = plan(half_turn(), arm, STRATEGIES[name])
    amplitude, _ = residual(found, arm)
    assert amplitude == pytest.approx(nominal, rel=0.02)
    amplitude, _ = residual(found, arm.scaled(stiffness=1.1, damping=1.1))
    assert amplitude == pytest.approx(mismatched, rel=0.02)
