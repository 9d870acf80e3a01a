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

"""A table of certified plans: one motion in each row, its figures and what it leaves behind."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from flat_planner_ros.core.arm import Drive, FlatPlannerError, FloatArray, locked
from flat_planner_ros.core.insensitive import misses, ResidualTable
from flat_planner_ros.core.motion_law import JET_ORDER
from flat_planner_ros.core.plan_table.arm_table import ArmTable, IntArray
from flat_planner_ros.core.plan_table.joint_figures import JointMotion
from flat_planner_ros.core.plan_table.problem_table import ProblemTable
from flat_planner_ros.core.plan_table.single_plans import (
    driving_signal,
    figures_of,
    request_of,
    residual_on,
)
from flat_planner_ros.core.planning import Plan, plan, PlanningOptions, residual_of_plan
import numpy as np


class Figures(NamedTuple):
    """
    Peaks and mean values of the motions of a table; NaN in rows that are refused.

    Attributes
    ----------
    rms_effort, peak_effort
        Of every joint, zero for the passive one, as those of a `Plan`, shape (N, n) [N m].
    peak_velocity
        Of every joint, shape (N, n) [rad/s].

    """

    rms_effort: FloatArray
    peak_effort: FloatArray
    peak_velocity: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanTable:
    """
    Plans from rest to rest, N of them, each in a row with its certificate.

    A row that is refused has NaN in every array, and its reason in `refusals`.

    Attributes
    ----------
    options
        How all of them are planned.
    arms
        The distinct arms, and which of them each row has.
    starts, distances
        Planned variables at the start, and the way to go, zero where it is too small for a motion,
        shape (N, n - 1) [rad].
    durations
        Shape (N,) [s].
    boundary_residual, optimality_residual
        The certificate, as that of a `Plan`, shape (N,) [-].
    cost_value
        As that of a `Plan`, shape (N,).
    refusals
        Why a row has no plan, by its number.
    problems
        Motions over 1 rad that rows share.
    problem
        Which of them each row is a multiple of, -1 for none, shape (N,).
    singles
        Plans of the rows that are no such multiple, by their number.

    """

    options: PlanningOptions
    arms: ArmTable
    starts: FloatArray
    distances: FloatArray
    durations: FloatArray
    boundary_residual: FloatArray
    optimality_residual: FloatArray
    cost_value: FloatArray
    refusals: Mapping[int, FlatPlannerError]
    problems: ProblemTable
    problem: IntArray
    singles: Mapping[int, Plan]

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.durations)

    @cached_property
    def is_certified(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """Tell which rows have a plan, shape (N,)."""
        certified = np.ones(len(self), dtype=bool)
        certified[list(self.refusals)] = False
        return locked(certified)

    def plan(self, row: int) -> Plan:
        """
        Return the plan of a row, as `plan` gives it.

        Raises
        ------
        FlatPlannerError
            The row is refused.

        """
        if row in self.refusals:
            raise self.refusals[row]
        if row in self.singles:
            return self.singles[row]
        request = request_of(self.starts[row], self.distances[row], float(self.durations[row]))
        return plan(request, self.arms.arms[self.arms.of_row[row]], self.options)

    @property
    def rms_effort(self) -> FloatArray:
        """Root mean square of every joint's effort, shape (N, n) [N m]."""
        return self.figures.rms_effort

    @property
    def peak_effort(self) -> FloatArray:
        """Largest magnitude of every joint's effort, shape (N, n) [N m]."""
        return self.figures.peak_effort

    @property
    def peak_velocity(self) -> FloatArray:
        """Largest magnitude of every joint's velocity, shape (N, n) [rad/s]."""
        return self.figures.peak_velocity

    @cached_property
    def figures(self) -> Figures:
        """
        Return RMS values and peaks.

        RMS values are good to 1e-9 of themselves; peaks are the largest at the nodes of a
        quadrature, within 2e-3 of the true ones from below.
        """
        count, joints = len(self), self.arms.arms[0].n
        rms, peak, velocity = np.full((3, count, joints), np.nan)
        rows = np.flatnonzero(self.problem >= 0)
        if joints == 2 and not self.options.compensate_friction:
            squares, peaks = (values[self.problem[rows]] for values in self.problems.means())
            way = np.abs(self.distances[rows, 0])
            rms[rows], peak[rows] = 0.0, 0.0
            rms[rows, 0], peak[rows, 0] = way * np.sqrt(squares[:, 0]), way * peaks[:, 0]
            velocity[rows] = way[:, None] * peaks[:, 1:]
        else:
            for places, motion in self._joint_motions(rows):
                rms[places], peak[places], velocity[places] = motion.figures()
        for row, planned in self.singles.items():
            rms[row], peak[row], velocity[row] = figures_of(planned)
        return Figures(locked(rms), locked(peak), locked(velocity))

    def _joint_motions(self, rows: IntArray) -> Iterator[tuple[IntArray, JointMotion]]:
        """Return the motions of rows, those of one arm and form together."""
        for places, problems, motions in self.problems.parts(self.problem[rows]):
            arms = self.problems.arm[problems]
            for arm in np.unique(arms).tolist():
                some = np.flatnonzero(arms == arm)
                chosen = rows[places[some]]
                yield (
                    chosen,
                    JointMotion(
                        arm=self.arms.arms[arm],
                        motions=motions.chosen(some),
                        rates=self.problems.rates(problems[some]),
                        rows=self.arms.rows[arm],
                        starts=self.starts[chosen],
                        distances=self.distances[chosen],
                        has_friction=self.options.compensate_friction,
                    ),
                )

    @cached_property
    def residuals(self) -> ResidualTable:
        """
        Return the oscillation that each motion leaves, and its miss of the goal.

        They are those of `residual_of_plan`: on the nominal arm, and the worst over the box of the
        options. NaN, too, where an arm does not oscillate.
        """
        box = self.options.insensitivity.box
        per_rad = self.problems.residuals(box)
        way = np.abs(self.distances[:, 0])
        # One place more, for rows that are no multiple of a problem.
        nominal, worst, miss = (
            way * np.append(values, np.nan)[self.problem]
            for values in (per_rad.nominal, per_rad.worst, per_rad.miss)
        )
        factors = np.append(per_rad.factors, [[np.nan] * 3], axis=0)[self.problem]
        for row, planned in self.singles.items():
            found = residual_of_plan(planned)
            nominal[row], worst[row], miss[row] = found.nominal, found.worst, found.miss or 0.0
            factors[row] = found.stiffness_factor, found.damping_factor, found.inertia_factor
        return ResidualTable(nominal=nominal, worst=worst, factors=factors, miss=miss, box=box)

    def residuals_on(self, factors: FloatArray) -> FloatArray:
        """
        Return the oscillation that each motion leaves on an arm of its own.

        Parameters
        ----------
        factors
            Of the true arms on the nominal stiffness, damping, inertia of link n about its joint
            and, if there is a fourth, inertia of link n-1 about its own, shape (N, 3) or (N, 4)
            [-].

        Returns
        -------
        FloatArray
            Amplitudes at the end, as `predict_residual` has them for an effort that is as good as
            continuous; NaN where an arm does not oscillate, shape (N,) [rad].

        """
        left = np.full(len(self), np.nan)
        rows = np.flatnonzero(self.problem >= 0)
        amplitudes = self.problems.amplitudes(self.problem[rows], factors[rows])
        left[rows] = np.abs(self.distances[rows, 0]) * amplitudes
        for row, planned in self.singles.items():
            left[row] = residual_on(planned, factors[row])
        return left

    def misses_on(self, factors: FloatArray) -> FloatArray:
        """
        Return how far from the goal each motion leaves an arm of its own.

        Parameters
        ----------
        factors
            Of the true arms, as for `residuals_on`.

        Returns
        -------
        FloatArray
            Of the last two links' angle; zero where a servo sets it, shape (N,) [rad].

        """
        oscillators = self.arms.oscillators.chosen(self.arms.of_row)
        missed = misses(oscillators, factors[:, None])[:, 0]
        return np.where(self.is_certified, np.abs(self.distances[:, 0]) * missed, np.nan)

    def driving(self, rows: IntArray, intervals: int) -> FloatArray:
        """
        Return what drives link n-1 at even times, both ends included.

        Parameters
        ----------
        rows
            Which motions, shape (q,).
        intervals
            Parts of each.

        Returns
        -------
        FloatArray
            Effort of joint n-1 without friction [N m], or where a servo drives it the velocity of
            link n-1 in absolute angle [rad/s], shape (q, intervals + 1).

        """
        quantity = 0 if self.options.drive is Drive.EFFORT else 1
        problems = self.problem[rows]
        factors = self.arms.rows[self.arms.of_row[rows], None, quantity]
        factors = factors * self.distances[rows, :1, None]
        table = self.problems.on_even_grid(problems, factors, intervals)[:, 0]
        for place in np.flatnonzero(problems < 0).tolist():
            planned = self.singles.get(int(rows[place]))
            if planned is not None:
                table[place] = driving_signal(planned, intervals)
        return table

    def planned(self, rows: IntArray, intervals: int) -> FloatArray:
        """
        Return the planned variables and their derivatives at even times, both ends included.

        Parameters
        ----------
        rows, intervals
            As for `driving`.

        Returns
        -------
        FloatArray
            Derivatives 0 to 6, shape (q, n - 1, 7, intervals + 1) [rad/s^k].

        """
        count = len(rows)
        problems = self.problem[rows]
        every = np.broadcast_to(np.eye(JET_ORDER + 1), (count, JET_ORDER + 1, JET_ORDER + 1))
        unit = self.problems.on_even_grid(problems, every, intervals)
        distances = self.distances[rows]
        table = distances[:, :, None, None] * unit[:, None]
        table[:, :, 0] += (self.starts[rows] + 0.5 * distances)[..., None]
        for place in np.flatnonzero(problems < 0).tolist():
            planned = self.singles.get(int(rows[place]))
            if planned is not None:
                times = np.linspace(0.0, planned.duration, intervals + 1)
                table[place] = planned.at(times).planned
        return table
