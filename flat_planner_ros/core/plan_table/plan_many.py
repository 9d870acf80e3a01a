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

"""Many plans in one call: motions from rest to rest, each certified by itself."""

from collections.abc import Sequence

from flat_planner_ros.core.arm import (
    FlatPlannerError,
    FloatArray,
    InvalidRequest,
    locked,
    PlanarArm,
)
from flat_planner_ros.core.plan_table.arm_table import ArmTable, IntArray
from flat_planner_ros.core.plan_table.problem_table import ProblemTable
from flat_planner_ros.core.plan_table.single_plans import request_of
from flat_planner_ros.core.plan_table.table import PlanTable
from flat_planner_ros.core.planning import NO_DISTANCE, OWN_LAWS, Plan, plan, PlanningOptions
import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray


def plan_many(
    arms: PlanarArm | Sequence[PlanarArm],
    distances: npt.ArrayLike,
    durations: npt.ArrayLike,
    options: PlanningOptions,
    *,
    starts: npt.ArrayLike = 0.0,
) -> PlanTable:
    """
    Return the optimal motions from rest to rest over many distances, in many durations.

    Each row is what `plan` returns for it, within the certificate. Strategies that are a quadratic
    cost are planned in arrays; those with a law of their own, and rows whose roots no array form
    holds, one by one.

    Parameters
    ----------
    arms
        One nominal model for all rows, or one for each, all with n joints; an object that comes
        again is prepared once.
    distances
        Way of the planned variables, the last link's absolute angle and q_1 ... q_(n-2), shape
        (N, n - 1); or of the first, shape (N,) or (), the others resting [rad].
    durations
        Shape (N,) or () [s].
    options
        Strategy, weights, flat model and drive of all of them.
    starts
        Planned variables at the start, where gravity makes a difference, as `distances` [rad].

    Raises
    ------
    InvalidRequest
        The numbers of arms, distances and durations differ. What is wrong with a single row does
        not raise, but is among the table's `refusals`.

    """
    way, begin, duration = _rows(arms, distances, starts, durations)
    table = ArmTable.of(arms, len(duration), options)
    if options.strategy in OWN_LAWS:
        solvable = np.zeros(len(duration), dtype=bool)
    else:
        solvable = _is_plain(table, way, begin, duration)
    problems, problem = _problems(table, way, duration, np.flatnonzero(solvable))
    boundary, optimality, cost = (
        np.append(values, np.nan)[problem]
        for values in (
            problems.boundary_residual,
            problems.optimality_residual,
            problems.cost_value,
        )
    )
    cost *= (way**2).sum(axis=1)
    boundary[~way.any(axis=1)], optimality[~way.any(axis=1)] = 0.0, 0.0
    left = np.flatnonzero(problem < 0)
    singles, refusals = _one_by_one(table, way, begin, duration, options, left)
    gone = list(refusals)
    boundary[gone], optimality[gone] = np.nan, np.nan
    for row, planned in singles.items():
        boundary[row], optimality[row] = planned.boundary_residual, planned.optimality_residual
        cost[row] = planned.cost_value
    return PlanTable(
        options=options,
        arms=table,
        starts=begin,
        distances=way,
        durations=duration,
        boundary_residual=boundary,
        optimality_residual=optimality,
        cost_value=cost,
        refusals=refusals,
        problems=problems,
        problem=problem,
        singles=singles,
    )


def _rows(
    arms: PlanarArm | Sequence[PlanarArm],
    distances: npt.ArrayLike,
    starts: npt.ArrayLike,
    durations: npt.ArrayLike,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return ways and starts, (N, n - 1), and durations, (N,); refuse numbers that differ."""
    count = 1 if isinstance(arms, PlanarArm) else len(arms)
    if count == 0:
        raise InvalidRequest('no arm is given: plan_many needs one, or one for each row')
    width = (arms if isinstance(arms, PlanarArm) else arms[0]).n - 1
    way, begin = _planned('distances', distances, width), _planned('starts', starts, width)
    duration = np.atleast_1d(np.array(durations, dtype=float))
    sizes = {len(way), len(begin), len(duration), count} - {1}
    if len(sizes) > 1 or duration.ndim > 1:
        raise InvalidRequest(
            f'{count} arms, {len(way)} distances, {len(begin)} starts and durations of shape '
            f'{duration.shape}: give one of each, or equally many'
        )
    rows = sizes.pop() if sizes else 1
    way, begin = (np.broadcast_to(table, (rows, width)).copy() for table in (way, begin))
    way[np.abs(way) < NO_DISTANCE] = 0.0
    return locked(way), locked(begin), locked(np.broadcast_to(duration, rows).copy())


def _planned(name: str, values: npt.ArrayLike, width: int) -> FloatArray:
    """Return values of the planned variables, shape (N, n - 1); others than the first rest."""
    table = np.array(values, dtype=float)
    if table.ndim < 2:
        table = np.pad(np.atleast_1d(table)[:, None], ((0, 0), (0, width - 1)))
    if table.ndim > 2 or table.shape[1] != width:
        raise InvalidRequest(
            f'{name} have shape {table.shape}: an arm of {width + 1} joints has {width} planned '
            f'variables in a row'
        )
    return table


def _is_plain(
    arms: ArmTable, way: FloatArray, begin: FloatArray, duration: FloatArray
) -> NDArray[np.bool_]:
    """Tell which rows have numbers that make a motion, and an arm that allows one."""
    is_finite = np.isfinite(duration) & np.isfinite(way + begin).all(axis=1)
    return is_finite & (duration > 0.0) & ~np.isin(arms.of_row, list(arms.refusals))


def _problems(
    arms: ArmTable, way: FloatArray, duration: FloatArray, rows: IntArray
) -> tuple[ProblemTable, IntArray]:
    """Return motions over 1 rad, and which of them each row is a multiple of, -1 for none."""
    keys = np.column_stack([arms.of_row[rows], duration[rows]])
    distinct, which = np.unique(keys, axis=0, return_inverse=True)
    problems = ProblemTable.of(arms, distinct[:, 0].astype(np.int64), distinct[:, 1])
    problem = np.full(len(duration), -1, dtype=np.int64)
    which = which.ravel()
    is_within = np.abs(way[rows]).max(axis=1) < problems.reach[which]
    problem[rows] = np.where(is_within & (problems.form[which] >= 0), which, -1)
    return problems, problem


def _one_by_one(
    arms: ArmTable,
    way: FloatArray,
    begin: FloatArray,
    duration: FloatArray,
    options: PlanningOptions,
    rows: IntArray,
) -> tuple[dict[int, Plan], dict[int, FlatPlannerError]]:
    """Return the plans of some rows, and why the others of them have none."""
    singles: dict[int, Plan] = {}
    refusals: dict[int, FlatPlannerError] = {}
    for row in rows.tolist():
        try:
            request = request_of(begin[row], way[row], float(duration[row]))
            singles[row] = plan(request, arms.arms[arms.of_row[row]], options)
        except FlatPlannerError as error:
            refusals[row] = error
    return singles, refusals
