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

"""A study: rows that are drawn, planned and simulated, each known by its number alone."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import nan
from typing import NamedTuple

from flat_planner_ros.core.arm import FlatPlannerError, FloatArray
from flat_planner_ros.core.planning import PlanSamples
from flat_planner_ros.core.plant import CommandTable, States
from flat_planner_ros.core.session import Motion
from flat_planner_ros.core.study.axes import Axes, Column, column, shares_of
from flat_planner_ros.core.study.case import Batch, Case
from flat_planner_ros.core.study.in_arrays import (
    commands_in_arrays,
    InArrays,
    planned_in_arrays,
)
from flat_planner_ros.core.study.planned import (
    ACCEPTED,
    Answer,
    answer,
    Clock,
    figures,
    refusal,
)
from flat_planner_ros.core.study.playing import ends_of, misses, Motions, motions_of, residuals
from flat_planner_ros.core.study.tracked import tracked_ends
import numpy as np
from numpy.typing import NDArray

Table = dict[str, Column]
"""Columns by their titles, as many values in each."""

CHECKED = 1.0 / 250.0
"""Share of the simulated rows that the plant's own integration repeats [-]."""

CHECK_STREAM = 'repeated by the plant'
"""Stream of the random numbers that choose them."""

ONE_PER_JOINT = ('peak_effort', 'rms_effort')
"""Columns that longer arms have for each actuated joint."""

NUMBERS = (
    'residual',
    'simulated_residual',
    'worst_residual',
    'miss',
    'simulated_miss',
    'worst_miss',
)
"""Columns of residuals and misses [rad]."""

TIME = 'planning_time'
"""Column that differs from run to run [s]."""


class Refused(NamedTuple):
    """Rows of a chunk (m,) that are no cases, and why."""

    places: NDArray[np.intp]
    answer: Answer


@dataclass(frozen=True, kw_only=True)
class Study:
    """
    What a table of results is made from; calling it with two numbers makes the rows between.

    Attributes
    ----------
    axes
        What the rows vary.
    cases
        Makes cases of the axes' columns; it must survive pickling where others do the work.
    joints
        Names in kinematic order.
    chunk
        Rows that are done together. What a row says may depend on it in the last digit.
    clock
        Tells how long planning took; None leaves that column out.

    """

    axes: Axes
    cases: Callable[[Mapping[str, Column]], Sequence[Batch | Refused]]
    joints: tuple[str, ...]
    chunk: int = 256
    clock: Clock | None = None

    @property
    def count(self) -> int:
        """Return the number of rows."""
        return self.axes.count

    @cached_property
    def titles(self) -> tuple[str, ...]:
        """Return the titles of the columns."""
        efforts = [title for name in ONE_PER_JOINT for title in self.effort_titles(name)]
        results = ('verdict', 'planned_duration', *efforts, *NUMBERS)
        times = () if self.clock is None else (TIME,)
        return ('row', *self.axes.names, *results, *times)

    def effort_titles(self, name: str) -> tuple[str, ...]:
        """Return the titles of the columns of efforts, one for each actuated joint."""
        if len(self.joints) == 2:
            return (name,)
        return tuple(f'{name}.{joint}' for joint in self.joints[:-1])

    def __call__(self, first: int, stop: int) -> Table:
        """
        Return the rows from one to before another, within a chunk.

        Raises
        ------
        PlantDisagrees
            Two simulations of one motion differ.

        """
        drawn = self.axes.columns(first, stop)
        share = shares_of(self.axes.seed, CHECK_STREAM, first, stop)
        rows = _Rows(self, stop - first, share < CHECKED)
        for part in self.cases(drawn):
            if isinstance(part, Refused):
                rows.refuse(part.places, part.answer)
            else:
                rows.take(part)
        found = {'row': np.arange(first, stop), **drawn, **rows.table}
        return {title: found[title] for title in self.titles}

    def row(self, number: int) -> Table:
        """Return one row, the same to the last digit as in the whole table."""
        first = number - number % self.chunk
        whole = self(first, min(first + self.chunk, self.count))
        return {
            title: values[number - first : number - first + 1] for title, values in whole.items()
        }

    def case(self, number: int) -> Case | Answer:
        """Return the case of one row, or why it is none."""
        (part,) = self.cases(self.axes.columns(number, number + 1))
        if isinstance(part, Refused):
            return part.answer
        try:
            return part.case(0)
        except FlatPlannerError as error:
            return refusal(error)


class _Rows:
    """Results of a chunk, filled in part by part."""

    def __init__(self, study: Study, count: int, checked: NDArray[np.bool_]) -> None:
        self._study, self._checked = study, checked
        efforts = {name: study.effort_titles(name) for name in ONE_PER_JOINT}
        titles = ['planned_duration', *sum(efforts.values(), ()), *NUMBERS, TIME]
        self._efforts = efforts
        self.table: Table = {title: np.full(count, nan) for title in titles}
        self.table['verdict'] = column(('',) * count)

    def refuse(self, places: NDArray[np.intp], said: Answer) -> None:
        """Enter a refusal of some rows, which have no numbers."""
        for title, values in self.table.items():
            if title != 'verdict':
                values[places] = nan
        self.table['verdict'][places] = said.verdict
        self.table[TIME][places] = said.seconds

    def take(self, batch: Batch) -> None:
        """Plan and simulate cases: in arrays what can be, the others one by one."""
        found = planned_in_arrays(batch, self._study.clock)
        left = np.ones(len(batch), dtype=bool)
        if found is not None:
            left[found.places] = False
            self._enter_table(batch, found)
        self._take_singly(batch, np.flatnonzero(left))

    def _take_singly(self, batch: Batch, indices: NDArray[np.intp]) -> None:
        """Plan and simulate some cases of a batch, each as the planner would by itself."""
        cases, samples, places = [], [], []
        for index in indices.tolist():
            place = int(batch.places[index])
            try:
                case = batch.case(index)
                said = answer(case, self._study.clock)
            except FlatPlannerError as error:
                said = refusal(error)
            self.refuse(np.array([place]), said)
            if said.motion is not None:
                self._enter(place, case, said.motion)
                cases.append(case)
                samples.append(said.motion.samples)
                places.append(place)
        if cases and batch.template.plays:
            self._play(cases, samples, np.array(places))

    def _enter_table(self, batch: Batch, found: InArrays) -> None:
        """Enter plans that were made in arrays, and simulate them."""
        places, table, rows = batch.places[found.places], found.table, found.rows
        figures_of_rows, left = table.figures, table.residuals
        columns = {
            'planned_duration': table.durations,
            'peak_effort': figures_of_rows.peak_effort[:, 0],
            'rms_effort': figures_of_rows.rms_effort[:, 0],
            'residual': table.residuals_on(found.factors),
            'worst_residual': left.worst,
            'miss': table.misses_on(found.factors),
            'worst_miss': left.miss,
            TIME: np.full(len(table), found.seconds),
        }
        for title, values in columns.items():
            self.table[title][places] = values[rows]
        self.table['verdict'][places] = ACCEPTED
        template = batch.template
        if not template.plays:
            return
        if template.tracker is not None:
            cases = [batch.case(index) for index in found.places.tolist()]
            period = template.settings.period
            samples = [table.plan(row).sample(period) for row in rows.tolist()]
            self._play(cases, samples, places)
            return
        motions = Motions(
            template=template,
            true=found.true,
            starts=batch.starts[found.places],
            finals=batch.finals[found.places],
            case=lambda row: batch.case(int(found.places[row])),
        )
        # Feedback needs to know where the joints should be, as servos do.
        drives = template.drives
        has_feedback = bool(drives.feedback_p or drives.feedback_d)
        commands = commands_in_arrays(
            found, template.settings.period, template.drive, with_positions=has_feedback
        )
        self._finish(motions, ends_of(motions, commands, self._checked[places].tolist()), places)

    def _finish(self, motions: Motions, ends: States, places: NDArray[np.intp]) -> None:
        """Enter what is left at the ends of motions."""
        self.table['simulated_residual'][places] = residuals(motions, ends)
        self.table['simulated_miss'][places] = misses(motions, ends)

    def _enter(self, place: int, case: Case, motion: Motion) -> None:
        """Enter what a motion takes and what is predicted of it."""
        found = figures(case, motion)
        values = {
            'planned_duration': found.duration,
            'residual': found.residual,
            'worst_residual': found.worst_residual,
            'miss': found.miss,
            'worst_miss': found.worst_miss,
        }
        for name, titles in self._efforts.items():
            values.update(zip(titles, getattr(found, name).tolist(), strict=True))
        for title, value in values.items():
            self.table[title][place] = value

    def _play(
        self, cases: Sequence[Case], samples: Sequence[PlanSamples], places: NDArray[np.intp]
    ) -> None:
        """Enter what motions leave when they are carried out."""
        checked = self._checked[places].tolist()
        if cases[0].tracker is None:
            motions = motions_of(cases)
            self._finish(motions, ends_of(motions, commands_of(samples), checked), places)
            return
        done, ends = [], []
        for index, end in enumerate(tracked_ends(cases, samples, checked)):
            if isinstance(end, FlatPlannerError):
                self.refuse(places[index : index + 1], refusal(end))
            else:
                done.append(index)
                ends.append(end)
        if ends:
            whole = States(*(np.concatenate(tables) for tables in zip(*ends, strict=True)))
            self._finish(motions_of([cases[index] for index in done]), whole, places[done])


def commands_of(samples: Sequence[PlanSamples]) -> CommandTable:
    """Return the commands of motions on their grids, as an executor gets them."""
    intervals = np.array([len(each.times) - 1 for each in samples])
    motors = samples[0].efforts.shape[1] - 1
    tables = np.zeros((3, len(samples), int(intervals.max()) + 1, motors))
    for row, each in enumerate(samples):
        points = slice(len(each.times))
        tables[0, row, points] = each.efforts[:, :-1]
        tables[1, row, points] = each.positions[:, :-1]
        tables[2, row, points] = each.velocities[:, :-1]
    efforts, positions, velocities = tables
    spacing: FloatArray = np.array([float(each.times[-1]) for each in samples]) / intervals
    return CommandTable(
        spacing=spacing,
        intervals=intervals,
        efforts=efforts,
        positions=positions,
        velocities=velocities,
    )
