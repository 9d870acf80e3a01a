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

"""Distinct arms of a table, each with what plans take from it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from flat_planner_ros.core.arm import (
    flat_map,
    FlatPlannerError,
    FloatArray,
    InvalidRequest,
    PlanarArm,
)
from flat_planner_ros.core.insensitive import Oscillator, OscillatorTable
from flat_planner_ros.core.motion_law import JET_ORDER
from flat_planner_ros.core.planning import joint_rows, PlanningOptions
import numpy as np
from numpy.typing import NDArray

IntArray = NDArray[np.int64]
"""Indices."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ArmTable:
    """
    Arms and what is minimised on each.

    Attributes
    ----------
    arms
        Each once, a of them, all with equally many joints.
    of_row
        Which of them each row has, shape (N,).
    coefficients
        a_0 ... a_6 of their Euler-Lagrange equations, shape (a, 7) [s^(2k - 12)].
    rows
        Effort of joint n-1, velocity of link n-1 and of joint n from the derivatives 0 to 6 of the
        planned variable, shape (a, 3, 7).
    oscillators
        The oscillation of each with the drive of the options.
    refusals
        Why an arm allows no plan, by its place.

    """

    arms: tuple[PlanarArm, ...]
    of_row: IntArray
    coefficients: FloatArray
    rows: FloatArray
    oscillators: OscillatorTable
    refusals: Mapping[int, FlatPlannerError]

    @classmethod
    def of(
        cls, arms: PlanarArm | Sequence[PlanarArm], count: int, options: PlanningOptions
    ) -> 'ArmTable':
        """
        Return the table of the arms of rows.

        Parameters
        ----------
        arms
            One for all rows, or as many as there are; the same object is prepared once.
        count
            Number of rows.
        options
            What is minimised.

        Raises
        ------
        InvalidRequest
            There is another number of arms, or they differ in their number of joints.

        """
        distinct, of_row = _distinct(arms, count)
        coefficients = np.full((len(distinct), JET_ORDER + 1), np.nan)
        rows = np.full((len(distinct), 3, JET_ORDER + 1), np.nan)
        oscillators: list[Oscillator | None] = []
        refusals: dict[int, FlatPlannerError] = {}
        for place, arm in enumerate(distinct):
            try:
                mapping = flat_map(arm, options.flat_model)
                cost = options.cost(arm, mapping)
                coefficients[place], rows[place] = cost.characteristic(), joint_rows(mapping)
                oscillators.append(Oscillator.of(arm, options.drive))
            except FlatPlannerError as error:
                refusals[place] = error
                oscillators.append(None)
        return cls(
            arms=distinct,
            of_row=of_row,
            coefficients=coefficients,
            rows=rows,
            oscillators=OscillatorTable.of(oscillators, options.drive),
            refusals=refusals,
        )


def _distinct(
    arms: PlanarArm | Sequence[PlanarArm], count: int
) -> tuple[tuple[PlanarArm, ...], IntArray]:
    """Return each arm once, and which of them each row has; refuse what does not fit."""
    if isinstance(arms, PlanarArm):
        return (arms,), np.zeros(count, dtype=np.int64)
    if len(arms) != count:
        raise InvalidRequest(f'{len(arms)} arms for {count} motions: give one, or {count}')
    places: dict[int, int] = {}
    of_row = [places.setdefault(id(arm), len(places)) for arm in arms]
    distinct = tuple({id(arm): arm for arm in arms}.values())
    joints = {arm.n for arm in distinct}
    if len(joints) > 1:
        raise InvalidRequest(
            f'arms of {min(joints)} and {max(joints)} joints: call once for each number'
        )
    return distinct, np.array(of_row, dtype=np.int64)
