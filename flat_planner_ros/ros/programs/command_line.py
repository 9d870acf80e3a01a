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
The one grammar of the programs' command lines, and a word on missing libraries.

`JOINT=RAD` is the angle of a joint, `--params-file` a parameter file, `--plot` a figure, `-`
standard output, wherever they occur.
"""

from argparse import Action, ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Iterable, Mapping, Sequence
from importlib.util import find_spec
from math import inf, nan
import os
from pathlib import Path
from shutil import which
import sys
from typing import Any

from flat_planner_ros.core.arm import FlatPlannerError, FloatArray
from flat_planner_ros.ros.programs.angles import angle_of, FORMS
from flat_planner_ros.ros.programs.outputs import STANDARD_OUTPUT
from flat_planner_ros.version import ShowVersion
import numpy as np

ANIMATION_SUFFIXES = ('.gif', '.mp4')
"""Kinds of moving pictures."""

FIGURE_SUFFIXES = ('.png', '.pdf', '.svg')
"""Suffixes of figures, which decide what is drawn."""

COMPLETION = '_ARGCOMPLETE'
"""Environment variable that a shell sets when it asks for completions."""


def parsed(
    parser: ArgumentParser, args: Sequence[str] | None, outputs: Sequence[str] = ()
) -> Namespace:
    """
    Return the options on a command line, of a parser that gets `--version` and completion.

    Parameters
    ----------
    parser
        Parser of all options but `--version`.
    args
        Command line without the program's name; the process's own by default.
    outputs
        Names of the options that name outputs, of which one may be `-`. No two of them are one
        file, and none is a file that is read.

    """
    parser.add_argument('--version', action=ShowVersion)
    if COMPLETION in os.environ and find_spec('argcomplete') is not None:
        # Imported here: argcomplete is an extra.
        from argcomplete import autocomplete

        autocomplete(parser)
    options = parser.parse_args(args)
    written = [str(getattr(options, name)) for name in outputs if getattr(options, name)]
    if written.count(STANDARD_OUTPUT) > 1:
        parser.error('only one output can be -, standard output')
    files = [Path(name).absolute() for name in written if name != STANDARD_OUTPUT]
    for index, path in enumerate(files):
        if path in files[:index]:
            parser.error(f'two outputs would be one file, {path}')
        if path in _inputs(options):
            parser.error(f'{path} is read, and would be overwritten')
    return options


def _inputs(options: Namespace) -> list[Path]:
    """Return the files that are read, by the names that their options have in all programs."""
    given = [getattr(options, name, None) for name in ('params_file', 'file', 'files', 'spec')]
    listed = [
        name for each in given if each for name in (each if isinstance(each, list) else [each])
    ]
    return [Path(name).absolute() for name in listed]


def number_above_zero(text: str) -> float:
    """Return a number above 0."""
    return _above_zero(text, 'number above 0, e.g. 1.5')


def seconds(text: str) -> float:
    """Return a time above 0 [s]."""
    return _above_zero(text, 'time above 0 in seconds, e.g. 1.5')


def _above_zero(text: str, what: str) -> float:
    """Return a finite number above 0; else say what is wanted."""
    try:
        number = float(text)
    except ValueError:
        number = nan
    if not 0.0 < number < inf:
        raise ArgumentTypeError(f'{text!r} is no {what}')
    return number


class JointAngles(Action):
    """Collects angles by joint; a joint that is given twice is an error with its name."""

    def __call__(
        self,
        parser: ArgumentParser,
        namespace: Namespace,
        values: Any,
        _option: str | None = None,
    ) -> None:
        """Take the angles of one occurrence."""
        try:
            known = getattr(namespace, self.dest) or {}
            setattr(namespace, self.dest, by_joint([*known.items(), *values]))
        except ArgumentTypeError as error:
            parser.error(f'{" ".join(self.option_strings) or "goal"}: {error}')


def joint_angle(text: str) -> tuple[str, float]:
    """Return a joint and its angle [rad] of `JOINT=RAD`, which may be written as in `angle_of`."""
    name, separator, value = text.partition('=')
    try:
        if name and separator:
            return name, angle_of(value)
    except ValueError:
        pass
    raise ArgumentTypeError(f'{text!r} is not JOINT=RAD, e.g. joint1={FORMS}')


def by_joint(angles: Iterable[tuple[str, float]]) -> dict[str, float]:
    """Return angles by joint [rad]; ArgumentTypeError names a joint that is given twice."""
    found: dict[str, float] = {}
    for name, angle in angles:
        if name in found:
            raise ArgumentTypeError(f'{name} is given twice: {found[name]:g} and {angle:g}')
        found[name] = angle
    return found


def via_point(text: str) -> tuple[dict[str, float], float]:
    """Return a pose by joint [rad] and its time, 0 where it is left open [s]."""
    pose, separator, time = text.partition('@')
    try:
        return by_joint(map(joint_angle, pose.split(','))), float(time) if separator else 0.0
    except ValueError:
        raise ArgumentTypeError(f'{time!r} in {text!r} is no time in seconds') from None


def pose_of(angles: Mapping[str, float], joints: Sequence[str], what: str) -> FloatArray:
    """
    Return the angles of all joints, 0 where none is given [rad].

    Raises
    ------
    FlatPlannerError
        The arm has no such joint; the message begins with `what`.

    """
    for name in angles:
        if name not in joints:
            raise FlatPlannerError(
                f'{what}: unknown joint {name!r}; the arm has {", ".join(joints)}'
            )
    return np.array([angles.get(name, 0.0) for name in joints])


def figure_name(text: str) -> str:
    """Return the name of a figure whose suffix says what to draw."""
    if text == STANDARD_OUTPUT or (
        Path(text).suffix in FIGURE_SUFFIXES and not Path(text).is_dir()
    ):
        return text
    raise ArgumentTypeError(
        f'{text!r} is no file name that ends in {", ".join(FIGURE_SUFFIXES)}, nor - (a PNG)'
    )


def animation_name(text: str) -> str:
    """
    Return the name of a moving picture whose suffix says what to write.

    Raises
    ------
    ArgumentTypeError
        No such suffix, or a film where there is no ffmpeg to make it.

    """
    suffix = Path(text).suffix
    if suffix not in ANIMATION_SUFFIXES or Path(text).is_dir():
        raise ArgumentTypeError(
            f'{text!r} is no file name that ends in {", ".join(ANIMATION_SUFFIXES)}'
        )
    if suffix != '.gif' and which('ffmpeg') is None:
        raise ArgumentTypeError(f'{text!r} needs ffmpeg, which is not installed; a .gif does not')
    return text


def explain_os(error: OSError) -> str:
    """Return what the operating system complains about, without its number."""
    reason = error.strerror or str(error)
    return f'{error.filename}: {reason}' if error.filename else reason


def split_arguments(args: Sequence[str]) -> tuple[list[str], list[str]]:
    """
    Return a program's own arguments, and its name with the arguments for ROS.

    Parameters
    ----------
    args
        Whole command line; what follows ``--ros-args``, up to ``--`` if there is one, is for ROS.

    """
    program, rest = args[0], list(args[1:])
    if '--ros-args' not in rest:
        return rest, [program]
    start = rest.index('--ros-args')
    end = rest.index('--', start) if '--' in rest[start:] else len(rest)
    return rest[:start] + rest[end + 1 :], [program, *rest[start:end]]


def explain_missing(error: ImportError, extra: str) -> int:
    """Say which extra a missing library comes with; return the exit code."""
    library = (error.name or 'a library').partition('.')[0]
    print(f'{library} is not installed: {_remedy(library, extra)}', file=sys.stderr)
    return 1


def missing_for_plot(*paths: str | None) -> str:
    """Return what figures need that is not installed, empty if nothing or no figure."""
    if not any(paths) or find_spec('matplotlib') is not None:
        return ''
    return f'figures need matplotlib: {_remedy("matplotlib", "plot")}'


def _remedy(library: str, extra: str) -> str:
    """Return how a library comes in, from the checkout or by itself."""
    return f"pip install '.[{extra}]' in the checkout, or {library} itself"
