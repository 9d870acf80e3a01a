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

"""Insensitive motions: the elastic end shaped, the other joints on smooth laws."""

from typing import NamedTuple

from flat_planner_ros.core.insensitive import insensitive_motion, Insensitivity
from flat_planner_ros.core.motion_law import CONDITIONS
from flat_planner_ros.core.planning.problem import MotionProblem
from flat_planner_ros.core.planning.reference_trajectory import LawTrajectory
import numpy as np


class ShapedTrajectory(NamedTuple):
    """A trajectory and its certificate, residuals as those of a plan."""

    trajectory: LawTrajectory
    boundary_residual: float
    optimality_residual: float


def shaped_trajectory(
    problem: MotionProblem,
    wanted: Insensitivity,
    start: tuple[float, ...],
    final: tuple[float, ...],
) -> ShapedTrajectory:
    """
    Return the insensitive motion from rest to rest.

    Only joint n-1 can excite or quiet the oscillation, and only the planned variable of the
    elastic end tells its effort: the others move by the problem's law, of the same duration.

    Parameters
    ----------
    problem
        The arm, the duration, and the law of the other planned variables.
    wanted
        Uncertainty and trade.
    start, final
        Planned variables at both ends, n - 1 of them, the first of each different [rad].

    Raises
    ------
    OutOfReach
        No motion meets the prescribed bound.
    InvalidRequest
        An arm in the box does not oscillate.

    """
    distance = final[0] - start[0]
    shaped = insensitive_motion(problem.arm, problem.duration, wanted, distance)
    others = (
        problem.unit.law_over(problem.duration, end - begin, 0.5 * (begin + end))
        for begin, end in zip(start[1:], final[1:], strict=True)
    )
    rest = np.zeros((len(start), CONDITIONS))
    rest[:, 0] = start
    trajectory = LawTrajectory(
        problem=problem,
        laws=(shaped.law.transformed(distance, 0.5 * (start[0] + final[0])), *others),
        start=rest,
        final=np.array(final),
        edges=(0.0, problem.duration),
        own_cost=shaped.cost,
    )
    unit = problem.unit
    return ShapedTrajectory(
        trajectory,
        max(unit.boundary_residual, shaped.boundary_residual),
        max(unit.optimality_residual, shaped.stationarity),
    )
