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

"""Random plans on random arms of a random box: what is predicted against what is simulated."""

from typing import NamedTuple

from flat_planner_ros.core.arm import ArmStack, Drive, FlatModel, PlanarArm
from flat_planner_ros.core.insensitive import Insensitivity, UncertaintyBox
from flat_planner_ros.core.insensitive.insensitivity import Criterion, Nominal
from flat_planner_ros.core.insensitive.oscillator import Oscillator
from flat_planner_ros.core.insensitive.residual import residual_amplitude
from flat_planner_ros.core.motion_law import Strategy
from flat_planner_ros.core.planning import (
    MotionRequest,
    Plan,
    plan,
    PlanningOptions,
    residual_of_plan,
)
from flat_planner_ros.core.plant import CommandTable, exact_ends, States
import numpy as np

PERIOD = 0.005
"""Spacing of a command's points, or less: a hundredth of the motion [s]."""

FINE = 8000
"""Parts of a motion over which the velocity that a servo gives is joined linearly."""

ACCURACY = (0.01, 1e-6)
"""How far a prediction may be from the truth: relative, or [rad]."""

FIRST_LINK = {'link_length': [0.2], 'link_com': [0.1], 'link_mass': [0.3], 'link_inertia': [1e-3]}
"""What carries the last two links of an arm of three joints; they do not feel its motion."""

STRATEGIES = (
    Strategy.POLYNOMIAL,
    Strategy.MIN_CONTROL_EFFORT,
    Strategy.MIN_POTENTIAL_ENERGY,
    Strategy.MIXED,
    Strategy.INSENSITIVE,
    Strategy.INSENSITIVE,
)
"""What is drawn from; half of the work is about the last."""


class Truth(NamedTuple):
    """Residuals of a case [rad]: on the true arm, predicted for it, and the worst of its box."""

    simulated: float
    predicted: float
    worst: float
    case: str

    @property
    def is_told(self) -> bool:
        """Whether the prediction is right, and the worst case no better than the truth."""
        relative, absolute = ACCURACY
        miss = abs(self.simulated - self.predicted)
        is_right = miss <= max(relative * self.simulated, absolute)
        return is_right and self.simulated <= self.worst * (1.0 + 1e-3) + absolute


def truth(seed: int) -> Truth:
    """Return the residuals of a random case."""
    rng = np.random.default_rng([seed, 16])
    arm, period = random_arm(rng, joints=int(rng.integers(2, 4)))
    drive = Drive(rng.choice([member.value for member in Drive]))
    box = random_box(rng)
    strategy = STRATEGIES[rng.integers(len(STRATEGIES))]
    is_shaped = strategy is Strategy.INSENSITIVE
    options = PlanningOptions(
        strategy=strategy,
        r=rng.uniform(50.0, 200.0),
        p=rng.uniform(5.0, 30.0),
        flat_model=FlatModel.EXACT if is_shaped else list(FlatModel)[rng.integers(2)],
        insensitivity=Insensitivity(
            box=box,
            nominal=list(Nominal)[rng.integers(2)],
            criterion=list(Criterion)[rng.integers(2)],
            weight=10.0 ** rng.uniform(0.5, 3.0),
        ),
        drive=drive,
    )
    duration = period * 10.0 ** rng.uniform(-0.1, 1.0)
    request = MotionRequest(start=np.zeros(arm.n), final=random_pose(rng, arm), duration=duration)
    planned = plan(request, arm, options)
    state = np.zeros(4)
    if rng.integers(2):
        # The same kind of motion to another pose, taken over on the way.
        planned, state = redirected(rng, planned, random_pose(rng, arm))
    factors = np.array([rng.uniform(low, high) for low, high in box.ranges])
    samples = planned.sample(min(PERIOD, duration / 100.0))
    begin = float(state[1] - state[0]), float(state[3] - state[2])
    oscillator = Oscillator.of(arm, drive)
    if drive is Drive.EFFORT:
        signal = played = samples.driving_effort
    else:
        signal = planned.sample(duration / 1000.0).driving_velocity
        played = planned.sample(duration / FINE).driving_velocity
    poles = oscillator.poles(factors[None])
    return Truth(
        simulated=simulated(arm, drive, played, duration, factors, state),
        predicted=float(residual_amplitude(oscillator, signal, duration, poles, begin)[0]),
        worst=residual_of_plan(planned, samples).worst,
        case=f'{seed}: {strategy.value}, {drive.value}, {duration / period:.3g} periods, {box}, '
        f'{arm.n} joints, from {state}',
    )


def random_pose(rng: np.random.Generator, arm: PlanarArm) -> np.ndarray:
    """Return a pose at rest some way from zero."""
    return np.array([*rng.uniform(-1.0, 1.0, arm.n - 2), rng.uniform(0.3, 3.0), 0.0])


def redirected(
    rng: np.random.Generator, running: Plan, final: np.ndarray
) -> tuple[Plan, np.ndarray]:
    """Return a plan that takes over, and the angles and rates of the last two links there."""
    time = running.duration * rng.uniform(0.1, 0.9)
    here = running.at(np.array([time]))
    request = MotionRequest(
        start=here.positions[0],
        final=final,
        duration=running.duration,
        start_jets=here.planned[:, :6, 0],
    )
    links = np.cumsum([here.positions[0], here.velocities[0]], axis=1)[:, -2:]
    return plan(request, running.problem.arm, running.options), links.ravel()


def random_arm(rng: np.random.Generator, *, joints: int = 2) -> tuple[PlanarArm, float]:
    """Return an arm, and the period of its passive joint under an effort [s]."""
    both = 10.0 ** rng.uniform(-4.0, 0.0)
    last = both * rng.uniform(0.02, 0.7)
    frequency = 2.0 * np.pi * 10.0 ** rng.uniform(np.log10(0.3), np.log10(20.0))
    ratio = rng.choice([0.0, rng.uniform(0.0, 0.2)])
    series = last * (both - last) / both
    arm = PlanarArm.reduced(
        inertia_star=(both, last),
        stiffness=series * frequency**2,
        damping=2.0 * ratio * series * frequency,
        **(FIRST_LINK if joints > 2 else {}),
    )
    return arm, 2.0 * np.pi / frequency


def random_box(rng: np.random.Generator) -> UncertaintyBox:
    """Return what may differ; one time in two the last link's inertia is known."""
    stiffness, damping = rng.uniform(0.0, 0.3), rng.uniform(0.0, 0.5)
    if rng.integers(2):
        return UncertaintyBox(stiffness=stiffness, damping=damping)
    payload = (rng.uniform(-0.3, 0.0), rng.uniform(0.0, 1.0))
    return UncertaintyBox(
        stiffness=stiffness, damping=damping, inertia=rng.uniform(0.0, 0.2), payload=payload
    )


def simulated(
    arm: PlanarArm,
    drive: Drive,
    signal: np.ndarray,
    duration: float,
    factors: np.ndarray,
    state: np.ndarray,
) -> float:
    """
    Return the amplitude that the passive joint keeps on the true arm, by its exact steps.

    The state is the absolute angles of the last two links and their rates, which the links before
    them do not feel; the signal is linear between its samples, so that angles of a servo are
    parabolas there.
    """
    both, last = arm.inertia_star
    true = PlanarArm.reduced(
        inertia_star=(both + last * (factors[2] - 1.0), last * factors[2]),
        stiffness=factors[0] * arm.stiffness,
        damping=factors[1] * arm.damping,
    )
    step = duration / (len(signal) - 1)
    means = 0.5 * step * (signal[1:] + signal[:-1])
    angles = state[0] + np.concatenate([[0.0], np.cumsum(means)])
    table = [values[None, :, None] for values in (signal, angles, signal)]
    commands = CommandTable(
        spacing=np.array([step]),
        intervals=np.array([len(signal) - 1]),
        **dict(zip(('efforts', 'positions', 'velocities'), table, strict=True)),
    )
    joints = np.array([state[0], state[1] - state[0]]), np.array([state[2], state[3] - state[2]])
    stack, begin = ArmStack.of([true]), States(*(values[None] for values in joints))
    ends = exact_ends(stack, commands, begin, drive=drive)
    return float(stack.swing(*ends, held=drive is Drive.POSITION)[0])


def untold(seed: int, stop: int) -> list[Truth]:
    """Return the cases of some seeds whose prediction is not the truth."""
    return [found for found in map(truth, range(seed, stop)) if not found.is_told]
