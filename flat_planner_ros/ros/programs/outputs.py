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

"""What programs write: files, or standard output for the name `-`, which then is theirs alone."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from errno import EISDIR, ENOENT
from os import strerror
from pathlib import Path
import sys
from tempfile import TemporaryDirectory
from typing import TextIO

from flat_planner_ros.core.arm import FlatPlannerError

STANDARD_OUTPUT = '-'
"""Name of an output that is standard output."""


class NotWritten(FlatPlannerError):
    """An output cannot be written; the message says which and why."""


def check_writable(*names: str | Path | None) -> None:
    """
    Refuse outputs that could not be written, before there is anything to write.

    Raises
    ------
    NotWritten
        There is no such folder, or a folder of this name.

    """
    for name in names:
        if name is None or name == STANDARD_OUTPUT:
            continue
        path = Path(name)
        if path.is_dir() or not path.parent.is_dir():
            number = EISDIR if path.is_dir() else ENOENT
            raise NotWritten(f'cannot write {name}: {strerror(number)}')


def summary_stream(*outputs: str | None) -> TextIO:
    """Return where a program tells what it did: not where one of its outputs goes."""
    return sys.stderr if STANDARD_OUTPUT in outputs else sys.stdout


@contextmanager
def open_text(name: str) -> Iterator[TextIO]:
    """
    Open an output for text.

    Raises
    ------
    NotWritten
        The file cannot be written.

    """
    if name == STANDARD_OUTPUT:
        yield sys.stdout
        return
    with _explained(name), open(name, 'w', newline='', encoding='utf-8') as file:
        yield file


def write_through(name: str, write: Callable[[Path], object], suffix: str) -> None:
    """
    Write an output with a function that writes files.

    Parameters
    ----------
    name
        The output.
    write
        Called with the file to write.
    suffix
        Of that file, where the output is standard output.

    Raises
    ------
    NotWritten
        The file cannot be written.

    """
    if name != STANDARD_OUTPUT:
        with _explained(name):
            write(Path(name))
        return
    with TemporaryDirectory() as directory:
        path = Path(directory) / f'output{suffix}'
        write(path)
        sys.stdout.flush()
        sys.stdout.buffer.write(path.read_bytes())


@contextmanager
def _explained(name: str) -> Iterator[None]:
    """Say of an error of the operating system what was being done."""
    try:
        yield
    except OSError as error:
        raise NotWritten(f'cannot write {name}: {error.strerror or error}') from error
