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

"""The present model as a parameter file that the nodes read."""

from collections.abc import Sequence
from pathlib import Path

from flat_planner_ros.core.arm import FlatPlannerError
from flat_planner_ros.ros.parameters.arm_model import MODEL_ROWS
from flat_planner_ros.ros.parameters.parameter_file import BLOCK
from flat_planner_ros.ros.parameters.row import Row, Values
import yaml

LINE = 100
"""Columns of a written file."""


class NotSaved(FlatPlannerError):
    """A model was not written; the message says where and why."""


def model_file(values: Values, namespace: str, remarks: Sequence[str]) -> str:
    """
    Return the text of a parameter file with the model of an arm, for all nodes of a namespace.

    Parameters
    ----------
    values
        The planner's parameters; only those of the model are written.
    namespace
        Of the planner, e.g. ``/`` or ``/left``.
    remarks
        Lines for its head.

    """
    tree: dict[str, object] = {}
    for row in MODEL_ROWS:
        if row.name in values:
            _put(tree, row, values[row.name])
    name = f'{namespace.rstrip("/")}/**'
    head = ''.join(f'# {line}\n' for line in remarks)
    body = {name: {BLOCK: tree}}
    text: str = yaml.safe_dump(body, sort_keys=False, default_flow_style=None, width=LINE)
    return f'{head}\n{text}'


def _put(tree: dict[str, object], row: Row, value: object) -> None:
    """Write a value into the group of its name."""
    group, _, name = row.name.rpartition('.')
    if not group:
        tree[name] = value
        return
    branch = tree.setdefault(group, {})
    if isinstance(branch, dict):
        branch[name] = value


def save(path: Path, text: str) -> str:
    """
    Write a file and return a sentence on it; one that is there already is kept under another name.

    Raises
    ------
    NotSaved
        It cannot be written.

    """
    path = path.expanduser().absolute()
    kept = ''
    try:
        if path.exists():
            former = _free_name(path)
            path.rename(former)
            kept = f'; what was there is now {former}'
        with path.open('x', encoding='utf-8') as file:
            file.write(text)
    except OSError as error:
        raise NotSaved(f'cannot write {path}: {error.strerror or error}{kept}') from error
    return f'the model is saved in {path}{kept}'


def _free_name(path: Path) -> Path:
    """Return the first name beside a file that is not taken yet."""
    number = 1
    while (other := path.with_name(f'{path.name}.{number}')).exists():
        number += 1
    return other
