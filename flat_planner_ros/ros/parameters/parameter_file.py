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
Settings of a node from a parameter file, without a node.

Tools that need what a node would know (an arm, options) read the file that the node is given by
`--params-file` and follow the same rules: names and types, ranges, unknown names, both forms of
the model, and the same sentence where something is wrong.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
import re
from typing import Any

from flat_planner_ros.ros.parameters.arm_model import model_defaults
from flat_planner_ros.ros.parameters.node_parameters import refuse_unknown, Settings
from flat_planner_ros.ros.parameters.plausibility import doubts
from flat_planner_ros.ros.parameters.row import (
    InvalidParameter,
    Row,
    TYPE_HINTS,
    Values,
    wrong_type,
)
from flat_planner_ros.ros.parameters.yaml_reader import parsed
from rclpy.parameter import Parameter

BLOCK = 'ros__parameters'
"""Key under which a parameter file lists a node's values."""

STUDY = 'study'
"""Key under which a parameter file says what a study varies, which is for no node."""

ASSIGNMENT = ':='
"""Between name and value of an override, as ROS writes it."""


def read_settings(
    path: Path | str | None,
    rows: Sequence[Row],
    build: Callable[[Values], Settings],
    *,
    node: str,
    overrides: Sequence[str] = (),
    warn: Callable[[str], object] = lambda text: None,
) -> Settings:
    """
    Return the settings that a node would start with.

    Parameters
    ----------
    path
        Parameter file, as for `--params-file`; None for the defaults alone.
    rows, build
        Parameters and builder of the node, e.g. those of `planner_parameters`.
    node
        Name of the node with its namespace, e.g. ``flat_planner`` or ``/left/flat_planner``.
    overrides
        Texts ``name:=value``; they win over the file, as `-p node:name:=value` does. (ROS takes
        `-p name:=value` for the block ``/**``, over which a node's own block wins.)
    warn
        Is told of names that mean nothing to the node, and of a model that is hardly one.

    Raises
    ------
    InvalidParameter
        The file cannot be read, or the node would not start with it.
    FlatPlannerError
        The values are no valid settings.

    """
    name = '/' + node.strip('/')
    given = {} if path is None else file_values(Path(path), name)
    for doubt in () if path is None else _missed(Path(path), name):
        warn(doubt)
    for override in overrides:
        name, separator, text = override.partition(ASSIGNMENT)
        if not (separator and name and text):
            meant = f'; did you mean {override.replace("=", ASSIGNMENT, 1)}?'
            raise InvalidParameter(
                f'an override is written name:=value, got {override!r}'
                f'{meant if "=" in override and not separator else ""}'
            )
        given[name] = parsed(text, f'the value of {name}')
    return settings_of(given, rows, build, warn)


def settings_of(
    given: Values,
    rows: Sequence[Row],
    build: Callable[[Values], Settings],
    warn: Callable[[str], object] = lambda text: None,
) -> Settings:
    """
    Return the settings that a node would start with, were it given these values.

    Parameters
    ----------
    given
        Values by the names of parameters.
    rows, build, warn
        As for `read_settings`, whose errors are these too.

    """
    refuse_unknown(given, [row.name for row in rows], warn)
    defaults = model_defaults(given)
    values = {}
    for row in rows:
        value = given.get(row.name, defaults.get(row.name, row.default))
        if isinstance(value, Parameter.Type):
            continue
        if not row.word:
            _check_type(row, value)
        row.check(value)
        values[row.name] = value
    settings = build(values)
    for doubt in doubts(values):
        warn(doubt)
    return settings


def block_names(path: Path) -> list[str]:
    """
    Return for which nodes a file has blocks, as patterns such as ``/**/flat_planner``.

    Raises
    ------
    InvalidParameter
        The file cannot be read.

    """
    return [pattern for pattern, _ in _blocks(file_content(path), path)]


def reaches(pattern: str, node: str) -> bool:
    """Return whether a block is for a node, whose name has its namespace."""
    return re.fullmatch(_expression(pattern), node) is not None


def _missed(path: Path, node: str) -> Iterator[str]:
    """Return blocks that were likely meant for a node but do not reach it; or that none does."""
    blocks = block_names(path)
    base = node.rpartition('/')[2]
    missed = [block for block in blocks if not reaches(block, node)]
    for block in missed:
        other = block.rpartition('/')[2]
        is_meant = other == base or (base.endswith(other) and other != base)
        if is_meant and not any(reaches(one, node) for one in blocks if base in one):
            yield (
                f'{path}: the block {block} is not for {node}, its values have no effect; did you '
                f'mean {node}, or /**/{base} for any namespace?'
            )
            return
    if len(missed) == len(blocks):
        yield f'{path}: no block is for {node}, only {", ".join(blocks)}; it has no effect'


def file_values(path: Path, node: str) -> dict[str, Any]:
    """
    Return all values in a file that are meant for a node, later blocks winning.

    Parameters
    ----------
    path
        Parameter file.
    node
        Name of the node with its namespace, e.g. ``/flat_planner``.

    Raises
    ------
    InvalidParameter
        The file cannot be read, or is none.

    """
    values: dict[str, Any] = {}
    for pattern, block in _blocks(file_content(path), path):
        if reaches(pattern, node):
            values.update(_flat(block))
    return values


def file_content(path: Path) -> Mapping[str, Any]:
    """Return the tree of blocks in a file; InvalidParameter if it cannot be read."""
    try:
        text = path.read_text('utf-8')
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, 'strerror', None) or 'not a text file'
        raise InvalidParameter(f'cannot read {path}: {reason}') from error
    content = parsed(text, str(path))
    if not isinstance(content, Mapping):
        raise InvalidParameter(f'{path} is no parameter file: it has no block for any node')
    return content


def _blocks(
    tree: Mapping[str, Any], path: Path, prefix: str = ''
) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Return the name pattern and the values of every node's block, namespaces unfolded."""
    for key, value in tree.items():
        if key == STUDY and not prefix:
            continue
        name = f'{prefix}/{str(key).strip("/")}'
        if not isinstance(value, Mapping):
            raise InvalidParameter(
                f'{path} is no parameter file: every block needs {BLOCK}:, but {name.strip("/")} '
                f'is {value!r}'
            )
        if BLOCK in value:
            yield name, value[BLOCK] or {}
        else:
            yield from _blocks(value, path, name)


def _expression(pattern: str) -> str:
    """Return the regular expression of a node name in which * stands for one part, ** for any."""
    parts = {'*': r'(/\w+)', '**': r'(/\w+)*'}
    return ''.join(parts.get(part, '/' + re.escape(part)) for part in pattern.split('/')[1:])


def _flat(block: Mapping[str, Any], prefix: str = '') -> Iterator[tuple[str, Any]]:
    """Return names with dots and their values."""
    for key, value in block.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f'{prefix}{key}.')
        else:
            yield f'{prefix}{key}', value


def _check_type(row: Row, value: Any) -> None:
    """Refuse a value of another type than the parameter's, as the middleware does."""
    try:
        given = Parameter.Type.from_parameter_value(value)
    except TypeError as error:
        hint = TYPE_HINTS.get(row.type, '')
        raise InvalidParameter(f'{row.name} has values of several types{hint}') from error
    is_empty_list = isinstance(value, list) and not value
    if given is not row.type and not (is_empty_list and row.type.name.endswith('_ARRAY')):
        raise wrong_type(row, value)
