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

"""Motions of least peak on random arms, played as samples that are joined linearly."""

from dataclasses import replace
from typing import NamedTuple

from flat_planner_ros.core.arm import ArmStack, Drive, PlanarArm
from flat_planner_ros.core.peak import PeakSettings
from flat_planner_ros.core.planning import (
    MotionRequest,
    plan,
    PlanningOptions,
    PlanSamples,
    Strategy,
)
from flat_planner_ros.core.plant import CommandTable, exact_ends, States
import numpy as np


class Left(NamedTuple):
    """What a motion leaves [rad]: an oscillation, and a distance from the goal."""

    swing: float
    miss: float
    case: str


def random_arm(rng: np.random.Generator, n: int) -> PlanarArm:
    """Return an arm of the admitted range with n joints."""
    both = 10.0 ** rng.uniform(-5.0, 0.0)
    last = both * 10.0 ** rng.uniform(-2.0, np.log10(0.9))
    frequency = 2.0 * np.pi * 10.0 ** rng.uniform(-1.0, np.log10(50.0))
    series = last * (both - last) / both
    lengths = rng.uniform(0.1, 0.5, n - 2)
    return PlanarArm.reduced(
        inertia_star=(both, last),
        stiffness=frequency**2 * series,
        damping=2.0 * rng.uniform(0.0, 0.3) * frequency * series,
        link_length=lengths,
        link_com=0.5 * lengths,
        link_mass=rng.uniform(0.1, 2.0, n - 2),
        link_inertia=rng.uniform(1e-3, 1e-2, n - 2),
    )


def played(arm: PlanarArm, samples: PlanSamples, drive: Drive) -> tuple[ArmStack, States]:
    """
    Return the last two links as an arm of their own, and how they end.

    They do not feel the joints before them; a servo gives link n-1 its acceleration.
    """
    last_links = PlanarArm.reduced(
        inertia_star=arm.inertia_star, stiffness=arm.stiffness, damping=arm.damping
    )
    step, start = float(samples.times[1]), samples.positions[0].cumsum()[-2:]
    given = np.asarray(samples.driving_effort)
    rate = angle = np.zeros_like(given)
    if drive is Drive.POSITION:
        given = samples.accelerations[:, :-1].sum(axis=1)
        before, after = given[:-1], given[1:]
        rate = np.append(0.0, np.cumsum(0.5 * step * (before + after)))
        way = step * rate[:-1] + step**2 * (2.0 * before + after) / 6.0
        angle = start[0] + np.append(0.0, np.cumsum(way))
    commands = CommandTable(
        spacing=np.array([step]),
        intervals=np.array([len(given) - 1]),
        efforts=given[None, :, None],
        positions=angle[None, :, None],
        velocities=rate[None, :, None],
    )
    stack = ArmStack.of([last_links])
    begin = States(np.array([[start[0], start[1] - start[0]]]), np.zeros((1, 2)))
    return stack, exact_ends(stack, commands, begin, drive=drive)


def left(seed: int, case: int) -> Left:
    """Return what a random motion leaves."""
    rng = np.random.default_rng([seed, case])
    n, drive = int(rng.integers(2, 8)), list(Drive)[case % 2]
    arm = random_arm(rng, n)
    duration = float(np.exp(rng.uniform(np.log(0.1), np.log(5.0))))
    mode = arm.natural_mode(held=drive is Drive.POSITION)
    settings = PeakSettings(intervals=int(rng.choice([16, 48, 96])))
    # In a small part of a turn arms hardly differ, nor do the conditions on them.
    if mode.frequency * duration > 0.5:
        settings = replace(
            settings,
            insensitive=bool(rng.integers(2)),
            max_residual=0.2 if case % 5 == 4 else 0.0,
        )
    start, final = np.zeros((2, n))
    start[:-1], final[:-1] = rng.uniform(-1.5, 1.5, (2, n - 1))
    options = PlanningOptions(strategy=Strategy.MIN_PEAK_EFFORT, peak=settings, drive=drive)
    made = plan(MotionRequest(start=start, final=final, duration=duration), arm, options)
    stack, ends = played(arm, made.sample(float(rng.uniform(5e-4, 1e-2))), drive)
    return Left(
        swing=float(stack.swing(*ends, held=drive is Drive.POSITION)[0]),
        miss=float(np.abs(ends.positions[0].cumsum() - final.sum()).max()),
        case=f'{case}: {n} joints, {drive.value}, {duration:.3g} s',
    )


def left_of(seed: int, first: int, stop: int) -> list[Left]:
    """Return what the motions from one to before another leave."""
    return [left(seed, case) for case in range(first, stop)]
