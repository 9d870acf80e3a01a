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

"""Recordings: one MCAP file as `ros2 bag` and Foxglove have it, written and read again."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from heapq import merge
from itertools import chain, islice
import json
from operator import attrgetter
from pathlib import Path
from typing import Any

from flat_planner_ros.ros.recording.storage import (
    Entry,
    items,
    Note,
    Span,
    storage_files,
    Topic,
)
from flat_planner_ros.ros.wire.message_types import message_class
from mcap.well_known import MessageEncoding, Profile, SchemaEncoding
from mcap.writer import CompressionType, Writer
from rclpy.duration import Duration
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message

PARAMETERS = 'flat_planner_ros parameters'
"""Name of the metadata records that hold the parameters of a node, as they were at a time."""

OFFERED = 'offered_qos_profiles'
"""Key of a channel's metadata under which `ros2 bag play` finds qualities of service."""

CHUNK_SIZE = 256 * 1024
"""Size of the pieces that are compressed together, before compression [bytes]."""

REORDERED = 1024
"""Messages among which they are brought into the order of time; memory does not grow with more."""

_TIME = attrgetter('time')

UNREADABLE = (rclpy_implementation.RMWError, ValueError, MemoryError)
"""Errors of a message that is not what its type says."""


class RecordingWriter:
    """
    Writes serialised messages.

    Parameters
    ----------
    path
        File to write.
    overwrite
        Replace a file that exists.

    Raises
    ------
    OSError
        In any method: the file cannot be written.

    """

    def __init__(self, path: Path, *, overwrite: bool = False) -> None:
        self._file = path.open('wb' if overwrite else 'xb')
        self._writer: Writer | None = Writer(
            self._file, chunk_size=CHUNK_SIZE, compression=CompressionType.ZSTD
        )
        self._writer.start(profile=Profile.ROS2)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._counts: dict[str, int] = {}
        self._span: tuple[int, int] | None = None

    @property
    def summary(self) -> str:
        """Return the numbers of messages and topics, and the time they span."""
        messages = sum(self._counts.values())
        first, last = self._span or (0, 0)
        return f'{messages} messages on {len(self._counts)} topics, {(last - first) * 1e-9:.1f} s'

    def knows(self, topic: str) -> bool:
        """Return whether a topic has been added."""
        return topic in self._channels

    def add_topic(self, topic: str, kind: str, schema: str, offered: Sequence[QoSProfile]) -> None:
        """
        Add a topic.

        Parameters
        ----------
        topic, kind
            Absolute name, and type as in ``sensor_msgs/msg/JointState``.
        schema
            Definition of the type with all that it is made of.
        offered
            Qualities of service of its publishers.

        """
        if kind not in self._schemas:
            data = schema.encode()
            self._schemas[kind] = self._open.register_schema(kind, SchemaEncoding.ROS2, data)
        qualities = '\n'.join(map(_offer, offered))
        self._channels[topic] = self._open.register_channel(
            topic, MessageEncoding.CDR, self._schemas[kind], {OFFERED: qualities}
        )

    def write(self, topic: str, time: int, message: bytes) -> None:
        """Add a message of a known topic that came at a time [ns since 1970]."""
        count = self._counts.get(topic, 0)
        self._open.add_message(self._channels[topic], time, message, time, sequence=count)
        self._counts[topic] = count + 1
        self._span = (self._span[0] if self._span else time, time)

    def note(self, name: str, values: Mapping[str, str]) -> None:
        """Add a metadata record."""
        self._open.add_metadata(name, dict(values))

    def flush(self) -> None:
        """Give everything so far to the operating system: a killed process loses no more."""
        self._open.flush()

    def close(self) -> None:
        """Write the index and close the file; without effect on a closed one."""
        if self._writer is not None:
            self._writer.finish()
            self._writer = None
            self._file.close()

    def abandon(self) -> None:
        """Close the file as it is."""
        self._writer = None
        # The descriptor alone: the buffered rest cannot be written, or it would be by now.
        self._file.raw.close()

    @property
    def _open(self) -> Writer:
        """Return the writer of a file that is still open."""
        if self._writer is None:
            raise OSError('the recording has ended')
        return self._writer


class Recording:
    """
    A recording to be read.

    Parameters
    ----------
    path
        MCAP file or sqlite3 bag of any name, compressed or not, complete or cut short, or a
        directory with such files.
    advance
        Is told while messages are read which share of a file has been read since it was last told.

    Attributes
    ----------
    topics
        Types of the topics by name.
    parameters : list[tuple]
        Parameters of nodes: time [ns since 1970], name with namespace, JSON text of the values.
    files
        The files in the order of their first messages.
    damage
        What is not whole, as far as has been read; empty for a complete recording.

    Raises
    ------
    UnreadableRecording
        The path is neither.

    """

    def __init__(self, path: Path, advance: Callable[[float], object] = float) -> None:
        self._advance = advance
        self._damages: list[str] = []
        self._damaged: set[tuple[str, int]] = set()
        self.topics: dict[str, str] = {}
        self.parameters: list[tuple[int, str, str]] = []
        spans = {file: self._looked_through(file) for file in storage_files(path)}
        self.files = sorted(spans, key=lambda file: spans[file])
        self._spans = [spans[file] for file in self.files]

    @property
    def damage(self) -> str:
        """Return what is not whole, a clause; empty for a complete recording."""
        damages = list(self._damages)
        if self._damaged:
            topics = ', '.join(sorted({topic for topic, _ in self._damaged}))
            damages.append(f'{len(self._damaged)} messages cannot be read, on {topics}')
        return '; '.join(damages)

    def entries(self, topics: Collection[str]) -> Iterator[Entry]:
        """
        Yield the messages of some topics in the order of their arrival.

        One that stands more than REORDERED messages from its place in time comes out of order.
        """
        return chain.from_iterable(self.batches(topics))

    def batches(self, topics: Collection[str]) -> Iterator[Sequence[Entry]]:
        """Yield the messages of some topics in order, some at a time."""
        for files in self._files_at_a_time():
            ordered = [self._ordered(file, topics) for file in files]
            if len(ordered) == 1:
                yield from ordered[0]
            else:
                merged = merge(*map(chain.from_iterable, ordered), key=_TIME)
                while batch := list(islice(merged, REORDERED)):
                    yield batch

    def messages(self, topics: Collection[str]) -> Iterator[tuple[Entry, Any]]:
        """Yield the entries of some topics with their messages; damaged ones are counted."""
        for entry in self.entries(topics):
            msg = self.read(entry)
            if msg is not None:
                yield entry, msg

    def read(self, entry: Entry) -> Any:
        """Return the message of an entry; None for a damaged one, which is counted."""
        try:
            return deserialize_message(entry.message, message_class(entry.kind))
        except UNREADABLE:
            self._damaged.add((entry.topic, entry.time))
            return None

    def _looked_through(self, file: Path) -> Span:
        """Note what a file has besides messages; return when they came."""
        spans: list[Span] = []
        for item in items(file, (), self._complain, float):
            if isinstance(item, Topic):
                self.topics[item.name] = item.kind
            elif isinstance(item, Note) and item.name == PARAMETERS:
                self._keep_parameters(item.values)
            elif isinstance(item, Span):
                spans = [_joined(item, *spans)]
        return spans[0] if spans else Span(0, 0)

    def _files_at_a_time(self) -> Iterator[list[Path]]:
        """Yield the files, those together whose messages came at the same time."""
        together: list[Path] = []
        until = 0
        for file, span in zip(self.files, self._spans, strict=True):
            if together and span.first > until:
                yield together
                together = []
            together.append(file)
            until = max(until, span.last)
        yield together

    def _ordered(self, file: Path, topics: Collection[str]) -> Iterator[list[Entry]]:
        """Yield the messages of a file in the order of time, some at a time."""
        waiting: list[Entry] = []
        for item in items(file, topics, self._complain, self._advance):
            if not isinstance(item, list):
                continue
            waiting += item
            if len(waiting) >= 2 * REORDERED:
                waiting.sort(key=_TIME)
                yield waiting[:-REORDERED]
                del waiting[:-REORDERED]
        yield sorted(waiting, key=_TIME)

    def _complain(self, damage: str) -> None:
        """Keep a damage, once."""
        if damage not in self._damages:
            self._damages.append(damage)

    def _keep_parameters(self, values: Mapping[str, str]) -> None:
        """Keep the parameters of a node, if the record is whole."""
        try:
            known = int(values['time']), values['node'], values['values']
            dict(json.loads(known[2]))
        except (ValueError, LookupError, TypeError):
            self._complain('parameters of a node cannot be read')
            return
        self.parameters.append(known)


def _joined(*spans: Span) -> Span:
    """Return the span of several."""
    return Span(min(span.first for span in spans), max(span.last for span in spans))


def _offer(quality: QoSProfile) -> str:
    """Return qualities of service as `ros2 bag` notes them (rosbag2 metadata, version 9)."""
    lines = {
        'history': quality.history.short_key,
        'depth': quality.depth,
        'reliability': quality.reliability.short_key,
        'durability': quality.durability.short_key,
        'deadline': _time(quality.deadline),
        'lifespan': _time(quality.lifespan),
        'liveliness': quality.liveliness.short_key,
        'liveliness_lease_duration': _time(quality.liveliness_lease_duration),
        'avoid_ros_namespace_conventions': str(quality.avoid_ros_namespace_conventions).lower(),
    }
    return '- ' + '\n  '.join(f'{key}: {value}' for key, value in lines.items())


def _time(duration: Duration) -> str:
    """Return a duration as `ros2 bag` notes it."""
    seconds, nanoseconds = divmod(duration.nanoseconds, 10**9)
    return f'{{sec: {seconds}, nsec: {nanoseconds}}}'
