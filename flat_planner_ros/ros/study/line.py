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

"""The line of `flat_plan` that repeats a row of a study."""

from collections.abc import Mapping
from pathlib import Path
import shlex
from typing import Any

from flat_planner_ros.core.study import Case
from flat_planner_ros.ros.parameters.arm_model import model_defaults
from flat_planner_ros.ros.parameters.parameter_file import ASSIGNMENT, file_values
from flat_planner_ros.ros.study.cases import Cases, with_values
from flat_planner_ros.ros.wire import interfaces


def flat_plan_line(cases: Cases, number: int, case: Case) -> str:
    """
    Return the command line that plans a row by itself.

    Parameters
    ----------
    cases
        Of the study.
    number
        Of the row.
    case
        What it is.

    """
    joints, spec = case.settings.joints, cases.spec
    words = ['flat_plan', *_angles(joints, case.final)]
    if case.duration > 0.0:
        words += ['--duration', repr(case.duration)]
    if any(case.start):
        words += ['--start', *_angles(joints, case.start)]
    for point in case.via:
        time = f'@{point.time!r}' if point.time > 0.0 else ''
        words += ['--via', ','.join(_angles(joints, point.position)) + time]
    if spec.params_file is not None:
        words += ['--params-file', str(spec.params_file)]
    for name, value in _changes(cases, number).items():
        words += ['-p', f'{name}{ASSIGNMENT}{_yaml(value)}']
    return shlex.join(words)


def _angles(joints: tuple[str, ...], pose: tuple[float, ...]) -> list[str]:
    """Return the angles of the actuated joints, all of them, so that none stays where it was."""
    return [f'{name}={angle!r}' for name, angle in zip(joints[:-1], pose, strict=False)]


def _changes(cases: Cases, number: int) -> Mapping[str, Any]:
    """Return the planner's parameters that its file does not say."""
    wanted = cases.given('', with_values(cases, number))
    file, node = cases.spec.params_file, f'/{interfaces.PLANNER}'
    known = {} if file is None else file_values(Path(file), node)
    changed = {name: value for name, value in wanted.items() if known.get(name) != value}
    example = model_defaults(known)
    if all(example.get(name) == changed.get(name) for name in example):
        # The paper's arm as it is needs no words.
        return {name: value for name, value in changed.items() if name not in example}
    return changed


def _yaml(value: Any) -> str:
    """Return a value as the nodes read it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (list, tuple)):
        return f'[{", ".join(map(_yaml, value))}]'
    return repr(value) if isinstance(value, float) else str(value)
