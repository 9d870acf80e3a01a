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

"""
Motions carried out by their true arms, many at once where that can be.

Two-joint arms go in exact steps, longer ones are integrated side by side, and what neither can do
(feedback, longer arms on servos) the plant does arm by arm. The plant also repeats a share of what
was done side by side; nothing here knows the flat map.
"""

from collections.abc import Callable, Sequence
from math import ceil
from typing import NamedTuple

from flat_planner_ros.core.arm import ArmStack, Drive, FlatPlannerError, FloatArray
from flat_planner_ros.core.plant import (
    CommandTable,
    EffortProfile,
    exact_ends,
    integrated_ends,
    SimulatedArm,
    States,
)
from flat_planner_ros.core.study.case import Case
import numpy as np

AGREEMENT = 1e-5
"""How far the plant's own integration may be from what was done side by side, of the way [-]."""

TURN_PER_STEP = 0.05
"""Of the fastest oscillation in a step of the plant that checks [rad]."""

ROUNDING = 1e-6
"""Share of a step by which a time may miss the grid [-]."""


class PlantDisagrees(FlatPlannerError):
    """
    Two simulations of one motion differ.

    Attributes
    ----------
    difference, allowed
        Of angles, or of rates over the frequency [rad].

    """

    def __init__(self, difference: float, allowed: float, message: str) -> None:
        super().__init__(message)
        self.difference, self.allowed = difference, allowed


class Motions(NamedTuple):
    """
    Motions that are to be carried out.

    Attributes
    ----------
    template
        What they have in common: drives, steps.
    true
        The arms that carry them out.
    starts, finals
        Joint angles, shape (m, n) [rad].
    case
        Returns one of them as a case by itself.

    """

    template: Case
    true: ArmStack
    starts: FloatArray
    finals: FloatArray
    case: Callable[[int], Case]


def motions_of(cases: Sequence[Case]) -> Motions:
    """Return cases of one template as motions."""
    return Motions(
        template=cases[0],
        true=ArmStack.of([case.true for case in cases]),
        starts=np.array([case.start for case in cases]),
        finals=np.array([case.final for case in cases]),
        case=lambda place: cases[place],
    )


def ends_of(motions: Motions, commands: CommandTable, checked: Sequence[bool]) -> States:
    """
    Return the states of the true arms when their commands end.

    Parameters
    ----------
    motions
        Without trackers.
    commands
        One for each.
    checked
        Which of them the plant's own integration repeats.

    Raises
    ------
    PlantDisagrees
        It comes to another result.

    """
    arms, template = motions.true, motions.template
    begin = States(motions.starts, np.zeros_like(motions.starts))
    drives, limit = template.drives, template.drives.saturation
    if drives.feedback_p or drives.feedback_d:
        return _one_by_one(motions, commands)
    is_clipped = limit is not None and bool((np.abs(commands.efforts) > np.array(limit)).any())
    if arms.n == 2 and arms.is_linear and not (is_clipped and drives.drive is Drive.EFFORT):
        ends = exact_ends(
            arms, commands, begin, drive=drives.drive, bandwidth=drives.servo_bandwidth
        )
    elif drives.drive is Drive.EFFORT:
        saturation = None if limit is None else np.array(limit)
        ends = integrated_ends(arms, commands, begin, step=template.step, saturation=saturation)
    else:
        return _one_by_one(motions, commands)
    for row in np.flatnonzero(checked).tolist():
        _check(motions.case(row), commands, row, ends)
    return ends


def _one_by_one(motions: Motions, commands: CommandTable) -> States:
    """Return what the plant makes of each command."""
    step = motions.template.step
    rows = range(len(motions.starts))
    found = [_played(motions.case(row), commands, row, step) for row in rows]
    positions, velocities = (np.concatenate(tables) for tables in zip(*found, strict=True))
    return States(positions, velocities)


def _played(case: Case, commands: CommandTable, row: int, step: float) -> States:
    """Return the state at the end of a command that the plant integrates."""
    spacing, intervals = float(commands.spacing[row]), int(commands.intervals[row])
    points = slice(intervals + 1)
    profile = EffortProfile(
        start=0.0,
        times=spacing * np.arange(intervals + 1.0),
        efforts=commands.efforts[row, points],
        positions=None if commands.positions is None else commands.positions[row, points],
        velocities=None if commands.velocities is None else commands.velocities[row, points],
    )
    fine = spacing / ceil(spacing / step - ROUNDING)
    arm = SimulatedArm(case.true, position=case.start, step=fine, drives=case.drives)
    arm.command(profile, 0.0)
    arm.advance(profile.end + ROUNDING * fine)
    return States(arm.position[None], arm.velocity[None])


def _check(case: Case, commands: CommandTable, row: int, ends: States) -> None:
    """Compare an end with the plant's own."""
    again = _played(case, commands, row, min(case.step, TURN_PER_STEP / _fastest(case)))
    check_end(case, again, States(ends.positions[row : row + 1], ends.velocities[row : row + 1]))


def check_end(case: Case, again: States, end: States) -> None:
    """
    Compare an end of a motion with the plant's own.

    Raises
    ------
    PlantDisagrees
        They differ.

    """
    fastest = _fastest(case)
    angles = float(np.abs(again.positions - end.positions).max())
    rates = float(np.abs(again.velocities - end.velocities).max())
    way = float(np.abs(np.subtract(case.final, case.start)).max())
    difference, allowed = max(angles, rates / fastest), AGREEMENT * way
    if difference > allowed:
        raise PlantDisagrees(
            difference,
            allowed,
            f'the plant integrates a motion of {way:.4g} rad to an end that is {difference:.2g} '
            f'rad from what exact or common steps found, beyond {allowed:.2g} rad',
        )


def _fastest(case: Case) -> float:
    """Return the frequency of the fastest oscillation of the true arm [rad/s]."""
    held = case.true.stiffness / case.true.inertia[-1, -1]
    last, both = case.true.inertia[-1, -1], case.true.inertia[-2:, -2:].trace()
    return float(np.sqrt(held * max(1.0, both / (both - last))))


def residuals(motions: Motions, ends: States) -> FloatArray:
    """Return the amplitude with which each passive joint goes on, NaN if it cannot, (m,) [rad]."""
    held = motions.template.drive is Drive.POSITION
    return motions.true.swing(ends.positions, ends.velocities, held=held)


def misses(motions: Motions, ends: States) -> FloatArray:
    """
    Return how far from their goals arms are, but for what the passive joint swings, (m,) [rad].

    The last two links count by the mean of their angles that the spring does not move, weighted by
    inertia; on servos, and before them, each joint counts.
    """
    off = ends.positions - motions.finals
    if motions.template.drive is Drive.POSITION:
        return np.asarray(np.abs(off[:, :-1]).max(axis=1))
    own, last = motions.true.inertia[:, -2, -2], motions.true.inertia[:, -1, -1]
    swinging = off[:, :-1].sum(axis=1) + last / (own + last) * off[:, -1]
    return np.asarray(np.abs(np.column_stack([off[:, :-2], swinging])).max(axis=1))
