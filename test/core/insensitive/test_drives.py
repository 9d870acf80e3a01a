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

"""Either drive, and an uncertain inertia: laws and predictions against independent integration."""

from core.conftest import ARM, ELBOW
from flat_planner_ros.core.arm.errors import InvalidRequest
from flat_planner_ros.core.arm.planar_arm import Drive, PlanarArm
from flat_planner_ros.core.insensitive.insensitivity import (
    Criterion,
    Insensitivity,
    Nominal,
    UncertaintyBox,
)
from flat_planner_ros.core.insensitive.momentum_angle import least_effort
from flat_planner_ros.core.insensitive.oscillator import Oscillator
from flat_planner_ros.core.insensitive.residual import (
    predict_residual,
    residual_amplitude,
    servo_effort,
)
from flat_planner_ros.core.insensitive.shapers import shaped_quintic, Shaper
from flat_planner_ros.core.motion_law.cost import Strategy
from flat_planner_ros.core.planning.planner import plan
from flat_planner_ros.core.planning.request import MotionRequest, PlanningOptions
from flat_planner_ros.core.planning.tradeoff import baselines, residual_of_plan
import numpy as np
import pytest
from scipy.integrate import cumulative_simpson, solve_ivp
from scipy.interpolate import CubicSpline

HEAVY = PlanarArm.reduced(inertia_star=(6.4e-4, 2.5e-4), stiffness=2.3e-2, damping=2.0e-5)
"""An arm whose last link has two fifths of the inertia: its two resonances lie far apart."""

ARMS = {'paper': ARM, 'heavy': HEAVY}

RESIDUALS = (0.06, 0.04, 0.03, 0.02, 0.01, 0.006, 0.003)

LEAST_RMS = {
    ('paper', 1.0, 'effort'): (0.00839, 0.01002, 0.01101, 0.01206, 0.0227, 0.0527),
    ('paper', 1.0, 'position'): (0.00865, 0.01049, 0.01158, 0.01273, 0.0251, 0.0596),
    ('paper', 1.2, 'effort'): (0.00543, 0.00543, 0.00543, 0.00546, 0.00554, 0.00732, 0.01244),
    ('paper', 1.2, 'position'): (0.00543, 0.00543, 0.00544, 0.00549, 0.00560, 0.00807, 0.01412),
    ('heavy', 1.0, 'effort'): (0.00786, 0.00786, 0.00786, 0.00786, 0.00885, 0.01227, 0.01558),
    ('heavy', 1.0, 'position'): (0.00788, 0.00809, 0.00828, 0.00851, 0.0194, 0.0361, 0.0491),
    ('heavy', 1.2, 'effort'): (0.00523, 0.00539, 0.00551, 0.00565, 0.00580, 0.00587, 0.00592),
    ('heavy', 1.2, 'position'): (0.00507, 0.00511, 0.00518, 0.00527, 0.00539, 0.00656, 0.00872),
    ('heavy', 1.5, 'position'): (0.00331, 0.00333, 0.00338, 0.00346, 0.00356, 0.00361, 0.00365),
}
"""
Smallest RMS effort [N m] for each of RESIDUALS, over +-10 % of stiffness and damping, 0 to pi.

Exact on the nominal arm, twelve end conditions, 30 B-spline coefficients of degree 9, by a conic
solver.
"""

CASES = [
    (arm, duration, Drive(drive), residual, rms)
    for (arm, duration, drive), row in LEAST_RMS.items()
    for residual, rms in zip(RESIDUALS, row, strict=False)
]


def planned(arm, duration, drive, final=np.pi, **wanted):
    """Return an insensitive plan from zero, and what it leaves."""
    goal = np.zeros(arm.n)
    goal[-2] = final
    request = MotionRequest(start=np.zeros(arm.n), final=goal, duration=duration)
    options = PlanningOptions(
        strategy=Strategy.INSENSITIVE, insensitivity=Insensitivity(**wanted), drive=drive
    )
    result = plan(request, arm, options)
    return result, residual_of_plan(result)


def swing(arm, drive, course, duration, factors, start=(0.0, 0.0)):
    """
    Return the passive joint's angle and rate and link n-1's angle and rate at the end.

    The two linear rows of the last two links in absolute angles are integrated as they stand;
    `course` is the effort of joint n-1 or the acceleration of link n-1 over time, `factors` are on
    stiffness, damping and inertia of the last link.
    """
    k, c = factors[0] * arm.stiffness, factors[1] * arm.damping
    both, last = arm.inertia_star
    free, last = both - last, factors[2] * last

    def rates(t, state):
        q, dq, _, speed = state
        reaction = k * q + c * dq
        push = (course(t) + reaction) / free if drive is Drive.EFFORT else course(t)
        return dq, -reaction / last - push, speed, push

    ends = (0.0, duration)
    state = (*start, 0.0, 0.0)
    solution = solve_ivp(rates, ends, state, 'DOP853', rtol=1e-10, atol=1e-12, max_step=0.01)
    return solution.y[:, -1]


def amplitude(arm, drive, factors, state):
    """Return the envelope of the passive joint's oscillation, from the other arm's own mode."""
    both, last = arm.inertia_star
    other = PlanarArm.reduced(
        inertia_star=(both + (factors[2] - 1.0) * last, factors[2] * last),
        stiffness=factors[0] * arm.stiffness,
        damping=factors[1] * arm.damping,
    )
    mode = other.natural_mode(held=drive is Drive.POSITION)
    angle, rate = state[:2]
    return np.hypot(angle, (rate + mode.decay_rate * angle) / mode.damped_frequency)


def driving(result, drive):
    """Return what drives joint n-1 in a plan, as a function of time."""
    samples = result.sample(result.duration / 2000.0)
    is_effort = drive is Drive.EFFORT
    values = samples.driving_effort if is_effort else samples.driving_velocity
    spline = CubicSpline(samples.times, values)
    return spline if is_effort else spline.derivative()


def bump(times, duration):
    """Return a course that is zero at both ends, and nothing that a planner would do."""
    x = 2.0 * times / duration - 1.0
    return (1.0 - x**2) ** 2 * (np.sin(4.0 * x) + 0.3 * np.cos(9.0 * x))


@pytest.mark.parametrize('drive', Drive)
@pytest.mark.parametrize('factors', [(1.0, 1.0, 1.0), (1.1, 0.9, 1.0), (0.8, 1.3, 1.7)])
@pytest.mark.parametrize('arm', ARMS)
def test_the_prediction_is_what_the_arm_does(arm, factors, drive):
    arm, duration, start = ARMS[arm], 0.9, (0.1, -0.4)
    size = 0.01 if drive is Drive.EFFORT else 20.0
    state = swing(arm, drive, lambda t: size * bump(t, duration), duration, factors, start)
    oscillator = Oscillator.of(arm, drive)
    times = np.linspace(0.0, duration, 4001)
    signal = size * bump(times, duration)
    if drive is Drive.POSITION:
        signal = cumulative_simpson(signal, x=times, initial=0.0)
        # At rest at the end, as a motion is; the sines above bring the link to a speed.
        signal -= signal[-1]
    poles = oscillator.poles(np.array([factors]))
    (predicted,) = residual_amplitude(oscillator, signal, duration, poles, start)
    assert predicted == pytest.approx(amplitude(arm, drive, factors, state), rel=1e-5)


@pytest.mark.parametrize('drive', Drive)
@pytest.mark.parametrize(
    'box',
    [
        UncertaintyBox(inertia=0.2),
        UncertaintyBox(stiffness=0.05, damping=0.5, payload=(0.0, 1.5)),
        UncertaintyBox(stiffness=0.0, damping=0.0, payload=(-0.3, 0.1)),
    ],
)
def test_the_worst_of_a_box_is_on_its_edges(box, drive):
    duration = 1.4
    times = np.linspace(0.0, duration, 501)
    signal = 0.01 * bump(times, duration)
    oscillator = Oscillator.of(HEAVY, drive)
    sides = [np.linspace(low, high, 31) for low, high in box.ranges]
    factors = np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 3)
    everywhere = residual_amplitude(oscillator, signal, duration, oscillator.poles(factors))
    predicted = predict_residual(HEAVY, signal, duration, box, drive=drive)
    assert predicted.worst == pytest.approx(everywhere.max(), rel=2e-3)
    assert predicted.worst >= everywhere.max() * (1.0 - 1e-4)
    names = ('stiffness_factor', 'damping_factor', 'inertia_factor')
    place = np.array([[getattr(predicted, name) for name in names]])
    (there,) = residual_amplitude(oscillator, signal, duration, oscillator.poles(place))
    assert there == pytest.approx(predicted.worst, rel=1e-3)


@pytest.mark.parametrize('width', [-0.1, 0.95, np.nan])
def test_an_inertia_stays_an_inertia(width):
    with pytest.raises(InvalidRequest, match='half-width of the inertia'):
        UncertaintyBox(inertia=width)


@pytest.mark.parametrize('payload', [(0.2, 0.1), (-0.95, 0.0), (0.0, 1e3), (np.nan, 0.0)])
def test_a_payload_is_a_range(payload):
    with pytest.raises(InvalidRequest, match='payload'):
        UncertaintyBox(payload=payload)


@pytest.mark.parametrize('arm', ARMS)
def test_an_effort_stops_a_heavier_link_short(arm):
    arm = ARMS[arm]
    result, left = planned(arm, 1.0, Drive.EFFORT, box=UncertaintyBox(payload=(0.0, 0.4)))
    angle, _, before, _ = swing(
        arm, Drive.EFFORT, driving(result, Drive.EFFORT), 1.0, (1.0, 1.0, 1.4)
    )
    # Of the momentum angle, about which the two links oscillate on.
    both, last = arm.inertia_star
    reached = before + 1.4 * last * angle / (both + 0.4 * last)
    assert left.miss == pytest.approx(np.pi - reached, rel=1e-4)


def test_a_servo_misses_nothing_and_nobody_knows_a_momentum():
    _, left = planned(HEAVY, 1.0, Drive.POSITION, box=UncertaintyBox(inertia=0.3))
    assert left.miss == 0.0
    moving = predict_residual(HEAVY, np.zeros(11), 1.0, UncertaintyBox(inertia=0.3), (0.1, 0.0))
    assert moving.miss is None


@pytest.mark.parametrize(('arm', 'duration', 'drive', 'residual', 'rms'), CASES)
def test_hardly_more_effort_than_the_least(arm, duration, drive, residual, rms):
    result, left = planned(ARMS[arm], duration, drive, max_residual=residual)
    assert left.worst <= residual
    assert left.nominal < 1e-6
    assert result.rms_effort[0] <= 1.1 * rms


@pytest.mark.parametrize('nominal', Nominal)
@pytest.mark.parametrize('factors', [(1.0, 1.0, 1.0), (1.1, 0.9, 1.0), (0.9, 1.1, 1.1)])
@pytest.mark.parametrize('drive', Drive)
def test_what_a_plan_leaves_is_what_is_predicted(drive, factors, nominal):
    result, left = planned(
        HEAVY, 1.0, drive, box=UncertaintyBox(inertia=0.1), nominal=nominal, weight=100.0
    )
    state = swing(HEAVY, drive, driving(result, drive), 1.0, factors)
    measured = amplitude(HEAVY, drive, factors, state)
    assert measured <= left.worst * (1.0 + 1e-3) + 1e-7
    if factors == (1.0, 1.0, 1.0):
        assert measured == pytest.approx(left.nominal, rel=1e-2, abs=1e-6)


def worst_of_corners(result, drive):
    """Return the largest measured residual of the arms at the corners of the usual box."""
    corners = [(k, c, 1.0) for k in (0.9, 1.1) for c in (0.9, 1.1)]
    course = driving(result, drive)
    states = [swing(HEAVY, drive, course, result.duration, corner) for corner in corners]
    pairs = zip(corners, states, strict=True)
    return max(amplitude(HEAVY, drive, corner, state) for corner, state in pairs)


@pytest.mark.parametrize(
    ('duration', 'predicted', 'left'), [(1.0, 0.0053, 0.0478), (1.2, 0.0005, 0.0288)]
)
def test_a_law_for_efforts_does_not_serve_a_servo(duration, predicted, left):
    result, residual = planned(HEAVY, duration, Drive.EFFORT)
    assert residual.worst == pytest.approx(predicted, abs=2e-4)
    assert worst_of_corners(result, Drive.POSITION) == pytest.approx(left, rel=0.05)
    own, residual = planned(HEAVY, duration, Drive.POSITION)
    assert worst_of_corners(own, Drive.POSITION) <= residual.worst * (1.0 + 1e-5) < 0.26 * left


@pytest.mark.parametrize('periods', [0.7, 3.0, 30.0, 300.0])
@pytest.mark.parametrize('nominal', Nominal)
def test_any_duration_under_a_servo(periods, nominal):
    period = 2.0 * np.pi / HEAVY.natural_mode(held=True).frequency
    result, left = planned(
        HEAVY, periods * period, Drive.POSITION, nominal=nominal, criterion=Criterion.MEAN
    )
    assert max(result.boundary_residual, result.optimality_residual) < 1e-9
    least = least_effort(HEAVY, np.pi, result.duration)
    share = result.rms_effort[0] / least
    assert share >= 1.0
    # The cost is the effort's square and what is left, weighed.
    assert result.trajectory.cost_value >= share**2 * (1.0 - 1e-4)
    if nominal is Nominal.EXACT:
        assert left.nominal < 1e-3 * max(left.worst, 0.01)


def test_the_effort_of_a_servo_is_that_of_the_flat_map():
    result, _ = planned(HEAVY, 1.0, Drive.POSITION)
    samples = result.sample(5e-4)
    effort = servo_effort(HEAVY, samples.driving_velocity, 1.0)
    size = np.abs(samples.driving_effort).max()
    assert effort == pytest.approx(samples.driving_effort, abs=2e-3 * size)


def test_a_servo_on_three_joints():
    result, left = planned(ELBOW, 1.0, Drive.POSITION, final=0.8, max_residual=0.01)
    assert left.worst <= 0.01
    state = swing(ELBOW, Drive.POSITION, driving(result, Drive.POSITION), 1.0, (0.9, 1.1, 1.0))
    assert amplitude(ELBOW, Drive.POSITION, (0.9, 1.1, 1.0), state) <= 0.01


@pytest.mark.parametrize('shaper', [Shaper.ZV, Shaper.ZVD])
def test_impulses_for_the_servo_s_resonance(shaper):
    times = np.linspace(0.0, 1.5, 3001)
    oscillator = Oscillator.of(HEAVY, Drive.POSITION)
    signal = shaped_quintic(HEAVY, 1.0, 1.5, shaper, times, Drive.POSITION)
    poles = oscillator.poles(np.array([[1.0, 1.0], [1.05, 1.0]]))
    exact, off = residual_amplitude(oscillator, signal, 1.5, poles)
    assert exact < 1e-6
    assert off > 50.0 * exact
    effort = shaped_quintic(HEAVY, 1.0, 1.5, shaper, times) / HEAVY.inertia_star.both
    other = cumulative_simpson(effort, x=times, initial=0.0)
    assert residual_amplitude(oscillator, other, 1.5, poles)[0] > 1e-3


def test_baselines_of_a_servo_take_what_it_takes():
    request = MotionRequest(start=np.zeros(2), final=np.array([1.0, 0.0]), duration=1.5)
    found = {
        point.series: point
        for point in baselines(plan(request, HEAVY, PlanningOptions(drive=Drive.POSITION)))
    }
    assert found.keys() == {'polynomial', 'quintic', 'zv_quintic', 'zvd_quintic'}
    assert found['polynomial'].nominal < 1e-6 < found['quintic'].nominal
    assert found['zv_quintic'].nominal < 1e-5
    least = least_effort(HEAVY, 1.0, 1.5)
    assert all(point.rms_effort > least for point in found.values())
