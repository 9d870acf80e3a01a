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
Names that users rely on: what is there now, and what has been promised with a version.

Usage: python test/ros/promised_names.py adds what is new to the list of what is promised, before
a release; members of classes are added by hand. It removes nothing: that is a major version.
"""

import ast
from enum import Enum, EnumMeta
import inspect
from itertools import takewhile
import json
from pathlib import Path
import re

from flat_planner_ros import core
from flat_planner_ros.ros.parameters import monitor, planner, plant, tracker
from flat_planner_ros.ros.wire import interfaces

CHECKOUT = Path(__file__).resolve().parents[2]
PROMISED = CHECKOUT / 'test' / 'reference' / 'promised_names.json'

NODES = {'planner': planner, 'plant': plant, 'monitor': monitor, 'tracker': tracker}

CALLS = 'flat_planner_ros.core'
MEMBERS = 'members of flat_planner_ros.core'

RESULTS = {'Plan', 'PlanTable'}
"""Classes that the core makes, and nobody else."""

KEY = re.compile(r'`(\w[\w.<>]*)`')
"""A key in the first column of a table of docs/interfaces.md."""

OPTION = re.compile(r"add_argument\(\s*(?:'-\w', )?'(--[\w-]+)'")
"""An option where it is declared."""


def present():
    """Return all names by kind, each kind a sorted list of texts."""
    return {kind: sorted(names) for kind, names in _kinds()}


def promised():
    """Return the names that have been promised, by kind."""
    return json.loads(PROMISED.read_text('utf-8'))


def _kinds():
    yield (
        'topics and services',
        [
            value
            for name, value in vars(interfaces).items()
            if name.isupper() and isinstance(value, str) and value.startswith(('~/', '/'))
        ],
    )
    yield 'status codes', [f'{r.value} {code}' for r, code in interfaces.ERROR_CODES.items()]
    text = (CHECKOUT / 'docs' / 'interfaces.md').read_text('utf-8')
    yield 'keys of verdicts', _keys(text, 'Status')
    yield 'keys of reports', _keys(text, 'Report')
    for node, table in NODES.items():
        yield f'parameters of {node}', [f'{row.name}: {_kind(row)}' for row in table.ROWS]
    setup = (CHECKOUT / 'setup.py').read_text('utf-8')
    yield 'programs', re.findall(r'(\w+) = flat_planner_ros\.programs', setup)
    sources = (CHECKOUT / 'flat_planner_ros' / 'ros').rglob('*.py')
    yield 'options of programs', {o for f in sources for o in OPTION.findall(f.read_text('utf-8'))}
    for file in sorted((CHECKOUT / 'launch').glob('*.py')):
        yield f'arguments of {file.name}', _launch_arguments(file)
    yield CALLS, [name for entry in core.__all__ for name in _python(entry)]
    yield MEMBERS, [name for entry in core.__all__ for name in _members(entry)]


def _kind(row):
    """Return the type of a parameter: of its default, or the one that it must have."""
    return (
        row.default.name.lower() if isinstance(row.default, Enum) else type(row.default).__name__
    )


def _keys(text, section):
    """Return the keys in the first table of a section."""
    lines = text.partition(f'### {section}\n')[2].splitlines()
    first = next(i for i, line in enumerate(lines) if line.startswith('| key |'))
    rows = takewhile(lambda line: line.startswith('| '), lines[first + 2 :])
    return [key for row in rows for key in KEY.findall(row.split(' | ')[0])]


def _launch_arguments(file):
    """Return the arguments that a launch file declares."""
    calls = [n for n in ast.walk(ast.parse(file.read_text('utf-8'))) if isinstance(n, ast.Call)]
    return [c.args[0].value for c in calls if getattr(c.func, 'id', '') == 'DeclareLaunchArgument']


def _python(name):
    """Return a public name, with what it is called with, or an enumeration's members."""
    value = getattr(core, name)
    if isinstance(value, EnumMeta):
        return [name, *(f'{name}.{member.name}' for member in value)]
    return [name, *(f'{name}({parameter})' for parameter in _parameters(name, value))]


def _members(name):
    """Return what a class has."""
    value = getattr(core, name)
    if not inspect.isclass(value) or isinstance(value, EnumMeta):
        return []
    members = set(vars(value)) | set(getattr(value, '__dataclass_fields__', ()))
    return [f'{name}.{member}' for member in members if not member.startswith('_')]


def _parameters(name, value):
    """Return the names of what a function or a class takes; none of what users do not make."""
    is_error = inspect.isclass(value) and issubclass(value, Exception)
    return () if is_error or name in RESULTS else inspect.signature(value).parameters


def main():
    """Add to the list what is new."""
    before, now = promised(), present()
    now.pop(MEMBERS)
    joined = {
        kind: sorted({*before.get(kind, ()), *now.get(kind, ())}) for kind in {**before, **now}
    }
    PROMISED.write_text(json.dumps(joined, indent=1) + '\n', 'utf-8')


if __name__ == '__main__':
    main()
