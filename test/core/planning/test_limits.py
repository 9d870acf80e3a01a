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

"""Extrema between samples against dense sampling, closed forms and multiple precision; limits."""

from dataclasses import replace
from math import inf, nan, pi

from flat_planner_ros.core.arm.errors import InvalidRequest
from flat_planner_ros.core.arm.flat_map import FlatModel
from flat_planner_ros.core.arm.planar_arm import PlanarArm
from flat_planner_ros.core.motion_law.cost import Strategy
from flat_planner_ros.core.planning.extrema import extrema_of, Quantity
from flat_planner_ros.core.planning.limits import JointLimits
from flat_planner_ros.core.planning.planner import plan
from flat_planner_ros.core.planning.request import MotionRequest, PlanningOptions, ViaPoint
import numpy as np
from numpy.polynomial import Polynomial
import pytest
from scipy.optimize import brentq

ACCURACY = 1e-6
"""Of an extremum, relative to the range that its quantity covers [-]."""

DENSE = 40_000

RANDOM_CASES = 40


def half_turn(arm, duration=1.0, **options):
    """Return the paper's motion."""
    request = MotionRequest(start=[0.0, 0.0], final=[pi, 0.0], duration=duration)
    return plan(request, arm, PlanningOptions(**options))


def random_plan(rng):
    """Return a plan of any arm, strategy, weights, map, way and duration from 0.05 to 60 s."""
    last = 10 ** rng.uniform(-5, -2)
    frequency, damping_ratio = 10 ** rng.uniform(-0.5, 1.0), rng.uniform(0.0, 0.3)
    omega = 2.0 * pi * frequency
    arm = PlanarArm.reduced(
        inertia_star=(last * rng.uniform(1.5, 30.0), last),
        stiffness=last * omega**2,
        damping=2.0 * damping_ratio * omega * last,
    )
    strategies = [strategy for strategy in Strategy if strategy.value != 'custom']
    named = ('polynomial', 'min_control_effort', 'min_potential_energy', 'mixed')
    options = PlanningOptions(
        strategy=rng.choice([s for s in strategies if s.value in named]),
        r=10 ** rng.uniform(-1.0, 3.0),
        p=10 ** rng.uniform(-1.0, 3.0),
        flat_model=rng.choice(list(FlatModel)),
    )
    start = [rng.uniform(-3.0, 3.0), 0.0]
    final = [start[0] + rng.choice([-1.0, 1.0]) * 10 ** rng.uniform(-2.0, 1.0), 0.0]
    duration = 10 ** rng.uniform(np.log10(0.05), np.log10(60.0))
    return plan(MotionRequest(start=start, final=final, duration=duration), arm, options)


def random_motion_of_many_joints(rng, joints, moving):
    """Return a plan of an arm in the vertical plane, with friction compensated."""
    first = joints - 2
    arm = PlanarArm.reduced(
        inertia_star=(0.04, 0.01),
        stiffness=2.0,
        damping=0.01,
        link_length=rng.uniform(0.2, 0.5, first),
        link_com=rng.uniform(0.0, 0.2, first),
        link_mass=rng.uniform(0.5, 2.0, first),
        link_inertia=rng.uniform(0.005, 0.05, first),
        tip_mass=1.5,
        gravity=9.81,
        viscous_friction=rng.uniform(0.0, 0.1, joints - 1),
        coulomb_friction=rng.uniform(0.0, 0.2, joints - 1),
    )
    options = PlanningOptions(
        strategy=Strategy.MIN_CONTROL_EFFORT,
        r=10 ** rng.uniform(0.0, 1.5),
        compensate_friction=True,
    )
    start, final = (np.append(rng.uniform(-2.0, 2.0, joints - 1), 0.0) for _ in range(2))
    request = MotionRequest(start=start, final=final, duration=10 ** rng.uniform(-0.5, 1.0))
    planned = plan(request, arm, options)
    if not moving:
        return planned
    jets = planned.trajectory.jets(np.array([0.4 * request.duration]))[:, :6, 0]
    elsewhere = np.append(rng.uniform(-2.0, 2.0, joints - 1), 0.0)
    return plan(replace(request, final=elsewhere, start_jets=jets), arm, options)


def brute_force(planned):
    """Return samples on a grid that is even and, towards the ends, ever finer."""
    duration = planned.request.duration
    near = np.geomspace(1e-7, 0.5, DENSE // 5)
    even = np.linspace(0.0, 1.0, DENSE + 1)
    return planned.at(duration * np.sort(np.concatenate([even, near, 1.0 - near])))


@pytest.mark.parametrize('seed', range(RANDOM_CASES))
def test_no_sample_is_beyond_the_extrema_and_they_are_attained(seed):
    planned = random_plan(np.random.default_rng(seed))
    samples = brute_force(planned)
    for quantity, found in zip(Quantity, extrema_of(planned), strict=True):
        values = quantity.of(samples)
        spread = np.ptp(values, axis=0)
        assert (values.max(axis=0) <= found.highest + ACCURACY * spread).all()
        assert (values.min(axis=0) >= found.lowest - ACCURACY * spread).all()
        for extreme, at in ((found.highest, found.highest_at), (found.lowest, found.lowest_at)):
            attained = np.diagonal(quantity.of(planned.at(at)))
            assert attained == pytest.approx(extreme, rel=1e-12, abs=1e-12 * spread.max())


@pytest.mark.parametrize('moving', [False, True], ids=['from rest', 'in motion'])
@pytest.mark.parametrize('joints', [3, 4, 7])
def test_extrema_of_efforts_that_are_not_linear_in_the_law(joints, moving):
    rng = np.random.default_rng(joints)
    for _ in range(4):
        planned = random_motion_of_many_joints(rng, joints, moving)
        samples = brute_force(planned)
        for quantity, found in zip(Quantity, extrema_of(planned), strict=True):
            values = quantity.of(samples)
            spread = np.ptp(values, axis=0)
            assert (values.max(axis=0) <= found.highest + ACCURACY * spread).all()
            assert (values.min(axis=0) >= found.lowest - ACCURACY * spread).all()
            assert (found.highest <= values.max(axis=0) + 1e-4 * spread).all()
            assert (found.lowest >= values.min(axis=0) - 1e-4 * spread).all()


@pytest.mark.parametrize('kind', ['through points', 'insensitive'])
def test_extrema_of_other_laws(paper_arm, kind):
    options = PlanningOptions(strategy=Strategy.MIN_CONTROL_EFFORT)
    via = ()
    if kind == 'insensitive':
        options = PlanningOptions(strategy=Strategy.INSENSITIVE)
    else:
        # An overshoot beyond the last point, and a reversal.
        via = tuple(
            ViaPoint(time=time, values=[value]) for time, value in ((0.6, 2.0), (1.0, -0.5))
        )
    request = MotionRequest(start=[0.0, 0.0], final=[1.0, 0.0], duration=1.9, via=via)
    planned = plan(request, paper_arm, options)
    samples = brute_force(planned)
    for quantity, found in zip(Quantity, extrema_of(planned), strict=True):
        values = quantity.of(samples)
        spread = np.ptp(values, axis=0)
        assert (np.abs(found.highest - values.max(axis=0)) <= ACCURACY * spread).all()
        assert (np.abs(found.lowest - values.min(axis=0)) <= ACCURACY * spread).all()


def test_extrema_of_the_polynomial_law_are_roots_of_polynomials(paper_arm):
    duration = 0.6
    planned = half_turn(
        paper_arm, duration, strategy=Strategy.POLYNOMIAL, flat_model=FlatModel.EXACT
    )
    # w' is proportional to (t (T - t))^5.
    bump = Polynomial([0.0, duration, -1.0]) ** 5
    w = bump.integ()
    w *= pi / w(duration)
    k, relaxation = paper_arm.stiffness, paper_arm.damping / paper_arm.stiffness
    inner, last = paper_arm.inertia_star
    deflection = -last / k * w.deriv(2)
    position = w + relaxation * w.deriv() - deflection
    torque = inner * (w.deriv(2) + relaxation * w.deriv(3))
    torque += last * (inner - last) / k * w.deriv(4)
    expected = {
        Quantity.POSITION: [position, deflection],
        Quantity.VELOCITY: [position.deriv(), deflection.deriv()],
        Quantity.EFFORT: [torque, Polynomial([0.0])],
    }
    for quantity, found in zip(Quantity, extrema_of(planned), strict=True):
        for joint, curve in enumerate(expected[quantity]):
            roots = curve.deriv().roots() if curve.degree() else np.array([])
            real = roots[np.abs(roots.imag) < 1e-7 * duration].real
            values = curve(np.append(real[(real > 0.0) & (real < duration)], [0.0, duration]))
            spread = np.ptp(values)
            assert found.highest[joint] == pytest.approx(values.max(), abs=1e-9 * spread)
            assert found.lowest[joint] == pytest.approx(values.min(), abs=1e-9 * spread)


@pytest.mark.parametrize(
    ('strategy', 'weights'),
    [
        (Strategy.MIN_CONTROL_EFFORT, {'r': 150.0, 'p': 0.0}),
        (Strategy.MIN_POTENTIAL_ENERGY, {'r': 0.0, 'p': 17.0}),
        (Strategy.MIN_POTENTIAL_ENERGY, {'r': 0.0, 'p': 200.0}),
    ],
)
def test_peak_torque_agrees_with_multiple_precision(oracle, paper_arm, strategy, weights):
    planned = half_turn(paper_arm, strategy=strategy, flat_model=FlatModel.APPROXIMATE, **weights)
    inner, last = paper_arm.inertia_star
    k, c = paper_arm.stiffness, paper_arm.damping
    ascending = oracle.characteristic(both=inner, last=last, stiffness=k, damping=c, **weights)
    zero = [0.0] * 5
    law = oracle.solve(oracle.square_roots(ascending), 1.0, [0.0, *zero], [pi, *zero])
    compliant = last * (inner - last) / k

    def torque(time, order=0):
        jet = law.jet([time], 6)[order:, 0]
        return inner * jet[2] + compliant * (jet[4] - c / k * jet[5])

    effort = extrema_of(planned, [Quantity.EFFORT])[0]
    for value, time in (
        (effort.highest[0], effort.highest_at[0]),
        (effort.lowest[0], effort.lowest_at[0]),
    ):
        peak_time = brentq(torque, time - 1e-6, time + 1e-6, args=(1,), xtol=1e-14)
        assert value == pytest.approx(torque(peak_time), rel=1e-9)


def test_a_thin_layer_between_coarse_nodes_is_found(paper_arm):
    planned = half_turn(paper_arm, 60.0, strategy=Strategy.MIN_POTENTIAL_ENERGY, p=1000.0, r=0.0)
    effort = extrema_of(planned, [Quantity.EFFORT])[0]
    coarse = np.abs(planned.at(np.linspace(0.0, 60.0, 2001)).efforts[:, 0]).max()
    fine = np.abs(planned.at(np.geomspace(1e-6, 1.0, 20001)).efforts[:, 0]).max()
    assert fine > 10.0 * coarse  # else the case shows nothing
    assert effort.peak[0] == pytest.approx(fine, rel=1e-5)
    assert effort.peak[0] >= fine * (1.0 - 1e-12)


def test_a_motion_over_no_distance_has_no_extent(paper_arm):
    request = MotionRequest(start=[0.3, 0.0], final=[0.3, 0.0], duration=1.0)
    position, velocity, effort = extrema_of(
        plan(request, paper_arm, PlanningOptions(strategy=Strategy.POLYNOMIAL))
    )
    assert position.highest.tolist() == position.lowest.tolist() == [0.3, 0.0]
    assert not velocity.peak.any()
    assert not effort.peak.any()


def test_a_limit_between_two_samples_counts(paper_arm):
    planned = half_turn(paper_arm)
    samples = planned.sample(0.05)
    sampled = np.abs(samples.efforts[:, 0]).max()
    peak = extrema_of(planned, [Quantity.EFFORT])[0].peak[0]
    limit = 0.5 * (sampled + peak)
    assert sampled < limit < peak
    violation = JointLimits.of(2, effort=[limit, inf]).worst(planned)
    assert violation.is_exceeded
    assert (violation.joint, violation.quantity) == (0, Quantity.EFFORT)
    assert abs(violation.value) == pytest.approx(peak)
    assert violation.limit == pytest.approx(np.copysign(limit, violation.value))
    attained = planned.at(np.array([violation.time])).efforts[0, 0]
    assert attained == pytest.approx(violation.value, rel=1e-12)


def test_what_is_just_within_its_limits_obeys_and_what_is_just_beyond_does_not(paper_arm):
    planned = half_turn(paper_arm)
    found = dict(zip(Quantity, extrema_of(planned), strict=True))
    position = found[Quantity.POSITION]
    exact = {
        'position_min': position.lowest,
        'position_max': position.highest,
        'velocity': found[Quantity.VELOCITY].peak,
        'effort': found[Quantity.EFFORT].peak,
    }
    assert not JointLimits(**exact).worst(planned).is_exceeded
    deflection = position.highest[1]
    for name, joint, step in (
        ('position_min', 1, 1e-6 * deflection),
        ('position_max', 1, -1e-6 * deflection),
        ('velocity', 0, -1e-6),
        ('velocity', 1, -1e-6),
        ('effort', 0, -1e-8),
    ):
        values = exact[name].copy()
        values[joint] += step
        limits = JointLimits(**{**exact, name: values})
        assert limits.worst(planned).joint == joint
        assert limits.worst(planned).quantity.value in name
        assert limits.worst(planned).is_exceeded


def test_without_limits_everything_obeys(paper_arm):
    limits = JointLimits.of(2)
    assert limits.worst(half_turn(paper_arm, 0.05)) is None
    assert limits.quantities == ()
    assert not limits.bounds_duration


def test_a_pose_outside_the_range_is_told_by_joint_and_side():
    limits = JointLimits.of(2, position_min=[-1.0, -inf], position_max=[2.0, 0.1])
    assert limits.pose_violation(np.array([2.0, 0.0])) is None
    low = limits.pose_violation(np.array([-1.1, 0.0]))
    assert (low.joint, low.value, low.limit) == (0, -1.1, -1.0)
    high = limits.pose_violation(np.array([0.0, 0.2]))
    assert (high.joint, high.value, high.limit) == (1, 0.2, 0.1)
    assert 'the position of elbow reaches 0.2 rad' in high.sentence('elbow')


@pytest.mark.parametrize(
    ('limits', 'words'),
    [
        ({'velocity': [1.0, 0.0]}, 'limits.velocity of joint 2 must be above 0'),
        ({'effort': [-1.0, inf]}, 'limits.effort of joint 1 must not be negative'),
        ({'effort': [nan, inf]}, 'limits.effort must be a vector of numbers'),
        ({'effort': [1.0]}, 'limits must be of the same joints'),
        ({'position_min': [1.0, -inf], 'position_max': [0.0, inf]}, 'no position within'),
        ({'position_min': [inf, -inf]}, 'no position within'),
    ],
)
def test_limits_that_nothing_can_obey_are_refused(limits, words):
    with pytest.raises(InvalidRequest, match=words):
        JointLimits.of(2, **limits)


def test_limits_of_another_arm_are_refused():
    four = {name: [1.0] * 4 for name in ('position_max', 'velocity', 'effort')}
    with pytest.raises(InvalidRequest, match='of 4 joints for an arm of 3'):
        JointLimits.of(3, position_min=[-1.0] * 4, **four)
