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

"""A robot that follows positions only: what the elastic joint keeps of a planned motion."""

from pathlib import Path
import re

from core.conftest import ARM, envelope
from flat_planner_ros.core.arm.flat_map import FlatModel
from flat_planner_ros.core.motion_law.cost import Strategy
from flat_planner_ros.core.planning.planner import plan
from flat_planner_ros.core.planning.request import MotionRequest, PlanningOptions
from flat_planner_ros.core.plant.drives import DriveSettings
from flat_planner_ros.core.plant.effort_profile import EffortProfile
from flat_planner_ros.core.plant.simulation import SimulatedArm
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import BPoly, PPoly

TEXT = (Path(__file__).resolve().parents[3] / 'docs' / 'real_robot.md').read_text('utf-8')
GOAL = np.pi
DURATION = 1.0
SEED = 11


@pytest.fixture(scope='module')
def motion():
    """Return the paper's motion of least control effort."""
    request = MotionRequest(start=np.zeros(2), final=np.array([GOAL, 0.0]), duration=DURATION)
    options = PlanningOptions(strategy=Strategy.MIN_CONTROL_EFFORT, flat_model=FlatModel.EXACT)
    return plan(request, ARM, options)


def linear(times, angles):
    """Return straight lines between points."""
    return PPoly(np.vstack([np.diff(angles) / np.diff(times), angles[:-1]]), times)


def servo_course(samples, kind):
    """Return the angle of joint 1 that an ideal servo makes of a command's points."""
    columns = (samples.positions, samples.velocities, samples.accelerations)
    data = [column[:, 0] for column in columns]
    if kind == 'linear':
        return linear(samples.times, data[0])
    count = {'cubic': 2, 'quintic': 3}[kind]
    joined = BPoly.from_derivatives(samples.times, np.stack(data[:count], axis=1))
    return PPoly.from_bernstein_basis(joined)


def residual(arm, course):
    """
    Return the amplitude of joint 2 at the end of a course of joint 1 [rad].

    I theta'' + c theta' + k theta = c q' + k q for theta = q + q2, solved mode by mode: a
    quadrature over every segment, exact to rounding.
    """
    inertia, k, c = arm.inertia[-1, -1], arm.stiffness, arm.damping
    poles, modes = np.linalg.eig(np.array([[0.0, 1.0], [-k / inertia, -c / inertia]]))
    nodes, weights = np.polynomial.legendre.leggauss(12)
    step = np.diff(course.x)[:, None]
    at = course.x[:-1, None] + step * (nodes + 1) / 2
    end = course.x[-1]
    force = (k * course(at) + c * course.derivative()(at)) * weights * step / 2
    content = np.array([np.sum(np.exp(pole * (end - at)) * force) for pole in poles])
    state = (modes @ (np.linalg.solve(modes, [0.0, 1.0 / inertia]) * content)).real
    return envelope(arm, state[0] - course(end), state[1], held=True)


def test_the_quadrature_agrees_with_an_integrator(motion):
    course = servo_course(motion.sample(0.1), 'quintic')
    inertia, k, c = ARM.inertia[-1, -1], ARM.stiffness, ARM.damping

    def rate(t, x):
        return [x[1], (c * (course(t, 1) - x[1]) + k * (course(t) - x[0])) / inertia]

    solution = solve_ivp(rate, (0.0, DURATION), [0.0, 0.0], rtol=1e-11, atol=1e-13)
    theta, speed = solution.y[:, -1]
    expected = envelope(ARM, theta - GOAL, speed, held=True)
    assert residual(ARM, course) == pytest.approx(expected, rel=1e-5)


def documented(row):
    """Return the numbers in a row of a table in docs/real_robot.md."""
    (cells,) = re.findall(rf'^\| {re.escape(row)} \|(.*)\|$', TEXT, re.MULTILINE)
    return [float(cell) for cell in cells.split('|')]


def assert_documented(row, measured):
    """Compare with the two digits that are printed; rounding decides the smallest ones."""
    assert documented(row) == pytest.approx(measured, rel=0.15, abs=2e-12)


@pytest.mark.parametrize('spacing', [0.005, 0.01, 0.02, 0.05, 0.1])
def test_the_residual_falls_with_the_sixth_power_of_the_spacing(motion, spacing):
    samples = motion.sample(spacing)
    measured = [residual(ARM, servo_course(samples, k)) for k in ('linear', 'cubic', 'quintic')]
    assert_documented(f'{spacing:g} s', measured)
    if spacing <= 0.02:
        finer = residual(ARM, servo_course(motion.sample(spacing / 2), 'quintic'))
        assert measured[2] / finer == pytest.approx(2**6, rel=0.2) or finer < 1e-12


def test_a_servo_that_is_late_or_slow_leaves_no_more(motion):
    samples = motion.sample(0.005)
    for lag in (0.01, 0.05):
        course = linear(samples.times, samples.positions[:, 0])
        # First-order lag, followed until it has settled.
        long = np.append(course.x, course.x[-1] + np.arange(1, 401) * 0.005)
        asked = np.append(course(course.x), np.full(400, GOAL))
        lagged = np.zeros_like(asked)
        pole = np.exp(-0.005 / lag)
        for i in range(1, asked.size):
            lagged[i] = pole * lagged[i - 1] + (1 - pole) * asked[i]
        assert residual(ARM, linear(long, lagged)) < 1e-8


def disturbed(motion, kind, size):
    """Return the residual of a course that is not what was commanded."""
    samples, rng = motion.sample(0.005), np.random.default_rng(SEED)
    times, angles = samples.times, samples.positions[:, 0]
    if kind == 'resolution':
        return residual(ARM, linear(times, np.round(angles / size) * size))
    if kind == 'jitter':
        runs = [
            linear(np.append(times + rng.uniform(0.0, size, times.size), 1.1), [*angles, GOAL])
            for _ in range(20)
        ]
        return max(residual(ARM, course) for course in runs)
    return residual(ARM.scaled(stiffness=1.0 + size), linear(times, angles))


@pytest.mark.parametrize(
    ('row', 'kind', 'size'),
    [
        ('positions in steps of 0.1 mrad', 'resolution', 1e-4),
        ('positions in steps of 1 mrad', 'resolution', 1e-3),
        ('points up to 0.1 ms late, each by itself', 'jitter', 1e-4),
        ('points up to 1 ms late, each by itself', 'jitter', 1e-3),
        ('spring 2 % stiffer than the model', 'spring', 0.02),
        ('spring 10 % stiffer than the model', 'spring', 0.1),
    ],
)
def test_what_disturbs_a_servo_is_documented(motion, row, kind, size):
    assert_documented(row, [disturbed(motion, kind, size)])


@pytest.mark.parametrize('bandwidth', [5, 10, 20, 50])
def test_a_servo_of_finite_stiffness_is_documented(motion, bandwidth):
    """Critically damped PD on joint 1 in the full simulation, without and with feed-forward."""
    samples = motion.sample(0.005)
    pole = 2 * np.pi * bandwidth
    gains = DriveSettings(
        feedback_p=(ARM.inertia_star.both * pole**2,),
        feedback_d=(2 * ARM.inertia_star.both * pole,),
    )
    measured = []
    for share in (0.0, 1.0):
        profile = EffortProfile(
            start=0.0,
            times=samples.times,
            efforts=share * samples.efforts[:, :-1],
            positions=samples.positions[:, :-1],
            velocities=samples.velocities[:, :-1],
        )
        simulated = SimulatedArm(ARM, step=5e-4, drives=gains)
        simulated.command(profile, 0.0)
        settled = DURATION + 3.0 / bandwidth
        simulated.advance(settled)
        swing = 0.0
        while simulated.time < settled + 0.7:
            simulated.advance(simulated.time + 2e-3)
            swing = max(swing, abs(simulated.position[1]))
        measured.append(swing)
    assert_documented(f'{bandwidth} Hz', measured)
