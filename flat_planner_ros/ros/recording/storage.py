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

from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import closing, contextmanager
from io import BytesIO
import os
from pathlib import Path
import re
import sqlite3
import struct
from tempfile import NamedTemporaryFile
from typing import Any, BinaryIO, NamedTuple

from flat_planner_ros.core.arm import FlatPlannerError
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    DataEnd,
    Footer,
    McapRecord,
    Message,
    Metadata,
    Schema,
)
from mcap.stream_reader import get_chunk_data_stream
from zstandard import ZstdDecompressor, ZstdError

MCAP = b'\x89MCAP0\r\n'
"""First bytes of an MCAP file."""

SQLITE = b'SQLite format 3\x00'
"""First bytes of an sqlite3 database."""

ZSTD = b'\x28\xb5\x2f\xfd'
"""First bytes of what `ros2 bag --compression-format zstd` has compressed."""

BLOCK = 1 << 20
"""Size of the pieces in which a file is decompressed [bytes]."""

RECORD = struct.Struct('<BQ')
"""Begin of a record of MCAP: its kind, and the length of what follows."""

MESSAGE = struct.Struct('<HIQQ')
"""Begin of a message: its channel, number, times of arrival and of sending [ns]."""

KINDS: Mapping[Opcode, Any] = {
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.CHUNK: Chunk,
    Opcode.METADATA: Metadata,
    Opcode.DATA_END: DataEnd,
    Opcode.FOOTER: Footer,
}
"""Records of MCAP that are read besides messages."""

ROWS = 4096
"""Messages of a database that are read together."""

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

SPAN = 'SELECT min(timestamp), max(timestamp), count(*) FROM messages'
"""Times of the first and the last message [ns since 1970], and the number of all."""


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


class Span(NamedTuple):
    """Times between which the messages of a part of a file came [ns since 1970]."""

    first: int
    last: int


Item = list[Entry] | Note | Topic | Span
"""What a file has in it."""

Advance = Callable[[float], object]
"""Is told which share of a file has been read since it was last told [-]."""

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


def items(
    path: Path, wanted: Collection[str], complain: Complain, advance: Advance
) -> Iterator[Item]:
    """Yield what a file has in it, as far as it is whole; messages of wanted topics only."""
    try:
        with _decompressed(path, complain) as plain:
            magic = _magic(plain)
            if magic.startswith(MCAP):
                yield from _mcap_items(plain, wanted, advance)
            elif magic.startswith(SQLITE):
                yield from _sqlite_items(plain, wanted, advance)
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


class _Channels:
    """
    What an MCAP file has said of its channels so far.

    Parameters
    ----------
    wanted
        Topics whose messages are read.

    """

    def __init__(self, wanted: Collection[str]) -> None:
        self._wanted = wanted
        self._schemas: dict[int, str] = {}
        self._topics: dict[int, Topic | None] = {}

    def item(self, record: McapRecord | None) -> Item | None:
        """Return what a record says, None for nothing of interest."""
        if isinstance(record, Schema):
            self._schemas[record.id] = record.name
        elif isinstance(record, Channel):
            topic = Topic(record.topic, self._schemas.get(record.schema_id, ''))
            self._topics[record.id] = topic if topic.name in self._wanted else None
            return topic
        elif isinstance(record, Metadata):
            return Note(record.name, record.metadata)
        elif isinstance(record, Message):
            known = self._topics[record.channel_id]
            if known is None:
                return Span(record.log_time, record.log_time)
            return [Entry(*known, record.log_time, record.data)]
        return None

    def in_chunk(self, chunk: Chunk) -> Iterator[Item]:
        """
        Yield what is in a chunk, its messages last.

        The library reads it field by field, which is most of the time of reading a recording.
        """
        stream, size = get_chunk_data_stream(chunk, validate_crc=True)
        yield Span(chunk.message_start_time, chunk.message_end_time)
        data = stream.read(size)
        entries: list[Entry] = []
        place = 0
        while place < size:
            begin = place
            opcode, length = RECORD.unpack_from(data, begin)
            place += RECORD.size + length
            if place > size:
                raise ValueError('a chunk ends within a record')
            if opcode != Opcode.MESSAGE:
                item = self.item(_record(opcode, data[begin + RECORD.size : place]))
                if item is not None:
                    yield item
            elif self._wanted:
                channel, _, time, _ = MESSAGE.unpack_from(data, begin + RECORD.size)
                topic = self._topics[channel]
                if topic is not None:
                    message = data[begin + RECORD.size + MESSAGE.size : place]
                    entries.append(Entry(topic.name, topic.kind, time, message))
        yield entries


def _record(opcode: int, content: bytes) -> McapRecord | None:
    """Return a record, None for one of a kind without interest."""
    for kind, record in KINDS.items():
        if kind == opcode:
            stream = ReadDataStream(BytesIO(content))
            read: McapRecord = record.read(stream)
            return read
    if opcode == Opcode.MESSAGE:
        message: McapRecord = Message.read(ReadDataStream(BytesIO(content)), len(content))
        return message
    return None


def _mcap_records(file: BinaryIO, size: int) -> Iterator[McapRecord]:
    """
    Yield the records of an MCAP file of some size, from its start: the index may be missing.

    The library would read the numbers of its index one by one.
    """
    stream = ReadDataStream(file, calculate_crc=True)
    opcode = 0
    while opcode != Opcode.FOOTER:
        if stream.count == 0:
            stream.read(len(MCAP))
        checksum = stream.checksum()
        opcode, length = stream.read1(), stream.read8()
        if length > size - stream.count:
            raise EOFError
        record = _record(opcode, stream.read(length))
        if isinstance(record, DataEnd) and record.data_section_crc not in (0, checksum):
            raise ValueError('the checksum of the data is wrong')
        if record is not None:
            yield record


def _mcap_items(path: Path, wanted: Collection[str], advance: Advance) -> Iterator[Item]:
    """Yield what an MCAP file has in it."""
    channels = _Channels(wanted)
    with path.open('rb') as file:
        size, told = os.fstat(file.fileno()).st_size, 0
        for record in _mcap_records(file, size):
            if isinstance(record, Chunk):
                yield from channels.in_chunk(record)
                advance((file.tell() - told) / size)
                told = file.tell()
                continue
            item = channels.item(record)
            if item is not None:
                yield item


def _sqlite_items(path: Path, wanted: Collection[str], advance: Advance) -> Iterator[Item]:
    """Yield what a database has in it; it is not changed, not even to repair it."""
    address = f'{path.resolve().as_uri()}?mode=ro&immutable=1'
    with closing(sqlite3.connect(address, uri=True)) as database:
        database.text_factory = lambda text: text.decode('utf-8', 'replace')
        for name, kind in database.execute('SELECT name, type FROM topics'):
            yield Topic(str(name), str(kind))
        first, last, count = database.execute(SPAN).fetchone()
        if not count:
            return
        yield Span(int(first), int(last))
        rows = database.execute(MESSAGES)
        while some := rows.fetchmany(ROWS):
            advance(len(some) / count)
            yield [
                Entry(name, kind, int(time), _unpacked(bytes(data)))
                for name, kind, time, data in some
                if name in wanted
            ]


def _unpacked(message: bytes) -> bytes:
    """Return a message without compression."""
    return ZstdDecompressor().decompress(message) if message.startswith(ZSTD) else message
