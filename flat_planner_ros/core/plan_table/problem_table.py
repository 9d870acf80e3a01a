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

"""Motions over 1 rad that the rows of a table share: one for each arm and duration."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from flat_planner_ros.core.arm import Drive, FloatArray
from flat_planner_ros.core.insensitive import residual_table, ResidualTable, UncertaintyBox
from flat_planner_ros.core.motion_law import (
    CONDITIONS,
    JET_ORDER,
    Mean,
    unit_table,
    UnitGroup,
    UnitMotions,
)
from flat_planner_ros.core.plan_table.arm_table import ArmTable, IntArray
from flat_planner_ros.core.planning import BOUNDARY_TOLERANCE, MAX_NUMBER, OPTIMALITY_TOLERANCE
import numpy as np

PART = 512
"""Motions that are evaluated together, few enough for the caches of a processor."""

_ORDERS = np.arange(JET_ORDER + 1.0)


class Part(NamedTuple):
    """Motions of one form, the problems that they belong to, and where they were asked for."""

    places: IntArray
    problems: IntArray
    motions: UnitMotions


@dataclass(frozen=True, kw_only=True, eq=False)
class ProblemTable:
    """
    Motions over 1 rad, p of them.

    Attributes
    ----------
    arms
        Arms of the table.
    arm
        Which of them each motion has, shape (p,).
    duration
        Shape (p,) [s].
    groups
        The motions by their form; a motion that no form holds is in no group.
    form
        In which group each motion is, -1 for none, shape (p,).
    place
        Where in its group, shape (p,).
    boundary_residual, optimality_residual, cost_value, reach
        As those of a `MotionProblem`, NaN for motions in no group, shape (p,).

    """

    arms: ArmTable
    arm: IntArray
    duration: FloatArray
    groups: tuple[UnitGroup, ...]
    form: IntArray
    place: IntArray
    boundary_residual: FloatArray
    optimality_residual: FloatArray
    cost_value: FloatArray
    reach: FloatArray

    @classmethod
    def of(cls, arms: ArmTable, arm: IntArray, duration: FloatArray) -> 'ProblemTable':
        """Return the motions of arms and durations."""
        half = 0.5 * duration
        powers = half[:, None] ** _ORDERS
        with np.errstate(over='ignore', invalid='ignore'):
            normalised = arms.coefficients[arm] * powers[:, ::-1] ** 2
        solvable = np.flatnonzero(np.isfinite(normalised).all(axis=1))
        # Slow motions together with slow ones: their oscillations turn equally often.
        solvable = solvable[np.argsort(duration[solvable], kind='stable')]
        tolerance = min(BOUNDARY_TOLERANCE, OPTIMALITY_TOLERANCE)
        groups = tuple(
            UnitGroup(solvable[group.rows], group.motions)
            for group in unit_table(normalised[solvable], tolerance)
        )
        form, place = np.full((2, len(duration)), -1, dtype=np.int64)
        boundary, optimality, cost, reach = np.full((4, len(duration)), np.nan)
        for index, (rows, motions) in enumerate(groups):
            found = motions.certificates
            form[rows], place[rows] = index, np.arange(len(rows))
            boundary[rows], optimality[rows] = found.boundary_residual, found.optimality_residual
            # (35) with every derivative in units of the half duration.
            cost[rows] = found.costate * half[rows] ** (1.0 - 2.0 * CONDITIONS)
            with np.errstate(divide='ignore', invalid='ignore'):
                largest = (found.peaks / powers[rows]).max(axis=1)
                within = np.minimum(MAX_NUMBER / largest, MAX_NUMBER**0.5 / cost[rows] ** 0.5)
            reach[rows] = np.where(cost[rows] > 0.0, within, 0.0)
        return cls(
            arms=arms,
            arm=arm,
            duration=duration,
            groups=groups,
            form=form,
            place=place,
            boundary_residual=boundary,
            optimality_residual=optimality,
            cost_value=cost,
            reach=reach,
        )

    def parts(self, problems: IntArray) -> Iterator[Part]:
        """Return the motions of some problems, in any order and number; those in no group not."""
        form = self.form[problems]
        order = np.argsort(form, kind='stable')
        bounds = np.searchsorted(form[order], np.arange(len(self.groups) + 1))
        for index, group in enumerate(self.groups):
            places = order[bounds[index] : bounds[index + 1]]
            for first in range(0, len(places), PART):
                some = places[first : first + PART]
                chosen = problems[some]
                yield Part(some, chosen, group.motions.chosen(self.place[chosen]))

    def rates(self, problems: IntArray) -> FloatArray:
        """Return factors of the derivatives 0 to 6 in physical time, shape (q, 7) [1/s^k]."""
        rates: FloatArray = (0.5 * self.duration[problems, None]) ** -_ORDERS
        return rates

    def means(self) -> Mean:
        """Return those of the quantities of `ArmTable.rows` over 1 rad, shape (p, 3)."""
        square, peak = np.full((2, len(self.duration), 3), np.nan)
        for part in self.parts(np.arange(len(self.duration))):
            rows = self.arms.rows[self.arm[part.problems]]
            mean = part.motions.means(rows * self.rates(part.problems)[:, None])
            square[part.places], peak[part.places] = mean
        return Mean(square, peak)

    def residuals(self, box: UncertaintyBox) -> ResidualTable:
        """Return what the motions leave behind over 1 rad; NaN where they are in no group."""
        count = len(self.duration)
        nominal, worst, miss = np.full((3, count), np.nan)
        factors = np.full((count, 3), np.nan)
        for places, problems, motions in self.parts(np.arange(count)):
            found = residual_table(
                self.arms.oscillators.chosen(self.arm[problems]),
                self._driving_rows(problems),
                self.duration[problems],
                motions.transform,
                box,
            )
            nominal[places], worst[places], miss[places] = found.nominal, found.worst, found.miss
            factors[places] = found.factors
        return ResidualTable(nominal=nominal, worst=worst, factors=factors, miss=miss, box=box)

    def amplitudes(self, problems: IntArray, factors: FloatArray) -> FloatArray:
        """
        Return what motions over 1 rad leave on arms of their own.

        Parameters
        ----------
        problems
            Which motions, shape (q,).
        factors
            Of the arms, as for `OscillatorTable.poles`, shape (q, 3) or (q, 4) [-].

        Returns
        -------
        FloatArray
            NaN where the arm does not oscillate or the motion is in no group, shape (q,) [rad].

        """
        left = np.full(len(problems), np.nan)
        for places, chosen, motions in self.parts(problems):
            oscillators = self.arms.oscillators.chosen(self.arm[chosen])
            left[places] = oscillators.amplitudes(
                factors[places, None],
                self._driving_rows(chosen),
                self.duration[chosen],
                motions.transform,
            )[:, 0]
        return left

    def on_even_grid(self, problems: IntArray, rows: FloatArray, intervals: int) -> FloatArray:
        """
        Return combinations of derivatives in physical time at even times.

        Parameters
        ----------
        problems
            Of which motions over 1 rad, shape (q,).
        rows
            Factors of the derivatives 0 to 6, shape (q, m, 7).
        intervals
            Parts of each motion.

        Returns
        -------
        FloatArray
            NaN where the motion is in no group, shape (q, m, intervals + 1).

        """
        table = np.full((*rows.shape[:2], intervals + 1), np.nan)
        for places, chosen, motions in self.parts(problems):
            physical = rows[places] * self.rates(chosen)[:, None]
            table[places] = motions.on_even_grid(physical, intervals)
        return table

    def _driving_rows(self, problems: IntArray) -> FloatArray:
        """Return what drives link n-1 from the derivatives of the planned variable, (q, 7)."""
        quantity = 0 if self.arms.oscillators.drive is Drive.EFFORT else 1
        rows: FloatArray = self.arms.rows[self.arm[problems], quantity]
        return rows
