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

"""Write the tables of parameters in interfaces.md, from the nodes' own declarations."""

from collections.abc import Iterable, Iterator
from math import inf
from pathlib import Path
import re
import sys

from flat_planner_ros.ros.parameters import monitor, planner, plant, tracker
from flat_planner_ros.ros.parameters.arm_model import MODEL_ROWS
from flat_planner_ros.ros.parameters.row import Row
from rclpy.parameter import Parameter

PAGE = Path(__file__).resolve().parent / 'interfaces.md'
"""The page with the tables."""

MARKED = re.compile(r'(<!-- parameters: (\w+) -->\n).*?(<!-- end -->)', re.DOTALL)
"""A table on the page, between two comments."""

TABLES = {
    'planner': planner.ROWS,
    'plant': plant.ROWS,
    'monitor': monitor.ROWS,
    'tracker': tracker.ROWS,
}
"""Parameters by node."""

HEADER = '| parameter | default | allowed | meaning |\n|---|---|---|---|\n'
"""First lines of a table."""


def page(text: str) -> str:
    """Return the page with its tables as the code has them."""
    return MARKED.sub(lambda match: match[1] + _table(match[2]) + match[3], text)


def _table(name: str) -> str:
    """Return a table."""
    return HEADER + ''.join(_line(row) for row in _rows(name))


def _rows(name: str) -> Iterator[Row]:
    """Return the rows of a node that are not the model's, or those of the model."""
    if name == 'model':
        yield from MODEL_ROWS
        return
    shared = {row.name for row in MODEL_ROWS}
    yield from (row for row in TABLES[name] if row.name not in shared)


def _line(row: Row) -> str:
    """Return a row of a table."""
    default = row.default
    # Asked first: in some ROS distributions a type is an integer, too.
    if isinstance(default, Parameter.Type):
        shown = 'not set'
    else:
        shown = f'`{str(default).lower()}`' if isinstance(default, bool) else f'`{default}`'
    meaning = row.description + (', *fixed*' if row.read_only else '')
    return f'| `{row.name}` | {shown} |{_allowed(row)}| {_escaped(meaning)} |\n'


def _allowed(row: Row) -> str:
    """Return what a parameter may be; a blank where its type says it all."""
    if row.choices:
        return f' {", ".join(row.choices)} '
    if row.lower == -inf and row.upper == inf:
        return ' '
    upper = '∞)' if row.upper == inf else f'{row.upper:g}]'
    lower = '(-∞' if row.lower == -inf else f'[{row.lower:g}'
    return f' {lower}, {upper} '


def _escaped(text: str) -> str:
    """Return text in which names of topics and stars are not markup."""
    return re.sub(r'(?<![\w`])(~?/[a-z][a-z_/]+|I\*_\S+)', r'`\1`', text)


def main(arguments: Iterable[str]) -> int:
    """Write the page; with --check, only tell whether it would change."""
    text = PAGE.read_text('utf-8')
    fresh = page(text)
    if '--check' in arguments:
        return int(fresh != text)
    PAGE.write_text(fresh, 'utf-8')
    return 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
