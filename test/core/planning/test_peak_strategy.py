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

"""The strategy of least peak effort as a plan: limits, samples, starts in motion, many joints."""

from math import inf, pi

from flat_planner_ros.core.arm import Drive, FlatModel, InvalidRequest, PlanarArm
from flat_planner_ros.core.peak import (
    peak_motion_from,
    PeakSettings,
    shortest_peak_duration_from,
)
from flat_planner_ros.core.planning import (
    check_options,
    DurationRules,
    extrema_of,
    fastest_points,
    JointLimits,
    MotionRequest,
    OnViolation,
    plan,
    PlanningOptions,
    Quantity,
    RequestRejected,
    stop_plan,
    Strategy,
    ViaPoint,
)
import numpy as np
import pytest
from scipy.integrate import trapezoid

ARM = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
LIMIT = 0.015
OPTIONS = PlanningOptions(strategy=Strategy.MIN_PEAK_EFFORT)
BANG_BANG = 0.832479


def rules(**limits):
    """Return rules for durations under limits of two joints."""
    return DurationRules(
        joints=('joint1', 'joint2'),
        limits=JointLimits.of(2, **{name: np.array(value) for name, value in limits.items()}),
        on_violation=OnViolation.REJECT,
        shortest=0.01,
        longest=60.0,
    )


def request(distance=pi, duration=1.0):
    """Return a motion from rest to rest."""
    return MotionRequest(start=np.zeros(2), final=np.array([distance, 0.0]), duration=duration)


def shortest(options=OPTIONS, asked=None, **limits):
    """Return the shortest plan within limits."""
    asked = request() if asked is None else asked
    return rules(**limits).plan_within(asked, ARM, options, is_prescribed=False)[0]


def test_without_a_duration_it_is_time_optimal():
    found = shortest(effort=[LIMIT, inf])
    assert BANG_BANG < found.duration < 1.02 * BANG_BANG
    peak = extrema_of(found, [Quantity.EFFORT])[0].peak[0]
    assert LIMIT * (1.0 - 1e-4) < peak <= LIMIT
    assert float(f'{found.duration:.9g}') == found.duration


def test_is_faster_than_every_other_strategy():
    others = [
        shortest(PlanningOptions(strategy=strategy), effort=[LIMIT, inf]).duration
        for strategy in (Strategy.POLYNOMIAL, Strategy.MIN_CONTROL_EFFORT)
    ]
    assert shortest(effort=[LIMIT, inf]).duration < 0.9 * min(others)


@pytest.mark.parametrize('period', [0.0005, 0.003, 0.005, 0.01, 1.0])
def test_samples_contain_the_corners_of_the_effort(period):
    found = plan(request(), ARM, OPTIONS)
    samples = found.sample(period)
    assert np.diff(samples.times).max() <= period
    # Joined linearly the samples are the effort itself.
    times = np.linspace(0.0, 1.0, 1777)
    joined = np.interp(times, samples.times, samples.driving_effort)
    exact = found.at(times).driving_effort
    np.testing.assert_allclose(joined, exact, atol=1e-10)
    assert samples.driving_effort[0] == samples.driving_effort[-1] == 0.0


def test_figures_are_those_of_a_fine_grid():
    found = plan(request(), ARM, OPTIONS)
    fine = found.sample(1e-5)
    rms = np.sqrt(trapezoid(fine.efforts[:, 0] ** 2, fine.times))
    assert found.rms_effort[0] == pytest.approx(rms, rel=1e-6)
    positions, velocities, efforts = extrema_of(found)
    assert efforts.peak[0] == pytest.approx(np.abs(fine.efforts[:, 0]).max(), rel=1e-9)
    np.testing.assert_allclose(velocities.peak, np.abs(fine.velocities).max(axis=0), rtol=1e-6)
    np.testing.assert_allclose(positions.highest, fine.positions.max(axis=0), rtol=1e-6)
    assert found.cost_value == pytest.approx(efforts.peak[0], rel=1e-6)


def test_keeps_a_limit_on_the_velocity_too():
    free = shortest(effort=[LIMIT, inf])
    found = shortest(effort=[LIMIT, inf], velocity=[4.0, inf])
    assert found.duration > 1.05 * free.duration
    assert extrema_of(found, [Quantity.VELOCITY])[0].peak[0] <= 4.0 * (1.0 + 1e-9)


def test_a_bound_on_the_velocity_takes_less_time_than_stretching():
    limits = {'effort': [LIMIT, inf], 'velocity': [4.0, inf]}
    stretched = shortest(**limits)
    peak = PeakSettings(velocity=4.0)
    bounded = shortest(PlanningOptions(strategy=Strategy.MIN_PEAK_EFFORT, peak=peak), **limits)
    assert bounded.duration < 0.8 * stretched.duration
    assert extrema_of(bounded, [Quantity.VELOCITY])[0].peak[0] <= 4.0 * (1.0 + 1e-9)


@pytest.mark.parametrize('final', [pi, 0.5, -1.0])
def test_takes_over_from_a_running_motion(final):
    running = shortest(effort=[LIMIT, inf])
    jets = running.at(np.array([0.4])).planned[:, :6, 0]
    asked = MotionRequest(
        start=np.zeros(2), final=np.array([final, 0.0]), duration=1.0, start_jets=jets
    )
    found = shortest(asked=asked, effort=[LIMIT, inf])
    assert found.options.strategy is Strategy.MIN_PEAK_EFFORT
    before, after = running.at(np.array([0.4])), found.at(np.array([1e-9]))
    np.testing.assert_allclose(after.positions, before.positions, atol=1e-7)
    np.testing.assert_allclose(after.efforts, before.efforts, atol=1e-7)
    assert extrema_of(found, [Quantity.EFFORT])[0].peak[0] <= LIMIT * (1.0 + 1e-8)
    try:
        others = shortest(PlanningOptions(), asked=asked, effort=[LIMIT, inf]).duration
    except RequestRejected:
        others = inf
    assert found.duration < others


@pytest.mark.parametrize('time', [0.1, 0.5, 0.8])
@pytest.mark.parametrize('final', [pi, -1.0, 20.0])
def test_dual_values_find_the_duration_that_a_search_finds(time, final):
    running = shortest(effort=[LIMIT, inf])
    jets = running.at(np.array([time])).planned[:, :6, 0]
    found = shortest_peak_duration_from(ARM, PeakSettings(), jets[0], final, LIMIT)
    for share, obeys in ((1.0, True), (0.999, False), (0.95, False), (0.8, False)):
        motion = peak_motion_from(ARM, share * found, PeakSettings(), jets[0], final)
        assert (motion.inner_peak <= LIMIT) == obeys


def test_arms_of_more_joints_move_in_synchrony():
    arm = PlanarArm.reduced(
        inertia_star=(6.4e-4, 3.3e-5),
        stiffness=3e-3,
        damping=2e-5,
        link_length=(0.3, 0.3),
        link_com=(0.15, 0.15),
        link_mass=(0.2, 0.2),
        link_inertia=(1e-3, 1e-3),
    )
    final = np.zeros(arm.n)
    final[:-1] = 0.7
    asked = MotionRequest(start=np.zeros(arm.n), final=final, duration=1.2)
    found = plan(asked, arm, OPTIONS)
    samples = found.sample(0.005)
    np.testing.assert_allclose(samples.positions[-1], final, atol=1e-12)
    assert (samples.velocities[-1] == 0.0).all()
    corners = np.diff(samples.driving_effort, 2)
    assert np.isfinite(samples.efforts).all()
    assert np.abs(corners).max() < np.abs(samples.driving_effort).max()


def test_refuses_what_it_cannot_plan():
    with pytest.raises(InvalidRequest, match='flat_model'):
        check_options(
            ARM,
            PlanningOptions(strategy=Strategy.MIN_PEAK_EFFORT, flat_model=FlatModel.APPROXIMATE),
        )
    stiff = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-3)
    with pytest.raises(InvalidRequest, match='oscillates'):
        check_options(stiff, OPTIONS)
    via = (ViaPoint(time=0.5, values=np.array([1.0])),)
    with pytest.raises(InvalidRequest, match='via'):
        plan(
            MotionRequest(start=np.zeros(2), final=np.array([pi, 0.0]), duration=1.0, via=via),
            ARM,
            OPTIONS,
        )


def test_a_servo_has_the_least_acceleration():
    by_effort, by_servo = (
        plan(request(), ARM, PlanningOptions(strategy=Strategy.MIN_PEAK_EFFORT, drive=drive))
        for drive in (Drive.EFFORT, Drive.POSITION)
    )
    peaks = [np.abs(p.sample(1e-3).accelerations[:, 0]).max() for p in (by_effort, by_servo)]
    assert peaks[1] < peaks[0]
    assert by_servo.peak_effort[0] > by_effort.peak_effort[0]


def test_a_stop_is_where_the_least_peak_leads():
    running = plan(request(), ARM, OPTIONS)
    time = 0.45
    now = running.at(np.array([time]))
    found = stop_plan(running, now.positions[0], now.planned[:, :6, 0], 1.0 - time)
    assert found.options.strategy is Strategy.MIN_PEAK_EFFORT
    assert found.duration < 0.9 * (1.0 - time)
    end = found.sample(0.005)
    assert (end.velocities[-1] == 0.0).all()
    # Nowhere else does it take less.
    for shift in (-0.05, 0.05):
        elsewhere = MotionRequest(
            start=now.positions[0],
            final=found.request.final + np.array([shift, 0.0]),
            duration=found.duration,
            start_jets=now.planned[:, :6, 0],
        )
        assert plan(elsewhere, ARM, OPTIONS).cost_value > found.cost_value * (1.0 - 1e-9)


def test_the_trade_of_time_against_residual():
    points = {point.series: point for point in fastest_points(request(), ARM, OPTIONS, LIMIT)}
    assert all(point.peak_effort <= LIMIT * (1.0 + 1e-9) for point in points.values())
    fastest, robust = points['min_peak_effort'], points['min_peak_effort, insensitive']
    assert min(points.values(), key=lambda point: point.duration) is fastest
    assert fastest.nominal < 1e-9
    assert robust.worst < 0.2 * fastest.worst
