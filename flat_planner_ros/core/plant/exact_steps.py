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
Two-joint arms in exact steps, many at once.

Without weight, Coulomb friction and limits of the effort, the true two-joint arm is linear, and
between two points of a command what drives it is a polynomial in time. What such a step does is
then one matrix, the exponential of the arm's dynamics with the polynomial's: there is no error of
integration, and all arms take a step together.
"""

from dataclasses import dataclass
from math import pi
from typing import NamedTuple

from flat_planner_ros.core.arm import (
    ArmStack,
    cubic_coefficients,
    Drive,
    FloatArray,
    InvalidModel,
    locked,
)
import numpy as np
from numpy.typing import NDArray

STATES = 4
"""Angles and rates of two joints."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CommandTable:
    """
    Commands of m arms side by side, each on an even grid of its own.

    Attributes
    ----------
    spacing
        From one point to the next, shape (m,) [s].
    intervals
        Number of them, shape (m,).
    efforts
        At the points, of the actuated joints, shape (m, p, n-1) with p above all intervals; what
        is beyond a command's last point does not matter [N m].
    positions, velocities
        The same of where the joints should be, for servos [rad], [rad/s]; else None.

    """

    spacing: FloatArray
    intervals: NDArray[np.int64]
    efforts: FloatArray
    positions: FloatArray | None = None
    velocities: FloatArray | None = None

    def __post_init__(self) -> None:
        """Lock the arrays."""
        for name in self.__dataclass_fields__:
            if getattr(self, name) is not None:
                locked(getattr(self, name))

    @property
    def order(self) -> NDArray[np.intp]:
        """Return the rows from the most intervals to the fewest."""
        return np.argsort(-self.intervals, kind='stable')

    def rows(self, places: NDArray[np.intp] | slice) -> 'CommandTable':
        """Return some of the commands."""
        return CommandTable(
            spacing=self.spacing[places],
            intervals=self.intervals[places],
            efforts=self.efforts[places],
            positions=None if self.positions is None else self.positions[places],
            velocities=None if self.velocities is None else self.velocities[places],
        )


class States(NamedTuple):
    """Angles [rad] and velocities [rad/s] of m arms, shape (m, n)."""

    positions: FloatArray
    velocities: FloatArray


class _Linear(NamedTuple):
    """Rows of x' = A x + b u of each arm: (m, 4, 4) and (m, 4)."""

    dynamics: FloatArray
    effect: FloatArray


def exact_ends(
    arms: ArmStack,
    commands: CommandTable,
    start: States,
    *,
    drive: Drive = Drive.EFFORT,
    bandwidth: float = 0.0,
) -> States:
    """
    Return the states of two-joint arms when their commands end.

    Parameters
    ----------
    arms
        What is moved; `is_linear`.
    commands
        One for each.
    start
        States at the commands' first points.
    drive
        Whether efforts move them, joined linearly, or servos follow positions.
    bandwidth
        Of those servos [Hz]; 0 for ideal ones.

    Raises
    ------
    InvalidModel
        The arms are not linear, or have other joints.

    """
    if arms.n != 2 or not arms.is_linear:
        raise InvalidModel(
            'exact steps are for two joints without weight, coupling and Coulomb friction; '
            f'got {arms.n} joints'
        )
    order = commands.order
    arms, commands = arms.rows(order), commands.rows(order)
    if drive is Drive.EFFORT:
        rows, drives = _driven_by_efforts(arms), _polynomials_of_efforts(commands)
    else:
        own = 2.0 * pi * bandwidth
        rows = _driven_by_servos(arms, own)
        drives = _polynomials_of_positions(commands, own)
    transitions, effects = _steps(rows, commands.spacing, len(drives))
    state = np.hstack(start)[order].T
    # Arms whose commands have ended are behind those whose have not.
    counts = np.searchsorted(-commands.intervals, -np.arange(drives[0].shape[1]), side='left')
    for step, count in enumerate(counts.tolist()):
        if count == 0:
            break
        moved = (transitions[:, :, :count] * state[None, :, :count]).sum(axis=1)
        for effect, drive_term in zip(effects, drives, strict=True):
            moved += effect[:, :count] * drive_term[:count, step]
        state[:, :count] = moved
    ends = np.empty_like(state)
    ends[:, order] = state
    return States(ends[:2].T, ends[2:].T)


def held_steps(arms: ArmStack, time: float) -> tuple[FloatArray, FloatArray]:
    """
    Return what a time with a constant effort does to linear two-joint arms.

    Parameters
    ----------
    arms
        What is moved; `is_linear`.
    time
        How long [s].

    Returns
    -------
    tuple
        What becomes of states, q_1, q_2 and their rates, shape (4, 4, m), and what one N m of
        joint 1 adds, (4, m).

    """
    transition, (effect,) = _steps(_driven_by_efforts(arms), np.full(len(arms), time), 1)
    return transition, effect


def _driven_by_efforts(arms: ArmStack) -> _Linear:
    """Return the rows for the effort of joint 1, from the arms' own equations of motion."""
    count = len(arms)
    nothing, effort = np.zeros((count, 2)), np.zeros((count, 1))
    dynamics = np.zeros((count, STATES, STATES))
    dynamics[:, :2, 2:] = np.eye(2)
    for joint, unit in enumerate(np.eye(2)):
        ones = np.tile(unit, (count, 1))
        dynamics[:, 2:, joint] = arms.forward_dynamics(ones, nothing, effort)
        dynamics[:, 2:, 2 + joint] = arms.forward_dynamics(nothing, ones, effort)
    effect = np.zeros((count, STATES))
    effect[:, 2:] = arms.forward_dynamics(nothing, nothing, effort + 1.0)
    return _Linear(dynamics, effect)


def _driven_by_servos(arms: ArmStack, own: float) -> _Linear:
    """Return the rows for what servos are told: an acceleration, or own^2 times a position."""
    count = len(arms)
    mass = arms.mass_matrix(np.zeros((count, 2)))[:, 1]
    dynamics = np.zeros((count, STATES, STATES))
    dynamics[:, :2, 2:] = np.eye(2)
    dynamics[:, 2, 0], dynamics[:, 2, 2] = -(own**2), -2.0 * own
    one, nothing = np.ones(count), np.zeros(count)
    dynamics[:, 3, 1] = arms.passive_effort(one, nothing) / mass[:, 1]
    dynamics[:, 3, 3] = arms.passive_effort(nothing, one) / mass[:, 1]
    # Joint 1 is accelerated whatever it takes, which pushes the passive joint the other way.
    push = -mass[:, 0] / mass[:, 1]
    dynamics[:, 3, [0, 2]] += push[:, None] * dynamics[:, 2, [0, 2]]
    effect = np.zeros((count, STATES))
    effect[:, 2], effect[:, 3] = 1.0, push
    return _Linear(dynamics, effect)


def _polynomials_of_efforts(commands: CommandTable) -> list[FloatArray]:
    """Return value and slope of the effort on each interval, each of shape (m, p-1)."""
    efforts = commands.efforts[:, :, 0]
    return [efforts[:, :-1], np.diff(efforts, axis=1) / commands.spacing[:, None]]


def _polynomials_of_positions(commands: CommandTable, own: float) -> list[FloatArray]:
    """Return what servos are told on each interval: its value and derivatives, (m, p-1) each."""
    if commands.positions is None or commands.velocities is None:
        raise InvalidModel('servos need commands with positions and velocities')
    position, velocity = commands.positions[:, :, 0], commands.velocities[:, :, 0]
    step = np.broadcast_to(commands.spacing[:, None], position[:, 1:].shape)
    chord = np.diff(position, axis=1) / step
    cubic, square = cubic_coefficients(step, chord, velocity[:, :-1], velocity[:, 1:])
    accelerations = [2.0 * square, 6.0 * cubic]
    if own == 0.0:
        return accelerations
    return [own**2 * term for term in (position[:, :-1], velocity[:, :-1], *accelerations)]


def _steps(
    rows: _Linear, spacing: FloatArray, terms: int
) -> tuple[FloatArray, tuple[FloatArray, ...]]:
    """
    Return what a step does to states, (4, 4, m), and what the polynomial's terms add, (4, m) each.

    The exponential of the dynamics, to which the polynomial's are appended: each of its
    derivatives is the rate of the one before (Van Loan, IEEE Trans. Autom. Control 23, 1978).
    """
    # Imported here: it takes longer than a motion.
    from scipy.linalg import expm

    size = STATES + terms
    whole = np.zeros((len(spacing), size, size))
    whole[:, :STATES, :STATES] = rows.dynamics
    whole[:, :STATES, STATES] = rows.effect
    whole[:, STATES:, STATES:] = np.eye(terms, k=1)
    jumps = np.moveaxis(expm(whole * spacing[:, None, None])[:, :STATES], 0, -1)
    transition = np.ascontiguousarray(jumps[:, :STATES])
    return transition, tuple(np.ascontiguousarray(jumps[:, k]) for k in range(STATES, size))
