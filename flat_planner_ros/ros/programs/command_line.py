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

"""Shared by the optional programs: their command lines, and a word on missing libraries."""

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
import sys


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
    remedy = f'pip install "flat_planner_ros[{extra}]", or {library} itself'
    print(f'{library} is not installed: {remedy}', file=sys.stderr)
    return 1


def missing_for_plot(path: Path | None) -> str:
    """Return what a figure needs that is not installed, empty if nothing or no figure."""
    if path is None or find_spec('matplotlib') is not None:
        return ''
    return '--plot needs matplotlib: pip install "flat_planner_ros[plot]"'
