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

"""Arms of any number of joints under efforts, many at once, by Runge-Kutta steps."""

from math import ceil

from flat_planner_ros.core.arm import ArmStack, FloatArray
from flat_planner_ros.core.plant.exact_steps import CommandTable, States
from flat_planner_ros.core.plant.simulation import GRID_TOLERANCE
import numpy as np


def integrated_ends(
    arms: ArmStack,
    commands: CommandTable,
    start: States,
    *,
    step: float = 1e-3,
    saturation: FloatArray | None = None,
) -> States:
    """
    Return the states of arms when their commands end, as `SimulatedArm` would integrate each.

    Parameters
    ----------
    arms
        What is moved.
    commands
        Efforts, joined linearly.
    start
        States at the commands' first points.
    step
        Longest step [s]; the one taken divides the time between points.
    saturation
        Largest effort of each motor, shape (n-1,) [N m]; None if unlimited.

    """
    order = commands.order
    commands = commands.rows(order)
    positions, velocities = start.positions[order].copy(), start.velocities[order].copy()
    parts = ceil(float(commands.spacing.max()) / step - GRID_TOLERANCE)
    intervals = commands.intervals
    counts = np.searchsorted(-intervals, -np.arange(int(intervals[0])), side='left')
    for count in sorted(set(counts.tolist()), reverse=True):
        # Between two ends of commands the same arms move.
        moving = _Moving(arms.rows(order[:count]), commands.rows(slice(count)), saturation)
        for index in np.flatnonzero(counts == count).tolist():
            q, dq = positions[:count], velocities[:count]
            positions[:count], velocities[:count] = moving.over(index, parts, q, dq)
    ends = States(np.empty_like(positions), np.empty_like(velocities))
    ends.positions[order], ends.velocities[order] = positions, velocities
    return ends


class _Moving:
    """Some arms and what moves them."""

    def __init__(
        self, arms: ArmStack, commands: CommandTable, saturation: FloatArray | None
    ) -> None:
        self._arms, self._commands, self._most = arms, commands, saturation

    def over(
        self, interval: int, parts: int, q: FloatArray, dq: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return angles and rates after an interval, taken in so many steps."""
        first, last = (self._commands.efforts[:, interval + k] for k in (0, 1))
        h = (self._commands.spacing / parts)[:, None]
        for part in range(parts):
            start, middle, end = (
                first + (last - first) * ((part + share) / parts) for share in (0.0, 0.5, 1.0)
            )
            ddq_1 = self._acceleration(start, q, dq)
            dq_2 = dq + h / 2 * ddq_1
            ddq_2 = self._acceleration(middle, q + h / 2 * dq, dq_2)
            dq_3 = dq + h / 2 * ddq_2
            ddq_3 = self._acceleration(middle, q + h / 2 * dq_2, dq_3)
            ddq_4 = self._acceleration(end, q + h * dq_3, dq + h * ddq_3)
            inner = ddq_2 + ddq_3
            q = q + h * (dq + h / 6 * (ddq_1 + inner))
            dq = dq + h / 6 * (ddq_1 + 2 * inner + ddq_4)
        return q, dq

    def _acceleration(self, effort: FloatArray, q: FloatArray, dq: FloatArray) -> FloatArray:
        """Return joint accelerations, shape (m, n) [rad/s^2]."""
        if self._most is not None:
            effort = np.clip(effort, -self._most, self._most)
        return self._arms.forward_dynamics(q, dq, effort)
