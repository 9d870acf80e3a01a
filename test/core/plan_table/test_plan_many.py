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

"""Rows of a table against plans made one by one, and against oscillations by other routes."""

from dataclasses import replace

from flat_planner_ros.core.arm import Drive, FlatModel, InvalidRequest, NotFlat, PlanarArm
from flat_planner_ros.core.insensitive import Insensitivity, predict_residual, UncertaintyBox
from flat_planner_ros.core.motion_law import Strategy
from flat_planner_ros.core.plan_table import plan_many
from flat_planner_ros.core.planning import (
    MotionRequest,
    plan,
    PlanningOptions,
    residual_of_plan,
)
import numpy as np
import pytest

ARM = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
"""That of the paper's table, with its damping."""

CLOSE = 1e-8
"""Largest difference of a derivative from that of a single plan, relative to its peak [-]."""

PEAK = 2e-3
"""The same of a peak, which both look for at nodes of their own [-]."""

SAMPLED = 1e-3
"""The same of a residual, which a single plan integrates over a thousand pieces of effort [-]."""

NOTHING = 1e-6
"""Residual below which that integration finds no more than its own error, per rad [rad]."""

CUSTOM = np.diag([1e4, 0.0, 3e8, 0.0, 0.0, 1.0])

STRATEGIES = {
    'polynomial': PlanningOptions(strategy=Strategy.POLYNOMIAL),
    'effort': PlanningOptions(strategy=Strategy.MIN_CONTROL_EFFORT),
    'energy': PlanningOptions(strategy=Strategy.MIN_POTENTIAL_ENERGY),
    'mixed': PlanningOptions(strategy=Strategy.MIXED),
    'custom': PlanningOptions(strategy=Strategy.CUSTOM, custom=CUSTOM),
}


def request(way, duration):
    """Return the motion of the paper's arm over a distance."""
    return MotionRequest(start=[0.0, 0.0], final=[way, 0.0], duration=duration)


def random_arms(rng, count, *, damped=True):
    """Return arms of two joints with periods of 0.1 to 5 s."""
    arms = []
    for _ in range(count):
        both = 10.0 ** rng.uniform(-5.0, 0.0)
        last = both * rng.uniform(0.02, 0.8)
        series = last * (both - last) / both
        frequency = 2.0 * np.pi * 10.0 ** rng.uniform(-0.7, 1.0)
        ratio = rng.uniform(0.0, 0.4) if damped else 0.0
        arms.append(
            PlanarArm.reduced(
                inertia_star=(both, last),
                stiffness=series * frequency**2,
                damping=2.0 * ratio * series * frequency,
            )
        )
    return arms


def periods(arm):
    """Return the period of the passive joint [s]."""
    return 2.0 * np.pi / arm.natural_mode().frequency


def peaks_of(table):
    """Return the largest magnitude over time."""
    return np.abs(table).max(axis=-1)


@pytest.mark.parametrize('model', FlatModel)
@pytest.mark.parametrize('name', STRATEGIES)
def test_each_row_is_the_plan_of_its_numbers(name, model):
    rng = np.random.default_rng(5)
    options = replace(STRATEGIES[name], flat_model=model)
    arms = random_arms(rng, 6) + random_arms(rng, 2, damped=False) + 4 * [ARM]
    ways = rng.uniform(-3.0, 3.0, len(arms))
    durations = [periods(arm) * 10.0 ** rng.uniform(-1.0, 0.7) for arm in arms]
    table = plan_many(arms, ways, durations, options)
    assert not table.refusals
    rows = np.arange(len(arms))
    planned, driving = table.planned(rows, 100), table.driving(rows, 100)
    for row, arm in enumerate(arms):
        single = plan(request(ways[row], durations[row]), arm, options)
        samples = single.at(np.linspace(0.0, durations[row], 101))
        assert (
            peaks_of(planned[row] - samples.planned) <= CLOSE * peaks_of(samples.planned)
        ).all()
        effort = samples.driving_effort
        assert peaks_of(driving[row] - effort) <= CLOSE * peaks_of(effort)
        np.testing.assert_allclose(table.rms_effort[row], single.rms_effort, rtol=CLOSE)
        np.testing.assert_allclose(table.peak_effort[row], single.peak_effort, rtol=PEAK)
        np.testing.assert_allclose(table.peak_velocity[row], single.peak_velocity, rtol=PEAK)
        assert table.cost_value[row] == pytest.approx(single.cost_value, rel=1e-6)
        assert table.boundary_residual[row] <= 1e-9
        assert table.optimality_residual[row] <= 1e-9
        assert table.plan(row).request.duration == durations[row]


def hard_arm(ratio):
    """Return an arm with the paper's inertias and spring and another damping ratio."""
    return replace(ARM, damping=ARM.damping * ratio / ARM.natural_mode().damping_ratio)


FOURFOLD = np.poly([-2.0] * 4 + [0.0, 0.0])[:-1]
"""(z + 2)^4 z^2, descending, without its constant: a_6 ... a_1 of an equation, signs aside."""

HARD = {
    'twelve roots around zero': (ARM, STRATEGIES['effort'], 0.02),
    'some around zero': (ARM, STRATEGIES['effort'], 0.45),
    'fourfold root': (
        ARM,
        PlanningOptions(strategy=Strategy.CUSTOM, custom=np.diag(np.abs(FOURFOLD)[::-1])),
        9.0,
    ),
    'strong damping': (hard_arm(0.8), STRATEGIES['mixed'], 1.5),
    'no damping': (hard_arm(0.0), STRATEGIES['effort'], 1.5),
    'no damping, large weight': (
        hard_arm(0.0),
        PlanningOptions(strategy=Strategy.MIN_CONTROL_EFFORT, effort_weight=20.0),
        2.0,
    ),
    'thin boundary layers': (
        ARM,
        PlanningOptions(strategy=Strategy.MIXED, effort_weight=30.0, energy_weight=30.0),
        6.0,
    ),
    'many periods': (ARM, STRATEGIES['polynomial'], 60.0),
}


@pytest.mark.parametrize('name', HARD)
def test_hard_cases_are_planned_and_predicted_like_single_plans(name):
    arm, options, duration = HARD[name]
    table = plan_many(arm, [1.0, -2.0], [duration, 1.1 * duration], options)
    assert table.is_certified.all()
    single = plan(request(-2.0, 1.1 * duration), arm, options)
    times = np.linspace(0.0, single.duration, 101)
    found, reached = table.planned(np.array([1]), 100)[0], single.at(times).planned
    assert (peaks_of(found - reached) <= CLOSE * peaks_of(reached)).all()
    np.testing.assert_allclose(table.rms_effort[1], single.rms_effort, rtol=CLOSE)
    np.testing.assert_allclose(table.peak_effort[1], single.peak_effort, rtol=PEAK)
    # Layers and steep beginnings take more than a thousand pieces of effort.
    samples = single.at(np.linspace(0.0, single.duration, 20001))
    expected = predict_residual(
        arm, samples.driving_effort, single.duration, options.insensitivity.box
    )
    left = table.residuals
    assert left.worst[1] == pytest.approx(expected.worst, rel=SAMPLED, abs=NOTHING)
    assert left.nominal[1] == pytest.approx(expected.nominal, rel=SAMPLED, abs=NOTHING)


def test_few_rows_are_planned_one_by_one():
    rng = np.random.default_rng(9)
    count = 300
    durations = np.exp(rng.uniform(np.log(0.1), np.log(8.0), count))
    for name in ('polynomial', 'effort', 'energy', 'mixed'):
        assert not plan_many(ARM, 1.0, durations, STRATEGIES[name]).singles


@pytest.mark.parametrize('drive', Drive)
@pytest.mark.parametrize('name', STRATEGIES)
def test_predicted_residuals_are_those_of_single_plans(name, drive):
    rng = np.random.default_rng(6)
    box = UncertaintyBox(stiffness=0.2, damping=0.3, payload=(0.0, 0.2))
    options = replace(STRATEGIES[name], drive=drive, insensitivity=Insensitivity(box=box))
    arms = random_arms(rng, 5) + 3 * [ARM]
    ways = rng.uniform(0.5, 3.0, len(arms))
    durations = np.array([periods(arm) for arm in arms]) * rng.uniform(0.7, 3.0, len(arms))
    table = plan_many(arms, ways, durations, options)
    for row, arm in enumerate(arms):
        single = residual_of_plan(plan(request(ways[row], durations[row]), arm, options))
        allowed = NOTHING * ways[row]
        found = table.residuals
        assert found.nominal[row] == pytest.approx(single.nominal, rel=SAMPLED, abs=allowed)
        assert found.worst[row] == pytest.approx(single.worst, rel=SAMPLED, abs=allowed)
        assert found.miss[row] == pytest.approx(single.miss, rel=1e-5)


@pytest.mark.parametrize('drive', Drive)
def test_the_residual_on_a_true_arm_is_that_of_the_effort_on_it(drive):
    rng = np.random.default_rng(7)
    count = 12
    ways, durations = rng.uniform(0.5, 2.0, count), rng.uniform(0.4, 1.5, count)
    factors = rng.uniform(0.7, 1.3, (count, 4))
    options = PlanningOptions(drive=drive)
    table = plan_many(ARM, ways, durations, options)
    left, missed = table.residuals_on(factors), table.misses_on(factors)
    driving = table.driving(np.arange(count), 4000)
    both, last = ARM.inertia_star
    for row, (k, c, outer, inner) in enumerate(factors):
        star = (outer * last + inner * (both - last), outer * last)
        true = PlanarArm.reduced(
            inertia_star=star, stiffness=k * ARM.stiffness, damping=c * ARM.damping
        )
        found = predict_residual(true, driving[row], durations[row], UncertaintyBox(), drive=drive)
        assert left[row] == pytest.approx(found.nominal, rel=1e-4, abs=1e-8)
        reached = ways[row] * both / star[0] if drive is Drive.EFFORT else ways[row]
        assert missed[row] == pytest.approx(abs(reached - ways[row]), abs=1e-12)


def test_every_joint_of_a_long_arm_has_its_figures():
    """In a vertical plane, where efforts depend on the pose, without friction and with it."""
    arm = PlanarArm.reduced(
        inertia_star=(6.4e-4, 3.3e-5),
        stiffness=3e-3,
        damping=2e-5,
        link_length=[0.2, 0.15],
        link_com=[0.1, 0.08],
        link_mass=[0.3, 0.2],
        link_inertia=[1e-3, 4e-4],
        tip_mass=0.1,
        gravity=9.81,
        viscous_friction=[1e-3, 1e-3, 1e-4],
        coulomb_friction=[1e-2, 1e-2, 1e-3],
    )
    rng = np.random.default_rng(11)
    ways, starts = rng.uniform(-1.5, 1.5, (2, 8, 3))
    durations = np.geomspace(0.3, 4.0, 8)
    for has_friction in (False, True):
        options = PlanningOptions(compensate_friction=has_friction)
        table = plan_many(arm, ways, durations, options, starts=starts)
        assert not table.singles
        planned = table.planned(np.arange(8), 50)
        for row in range(8):
            single = table.plan(row)
            np.testing.assert_allclose(table.rms_effort[row], single.rms_effort, rtol=1e-4)
            np.testing.assert_allclose(table.peak_effort[row], single.peak_effort, rtol=5e-3)
            np.testing.assert_allclose(table.peak_velocity[row], single.peak_velocity, rtol=PEAK)
            reached = single.at(np.linspace(0.0, durations[row], 51)).planned
            assert (peaks_of(planned[row] - reached) <= CLOSE * peaks_of(reached)).all()


def test_a_row_that_is_refused_has_its_reason_and_keeps_its_place():
    lopsided = replace(ARM, static_moment=np.array([0.0, 1e-3]), carried_mass=np.array([1.0, 1.0]))
    arms = [ARM, lopsided, ARM, ARM]
    table = plan_many(arms, [1.0, 1.0, np.nan, 1.0], [0.5, 0.5, 0.5, -1.0], PlanningOptions())
    np.testing.assert_array_equal(table.is_certified, [True, False, False, False])
    assert isinstance(table.refusals[1], NotFlat)
    assert all(isinstance(table.refusals[row], InvalidRequest) for row in (2, 3))
    for values in (table.rms_effort, table.residuals.worst, table.boundary_residual):
        assert np.isfinite(values[0]).all()
        assert np.isnan(values[1:]).all()
    with pytest.raises(NotFlat, match='link 2'):
        table.plan(1)


def test_a_row_without_a_way_rests():
    table = plan_many(ARM, [0.0, 1.0], 0.5, PlanningOptions())
    assert table.is_certified.all()
    assert table.boundary_residual[0] == table.rms_effort[0, 0] == table.residuals.worst[0] == 0.0
    assert table.rms_effort[1, 0] > 0.0


def test_an_arm_that_creeps_has_no_residual():
    slow = replace(ARM, damping=3.0 * ARM.damping / ARM.natural_mode().damping_ratio)
    table = plan_many([ARM, slow], 1.0, 0.5, PlanningOptions(strategy=Strategy.POLYNOMIAL))
    assert table.is_certified.all()
    assert table.residuals.worst[0] > 0.0
    assert np.isnan(table.residuals.worst[1])
    with pytest.raises(InvalidRequest, match='does not oscillate'):
        residual_of_plan(table.plan(1))


@pytest.mark.parametrize(
    ('strategy', 'rows'), [(Strategy.INSENSITIVE, 3), (Strategy.MIN_PEAK_EFFORT, 2)]
)
def test_strategies_with_laws_of_their_own_are_planned_one_by_one(strategy, rows):
    options = PlanningOptions(strategy=strategy)
    ways, durations = np.linspace(0.5, 1.0, rows), np.linspace(1.0, 1.4, rows)
    table = plan_many(ARM, ways, durations, options)
    single = plan(request(ways[1], durations[1]), ARM, options)
    assert table.cost_value[1] == single.cost_value
    np.testing.assert_array_equal(table.rms_effort[1], single.rms_effort)
    assert table.residuals.worst[1] == residual_of_plan(single).worst
    # A pole of its own: the arm that is worst in the box.
    worst = np.tile(table.residuals.factors[1], (rows, 1))
    assert table.residuals_on(worst)[1] == pytest.approx(table.residuals.worst[1], rel=1e-3)


def test_numbers_that_differ_are_refused():
    with pytest.raises(InvalidRequest, match='give one of each'):
        plan_many(ARM, [1.0, 2.0], [1.0, 2.0, 3.0], PlanningOptions())
    with pytest.raises(InvalidRequest, match='has 1 planned'):
        plan_many(ARM, np.ones((3, 2)), 1.0, PlanningOptions())
    with pytest.raises(InvalidRequest, match='no arm'):
        plan_many([], 1.0, 1.0, PlanningOptions())
