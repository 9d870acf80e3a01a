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
Runge-Kutta steps of fourth order, one at a time, or many of an arm that is linear.

An arm whose links do not push each other, without weight and dry friction, accelerates in
proportion to its state and its efforts. So does each step of its integration, which then is one
matrix: the step itself, taken by unit vectors.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple, TypeVar

from flat_planner_ros.core.arm import FloatArray, locked, PlanarArm
import numpy as np

Input = TypeVar('Input')

STAGES = 3
"""Times of a step at which its input counts: start, middle and end."""

STEPS_KEPT = 8
"""Arms and step lengths whose matrices are remembered."""


def runge_kutta(
    acceleration: Callable[[Input, FloatArray, FloatArray], FloatArray],
    step: float,
    q: FloatArray,
    dq: FloatArray,
    inputs: tuple[Input, Input, Input],
) -> tuple[FloatArray, FloatArray]:
    """
    Return angles and velocities after a step.

    Parameters
    ----------
    acceleration
        Accelerations, from an input, angles and velocities.
    step
        Length of the step [s].
    q, dq
        Angles [rad] and velocities [rad/s], shape (..., n).
    inputs
        What acts at the start, in the middle and at the end.

    """
    h, (start, middle, end) = step, inputs
    ddq_1 = acceleration(start, q, dq)
    dq_2 = dq + h / 2 * ddq_1
    ddq_2 = acceleration(middle, q + h / 2 * dq, dq_2)
    dq_3 = dq + h / 2 * ddq_2
    ddq_3 = acceleration(middle, q + h / 2 * dq_2, dq_3)
    ddq_4 = acceleration(end, q + h * dq_3, dq + h * ddq_3)
    inner = ddq_2 + ddq_3
    velocity: FloatArray = dq + h / 6 * (ddq_1 + 2 * inner + ddq_4)
    position: FloatArray = q + h * (dq + h / 6 * (ddq_1 + inner))
    return position, velocity


class LinearSteps(NamedTuple):
    """
    Steps of an arm as products.

    Attributes
    ----------
    from_state
        Angles and velocities after a step from those before it, shape (2 n, 2 n).
    from_effort
        The same from the efforts at its start, middle and end, shape (STAGES, n-1, 2 n).

    """

    from_state: FloatArray
    from_effort: FloatArray

    def states(self, first: FloatArray, efforts: FloatArray) -> FloatArray:
        """
        Return angles and velocities before the first of some steps and after each.

        Parameters
        ----------
        first
            Those before, shape (2 n,) [rad], [rad/s].
        efforts
            Of the motors at every half step, both ends included, shape (2 m + 1, n-1) [N m].

        Returns
        -------
        FloatArray
            Shape (m + 1, 2 n).

        """
        table = np.zeros((1 + len(efforts) // 2, len(first)))
        table[0], driven = first, table[1:]
        for stage, of_motors in enumerate(self.from_effort):
            present = efforts[stage : len(efforts) - STAGES + 1 + stage : 2]
            # Motor by motor, so that a step does not depend on how many others there are.
            for motor, answer in enumerate(of_motors):
                driven += np.multiply.outer(present[:, motor], answer)
        state, carry, carried = first, self.from_state.dot, np.empty(len(first))
        for row in driven:
            carry(state, carried)
            row += carried
            state = row
        return table


@lru_cache(maxsize=STEPS_KEPT)
def linear_steps(arm: PlanarArm, step: float) -> LinearSteps | None:
    """Return the steps of an arm as products; None for one that is not linear."""
    if not arm.is_linear:
        return None
    n = arm.n
    widths = [n, n, *STAGES * [n - 1]]
    unit = np.split(np.eye(sum(widths)), np.cumsum(widths)[:-1], axis=1)
    q, dq, *efforts = unit

    def acceleration(effort: FloatArray, q: FloatArray, dq: FloatArray) -> FloatArray:
        return arm.forward_dynamics(q, dq, effort)

    start, middle, end = efforts
    after = np.hstack(runge_kutta(acceleration, step, q, dq, (start, middle, end)))
    from_effort = after[2 * n :].reshape(STAGES, n - 1, 2 * n)
    return LinearSteps(locked(after[: 2 * n].T.copy()), locked(from_effort))
