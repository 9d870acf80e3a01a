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

"""Plans of arms with more than two joints, against the arm's own dynamics."""

from flat_planner_ros.core.arm.errors import InvalidRequest, UncertifiedPlan
from flat_planner_ros.core.arm.flat_map import FlatModel
from flat_planner_ros.core.arm.planar_arm import PlanarArm
from flat_planner_ros.core.motion_law.cost import Strategy
from flat_planner_ros.core.planning.planner import plan
from flat_planner_ros.core.planning.request import MotionRequest, PlanningOptions, ViaPoint
import numpy as np
import pytest

SIZES = [2, 3, 4, 5, 6, 7]

STRATEGIES = [
    Strategy.POLYNOMIAL,
    Strategy.MIN_CONTROL_EFFORT,
    Strategy.MIN_POTENTIAL_ENERGY,
    Strategy.MIXED,
]


def arm_of(n, gravity=9.81, friction=0.0):
    """Return a flat arm of n joints, about one metre long."""
    rng = np.random.default_rng(n)
    return PlanarArm.reduced(
        inertia_star=(0.02, 0.004),
        stiffness=2.0,
        damping=0.01,
        link_length=rng.uniform(0.2, 0.4, n - 2),
        link_com=rng.uniform(0.1, 0.2, n - 2),
        link_mass=rng.uniform(0.3, 1.0, n - 2),
        link_inertia=rng.uniform(1e-3, 1e-2, n - 2),
        tip_mass=0.8,
        gravity=gravity,
        viscous_friction=np.full(n - 1, friction),
        coulomb_friction=np.full(n - 1, friction),
    )


def request_of(n, duration=1.5):
    """Return a motion of all actuated joints."""
    rng = np.random.default_rng(10 + n)
    start, final = rng.uniform(-2.0, 2.0, (2, n))
    start[-1] = final[-1] = 0.0
    return MotionRequest(start=start, final=final, duration=duration)


def options_of(strategy=Strategy.MIXED, **changes):
    """Return options with weights that matter for these arms."""
    return PlanningOptions(strategy=strategy, r=8.0, p=6.0, **changes)


@pytest.mark.parametrize('strategy', STRATEGIES)
@pytest.mark.parametrize('n', SIZES)
def test_efforts_are_those_of_the_whole_arm(n, strategy):
    """Inverse dynamics agrees at every joint and asks for nothing at the passive one."""
    arm = arm_of(n)
    found = plan(request_of(n), arm, options_of(strategy))
    samples = found.sample(0.01)
    effort = arm.inverse_dynamics(samples.positions, samples.velocities, samples.accelerations)
    scale = np.abs(effort).max()
    assert samples.efforts.shape == effort.shape == (len(samples.times), n)
    np.testing.assert_allclose(samples.efforts, effort, rtol=0, atol=1e-11 * scale)
    np.testing.assert_array_equal(samples.efforts[:, -1], 0.0)


@pytest.mark.parametrize('n', SIZES)
def test_a_motion_starts_and_ends_at_rest_where_it_should(n):
    request, arm = request_of(n), arm_of(n)
    for samples in (
        (found := plan(request, arm, options_of())).sample(0.01),
        found.at(np.array([-1.0, 0.7, 9.0])),
    ):
        for row, angles in ((0, request.start), (-1, request.final)):
            np.testing.assert_allclose(samples.positions[row], angles, rtol=0, atol=2e-15)
            np.testing.assert_array_equal(samples.velocities[row], 0.0)
            np.testing.assert_array_equal(samples.accelerations[row], 0.0)
            hold = arm.gravity_effort(samples.positions[row])
            np.testing.assert_allclose(samples.efforts[row], hold, rtol=0, atol=1e-12)
        assert samples.planned.shape == (n - 1, 7, len(samples.times))
        assert samples.flat.shape == (n - 1, 6, len(samples.times))


@pytest.mark.parametrize('n', SIZES)
def test_joint_motion_is_consistent(n):
    """Slopes of samples, and the flat outputs: the last link's angle and the first joints."""
    found = plan(request_of(n), arm_of(n), options_of())
    times, step = np.linspace(0.01, 1.49, 40), 1e-5
    samples, before, after = (found.at(times + shift) for shift in (0.0, -step, step))
    for value, slope in (('positions', 'velocities'), ('velocities', 'accelerations')):
        difference = (getattr(after, value) - getattr(before, value)) / (2.0 * step)
        expected = getattr(samples, slope)
        assert np.abs(difference - expected).max() <= 1e-7 * np.abs(expected).max()
    np.testing.assert_allclose(samples.flat[0, 0], samples.positions.sum(axis=1), atol=1e-14)
    for i in range(n - 2):
        np.testing.assert_array_equal(samples.flat[1 + i, 0], samples.positions[:, i])
    np.testing.assert_allclose(found.trajectory.jets(times), samples.planned, rtol=1e-15)
    for law, jet in zip(found.trajectory.laws, samples.planned, strict=True):
        scale = np.abs(jet).max(axis=1, keepdims=True)
        assert (np.abs(law.jet(times, 6) - jet) <= 1e-11 * scale).all()
        assert law.duration == found.duration == 1.5


@pytest.mark.parametrize('n', SIZES)
def test_planned_variables_move_in_synchrony(n):
    request = request_of(n)
    jets = plan(request, arm_of(n), options_of()).trajectory.jets(np.linspace(0.0, 1.5, 50))
    way = np.append(request.final.sum() - request.start.sum(), (request.final - request.start))
    unit = jets[0] / way[0]
    unit[0] = (jets[0, 0] - request.start.sum()) / way[0]
    for i in range(n - 2):
        np.testing.assert_allclose(
            jets[1 + i, 1:], way[1 + i] * unit[1:], atol=1e-12 * np.abs(jets).max()
        )
        np.testing.assert_allclose(
            jets[1 + i, 0], request.start[i] + way[1 + i] * unit[0], atol=1e-13
        )


def test_a_joint_without_a_way_stays_where_it_is():
    arm = arm_of(4)
    request = MotionRequest(start=[0.3, -0.7, 1.1, 0.0], final=[1.3, -0.7, 1.4, 0.0], duration=1.0)
    samples = plan(request, arm, options_of()).sample(0.01)
    np.testing.assert_array_equal(samples.positions[:, 1], -0.7)
    np.testing.assert_array_equal(samples.velocities[:, 1], 0.0)
    assert np.abs(samples.velocities[:, [0, 2, 3]]).max(axis=0).min() > 0.01


@pytest.mark.parametrize('n', SIZES)
@pytest.mark.parametrize('compensates', [False, True])
def test_effort_and_peaks_are_those_of_dense_samples(n, compensates):
    found = plan(
        request_of(n), arm_of(n, friction=0.05), options_of(compensate_friction=compensates)
    )
    x, w = np.polynomial.legendre.leggauss(10)
    width = found.duration / 800
    times = (width * np.arange(800)[:, None] + 0.5 * width * (x + 1.0)).ravel()
    samples = found.at(times)
    mean = np.tile(0.5 * w / 800, 800) @ samples.efforts**2
    # The smoothed sign of Coulomb friction has layers of its own.
    tolerance = 1e-4 if compensates else 1e-9
    np.testing.assert_allclose(found.rms_effort, np.sqrt(mean), rtol=tolerance)
    for peak, dense in (
        (found.peak_effort, samples.efforts),
        (found.peak_velocity, samples.velocities),
    ):
        expected = np.abs(dense).max(axis=0)
        assert peak.shape == (n,)
        assert (peak <= expected * (1.0 + 1e-4)).all()
        assert (peak >= expected * (1.0 - 2e-3)).all()


def test_cost_is_the_sum_over_the_planned_variables():
    request, arm = request_of(4), arm_of(4)
    found = plan(request, arm, options_of())
    x, w = np.polynomial.legendre.leggauss(12)
    times = (1.5 / 200 * (np.arange(200)[:, None] + 0.5 * (x + 1.0))).ravel()
    jets = found.trajectory.jets(times)[:, 1:]
    density = np.einsum('vim,ij,vjm->m', jets, found.problem.cost.matrix, jets)
    assert found.cost_value == pytest.approx(1.5 / 200 * np.tile(0.5 * w, 200) @ density, rel=1e-9)


@pytest.mark.parametrize('model', FlatModel)
@pytest.mark.parametrize('n', SIZES)
def test_friction_is_compensated_where_asked_for(n, model):
    """What friction takes is added at every motor, and only there."""
    arm, request = arm_of(n, friction=0.3), request_of(n)
    plain, full = (
        plan(request, arm, options_of(flat_model=model, compensate_friction=asked)).sample(0.01)
        for asked in (False, True)
    )
    np.testing.assert_array_equal(plain.positions, full.positions)
    difference = full.efforts - plain.efforts
    expected = arm.friction(plain.velocities)
    np.testing.assert_allclose(difference[:, :-1], expected, atol=1e-14 * plain.efforts.max())
    np.testing.assert_array_equal(full.efforts[:, -1], 0.0)
    assert np.abs(expected).max(axis=0).min() > 0.1
    np.testing.assert_array_equal(difference[[0, -1]], 0.0)


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'start': [0.0, 0.0]}, 'start has 2 joints, final has 3'),
        ({'via': (ViaPoint(time=0.5, values=[1.0]),)}, 'has 1 values for 2 flat outputs'),
        ({'via': (ViaPoint(time=1.5, values=[1.0, 2.0]),)}, 'before the end at 1 s'),
        ({'via': (ViaPoint(time=0.5, values=[1.0, 2.0]),) * 2}, 'must lie after 0.5 s'),
        ({'start_jets': np.zeros((3, 6))}, r'must have shape \(2, 6\)'),
        ({'start_jets': np.full((2, 6), np.nan)}, 'must be finite'),
    ],
)
def test_refuses_a_request_that_contradicts_itself(change, message):
    good = {'start': [0.0, 0.0, 0.0], 'final': [1.0, 0.0, 0.0], 'duration': 1.0}
    MotionRequest(**good, via=(ViaPoint(time=0.5, values=[1.0, 2.0]),), start_jets=np.ones((2, 6)))
    with pytest.raises(InvalidRequest, match=message):
        MotionRequest(**{**good, **change})


@pytest.mark.parametrize(('time', 'values'), [(0.0, [1.0]), (np.nan, [1.0]), (1.0, [np.inf])])
def test_refuses_a_via_point_without_meaning(time, values):
    with pytest.raises(InvalidRequest, match='via'):
        ViaPoint(time=time, values=values)


def test_refuses_an_arm_with_other_joints():
    with pytest.raises(InvalidRequest, match='the arm has 4 joints, the request 3 angles'):
        plan(request_of(3), arm_of(4), options_of())


def test_refuses_a_joint_whose_way_leaves_double_precision():
    far = MotionRequest(start=[0.0, 0.0, 0.0], final=[1e305, -1e305, 0.0], duration=1.0)
    with pytest.raises(UncertifiedPlan):
        plan(far, arm_of(3), options_of())
