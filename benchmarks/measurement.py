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

"""Times of functions, and tables of results."""

from collections.abc import Callable, Sequence
import gc
from statistics import median
from time import perf_counter
from typing import Any, NamedTuple


class Timing(NamedTuple):
    """
    Times of one function over some calls.

    Attributes
    ----------
    best, median, worst
        Of all calls but the first ones [s].
    count
        Number of calls that were timed [-].

    """

    best: float
    median: float
    worst: float
    count: int

    @classmethod
    def of(cls, times: Sequence[float]) -> 'Timing':
        """Return the summary of some times [s]."""
        return cls(min(times), median(times), max(times), len(times))


class Section(NamedTuple):
    """
    A table of results.

    Attributes
    ----------
    title, header, rows
        Its text; the first column is left-aligned.
    notes : Sequence[str]
        Lines below it.

    """

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    notes: Sequence[str] = ()

    def markdown(self) -> str:
        """Return the table as Markdown, aligned for reading as plain text too."""
        table = [list(self.header), *map(list, self.rows)]
        widths = [max(map(len, column)) for column in zip(*table, strict=True)]
        rule = ['-' * widths[0], *('-' * (width - 1) + ':' for width in widths[1:])]
        lines = [_line(row, widths) for row in (table[0], rule, *table[1:])]
        notes = [f'- {note}' for note in self.notes]
        return '\n'.join([f'## {self.title}', '', *lines, *([''] if notes else []), *notes])


def timing(
    function: Callable[[Any], object],
    arguments: Callable[[], Any] = lambda: None,
    *,
    budget: float = 2.0,
    most: int = 2000,
    warm_up: int = 3,
    least: int = 3,
) -> Timing:
    """
    Return what calls of a function take.

    Parameters
    ----------
    function
        What is timed.
    arguments
        Makes the argument of each call, untimed.
    budget
        Time after which no further call is made [s].
    most, least
        Bounds on the number of calls.
    warm_up
        Calls before the first that counts.

    """
    for _ in range(warm_up):
        function(arguments())
    times: list[float] = []
    end = perf_counter() + budget
    gc.collect()
    gc.disable()
    try:
        while len(times) < least or (len(times) < most and perf_counter() < end):
            argument = arguments()
            start = perf_counter()
            function(argument)
            times.append(perf_counter() - start)
    finally:
        gc.enable()
    return Timing.of(times)


def duration_text(seconds: float) -> str:
    """Return a duration with three digits and its unit."""
    for unit, size in (('s', 1.0), ('ms', 1e-3)):
        if seconds >= size:
            return f'{seconds / size:.3g} {unit}'
    return f'{seconds / 1e-6:.3g} µs'


def verdict(is_met: bool) -> str:
    """Return how a target fares in a table."""
    return 'met' if is_met else 'MISSED'


def _line(cells: Sequence[str], widths: Sequence[int]) -> str:
    """Return a row of a table."""
    first, *others = zip(cells, widths, strict=True)
    padded = [first[0].ljust(first[1]), *(cell.rjust(width) for cell, width in others)]
    return f'| {" | ".join(padded)} |'
