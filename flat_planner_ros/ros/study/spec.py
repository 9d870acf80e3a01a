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
What a study is asked for: a parameter file with one more block, `study`.

The block says what is set and what varies. Both go by the same names: those of the planner's
parameters, `plant.` and `tracker.` before the other nodes', and a few that are no parameters (the
goal, the start, via points, the duration, a payload, whether a tracker is in the loop).
"""

from argparse import ArgumentTypeError
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from hashlib import sha256
import json
from pathlib import Path
import re
from typing import Any

from flat_planner_ros.core.study import Axes, Distribution, Draws, InvalidStudy, Turns
from flat_planner_ros.ros.parameters import planner, plant, tracker
from flat_planner_ros.ros.parameters.parameter_file import file_content, file_values, STUDY
from flat_planner_ros.ros.parameters.row import DOUBLE, DOUBLES, Row
from flat_planner_ros.ros.programs.angles import angle_of
from flat_planner_ros.ros.programs.command_line import via_point
from flat_planner_ros.ros.wire import interfaces
from flat_planner_ros.version import version_line
import numpy as np

KEYS = ('params_file', 'seed', 'repeats', 'chunk', 'set', 'axes')
"""What the block may hold."""

NODES = {
    '': (interfaces.PLANNER, planner.ROWS),
    'plant.': (interfaces.PLANT, plant.ROWS),
    'tracker.': (interfaces.TRACKER, tracker.ROWS),
}
"""Nodes and their parameters, by what stands before the names of these."""

ROWS = {prefix + row.name: row for prefix, (_, rows) in NODES.items() for row in rows}
"""All parameters by their names in a study."""

DURATION, PAYLOAD, TRACKER, SIMULATE, VIA = 'duration', 'payload', 'tracker', 'simulate', 'via'
"""What else may be set."""

OTHERS = (DURATION, PAYLOAD, TRACKER, SIMULATE, VIA)

ANGLE = re.compile(r'(goal|start)\.(?P<joint>.+)')
"""Names of angles."""

VIA_ENTRY = re.compile(r'via\.(?P<number>[1-9]\d*)\.(?P<what>.+)')
"""Names of a via point's angle, or of its `time`."""

ELEMENT = re.compile(r'(?P<name>.+)\[(?P<number>[1-9]\d*)\]')
"""Name of one number of a list, counted from 1."""

RANGE = {'from', 'to', 'count', 'spacing'}
"""Keys of a range."""

LINEAR, LOGARITHMIC = 'linear', 'logarithmic'

MOST_CHUNK, LEAST_CHUNK, CHUNKS = 512, 8, 64
"""Rows of a chunk that is not chosen: an even share of the rows, within these."""


@dataclass(frozen=True, kw_only=True)
class Spec:
    """
    What a study is asked for.

    Attributes
    ----------
    path
        The file it is from.
    params_file
        The parameter file of its nodes; None for the paper's arm.
    fixed
        What is set for all rows, by name.
    axes
        What varies.
    chunk
        Rows that are done together.
    given
        Values of the nodes in the files, by what stands before their names in a study.

    """

    path: Path
    params_file: Path | None
    fixed: Mapping[str, Any]
    axes: Axes
    chunk: int
    given: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """Return what is set and what varies."""
        return (*self.fixed, *self.axes.names)

    @property
    def fingerprint(self) -> str:
        """Return a text that differs for every other table."""
        parts = [repr(self.axes), self.chunk, self.fixed, self.given, version_line()]
        return sha256(json.dumps(parts, sort_keys=True, default=repr).encode()).hexdigest()


def read_spec(path: Path, overrides: Mapping[str, Any] | None = None) -> Spec:
    """
    Return what a file asks for.

    Parameters
    ----------
    path
        A parameter file with a block `study`.
    overrides
        Values in place of what the block sets, or besides.

    Raises
    ------
    InvalidParameter
        The file, or the parameter file that it names, cannot be read.
    InvalidStudy
        What it asks for has no meaning.

    """
    content = file_content(path)
    block = content.get(STUDY)
    if not isinstance(block, Mapping):
        raise InvalidStudy(f'{path} has no block {STUDY}: with axes; config/studies shows some')
    for key in block:
        if key not in KEYS:
            raise InvalidStudy(f'{path}: unknown {key!r} in {STUDY}:{_meant(str(key), KEYS)}')
    named = block.get('params_file')
    params_file = None if named is None else path.parent / str(named)
    sources = [source for source in (params_file, path) if source is not None]
    given = {}
    for prefix, (node, _) in NODES.items():
        given[prefix] = {
            name: value
            for source in sources
            for name, value in file_values(source, f'/{node}').items()
        }
    fixed = {
        name: _value(name, value)
        for name, value in {**_mapping(block, 'set'), **(overrides or {})}.items()
    }
    axes = _axes(_mapping(block, 'axes'), block)
    for name in axes.names:
        fixed.pop(name, None)
    if not any(name.startswith('goal.') for name in (*fixed, *axes.names)):
        raise InvalidStudy(f'{path} names no goal: set goal.JOINT, or let it vary')
    has_own = any(key != STUDY for key in content)
    return Spec(
        path=path,
        params_file=params_file if params_file is not None else (path if has_own else None),
        fixed=fixed,
        axes=axes,
        chunk=_integer(block, 'chunk', _usual_chunk(axes.count)),
        given=given,
    )


def check_name(name: str) -> None:
    """Refuse a name that means nothing, as InvalidStudy."""
    element = ELEMENT.fullmatch(name)
    base = element['name'] if element else name
    if base in ROWS and (element is None or ROWS[base].type is DOUBLES):
        return
    if element is None and (name in OTHERS or ANGLE.fullmatch(name) or VIA_ENTRY.fullmatch(name)):
        return
    known = [*ROWS, *OTHERS, 'goal.joint1', 'start.joint1', 'via.1.joint1', 'via.1.time']
    raise InvalidStudy(f'nothing is called {name}{_meant(base, known)}')


def _meant(name: str, known: Sequence[str]) -> str:
    """Return what was likely meant."""
    similar = get_close_matches(name, known, n=1)
    return f'; did you mean {similar[0]}?' if similar else f'; known are {", ".join(known[:6])} …'


def _mapping(block: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    """Return a part of the block."""
    part = block.get(key) or {}
    if not isinstance(part, Mapping):
        raise InvalidStudy(f'{key}: needs names and values below it, got {part!r}')
    return {str(name): value for name, value in part.items()}


def _integer(block: Mapping[str, Any], key: str, default: int) -> int:
    """Return a whole number of the block."""
    value = block.get(key, default)
    if type(value) is not int or value < (0 if key == 'seed' else 1):
        raise InvalidStudy(f'{key} must be a whole number above 0, got {value!r}')
    return value


def _usual_chunk(count: int) -> int:
    """Return the rows of a chunk for a number of rows."""
    return min(MOST_CHUNK, max(LEAST_CHUNK, -(-count // CHUNKS)))


def _axes(given: Mapping[str, Any], block: Mapping[str, Any]) -> Axes:
    """Return the axes of a block."""
    turns: list[Turns] = []
    draws: list[Draws] = []
    for name, axis in given.items():
        if isinstance(axis, Mapping) and not RANGE.issuperset(axis):
            draws.append(_drawn(name, axis))
        elif isinstance(axis, Mapping):
            check_name(name)
            turns.append(Turns(names=(name,), values=tuple((v,) for v in _range(name, axis))))
        elif isinstance(axis, list) and axis and all(isinstance(v, Mapping) for v in axis):
            turns.append(_together(axis))
        elif isinstance(axis, list):
            check_name(name)
            values = tuple((_value(name, value),) for value in axis)
            turns.append(Turns(names=(name,), values=values))
        else:
            raise InvalidStudy(
                f'{name}: an axis is a list, a range {{from, to, count}} or a distribution '
                f'({", ".join(kind.value for kind in Distribution)}), got {axis!r}'
            )
    return Axes(
        turns=tuple(turns),
        draws=tuple(draws),
        repeats=_integer(block, 'repeats', 1),
        seed=_integer(block, 'seed', 0),
    )


def _drawn(name: str, axis: Mapping[str, Any]) -> Draws:
    """Return a random axis."""
    check_name(name)
    kinds = {kind.value: kind for kind in Distribution}
    if len(axis) != 1 or next(iter(axis)) not in kinds:
        raise InvalidStudy(
            f'{name}: a random axis is one of {", ".join(kinds)}, a range has from, to and count; '
            f'got {", ".join(map(str, axis))}'
        )
    ((kind, given),) = axis.items()
    if not isinstance(given, list):
        raise InvalidStudy(f'{name}: {kind} needs a list, got {given!r}')
    if kinds[kind] is not Distribution.CHOICE and not _takes_numbers(name):
        raise InvalidStudy(f'{name}: {kind} is for numbers, {name} is none; take choice')
    values = tuple(_value(name, value) for value in given)
    return Draws(name=name, distribution=kinds[kind], spread=values)


def _takes_numbers(name: str) -> bool:
    """Tell whether a name is one of a number."""
    row = ROWS.get(name)
    if row is not None:
        return row.type is DOUBLE
    return name not in (TRACKER, SIMULATE, VIA)


def _together(axis: Sequence[Mapping[str, Any]]) -> Turns:
    """Return an axis that sets several things together; what a value leaves out stays as it is."""
    names = tuple(dict.fromkeys(str(name) for values in axis for name in values))
    for name in names:
        check_name(name)
    return Turns(
        names=names,
        values=tuple(
            tuple(_value(name, values[name]) if name in values else None for name in names)
            for values in axis
        ),
    )


def _range(name: str, axis: Mapping[str, Any]) -> Iterator[float]:
    """Return evenly spaced values."""
    missing = {'from', 'to', 'count'} - set(axis)
    if missing:
        raise InvalidStudy(f'{name}: a range has from, to and count; {min(missing)} is missing')
    first, last = (_value(name, axis[key]) for key in ('from', 'to'))
    spacing, count = axis.get('spacing', LINEAR), _integer(axis, 'count', 1)
    if not (isinstance(first, float) and isinstance(last, float)):
        raise InvalidStudy(f'{name}: a range goes from one number to another')
    if spacing == LOGARITHMIC:
        if not first * last > 0.0:
            raise InvalidStudy(f'{name}: {spacing} spacing needs numbers above 0')
        yield from np.geomspace(first, last, count).tolist()
    elif spacing == LINEAR:
        yield from np.linspace(first, last, count).tolist()
    else:
        raise InvalidStudy(f'{name}: spacing is {LINEAR} or {LOGARITHMIC}, got {spacing!r}')


def _value(name: str, value: Any) -> Any:
    """Return a value as it is kept: numbers as floats where they may be, angles in radians."""
    check_name(name)
    if ELEMENT.fullmatch(name) or name in (DURATION, PAYLOAD) or _is_angle(name):
        return _number(name, value)
    if name in (TRACKER, SIMULATE):
        if not isinstance(value, bool):
            raise InvalidStudy(f'{name} is true or false, got {value!r}')
        return value
    if name == VIA:
        texts = value if isinstance(value, list) else [value]
        return tuple(_via(str(text)) for text in texts if text)
    return _for_row(ROWS[name], value)


def _via(text: str) -> str:
    """Return a via point as it is written, if it is one."""
    try:
        via_point(text)
    except ArgumentTypeError as error:
        raise InvalidStudy(f'{VIA}: {error}') from None
    return text


def _is_angle(name: str) -> bool:
    """Tell whether a name is one of an angle, or a via point's time."""
    return bool(ANGLE.fullmatch(name) or VIA_ENTRY.fullmatch(name))


def _number(name: str, value: Any) -> float:
    """Return a number, which may be written as an angle where it is one."""
    try:
        return angle_of(value) if isinstance(value, str) and _is_angle(name) else float(value)
    except (TypeError, ValueError):
        raise InvalidStudy(f'{name} must be a number, got {value!r}') from None


def _for_row(row: Row, value: Any) -> Any:
    """Return the value of a parameter: 1 stands for 1.0, and lists are kept unchangeable."""
    if isinstance(value, list):
        return tuple(float(v) if type(v) is int and row.type is DOUBLES else v for v in value)
    return float(value) if type(value) is int and row.type is DOUBLE else value


UNITS = {
    'duration': 's',
    'planned_duration': 's',
    'planning_time': 's',
    'peak_effort': 'N m',
    'rms_effort': 'N m',
    'residual': 'rad',
    'simulated_residual': 'rad',
    'worst_residual': 'rad',
    'miss': 'rad',
    'simulated_miss': 'rad',
    'worst_miss': 'rad',
}
"""Units of columns that are no parameters; without those of the joints in their names."""


def label_of(title: str) -> str:
    """Return how a column is called with its unit."""
    element = ELEMENT.fullmatch(title)
    row = ROWS.get(element['name'] if element else title)
    if row is not None:
        unit = row.unit
    elif _is_angle(title):
        unit = 's' if title.endswith('.time') else 'rad'
    else:
        unit = UNITS.get(title.partition('.')[0], '')
    words = title.replace('_', ' ') if row is None else title
    return f'{words} [{unit}]' if unit else words
