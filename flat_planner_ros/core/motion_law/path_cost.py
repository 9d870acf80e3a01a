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
Cost of the optimal path as a function of the times of its via points.

Nothing is certified here: slopes and curvatures guide the search for the cheapest times, whose
path is solved and certified like any other.
"""

from functools import cached_property, partial

from flat_planner_ros.core.arm import FloatArray, strict_arithmetic
from flat_planner_ros.core.motion_law.basis import CONDITIONS
from flat_planner_ros.core.motion_law.cost import QuadraticCost
from flat_planner_ros.core.motion_law.optimal_path import (
    PathConditions,
    share_of_start,
    solved_path,
)
import numpy as np


class PathCost:
    """
    Cost of the laws of least cost through a path, with its derivatives by the via times.

    Parameters
    ----------
    cost
        What is minimised.
    path
        What the laws go through.

    Raises
    ------
    UncertifiedPlan, ArithmeticError
        As by `optimal_path`.

    """

    def __init__(self, cost: QuadraticCost, path: PathConditions) -> None:
        """Solve for the laws, and take their derivatives at the knots."""
        self._coefficients = cost.characteristic()
        self._relaxations = path.relaxations
        with strict_arithmetic():
            self._solution = solved_path(cost, path)
            self._at_start, self._at_middle, self._at_end = self._solution.places
            amplitudes = self._solution.amplitudes.values
            self._before = self._at_end[:-1] @ amplitudes[:-1]  # (p - 1, 12, m)
            # Constant along each segment: taken in its middle.
            costates = self._costate_rows @ amplitudes
            start = self._at_start[0] @ amplitudes[0]
            moving = sum(map(partial(share_of_start, cost), path.start, start.T))
            self.value = float(np.sum(costates[:, 0] * self._solution.steps.T) - moving)
            """Integral of Y^T Q Y over the motion, summed over the variables."""
            self._costate_jumps = np.diff(costates[:, 0], axis=0)  # (p - 1, m)

    @property
    def slopes(self) -> FloatArray:
        """
        Return the derivatives of the cost by the times of the via points, shape (p - 1,) [1/s].

        (V8) of docs/derivation.md.
        """
        slopes: FloatArray = 2.0 * np.sum(self._costate_jumps * self._speeds(1), axis=1)
        return slopes

    @strict_arithmetic()
    def curvatures(self) -> FloatArray:
        """
        Return the second derivatives by the times, shape (p - 1, p - 1) [1/s^2].

        (V10) of docs/derivation.md.
        """
        after = self._at_start[1:] @ self._solution.amplitudes.values[1:]
        tenth, eleventh = (after - self._before)[:, -2:].swapaxes(0, 1)
        # The twelfth derivative is that of the equation; lower ones do not jump.
        twelfth = -self._coefficients[CONDITIONS - 1] * tenth
        jumps = np.array([tenth, eleventh + self._relaxations * twelfth])
        curvatures = np.diag(np.sum(self._costate_jumps * self._speeds(2), axis=1))
        for system, alike in self._solution.systems:
            for variable in np.flatnonzero(alike):
                shifts = system.shifts(self._speeds(1)[:, variable], jumps[:, :, variable])
                pushes = np.diff((self._costate_rows @ shifts)[:, 0], axis=0)
                curvatures += pushes * self._speeds(1)[:, variable, None]
                rows = self._at_end[:-1, 1] + self._relaxations[variable] * self._at_end[:-1, 2]
                turns = (rows[:, None] @ shifts[:-1])[:, 0]
                curvatures += self._costate_jumps[:, variable, None] * turns
        return curvatures + curvatures.T

    @cached_property
    def _costate_rows(self) -> FloatArray:
        """Half the costate on every segment of every solution, shape (p, 1, 12)."""
        rows: FloatArray = -self._coefficients[1:] @ self._at_middle[:, None, 1::2]
        return rows

    def _speeds(self, order: int) -> FloatArray:
        """Return a derivative of w + relaxation w' before each knot, shape (p - 1, m)."""
        speeds: FloatArray = (
            self._before[:, order] + self._relaxations * self._before[:, order + 1]
        )
        return speeds
