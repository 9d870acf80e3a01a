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

"""Plans through via points, and times for those that have none."""

from dataclasses import replace

from core.conftest import ELBOW
from flat_planner_ros.core import (
    EffortProfile,
    FlatModel,
    MotionRequest,
    plan,
    PlanningOptions,
    rollout,
    Strategy,
    ViaPoint,
    with_via_times,
)
from flat_planner_ros.core.arm import InvalidRequest, UncertifiedPlan
import numpy as np
import pytest

STRATEGIES = {
    'polynomial': PlanningOptions(strategy=Strategy.POLYNOMIAL),
    'effort': PlanningOptions(strategy=Strategy.MIN_CONTROL_EFFORT),
    'energy': PlanningOptions(strategy=Strategy.MIN_POTENTIAL_ENERGY),
    'mixed': PlanningOptions(strategy=Strategy.MIXED, r=30.0, p=3.0),
    'custom': PlanningOptions(
        strategy=Strategy.CUSTOM, custom=np.diag([0.0, 1e6, 1e5, 1e4, 1e2, 1.0])
    ),
}


@pytest.fixture
def arm():
    """Return the paper's last two links on a first link."""
    return replace(ELBOW)


REQUEST = MotionRequest(
    start=np.zeros(3),
    final=np.array([0.5, 1.0, 0.0]),
    duration=2.0,
    via=(
        ViaPoint(time=0.6, values=np.array([1.0, -0.3])),
        ViaPoint(time=0.9, values=np.array([0.4, 0.2])),
        ViaPoint(time=1.4, values=np.array([2.0, 0.7])),
    ),
)
"""Three points for the flat outputs of three joints."""


@pytest.mark.parametrize('model', FlatModel)
@pytest.mark.parametrize('name', STRATEGIES)
def test_flat_outputs_pass_the_points(arm, name, model):
    found = plan(REQUEST, arm, replace(STRATEGIES[name], flat_model=model))
    assert 0.0 < found.boundary_residual <= 1e-9
    assert 0.0 < found.optimality_residual <= 1e-9
    times = np.array([point.time for point in REQUEST.via])
    samples = found.at(times)
    expected = np.array([point.values for point in REQUEST.via])
    np.testing.assert_allclose(samples.flat[:, 0].T, expected, atol=1e-12)
    # y1 is the sum of the joints' angles, and joint 1 is an output itself.
    np.testing.assert_allclose(samples.positions.sum(axis=1), expected[:, 0], atol=1e-12)
    np.testing.assert_allclose(samples.positions[:, 0], expected[:, 1], atol=1e-12)
    ends = found.at(np.array([0.0, 2.0]))
    np.testing.assert_array_equal(ends.positions, [REQUEST.start, REQUEST.final])
    assert not ends.velocities.any()
    assert found.cost_value > plan(replace(REQUEST, via=()), arm, found.options).cost_value


def test_efforts_have_no_jump_at_a_point(arm):
    found = plan(REQUEST, arm, STRATEGIES['effort'])
    step = 1e-7
    for point in REQUEST.via:
        before, after = found.at(point.time + np.array([-step, step])).efforts
        peak = found.peak_effort[:-1]
        assert (np.abs(after - before)[:-1] < 1e-4 * peak).all()


@pytest.mark.parametrize('name', STRATEGIES)
def test_the_simulated_arm_passes_the_points_and_rests(arm, name):
    found = plan(REQUEST, arm, STRATEGIES[name])
    samples = found.sample(1e-3)
    profile = EffortProfile(start=0.0, times=samples.times, efforts=samples.efforts[:, :-1])
    states = rollout(arm, profile, REQUEST.duration, step=5e-4, position=REQUEST.start)
    for point in REQUEST.via:
        passed = states.positions[np.argmin(np.abs(states.times - point.time))]
        assert passed.sum() == pytest.approx(point.values[0], abs=1e-5)
        assert passed[0] == pytest.approx(point.values[1], abs=1e-5)
    assert np.abs(states.positions[-1] - REQUEST.final).max() < 1e-5
    # At most what makes 1e-5 rad of oscillation at 1.6 Hz.
    assert np.abs(states.velocities[-1]).max() < 1e-4


@pytest.mark.parametrize('name', STRATEGIES)
def test_stretching_keeps_the_shares(arm, name):
    longer = REQUEST.stretched(5.0)
    assert longer.duration == 5.0
    assert [point.time for point in longer.via] == pytest.approx([1.5, 2.25, 3.5])
    assert REQUEST.stretched(2.0) is REQUEST
    found = plan(longer, arm, STRATEGIES[name])
    assert found.at(np.array([2.25])).flat[0, 0, 0] == pytest.approx(0.4, abs=1e-12)


@pytest.mark.parametrize('name', STRATEGIES)
def test_chosen_times_are_locally_best(arm, name):
    options = STRATEGIES[name]
    chosen = with_via_times(REQUEST, arm, options)
    assert chosen.duration == REQUEST.duration
    best = plan(chosen, arm, options).cost_value
    assert best < plan(REQUEST, arm, options).cost_value
    for index, point in enumerate(chosen.via):
        for shift in (-0.02, 0.02):
            via = list(chosen.via)
            via[index] = replace(point, time=point.time + shift)
            moved = plan(replace(chosen, via=tuple(via)), arm, options)
            assert moved.cost_value > best


@pytest.mark.parametrize('name', STRATEGIES)
def test_chosen_times_do_not_depend_on_the_given_ones(arm, name):
    other = tuple(
        replace(point, time=0.1 * (index + 1)) for index, point in enumerate(REQUEST.via)
    )
    chosen = with_via_times(REQUEST, arm, STRATEGIES[name])
    again = with_via_times(replace(REQUEST, via=other), arm, STRATEGIES[name])
    assert [p.time for p in chosen.via] == [p.time for p in again.via]


def test_equal_points_keep_a_share_of_the_time(arm):
    values = [np.array(v) for v in ([1.0, 0.3], [1.0, 0.3], [1.5, 0.5])]
    via = tuple(ViaPoint(time=0.1 * (i + 1), values=v) for i, v in enumerate(values))
    for name, options in STRATEGIES.items():
        chosen = with_via_times(replace(REQUEST, via=via), arm, options)
        edges = [0.0, *(point.time for point in chosen.via), chosen.duration]
        assert np.diff(edges).min() >= 0.05 * 2.0 / 4 * (1.0 - 1e-12), name


def test_no_motion_is_divided_evenly(arm):
    via = tuple(ViaPoint(time=0.1 * (i + 1), values=np.zeros(2)) for i in range(3))
    still = replace(REQUEST, final=np.zeros(3), via=via)
    chosen = with_via_times(still, arm, STRATEGIES['effort'])
    assert [point.time for point in chosen.via] == pytest.approx([0.5, 1.0, 1.5])
    found = plan(chosen, arm, STRATEGIES['effort'])
    assert found.cost_value == 0.0
    assert not found.sample(0.01).positions.any()


def test_a_start_in_motion(arm):
    options = STRATEGIES['effort']
    first = plan(REQUEST, arm, options)
    jets = first.trajectory.jets(np.array([0.7]))[:, :6, 0]
    rest = tuple(replace(point, time=point.time - 0.7) for point in REQUEST.via[1:])
    again = plan(replace(REQUEST, duration=1.3, via=rest, start_jets=jets), arm, options)
    times = np.linspace(0.0, 1.3, 100)
    expected = first.trajectory.jets(0.7 + times)
    peaks = np.abs(expected).max(axis=2, keepdims=True)
    assert (np.abs(again.trajectory.jets(times) - expected) <= 1e-9 * peaks).all()


def test_points_too_close_in_time_are_refused(arm):
    via = (REQUEST.via[0], replace(REQUEST.via[1], time=0.6 * (1.0 + 1e-13)))
    with pytest.raises(UncertifiedPlan):
        plan(replace(REQUEST, via=via), arm, STRATEGIES['effort'])
    with pytest.raises(InvalidRequest, match='after'):
        replace(REQUEST, via=(REQUEST.via[1], REQUEST.via[0]))


def test_motions_of_least_peak_have_no_via_points(arm):
    with pytest.raises(InvalidRequest, match='min_peak_effort'):
        plan(REQUEST, arm, PlanningOptions(strategy=Strategy.MIN_PEAK_EFFORT))


def test_fifty_points(arm):
    rng = np.random.default_rng(4)
    times = np.cumsum(rng.uniform(0.1, 0.4, 51))
    via = tuple(
        ViaPoint(time=time, values=values)
        for time, values in zip(times[:-1], rng.normal(size=(50, 2)), strict=True)
    )
    for name, options in STRATEGIES.items():
        found = plan(replace(REQUEST, duration=times[-1], via=via), arm, options)
        flat = found.at(times[:-1]).flat[:, 0].T
        expected = np.array([point.values for point in via])
        assert np.abs(flat - expected).max() < 1e-11, name


@pytest.mark.parametrize('name', STRATEGIES)
def test_times_of_another_duration_are_near(arm, name):
    options = STRATEGIES[name]
    chosen = with_via_times(REQUEST, arm, options)
    longer = chosen.stretched(1.2 * chosen.duration)
    near = plan(with_via_times(longer, arm, options, is_near=True), arm, options)
    anew = plan(with_via_times(longer, arm, options), arm, options)
    assert near.cost_value == pytest.approx(anew.cost_value, rel=1e-4)
    assert near.cost_value <= plan(longer, arm, options).cost_value
