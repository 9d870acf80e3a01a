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

"""Motions that start in the midst of another one."""

from dataclasses import replace

from core.conftest import ELBOW
from flat_planner_ros.core.arm.errors import UncertifiedPlan
from flat_planner_ros.core.motion_law.cost import Strategy
from flat_planner_ros.core.motion_law.extremal import BoundaryConditions
from flat_planner_ros.core.planning import certified_plan, planner
from flat_planner_ros.core.planning.planner import plan
from flat_planner_ros.core.planning.request import MotionRequest, PlanningOptions
import numpy as np
import pytest

STRATEGIES = {
    'polynomial': PlanningOptions(strategy=Strategy.POLYNOMIAL),
    'effort': PlanningOptions(strategy=Strategy.MIN_CONTROL_EFFORT),
    'energy': PlanningOptions(strategy=Strategy.MIN_POTENTIAL_ENERGY),
    'mixed': PlanningOptions(strategy=Strategy.MIXED),
}
FINAL = (1.5, -0.5)
"""Where the motions of this file end, planned variables [rad]."""


@pytest.fixture
def arm():
    """Return the paper's last two links on a first link."""
    return replace(ELBOW)


def request_from(jets, duration=1.0):
    """Return a motion from given derivatives to the common end."""
    last, first = FINAL
    final = np.array([first, last - first, 0.0])
    return MotionRequest(start=np.zeros(3), final=final, duration=duration, start_jets=jets)


def random_jets(seed, duration=1.0):
    """Return derivatives of the size that a motion of this duration has."""
    sizes = (2.0 / duration) ** np.arange(6.0) * [1, 1, 2, 10, 50, 200]
    return np.random.default_rng(seed).normal(size=(2, 6)) * sizes


@pytest.mark.parametrize('name', STRATEGIES)
@pytest.mark.parametrize('duration', [0.3, 1.0, 4.0])
def test_ends_are_met(arm, name, duration):
    jets = random_jets(1, duration)
    found = plan(request_from(jets, duration), arm, STRATEGIES[name])
    assert 0.0 < found.boundary_residual <= 1e-9
    assert found.optimality_residual <= 1e-9
    for law, start, end in zip(found.trajectory.laws, jets, FINAL, strict=True):
        ends = law.jet(np.array([0.0, duration]), 6)
        size = np.abs(law.jet(np.linspace(0.0, duration, 999), 6)).max(axis=1)
        assert (np.abs(ends[:6, 0] - start) <= 1e-9 * size[:6]).all()
        assert (np.abs(ends[:6, 1] - [end, 0, 0, 0, 0, 0]) <= 1e-9 * size[:6]).all()
    samples = found.sample(duration / 100)
    np.testing.assert_array_equal(samples.planned[:, :6, 0], jets)
    np.testing.assert_array_equal(samples.planned[:, 0, -1], FINAL)
    np.testing.assert_array_equal(samples.planned[:, 1:6, -1], 0.0)
    for table in (samples.velocities, samples.accelerations, samples.efforts):
        np.testing.assert_array_equal(table[-1], 0.0)
    clipped = found.trajectory.jets(np.array([-3.0, duration + 3.0]))
    np.testing.assert_array_equal(clipped[:, :6, 0], jets)
    np.testing.assert_array_equal(clipped[:, 0, 1], FINAL)


@pytest.mark.parametrize('name', STRATEGIES)
def test_no_other_motion_with_these_ends_costs_less(arm, name):
    """The first variation vanishes for bumps of any shape, and a bump only adds its own cost."""
    found = plan(request_from(random_jets(2)), arm, STRATEGIES[name])
    x, weights = np.polynomial.legendre.leggauss(150)
    times, weights = 0.5 * (x + 1.0), 0.5 * weights
    derivatives = np.array([law.jet(times, 6)[1:] for law in found.trajectory.laws])
    cost = found.problem.cost.matrix
    checked = 0
    for degree in range(6):
        bump = np.polynomial.Polynomial([1, 0, -1]) ** 6 * np.polynomial.Polynomial.basis(degree)
        change = np.array([2.0**k * bump.deriv(k)(x) for k in range(1, 7)])
        own = weights @ np.einsum('im,ij,jm->m', change, cost, change)
        for derivative in derivatives:
            total = weights @ np.einsum('im,ij,jm->m', derivative, cost, derivative)
            mixed = weights @ np.einsum('im,ij,jm->m', change, cost, derivative)
            assert abs(mixed) <= 1e-9 * np.sqrt(own * total)
            checked += 1
    assert checked == 12
    total = weights @ np.einsum('vim,ij,vjm->m', derivatives, cost, derivatives)
    assert found.cost_value == pytest.approx(total, rel=1e-9)


@pytest.mark.parametrize('name', STRATEGIES)
@pytest.mark.parametrize('share', [0.0, 0.1, 0.5, 0.8])
def test_the_rest_of_an_optimal_motion_is_optimal(arm, name, share):
    """Planned again from its own midst, to its own end and time, a motion goes on unchanged."""
    whole = plan(
        MotionRequest(start=np.zeros(3), final=[-0.5, 2.0, 0.0], duration=1.0),
        arm,
        STRATEGIES[name],
    )
    jets = whole.trajectory.jets(np.array([share]))[:, :6, 0]
    rest = plan(request_from(jets, 1.0 - share), arm, STRATEGIES[name])
    times = np.linspace(0.0, 1.0 - share, 60)
    expected, found = whole.trajectory.jets(share + times), rest.trajectory.jets(times)
    scale = np.abs(whole.trajectory.jets(np.linspace(0, 1, 300))).max(axis=2, keepdims=True)
    # The splice's derivatives are rounded, and the fifth of them is felt most at the sixth.
    assert (np.abs(found - expected)[:, :6] <= 1e-9 * scale[:, :6]).all()
    assert rest.at(times).efforts == pytest.approx(
        whole.at(share + times).efforts, abs=1e-9 * whole.peak_effort.max()
    )


@pytest.mark.parametrize('name', STRATEGIES)
def test_figures_are_those_of_dense_samples(arm, name):
    found = plan(request_from(random_jets(5)), arm, STRATEGIES[name])
    x, w = np.polynomial.legendre.leggauss(10)
    times = ((np.arange(500)[:, None] + 0.5 * (x + 1.0)) / 500).ravel()
    samples = found.at(times)
    mean = np.tile(0.5 * w / 500, 500) @ samples.efforts**2
    np.testing.assert_allclose(found.rms_effort, np.sqrt(mean), rtol=1e-9)
    for peak, table in (
        (found.peak_effort, samples.efforts),
        (found.peak_velocity, samples.velocities),
    ):
        np.testing.assert_allclose(peak, np.abs(table).max(axis=0), rtol=2e-3)


def test_an_arm_at_rest_where_it_should_be_stays(arm):
    jets = np.zeros((2, 6))
    jets[:, 0] = FINAL
    found = plan(request_from(jets), arm, STRATEGIES['mixed'])
    assert found.boundary_residual == found.optimality_residual == found.cost_value == 0.0
    samples = found.sample(0.1)
    np.testing.assert_array_equal(samples.velocities, 0.0)
    np.testing.assert_array_equal(samples.planned[:, 0], np.tile(FINAL, (11, 1)).T)


def test_a_distant_place_costs_no_digits(arm):
    near, far = random_jets(6), random_jets(6)
    far[:, 0] += 1e6
    one = plan(request_from(near), arm, STRATEGIES['mixed'])
    request = request_from(far)
    final = request.final + [1e6, 0.0, 0.0]
    request = MotionRequest(start=request.start, final=final, duration=1.0, start_jets=far)
    other = plan(request, arm, STRATEGIES['mixed'])
    assert other.boundary_residual <= 1e-12
    times = np.linspace(0.0, 1.0, 30)
    expected = one.trajectory.jets(times)[:, 1:6]
    scale = np.abs(expected).max(axis=2, keepdims=True)
    assert (np.abs(other.trajectory.jets(times)[:, 1:6] - expected) <= 1e-7 * scale).all()


@pytest.mark.parametrize(
    ('constant', 'quantity'),
    [
        ('BOUNDARY_TOLERANCE', 'boundary residual'),
        ('OPTIMALITY_TOLERANCE', 'optimality residual'),
    ],
)
def test_refuses_a_law_that_misses_its_certificate(monkeypatch, arm, constant, quantity):
    monkeypatch.setattr(certified_plan, constant, 0.0)
    with pytest.raises(UncertifiedPlan, match=quantity):
        plan(request_from(random_jets(7)), arm, STRATEGIES['mixed'])


@pytest.mark.parametrize('damage', ['boundary', 'optimality'])
def test_certificates_see_a_law_that_is_wrong(monkeypatch, arm, damage):
    compute = planner.extremals

    def wrong(coefficients, duration, jets):
        if damage == 'optimality':
            return compute(coefficients * [1, 1, 1 + 1e-6, 1, 1, 1, 1], duration, jets)
        near = [BoundaryConditions(start=ends.start * (1.0 + 1e-8), end=ends.end) for ends in jets]
        return compute(coefficients, duration, near)

    monkeypatch.setattr(planner, 'extremals', wrong)
    with pytest.raises(UncertifiedPlan, match=damage):
        plan(request_from(random_jets(8)), arm, STRATEGIES['energy'])


@pytest.mark.parametrize('size', [1e300, 1e308])
def test_refuses_what_leaves_double_precision(arm, size):
    with pytest.raises(UncertifiedPlan):
        plan(request_from(np.full((2, 6), size), 1e-3), arm, STRATEGIES['polynomial'])
