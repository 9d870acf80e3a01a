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

"""Insensitive motions that begin in the midst of another, or on a swinging arm."""

from dataclasses import replace

from core.conftest import ARM, ELBOW
from flat_planner_ros.core.arm import Drive, OutOfReach
from flat_planner_ros.core.insensitive import Insensitivity, UncertaintyBox
from flat_planner_ros.core.insensitive.insensitivity import Criterion, Nominal
from flat_planner_ros.core.insensitive.oscillator import Oscillator
from flat_planner_ros.core.insensitive.residual import residual_amplitude
from flat_planner_ros.core.motion_law import Strategy
from flat_planner_ros.core.planning import MotionRequest, plan, PlanningOptions, residual_of_plan
import numpy as np
import pytest

LAST = 2.0 * np.pi / ARM.natural_mode().frequency
"""Period of the passive joint [s]."""


def options_of(drive=Drive.EFFORT, **wanted):
    """Return the options of the strategy."""
    return PlanningOptions(
        strategy=Strategy.INSENSITIVE, insensitivity=Insensitivity(**wanted), drive=drive
    )


def redirected(time, duration, options, arm=ARM):
    """Return a plan that takes over from one to pi, and the jets there."""
    final = np.zeros(arm.n)
    final[-2] = np.pi
    first = plan(MotionRequest(start=np.zeros(arm.n), final=final, duration=1.0), arm, options)
    here = first.at(np.array([time]))
    final[-2] = 1.0
    request = MotionRequest(
        start=here.positions[0], final=final, duration=duration, start_jets=here.planned[:, :6, 0]
    )
    return plan(request, arm, options), here


@pytest.mark.parametrize('arm', [ARM, ELBOW], ids=['2', '3'])
@pytest.mark.parametrize('drive', Drive)
@pytest.mark.parametrize('duration', [0.3, 1.0, 4.0, 30.0])
def test_takes_over_without_a_step_and_comes_to_rest(arm, drive, duration):
    planned, here = redirected(0.4, duration, options_of(drive), arm)
    ends = np.array([1e-12, 1.0 - 1e-12]) * duration
    jets = planned.trajectory.jets(ends)[:, :6]
    peaks = np.abs(planned.sample(duration / 200.0).planned[:, :6]).max(axis=2)
    peaks = np.where(peaks > 0.0, peaks, 1.0)
    assert (np.abs(jets[..., 0] - here.planned[:, :6, 0]) < 1e-7 * peaks).all()
    final = np.zeros_like(peaks)
    final[0, 0] = 1.0
    assert (np.abs(jets[..., 1] - final) < 1e-7 * peaks).all()
    assert planned.at(np.zeros(1)).driving_effort == pytest.approx(here.driving_effort, rel=1e-9)
    assert planned.options.strategy is Strategy.INSENSITIVE
    assert planned.boundary_residual < 1e-10


@pytest.mark.parametrize('drive', Drive)
@pytest.mark.parametrize('nominal', Nominal)
def test_derivatives_of_zero_are_a_start_at_rest(drive, nominal):
    request = MotionRequest(start=[0.2, 0.0], final=[1.5, 0.0], duration=1.1)
    jets = np.zeros((1, 6))
    jets[0, 0] = 0.2
    times = np.linspace(0.0, 1.1, 50)
    wanted = options_of(drive, nominal=nominal)
    rests = plan(request, ARM, wanted).at(times).planned
    moves = plan(replace(request, start_jets=jets), ARM, wanted).at(times).planned
    sizes = np.abs(rests).max(axis=2, keepdims=True)
    assert (np.abs(rests - moves) < 1e-6 * sizes).all()


def test_twice_the_start_and_twice_the_way_take_twice_the_effort():
    jets = np.array([[0.3, 2.0, 0.0, 0.0, 0.0, 0.0]])
    options, times = options_of(), np.linspace(0.0, 1.0, 50)
    request = MotionRequest(start=[0.3, 0.0], final=[1.0, 0.0], duration=1.0, start_jets=jets)
    doubled = replace(request, start_jets=2.0 * jets, final=[2.0, 0.0])
    efforts = [plan(each, ARM, options).at(times).driving_effort for each in (request, doubled)]
    assert efforts[1] == pytest.approx(2.0 * efforts[0], abs=1e-9 * np.abs(efforts[1]).max())


@pytest.mark.parametrize('drive', Drive)
@pytest.mark.parametrize('periods', [0.8, 2.0, 6.0])
def test_a_swinging_arm_is_brought_to_rest(drive, periods):
    # At the goal already, and only the passive joint moves.
    swing = -ARM.inertia_star.last / ARM.stiffness
    mode = ARM.natural_mode(held=drive is Drive.POSITION)
    pole = -mode.decay_rate + 1j * mode.damped_frequency
    # Its free oscillation: sigma stays at zero.
    jets = (0.1 / swing * pole ** np.arange(-2.0, 4.0)).real[None]
    request = MotionRequest(
        start=np.zeros(2), final=np.zeros(2), duration=periods * LAST, start_jets=jets
    )
    planned = plan(request, ARM, options_of(drive))
    left = residual_of_plan(planned, planned.sample(request.duration / 2000.0))
    assert planned.at(np.zeros(1)).positions[0, -1] == pytest.approx(0.1)
    assert left.nominal < 2e-5
    coasting = np.exp(-mode.decay_rate * request.duration) * 0.1
    assert left.worst < (0.9 if periods < 1.0 else 0.3) * coasting


@pytest.mark.parametrize('drive', Drive)
def test_less_than_the_polynomial_law_leaves_and_bounds_are_kept(drive):
    planned, _ = redirected(0.4, 1.2, options_of(drive))
    polynomial = replace(planned.options, strategy=Strategy.POLYNOMIAL)
    other = plan(planned.request, ARM, polynomial)
    left, left_by_other = residual_of_plan(planned), residual_of_plan(other)
    assert left.worst < 0.5 * left_by_other.worst
    bounded, _ = redirected(0.4, 1.2, options_of(drive, max_residual=0.02))
    assert residual_of_plan(bounded).worst <= 0.02
    assert bounded.rms_effort[0] <= planned.rms_effort[0]
    bounded, _ = redirected(0.4, 1.2, options_of(max_effort_rms=0.01))
    assert bounded.rms_effort[0] <= 0.01
    with pytest.raises(OutOfReach, match='longer duration'):
        redirected(0.4, 0.4, options_of(drive, max_residual=1e-4))


@pytest.mark.parametrize('nominal', Nominal)
def test_no_other_law_of_the_same_start_costs_less(nominal):
    duration, weight = 1.0, 100.0
    box = UncertaintyBox(stiffness=0.1, damping=0.0)
    options = options_of(nominal=nominal, criterion=Criterion.MEAN, weight=weight, box=box)
    planned, here = redirected(0.4, duration, options)
    effort = planned.sample(duration / 2000.0).driving_effort
    times = np.linspace(0.0, duration, len(effort))
    begin = float(here.positions[0, -1]), float(here.velocities[0, -1])
    oscillator = Oscillator.of(ARM)
    nodes, weights = np.polynomial.legendre.leggauss(12)
    poles = oscillator.poles(np.column_stack([1.0 + 0.1 * nodes, np.ones(12)]))
    unit = np.sqrt(12.0) * ARM.inertia_star.both / duration**2

    def cost(values):
        amplitudes = residual_amplitude(oscillator, values, duration, poles, begin)
        return np.mean(values**2) / unit**2 + weight**2 * 0.5 * (weights @ amplitudes**2)

    assert cost(effort) == pytest.approx(planned.cost_value, rel=2e-3)
    # Smooth changes, zero at both ends, that keep the momentum angle's ends and the nominal swing.
    bumps = np.array([np.sin(np.pi * times) ** 2 * np.cos(j * np.pi * times) for j in range(12)])
    keep = [np.ones_like(times), times]
    if nominal is Nominal.EXACT:
        (pole,) = oscillator.poles(np.ones((1, 2)))
        wave = np.exp(pole * (duration - times))
        keep += [wave.real, wave.imag]
    null = np.linalg.svd(np.array(keep) @ bumps.T)[2][len(keep) :]
    rng = np.random.default_rng(3)
    for _ in range(50):
        change = rng.normal(size=len(null)) @ null @ bumps
        change *= 0.05 * np.abs(effort).max() / np.abs(change).max()
        # The slope of the cost along it, and the cost beyond.
        up, down = cost(effort + change), cost(effort - change)
        assert min(up, down) > cost(effort) * (1.0 - 2e-3)
        assert abs(up - down) < 0.5 * (up + down - 2.0 * cost(effort)) + 0.02 * cost(effort)
