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
The table of a study in a file, chunk by chunk, so that what is done is never lost.

A CSV file grows by whole chunks, and a small file beside it says which study it is from: after an
interruption, the same command goes on behind the last whole chunk. A Parquet file is made of such
a CSV file when all rows are there, as it cannot be read before its end is written.
"""

from collections.abc import Iterator, Sequence
import csv
from dataclasses import dataclass
import io
import json
from math import isnan, nan
import os
from pathlib import Path
from typing import Any, TextIO

from flat_planner_ros.core.arm import FlatPlannerError
from flat_planner_ros.core.study import ACCEPTED, Column, Study, Table
from flat_planner_ros.ros.wire import interfaces
from flat_planner_ros.version import version_line

PARQUET = '.parquet'
"""Suffix of a name that asks for such a file."""

VERDICT, CODE = 'verdict', 'code'
"""Columns of the verdict, and of its number in `~/status`, which is empty for other errors."""

CODES = {ACCEPTED: 0, **{reason.value: code for reason, code in interfaces.ERROR_CODES.items()}}
"""Numbers of verdicts."""

FINGERPRINT = b'study'
"""Key in the metadata of a Parquet file under which it says what it is of."""

BLOCK = 1 << 20
"""Bytes that are read at a time."""


class OtherStudy(FlatPlannerError):
    """A file has rows of another study; the message says what to do."""


def titles_of(study: Study) -> list[str]:
    """Return the titles of a table's columns."""
    return [t for title in study.titles for t in ((title, CODE) if title == VERDICT else (title,))]


def text_of(table: Table) -> str:
    """Return rows as lines of CSV, empty where there is no number."""
    columns = []
    for title, values in table.items():
        columns.append(_cells(values))
        if title == VERDICT:
            columns.append([CODES.get(verdict, '') for verdict in values.tolist()])
    file = io.StringIO(newline='')
    csv.writer(file, lineterminator='\n').writerows(zip(*columns, strict=True))
    return file.getvalue()


def _cells(values: Column) -> list[Any]:
    """Return what stands in the cells of a column."""
    cells = values.tolist()
    if values.dtype == float:
        return ['' if isnan(cell) else cell for cell in cells]
    return [_cell(cell) for cell in cells]


def _cell(value: Any) -> Any:
    """Return what stands in a cell that is no number."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return ' '.join(map(str, value))
    return '' if value is None else value


@dataclass(frozen=True, kw_only=True)
class Lines:
    """
    Makes the rows of a study as lines of CSV, so that whoever does the work does this too.

    Attributes
    ----------
    study
        The study.

    """

    study: Study

    def __call__(self, first: int, stop: int) -> str:
        """Return the lines of the rows from one to before another."""
        return text_of(self.study(first, stop))


class ResultFile:
    """
    The table of a study as it grows.

    Parameters
    ----------
    path
        The CSV file.
    study
        What is written.
    fingerprint
        Of the study.
    is_fresh
        Whether what is there is thrown away.

    Raises
    ------
    OtherStudy
        What is there is another study's, or no table.
    OSError
        The file cannot be read or written.

    """

    def __init__(self, path: Path, study: Study, fingerprint: str, *, is_fresh: bool) -> None:
        self._path, self._study = path, study
        self._mark = _mark_of(path)
        header = self._header = ','.join(titles_of(study)) + '\n'
        self.done = 0
        """Rows that are there."""
        if not is_fresh and path.exists() and path.stat().st_size:
            self._check(fingerprint)
            self.done = self._keep_whole_chunks(header)
        else:
            mark = {
                'fingerprint': fingerprint,
                'rows': study.count,
                'chunk': study.chunk,
                'version': version_line(),
            }
            path.write_text(header, encoding='utf-8')
            self._mark.write_text(json.dumps(mark, indent=1) + '\n', encoding='utf-8')
        self._file: TextIO = path.open('a', encoding='utf-8', newline='')

    def add(self, lines: str) -> None:
        """Write the rows of a chunk, all of them at once."""
        self._file.write(lines)
        self._file.flush()
        self.done += lines.count('\n')

    def close(self) -> None:
        """Write no more; what an interrupt has left of a chunk is cut off."""
        self._file.close()
        if self.done < self._study.count:
            self.done = self._keep_whole_chunks(self._header)

    def _check(self, fingerprint: str) -> None:
        """Refuse a file that another study has made."""
        remedy = 'give another name, or --fresh to write it anew'
        try:
            mark = json.loads(self._mark.read_text(encoding='utf-8'))
        except (OSError, ValueError):
            raise OtherStudy(
                f'{self._path} is there, and no {self._mark.name} says which study it is from: '
                f'{remedy}'
            ) from None
        if mark.get('fingerprint') != fingerprint:
            raise OtherStudy(
                f'{self._path} has rows of a study that was another one, or made by another '
                f'version ({mark.get("version", "unknown")}): {remedy}'
            )

    def _keep_whole_chunks(self, header: str) -> int:
        """Cut off what is behind the last whole chunk; return the rows that are left."""
        chunk, count = self._study.chunk, self._study.count
        rows, keep, end = -1, 0, len(header.encode())
        with self._path.open('rb') as file:
            if file.read(end) != header.encode():
                raise OtherStudy(f'{self._path} has other columns: give another name, or --fresh')
            keep, rows = end, 0
            for place, line in enumerate(_line_ends(file, end), start=1):
                if place % chunk == 0 or place == count:
                    keep, rows = line, place
        if keep < self._path.stat().st_size:
            os.truncate(self._path, keep)
        return rows


def _line_ends(file: io.BufferedReader, start: int) -> Iterator[int]:
    """Return where the lines of a file end, from a place on."""
    place = start
    while block := file.read(BLOCK):
        found = block.find(b'\n')
        while found >= 0:
            yield place + found + 1
            found = block.find(b'\n', found + 1)
        place += len(block)


def _mark_of(path: Path) -> Path:
    """Return the file that says which study a table is from."""
    return path.with_name(f'{path.name}.study')


def remove(path: Path) -> None:
    """Remove a table and what says where it is from."""
    path.unlink(missing_ok=True)
    _mark_of(path).unlink(missing_ok=True)


def write_parquet(source: Path, target: Path, study: Study, fingerprint: str) -> None:
    """
    Write a whole CSV table as Parquet, part by part.

    Parameters
    ----------
    source, target
        The files.
    study
        What is in them.
    fingerprint
        Of the study, which the file keeps.

    """
    # Imported here: an extra.
    import pyarrow as pa
    from pyarrow import csv as reader
    from pyarrow import parquet

    first = study(0, 1)
    whole = {'row': pa.int64(), CODE: pa.int16()}
    numbers = {t: pa.float64() for t, values in first.items() if values.dtype == float}
    types = {title: {**numbers, **whole}.get(title, pa.string()) for title in titles_of(study)}
    schema = pa.schema(list(types.items()), metadata={FINGERPRINT: fingerprint.encode()})
    options = reader.ConvertOptions(column_types=schema, null_values=[''])
    with (
        reader.open_csv(source, convert_options=options) as table,
        parquet.ParquetWriter(target, schema) as writer,
    ):
        for batch in table:
            writer.write_batch(batch)


def is_parquet_of(path: Path, fingerprint: str) -> bool:
    """Tell whether a file is there and has the whole table of a study."""
    if not path.exists():
        return False
    # Imported here: an extra.
    from pyarrow import parquet

    metadata = parquet.read_schema(path).metadata or {}
    if metadata.get(FINGERPRINT) != fingerprint.encode():
        raise OtherStudy(
            f'{path} is of another study: give another name, or --fresh to write it anew'
        )
    return True


def cells_of(path: Path, titles: Sequence[str]) -> Iterator[tuple[Any, ...]]:
    """
    Return some cells of each row: numbers as floats, empty ones as NaN in columns of numbers.

    Raises
    ------
    OtherStudy
        There is no such column.

    """
    rows = _parquet_rows(path) if path.suffix == PARQUET else _csv_rows(path)
    known = next(rows)
    for title in titles:
        if title not in known:
            raise OtherStudy(f'there is no column {title}; there are {", ".join(known)}')
    places = [known.index(title) for title in titles]
    for row in rows:
        yield tuple(row[place] for place in places)


def _csv_rows(path: Path) -> Iterator[list[Any]]:
    """Return the titles, and then the cells of each row."""
    with path.open(encoding='utf-8', newline='') as file:
        yield from csv.reader(file)


def _parquet_rows(path: Path) -> Iterator[list[Any]]:
    """Return the same of a Parquet file."""
    # Imported here: an extra.
    from pyarrow import parquet

    file = parquet.ParquetFile(path)
    yield file.schema_arrow.names
    for batch in file.iter_batches():
        for row in zip(*(column.to_pylist() for column in batch.columns), strict=True):
            yield ['' if cell is None else cell for cell in row]


def values_of(cells: Sequence[Any]) -> list[Any]:
    """Return a column's cells as numbers where all that are not empty are numbers."""
    try:
        return [float(cell) if cell != '' else nan for cell in cells]
    except ValueError:
        return list(cells)
