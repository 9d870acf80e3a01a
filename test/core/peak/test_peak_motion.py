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

"""Motions of least peak effort: known times, the motion that is played, and what duals prove."""

from math import inf, pi

from flat_planner_ros.core.arm import apply_row, Drive, flat_map, OutOfReach, PlanarArm
from flat_planner_ros.core.peak import (
    LinearEffortLaw,
    peak_motion,
    peak_motion_from,
    PeakSettings,
    shortest_peak_duration,
)
from flat_planner_ros.core.plant import EffortProfile, SimulatedArm
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp, trapezoid
from scipy.optimize import fsolve

ARM = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
LIMIT = 0.015
MAP = flat_map(ARM)

BANG_BANG = 0.832479
INSENSITIVE_BANG_BANG = 1.022530
"""Least times over pi within 0.015 N m [s], computed apart from this project's code."""


def pole_of(arm):
    """Return the pole of the passive joint's oscillation while joint n-1 is free."""
    both, last = arm.inertia_star
    series = last * (both - last) / both
    decay = 0.5 * arm.damping / series
    return complex(-decay, np.sqrt(arm.stiffness / series - decay**2))


def bang_bang_duration(arm, distance, limit):
    """Return the duration of + - + - over a distance, its switches found as roots."""
    both, _ = arm.inertia_star
    pole = pole_of(arm)

    def miss(times):
        """Return what is left at the end of momentum, of the way and of the oscillation."""
        left = times[-1] - np.append(0.0, times)
        signs = np.array([1.0, -2.0, 2.0, -2.0, 1.0])
        swing = signs @ np.exp(pole * left)
        way = 0.5 * limit / both * (signs @ left**2)
        return [signs @ left, way - distance, swing.real, swing.imag]

    times, _, found, message = fsolve(miss, [0.3, 0.42, 0.54, 0.83], full_output=True)
    assert found == 1, message
    return times[-1]


def effort(law, times):
    """Return the effort of joint n-1 by the flat map."""
    return apply_row(MAP.effort, law.jet(times, 4))


@pytest.mark.parametrize(('intervals', 'most'), [(48, 1.02), (96, 1.01)])
def test_comes_near_to_bang_bang(intervals, most):
    settings = PeakSettings(intervals=intervals)
    duration = shortest_peak_duration(ARM, settings, pi, LIMIT)
    best = bang_bang_duration(ARM, pi, LIMIT)
    assert best == pytest.approx(BANG_BANG, rel=1e-5)
    assert best < duration < most * best


def test_comes_near_to_insensitive_bang_bang():
    duration = shortest_peak_duration(ARM, PeakSettings(insensitive=True), pi, LIMIT)
    assert INSENSITIVE_BANG_BANG < duration < 1.03 * INSENSITIVE_BANG_BANG


def test_uses_the_limit_and_does_not_exceed_it():
    duration = shortest_peak_duration(ARM, PeakSettings(), pi, LIMIT)
    law = peak_motion(ARM, duration, PeakSettings(), pi).law.transformed(pi, 0.5 * pi)
    peak = np.abs(effort(law, np.linspace(0.0, duration, 3001))).max()
    assert LIMIT * (1.0 - 1e-4) < peak < LIMIT


@pytest.mark.parametrize(('insensitive', 'best'), [(False, BANG_BANG), (True, 1.022530)])
def test_dual_values_prove_what_no_motion_can_do(insensitive, best):
    settings = PeakSettings(insensitive=insensitive)
    duration = shortest_peak_duration(ARM, settings, pi, LIMIT)
    motion = peak_motion(ARM, duration, settings, pi)
    # The integral of the switching function, by quadrature that knows nothing of its switches.
    integral = quad(
        lambda left: abs(motion.switching.at(np.array([left]))[0]), 0.0, duration, limit=400
    )[0]
    assert motion.least_peak == pytest.approx(motion.target / integral, rel=1e-6)
    proven = motion.switching.shortest_duration(motion.target, LIMIT / pi, duration)
    assert 0.99 * best < proven < best * (1.0 + 1e-6)
    for share in np.linspace(0.05, 0.95, 7):
        least = motion.switching.shortest_duration(share * motion.target, LIMIT / pi, duration)
        assert motion.switching.magnitude(least) * LIMIT / pi == pytest.approx(
            share * motion.target, rel=1e-9
        )


def test_the_switching_function_weighs_every_motion_alike():
    # For any effort that goes over 1 rad and leaves nothing, the integral against it is p b.
    duration = 1.1
    one = peak_motion(ARM, duration, PeakSettings(), 1.0)
    for other in (PeakSettings(intervals=20), PeakSettings(insensitive=True)):
        law = peak_motion(ARM, duration, other, 1.0).law
        times = np.linspace(0.0, duration, 200_001)
        weighed = effort(law, times) * one.switching.at(duration - times)
        assert trapezoid(weighed, times) == pytest.approx(one.target, rel=1e-6)
        assert np.abs(effort(law, times)).max() > one.least_peak


@pytest.mark.parametrize('drive', Drive)
def test_certifies_itself_on_random_arms(drive):
    rng = np.random.default_rng(5)
    for _ in range(12):
        both = 10.0 ** rng.uniform(-6, 1)
        last = both * 10.0 ** rng.uniform(-3, np.log10(0.9))
        frequency = 2.0 * np.pi * 10.0 ** rng.uniform(-1, np.log10(50.0))
        series = last * (both - last) / both
        arm = PlanarArm.reduced(
            inertia_star=(both, last),
            stiffness=frequency**2 * series,
            damping=0.4 * rng.uniform() * frequency * series,
        )
        duration = np.exp(rng.uniform(np.log(0.05), np.log(3.0)))
        motion = peak_motion(arm, duration, PeakSettings(), 1.0, drive)
        assert motion.boundary_residual < 1e-10
        assert motion.optimality_residual < 1e-10
        assert 0.0 < motion.gap < 0.1


def test_the_law_solves_the_equations_of_motion():
    duration = 0.9
    law = peak_motion(ARM, duration, PeakSettings(), 1.0).law
    knots = law.knots
    drive = effort(law, knots)
    both, last = ARM.inertia_star

    def motion(t, state):
        """Return the rates of both links' angles and velocities, row by row."""
        inner, outer, inner_rate, outer_rate = state
        spring = ARM.stiffness * (outer - inner) + ARM.damping * (outer_rate - inner_rate)
        tau = np.interp(t, knots, drive)
        return [inner_rate, outer_rate, (tau + spring) / (both - last), -spring / last]

    found = solve_ivp(
        motion, (0.0, duration), [-0.5, -0.5, 0.0, 0.0], rtol=1e-10, atol=1e-12, max_step=2e-3
    )
    last_link = apply_row(MAP.output, law.jet(found.t, 2))
    # The integrator does not know the corners of the effort.
    np.testing.assert_allclose(found.y[1], last_link, atol=1e-7)
    np.testing.assert_allclose(found.y[:, -1], [0.5, 0.5, 0.0, 0.0], atol=1e-6)


def test_derivatives_are_those_of_the_value():
    law = peak_motion(ARM, 0.9, PeakSettings(intervals=16), 1.0).law
    step = 1e-5
    middles = law.knots[:-1] + 0.4 * np.diff(law.knots)
    jet = law.jet(middles, 6)
    slopes = (law.jet(middles + step, 6) - law.jet(middles - step, 6)) / (2.0 * step)
    for order in range(6):
        scale = np.abs(jet[order + 1]).max()
        np.testing.assert_allclose(slopes[order], jet[order + 1], atol=1e-5 * scale)


@pytest.mark.parametrize('period', [0.0005, 0.005, 0.01])
def test_what_is_played_leaves_nothing(period):
    duration = shortest_peak_duration(ARM, PeakSettings(), pi, LIMIT)
    law = peak_motion(ARM, duration, PeakSettings(), pi).law.transformed(pi, 0.5 * pi)
    pieces = len(law.knots) - 1
    times = np.linspace(0.0, duration, pieces * int(np.ceil(duration / period / pieces)) + 1)
    samples = effort(law, times)
    samples[-1] = 0.0
    arm = SimulatedArm(ARM, step=1e-3)
    arm.command(EffortProfile(start=0.0, times=times, efforts=samples[:, None]), 0.0)
    arm.advance(duration + 0.002)
    swing, rest = [], []
    for _ in range(400):
        arm.advance(arm.time + 2e-3)
        swing.append(arm.position[1])
        rest.append(arm.position[0])
    assert np.abs(swing).max() < 1e-5
    assert abs(np.mean(rest) - pi) < 1e-4


def test_insensitive_motions_leave_less_on_other_arms():
    duration = 1.1
    left = {}
    for insensitive in (False, True):
        law = peak_motion(ARM, duration, PeakSettings(insensitive=insensitive), pi).law
        times = np.linspace(0.0, duration, 20_001)
        drive = pi * effort(law, times)
        pole = 1.02 * pole_of(ARM)
        left[insensitive] = abs(trapezoid(drive * np.exp(pole * (duration - times)), times))
    assert left[True] < 0.1 * left[False]


def test_the_rate_of_the_effort_is_bounded():
    settings = PeakSettings(effort_rate=0.05)
    law = peak_motion(ARM, 1.2, settings, pi).law.transformed(pi, 0.0)
    times = np.linspace(0.0, 1.2, 20_001)
    rates = np.diff(effort(law, times)) / np.diff(times)
    assert 0.049 < np.abs(rates).max() < 0.05 * (1.0 + 1e-6)
    with pytest.raises(OutOfReach, match='longer'):
        peak_motion(ARM, 0.9, settings, pi)


def test_a_long_motion_has_three_phases():
    settings = PeakSettings(velocity=6.0)
    law = peak_motion(ARM, 6.0, settings, 30.0).law.transformed(30.0, 0.0)
    jet = law.jet(np.linspace(0.0, 6.0, 3001), 5)
    deflection = apply_row(MAP.deflection, jet, 1)
    velocity = apply_row(MAP.output, jet, 1) - deflection
    assert velocity.max() < 6.0 * 1.01
    # More than half the time at nearly full speed.
    assert np.mean(velocity > 5.9) > 0.5
    np.testing.assert_allclose(jet[1:5, -1], 0.0, atol=1e-6)


@pytest.mark.parametrize('duration', [0.3, 0.9, 1.5])
def test_starts_from_the_midst_of_a_motion(duration):
    running = peak_motion(ARM, 0.9, PeakSettings(), pi).law.transformed(pi, 0.0)
    start = running.jet(0.3, 5)[:, 0]
    found = peak_motion_from(ARM, duration, PeakSettings(), start, -1.0)
    ends = found.law.jet([0.0, duration], 4)
    scale = np.abs(found.law.jet(found.law.knots, 4)).max(axis=1)
    assert (np.abs(ends[:, 0] - start[:5]) < 1e-12 * scale).all()
    assert (np.abs(ends[:, 1] - [-1.0, 0.0, 0.0, 0.0, 0.0]) < 1e-10 * scale).all()
    assert found.boundary_residual < 1e-10
    assert found.optimality_residual < 1e-10
    # Never less than what acts at the start.
    assert found.peak >= abs(apply_row(MAP.effort, start[:, None])[0]) * (1.0 - 1e-12)


def test_under_a_servo_the_acceleration_of_the_link_has_the_least_peak():
    duration = 0.9
    found = peak_motion(ARM, duration, PeakSettings(), 1.0, Drive.POSITION)
    times = np.linspace(0.0, duration, 20_001)
    jet = found.law.jet(times, 4)
    output, deflection = (apply_row(row, jet, 2) for row in (MAP.output, MAP.deflection))
    link = output - deflection
    assert np.abs(link).max() == pytest.approx(found.peak, rel=1e-3)
    assert np.abs(np.diff(link)).max() < 0.1 * found.peak
    other = peak_motion(ARM, duration, PeakSettings(), 1.0).law.jet(times, 4)
    output, deflection = (apply_row(row, other, 2) for row in (MAP.output, MAP.deflection))
    assert np.abs(output - deflection).max() > found.peak


def test_a_law_serves_any_distance_and_place():
    law = peak_motion(ARM, 0.9, PeakSettings(), 1.0).law
    moved = law.transformed(2.0, 1.0)
    assert isinstance(moved, LinearEffortLaw)
    np.testing.assert_allclose(moved.jet([0.0, 0.9], 0)[0], [0.0, 2.0], atol=1e-12)
    assert PeakSettings().is_homogeneous
    assert not PeakSettings(velocity=1.0).is_homogeneous
    assert PeakSettings(velocity=inf).is_homogeneous
