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

"""Joint states from a table of numbers, as spreadsheets and PlotJuggler export them."""

from collections.abc import Iterator, Sequence
import csv
from pathlib import Path
import re

from flat_planner_ros.core.arm import FlatPlannerError, FloatArray, SampleTable
import numpy as np

SUFFIXES = ('.csv', '.tsv')
"""Ends of the names of such files."""

TIME = ('time', 't', 'stamp', 'timestamp', '__time')
"""Names of a column with times [s]."""

POSITION, EFFORT = ('position', 'pos'), ('effort', 'torque')
"""Words in the name of a column, beside the joint's."""

SEPARATORS = ',;\t'
"""What may stand between two numbers."""


class UnreadableTable(FlatPlannerError):
    """A file that is no table of joint states; the message says what is missing."""


def csv_samples(path: Path, joints: Sequence[str]) -> SampleTable:
    """
    Return the joint states of a table in the order of their times.

    Parameters
    ----------
    path
        File with a line of names and one line of numbers for each sample; a column's name holds
        the joint's and the quantity's, such as ``joint1.position`` or
        ``/joint_states/joint1/effort``.
    joints
        Names, the passive joint last; its effort is not needed.

    Raises
    ------
    UnreadableTable
        A column is missing or stands twice.
    OSError
        The file cannot be read.

    """
    with path.open(encoding='utf-8-sig', newline='') as file:
        first = file.readline()
        separator = max(SEPARATORS, key=first.count)
        names = [name.strip() for name in next(csv.reader([first], delimiter=separator), [])]
        wanted = [_column(path, names, joints, None, TIME)]
        wanted += [_column(path, names, joints, joint, POSITION) for joint in joints]
        wanted += [_column(path, names, joints, joint, EFFORT) for joint in joints[:-1]]
        lines = list(_numbers(csv.reader(file, delimiter=separator), wanted))
    table = np.array(lines).reshape(-1, len(wanted))
    table = table[np.isfinite(table).all(axis=1)]
    table = table[np.unique(table[:, 0], return_index=True)[1]]
    places, efforts = table[:, 1 : 1 + len(joints)], table[:, 1 + len(joints) :]
    unknown: FloatArray = np.full((len(table), 1), np.nan)
    return SampleTable(times=table[:, 0], positions=places, efforts=np.hstack((efforts, unknown)))


def _column(
    path: Path, names: list[str], joints: Sequence[str], joint: str | None, words: Sequence[str]
) -> int:
    """Return the place of the column with a word in its name, and with a joint or with none."""
    found = []
    for index, name in enumerate(names):
        tokens = set(re.split(r'[^\w]+', name))
        lower = {token.lower() for token in tokens}
        has_joint = joint in tokens if joint else not tokens & set(joints)
        if has_joint and lower & set(words):
            found.append(index)
    if len(found) == 1:
        return found[0]
    kind = f'{joint}.{words[0]}' if joint else words[0]
    many = 'several columns' if found else 'no column'
    raise UnreadableTable(
        f'{path} has {many} for {kind}; its columns are {", ".join(names)}; the names wanted are '
        f'time [s], {joints[0]}.position [rad], {joints[0]}.effort [N m] and so on'
    )


def _numbers(rows: Iterator[list[str]], wanted: Sequence[int]) -> Iterator[list[float]]:
    """Yield the wanted numbers of each line; what is none is NaN."""
    for row in rows:
        yield [_number(row[index]) if index < len(row) else float('nan') for index in wanted]


def _number(text: str) -> float:
    """Return a number, NaN for anything else."""
    try:
        return float(text)
    except ValueError:
        return float('nan')
