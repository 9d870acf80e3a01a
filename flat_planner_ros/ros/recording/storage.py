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

"""Files with recorded messages, known by their content: MCAP and sqlite3, compressed or not."""

from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
import re
import sqlite3
import struct
from tempfile import NamedTemporaryFile
from typing import NamedTuple

from flat_planner_ros.core.arm import FlatPlannerError
from mcap.exceptions import McapError
from mcap.records import Channel, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from zstandard import ZstdDecompressor, ZstdError

MCAP = b'\x89MCAP0\r\n'
"""First bytes of an MCAP file."""

SQLITE = b'SQLite format 3\x00'
"""First bytes of an sqlite3 database."""

ZSTD = b'\x28\xb5\x2f\xfd'
"""First bytes of what `ros2 bag --compression-format zstd` has compressed."""

BLOCK = 1 << 20
"""Size of the pieces in which a file is decompressed [bytes]."""

DAMAGES = (
    *(McapError, ZstdError, struct.error, EOFError),
    *(ValueError, LookupError, OverflowError, MemoryError),
)
"""Errors of the libraries where a file is cut short or spoilt."""

MESSAGES = (
    'SELECT topics.name, topics.type, messages.timestamp, messages.data '
    'FROM messages JOIN topics ON messages.topic_id = topics.id ORDER BY messages.id'
)
"""All messages of a bag in an sqlite3 database."""


class UnreadableRecording(FlatPlannerError):
    """A file that is no recording; the message says why."""


class Entry(NamedTuple):
    """A message: its topic and type, when it came [ns since 1970], and itself, serialised."""

    topic: str
    kind: str
    time: int
    message: bytes


class Note(NamedTuple):
    """A metadata record: its name and its values."""

    name: str
    values: dict[str, str]


class Topic(NamedTuple):
    """A topic with its type, known before its first message."""

    name: str
    kind: str


Item = Entry | Note | Topic
"""What a file has in it."""

Complain = Callable[[str], object]
"""Is told where and why reading ends early."""


def storage_files(path: Path) -> list[Path]:
    """
    Return the files of a recording: itself, or those in a directory, in the order of their names.

    Raises
    ------
    UnreadableRecording
        There is no such file, or none that holds messages.

    """
    try:
        files = [path]
        if path.is_dir():
            files = sorted((each for each in path.iterdir() if each.is_file()), key=_in_order)
        found = [each for each in files if _magic(each).startswith((MCAP, SQLITE, ZSTD))]
    except OSError as error:
        raise UnreadableRecording(f'cannot read {path}: {error.strerror}') from error
    if not found:
        what = 'holds no MCAP file and no' if path.is_dir() else 'is no MCAP file and no'
        raise UnreadableRecording(f'{path} {what} sqlite3 bag, by its content')
    return found


def items(path: Path, complain: Complain) -> Iterator[Item]:
    """Yield what a file has in it, as far as it is whole."""
    try:
        with _decompressed(path, complain) as plain:
            magic = _magic(plain)
            if magic.startswith(MCAP):
                yield from _mcap_items(plain)
            elif magic.startswith(SQLITE):
                yield from _sqlite_items(plain)
            else:
                complain('what has been compressed is no recording')
    except (*DAMAGES, sqlite3.Error) as error:
        complain(' '.join(str(error).split()) or 'the file ends early')
    except OSError as error:
        raise UnreadableRecording(f'cannot read {path}: {error.strerror}') from error


def _in_order(path: Path) -> list[str | int]:
    """Return a key that puts part 10 of a bag behind part 9."""
    parts = re.split(r'(\d+)', path.name)
    return [int(part) if part.isdigit() else part for part in parts]


def _magic(path: Path) -> bytes:
    """Return the first bytes of a file."""
    with path.open('rb') as file:
        return file.read(len(SQLITE))


@contextmanager
def _decompressed(path: Path, complain: Complain) -> Iterator[Path]:
    """Provide a file without compression; of a damaged one what comes before the damage."""
    if not _magic(path).startswith(ZSTD):
        yield path
        return
    with NamedTemporaryFile() as plain:
        with path.open('rb') as packed:
            reader = ZstdDecompressor().stream_reader(packed, read_across_frames=True)
            try:
                while block := reader.read(BLOCK):
                    plain.write(block)
            except ZstdError as error:
                complain(f'compressed data: {error}')
        plain.flush()
        yield Path(plain.name)


def _mcap_items(path: Path) -> Iterator[Item]:
    """Yield what an MCAP file has in it, from its start: the index may be missing."""
    schemas: dict[int, str] = {}
    topics: dict[int, Topic] = {}
    for record in _mcap_records(path):
        if isinstance(record, Schema):
            schemas[record.id] = record.name
        elif isinstance(record, Channel):
            topics[record.id] = Topic(record.topic, schemas.get(record.schema_id, ''))
            yield topics[record.id]
        elif isinstance(record, Metadata):
            yield Note(record.name, record.metadata)
        elif isinstance(record, Message):
            yield Entry(*topics[record.channel_id], record.log_time, record.data)


def _mcap_records(path: Path) -> Iterator[McapRecord]:
    """Yield the records of an MCAP file."""
    with path.open('rb') as file:
        yield from StreamReader(file, validate_crcs=True).records


def _sqlite_items(path: Path) -> Iterator[Item]:
    """Yield what a database has in it; it is not changed, not even to repair it."""
    address = f'{path.resolve().as_uri()}?mode=ro&immutable=1'
    with closing(sqlite3.connect(address, uri=True)) as database:
        database.text_factory = lambda text: text.decode('utf-8', 'replace')
        for name, kind in database.execute('SELECT name, type FROM topics'):
            yield Topic(str(name), str(kind))
        for name, kind, time, data in database.execute(MESSAGES):
            message = bytes(data)
            if message.startswith(ZSTD):
                message = ZstdDecompressor().decompress(message)
            yield Entry(str(name), str(kind), int(time), message)
