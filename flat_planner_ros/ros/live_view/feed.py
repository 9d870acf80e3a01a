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

"""News for browsers: the newest values and a bounded past, safe between threads."""

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import islice
from math import isfinite
from threading import Lock
from typing import Any

HISTORY = 12000
"""Rows of a stream that are kept, two minutes at 100 Hz [-]."""

PORTION = 1500
"""Most rows of a stream in one message, so that a past is told without a pause in the present."""

DIGITS = 7
"""Significant digits of a number on the page [-]."""

TIME_DECIMALS = 4
"""Decimals of a row's time [s], which counts from an origin that may be days ago [-]."""


@dataclass
class Cursor:
    """Progress of one browser: the run of the streams, rows of each, values by version."""

    run: int = -1
    rows: dict[str, int] = field(default_factory=dict)
    versions: dict[str, int] = field(default_factory=dict)


class Feed:
    """
    Values that replace each other, and streams of rows that scroll.

    Parameters
    ----------
    streams
        Names of the streams.

    """

    def __init__(self, streams: Iterable[str]) -> None:
        self._lock = Lock()
        self._run = 0
        self._values: dict[str, tuple[int, Any]] = {}
        self._streams = {name: _Stream() for name in streams}

    def put(self, name: str, value: Any) -> None:
        """Replace a value, which is JSON; nothing is told if it is the same."""
        with self._lock:
            version, former = self._values.get(name, (0, None))
            if version == 0 or value != former:
                self._values[name] = version + 1, value

    def append(self, stream: str, row: Sequence[float]) -> None:
        """Add a row to a stream, its time first; undefined numbers become null."""
        time, *others = row
        numbers = [_rounded(time, TIME_DECIMALS, 'f')]
        numbers += [_rounded(x, DIGITS, 'g') for x in others]
        with self._lock:
            self._streams[stream].append(numbers)

    def restart(self) -> None:
        """Forget all streams: another arm, or another time."""
        with self._lock:
            self._run += 1
            for stream in self._streams.values():
                stream.rows.clear()

    def news(self, cursor: Cursor) -> dict[str, Any] | None:
        """
        Return what a browser does not know yet, and note in its cursor that it does.

        Returns
        -------
        dict or None
            ``values`` by name, new rows of ``streams`` by name, and ``restart`` if all former
            rows are void; None without news.

        """
        with self._lock:
            news: dict[str, Any] = {}
            if cursor.run != self._run:
                cursor.run, cursor.rows = self._run, {}
                news['restart'] = True
            values = {}
            for name, (version, value) in self._values.items():
                if cursor.versions.get(name) != version:
                    cursor.versions[name] = version
                    values[name] = value
            if values:
                news['values'] = values
            streams = {}
            for name, stream in self._streams.items():
                rows, cursor.rows[name] = stream.after(cursor.rows.get(name, 0))
                if rows:
                    streams[name] = rows
            if streams:
                news['streams'] = streams
            return news or None


class _Stream:
    """The newest rows and the number of all that there were."""

    def __init__(self) -> None:
        self.rows: deque[list[float | None]] = deque(maxlen=HISTORY)
        self.count = 0

    def append(self, row: list[float | None]) -> None:
        """Add a row, forgetting the oldest."""
        self.rows.append(row)
        self.count += 1

    def after(self, count: int) -> tuple[list[list[float | None]], int]:
        """Return the first rows that are kept after the first `count`, and how many those make."""
        forgotten = self.count - len(self.rows)
        first = max(count, forgotten) - forgotten
        rows = list(islice(self.rows, first, first + PORTION))
        return rows, forgotten + first + len(rows)


def _rounded(x: float, digits: int, form: str) -> float | None:
    """Return a number as short as the page needs it."""
    return float(f'{x:.{digits}{form}}') if isfinite(x) else None
