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

"""Bounds on a motion of least peak besides that on its peak, and what dual values prove."""

from math import inf, pi

from flat_planner_ros.core.arm import Drive, InvalidRequest, OutOfReach, PlanarArm
from flat_planner_ros.core.insensitive import UncertaintyBox
from flat_planner_ros.core.peak import (
    check_peak,
    peak_motion,
    peak_motion_from,
    PeakSettings,
    shortest_peak_duration,
    shortest_peak_duration_from,
)
from flat_planner_ros.core.planning import (
    MotionRequest,
    plan,
    PlanningOptions,
    residual_of_plan,
    stop_plan,
    Strategy,
)
import numpy as np
import pytest
from scipy.integrate import trapezoid

ARM = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
HEAVY = PlanarArm.reduced(inertia_star=(6.4e-4, 2.5e-4), stiffness=2.3e-2, damping=2e-5)
LIMIT = 0.015
BOX = UncertaintyBox()


def worst_of(arm, settings, duration, drive=Drive.EFFORT, start_jets=None):
    """Return the worst predicted residual of a motion over pi, or of one from a start."""
    options = PlanningOptions(strategy=Strategy.MIN_PEAK_EFFORT, peak=settings, drive=drive)
    request = MotionRequest(
        start=np.zeros(2),
        final=np.array([pi, 0.0]),
        duration=duration,
        start_jets=start_jets,
    )
    return residual_of_plan(plan(request, arm, options)).worst


@pytest.mark.parametrize('drive', Drive)
@pytest.mark.parametrize('arm', [ARM, HEAVY], ids=['light', 'heavy'])
def test_the_residual_over_the_box_keeps_its_bound(arm, drive):
    free = worst_of(arm, PeakSettings(), 1.0, drive)
    settings = PeakSettings(max_residual=0.3 * free)
    left = worst_of(arm, settings, 1.0, drive)
    # Predictions for a servo are sums over its velocity, good to 1e-3 of themselves.
    assert 0.28 * free < left < 0.3 * free * (1.0 + 2e-3)
    bounded, plain = (
        peak_motion(arm, 1.0, wanted, pi, drive) for wanted in (settings, PeakSettings())
    )
    assert plain.peak < bounded.least_peak < bounded.peak < 1.2 * bounded.least_peak
    assert bounded.optimality_residual < 1e-9
    assert bounded.boundary_residual < 1e-10


def test_a_payload_is_an_arm_of_the_box_too():
    box = UncertaintyBox(stiffness=0.05, damping=0.0, payload=(0.0, 0.2))
    settings = PeakSettings(max_residual=0.05, box=box)
    motion = peak_motion(ARM, 1.1, settings, pi)
    assert motion.peak > 1.01 * peak_motion(ARM, 1.1, PeakSettings(), pi).peak
    narrow = UncertaintyBox(stiffness=0.05, damping=0.0)
    less = peak_motion(ARM, 1.1, PeakSettings(max_residual=0.05, box=narrow), pi)
    assert less.peak < motion.peak


def test_the_shortest_within_a_residual_and_what_no_motion_can_do():
    settings = PeakSettings(max_residual=0.02)
    duration = shortest_peak_duration(ARM, settings, pi, LIMIT)
    found = peak_motion(ARM, duration, settings, pi)
    assert (1.0 - 3e-3) * LIMIT < pi * found.peak <= LIMIT
    assert 0.97 * duration < found.least_duration < duration
    # A finer spline is another motion, and keeps to what was proven.
    fine = PeakSettings(max_residual=0.02, intervals=96)
    finer = shortest_peak_duration(ARM, fine, pi, LIMIT)
    assert found.least_duration < finer < duration


@pytest.mark.parametrize(('distance', 'velocity'), [(pi, 4.0), (1.0, 3.0)])
def test_the_shortest_within_a_velocity(distance, velocity):
    settings = PeakSettings(velocity=velocity)
    duration = shortest_peak_duration(ARM, settings, distance, LIMIT)
    found = peak_motion(ARM, duration, settings, distance)
    assert (1.0 - 3e-3) * LIMIT < distance * found.peak <= LIMIT
    assert 0.98 * velocity < distance * found.peak_velocity <= velocity
    assert 0.94 * duration < found.least_duration < duration
    plain = shortest_peak_duration(ARM, PeakSettings(), distance, LIMIT)
    assert found.least_duration > peak_motion(ARM, plain, PeakSettings(), distance).least_duration
    # A finer spline, whose motion is nearer to what was proven, is not beyond it.
    fine = PeakSettings(velocity=velocity, intervals=96)
    for share in (1.0, 0.995):
        other = peak_motion(ARM, share * duration, fine, distance)
        assert other.peak > peak_motion(ARM, share * duration, settings, distance).least_peak


def test_a_long_way_is_cruised_at_full_speed():
    settings = PeakSettings(velocity=2.0)
    found = peak_motion(ARM, 15.8, settings, 30.0)
    times = np.linspace(0.0, 15.8, 4001)
    velocity = 30.0 * found.velocities(times)
    assert velocity.max() <= 2.0
    cruise = (times > 2.3) & (times < 13.5)
    assert np.ptp(velocity[cruise]) < 1e-6
    assert velocity[cruise].min() > 1.98
    assert found.boundary_residual < 1e-10
    jet = found.law.jet(times, 4)
    assert np.abs(jet[2:, cruise]).max() < 1e-6 * np.abs(jet[2:]).max()


def test_a_bound_on_the_rate_alone_may_decide():
    settings = PeakSettings(effort_rate=0.05)
    duration = shortest_peak_duration(ARM, settings, pi, LIMIT)
    assert pi * peak_motion(ARM, duration, settings, pi).peak < 0.9 * LIMIT
    slow = PeakSettings(effort_rate=0.2)
    duration = shortest_peak_duration(ARM, slow, pi, LIMIT)
    peak = pi * peak_motion(ARM, duration, slow, pi).peak
    assert (1.0 - 3e-3) * LIMIT < peak <= LIMIT


def midst():
    """Return the derivatives of a running motion at 0.4 s."""
    return peak_motion(ARM, 0.85, PeakSettings(), pi).law.transformed(pi, 0.5 * pi).jet(0.4, 5)


def residual_from(drive, start, duration, settings, stiffness, damping):
    """Return what a motion from a start leaves on an arm of another spring, by simulation."""
    found = peak_motion_from(ARM, duration, settings, start, pi, drive)
    both, last = ARM.inertia_star
    k, c = stiffness * ARM.stiffness, damping * ARM.damping
    # The passive joint under what drives link n-1, as an oscillator of its own.
    inertia, gain = (
        (last, 1.0)
        if drive is Drive.POSITION
        else (last * (both - last) / both, 1 / (both - last))
    )
    pole = complex(-0.5 * c / inertia, np.sqrt(k / inertia - (0.5 * c / inertia) ** 2))
    fine = np.linspace(0.0, duration, 40_001)
    knots = np.linspace(0.0, duration, len(found.samples))
    drive_at = np.interp(fine, knots, found.samples)
    angle, rate = -last / ARM.stiffness * start[2:4]
    driven = gain * trapezoid(drive_at * np.exp(pole * (duration - fine)), fine)
    return abs(np.exp(pole * duration) * (rate - np.conj(pole) * angle) - driven) / pole.imag


@pytest.mark.parametrize('drive', Drive)
def test_insensitive_from_a_start_in_motion(drive):
    start = midst()[:, 0]
    plain, robust = PeakSettings(), PeakSettings(insensitive=True)
    for change in (-0.01, 0.01):
        left = [
            residual_from(drive, start, 1.2, wanted, 1.0 + change, 1.0)
            for wanted in (plain, robust)
        ]
        assert left[1] < 0.1 * left[0]
    # To first order: four times the error leaves sixteen times as much.
    few = [residual_from(drive, start, 1.2, robust, 1.0 + e, 1.0) for e in (0.005, 0.02)]
    assert few[1] == pytest.approx(16.0 * few[0], rel=0.3)
    assert residual_from(drive, start, 1.2, robust, 1.0, 1.0) < 1e-6


@pytest.mark.parametrize('drive', Drive)
def test_the_residual_keeps_its_bound_from_a_start_in_motion(drive):
    start = midst()[:, 0]
    corners = [(a, b) for a in (0.9, 1.0, 1.1) for b in (0.9, 1.1)]
    worst = {}
    for bound in (0.0, 0.03):
        settings = PeakSettings(max_residual=bound)
        worst[bound] = max(
            residual_from(drive, start, 1.1, settings, *corner) for corner in corners
        )
    assert worst[0.03] <= 0.03 < worst[0.0]


def test_the_shortest_from_a_start_in_motion_keeps_its_bounds():
    start = midst()[:, 0]
    free = shortest_peak_duration_from(ARM, PeakSettings(), start, 20.0, LIMIT)
    settings = PeakSettings(velocity=8.0)
    duration = shortest_peak_duration_from(ARM, settings, start, 20.0, LIMIT)
    found = peak_motion_from(ARM, duration, settings, start, 20.0)
    assert duration > free
    assert found.peak_velocity <= 8.0
    assert found.inner_peak <= LIMIT
    assert peak_motion_from(ARM, free, PeakSettings(), start, 20.0).peak_velocity > 8.0


def test_a_box_with_arms_that_do_not_oscillate_is_refused():
    damped = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=3e-4)
    wide = UncertaintyBox(stiffness=0.8, damping=0.9)
    check_peak(damped, PeakSettings(box=wide))
    with pytest.raises(InvalidRequest, match='does not oscillate'):
        check_peak(damped, PeakSettings(box=wide, max_residual=0.01))


def test_a_residual_that_no_motion_keeps_is_refused():
    with pytest.raises(OutOfReach, match='max_residual = 1e-06'):
        peak_motion(ARM, 0.4, PeakSettings(max_residual=1e-6), pi)


@pytest.mark.parametrize(
    'changes', [{'velocity': 6.0}, {'effort_rate': 0.3}, {'max_residual': 0.03}]
)
def test_a_stop_keeps_bounds_where_it_can_and_comes_in_any_case(changes):
    options = PlanningOptions(strategy=Strategy.MIN_PEAK_EFFORT, peak=PeakSettings(**changes))
    request = MotionRequest(start=np.zeros(2), final=np.array([pi, 0.0]), duration=1.4)
    running = plan(request, ARM, options)
    now = running.at(np.array([0.7]))
    jets = now.planned[:, :6, 0]
    for remaining in (0.7, 0.1):
        found = stop_plan(running, now.positions[0], jets, remaining)
        assert found.duration <= remaining
        assert (found.sample(0.005).velocities[-1] == 0.0).all()
        assert found.boundary_residual < 1e-9
    if 'max_residual' in changes:
        found = stop_plan(running, now.positions[0], jets, 0.7)
        assert found.options.peak == options.peak
        assert residual_of_plan(found).worst <= 0.03 * (1.0 + 1e-3)


def test_settings_tell_whether_ways_are_alike():
    assert PeakSettings(insensitive=True).is_homogeneous
    assert not PeakSettings(max_residual=0.01).is_homogeneous
    assert PeakSettings(max_residual=0.01, velocity=2.0).unbounded == PeakSettings(velocity=inf)
