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

from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
import struct
from typing import NamedTuple

from flat_planner_ros.core.arm import FlatPlannerError
from mcap.exceptions import McapError
from mcap.records import Channel, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.well_known import MessageEncoding, Profile, SchemaEncoding
from mcap.writer import CompressionType, Writer
from rclpy.duration import Duration
from rclpy.qos import QoSProfile
from zstandard import ZstdError

PARAMETERS = 'flat_planner_ros parameters'
"""Name of the metadata records that hold the parameters of a node, as they were at a time."""

OFFERED = 'offered_qos_profiles'
"""Key of a channel's metadata under which `ros2 bag play` finds qualities of service."""

CHUNK_SIZE = 256 * 1024
"""Size of the pieces that are compressed together, before compression [bytes]."""


DAMAGES = (McapError, ZstdError, struct.error, ValueError, LookupError)
"""Errors of the library where a file is cut short or spoilt."""


class UnreadableRecording(FlatPlannerError):
    """A file that is no recording; the message says why."""


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


class Entry(NamedTuple):
    """A message: its topic and type, when it came [ns since 1970], and itself, serialised."""

    topic: str
    kind: str
    time: int
    message: bytes


class Recording:
    """
    A recording to be read.

    Parameters
    ----------
    path
        MCAP file, complete or cut short; or, with the library `rosbags`, any directory or file
        that `ros2 bag` writes.

    Attributes
    ----------
    topics
        Types of the topics by name.
    parameters : list[tuple]
        Parameters of nodes: time [ns since 1970], name with namespace, JSON text of the values.
    damage
        Place and reason at which reading ends early, empty for a complete recording.

    Raises
    ------
    UnreadableRecording
        The path is neither.

    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.topics: dict[str, str] = {}
        self.parameters: list[tuple[int, str, str]] = []
        self.damage = ''
        self._is_mcap = path.suffix == '.mcap' and not path.is_dir()
        if self._is_mcap:
            for record in self._records():
                if isinstance(record, Metadata) and record.name == PARAMETERS:
                    values = record.metadata
                    known = int(values['time']), values['node'], values['values']
                    self.parameters.append(known)
        else:
            for _ in self._bag_entries(()):
                pass

    def entries(self, topics: Collection[str]) -> list[Entry]:
        """Return the messages of some topics in the order of their arrival."""
        entries = self._mcap_entries(topics) if self._is_mcap else self._bag_entries(topics)
        return sorted(entries, key=lambda entry: entry.time)

    def _mcap_entries(self, topics: Collection[str]) -> Iterator[Entry]:
        """Yield the messages of some topics of an MCAP file."""
        names: dict[int, str] = {}
        for record in self._records():
            if isinstance(record, Channel):
                names[record.id] = record.topic
            elif isinstance(record, Message) and names[record.channel_id] in topics:
                name = names[record.channel_id]
                yield Entry(name, self.topics[name], record.log_time, record.data)

    def _records(self) -> Iterator[McapRecord]:
        """Yield the records of an MCAP file from its start: the index may be missing."""
        schemas: dict[int, str] = {}
        is_read = False
        try:
            with self._path.open('rb') as file:
                for record in StreamReader(file, validate_crcs=True).records:
                    is_read = True
                    if isinstance(record, Schema):
                        schemas[record.id] = record.name
                    elif isinstance(record, Channel):
                        self.topics[record.topic] = schemas[record.schema_id]
                    yield record
        except DAMAGES as error:
            if not is_read:
                raise UnreadableRecording(f'{self._path} is no MCAP file') from error
            self.damage = str(error) or 'the file ends early'
        except OSError as error:
            raise UnreadableRecording(f'cannot read {self._path}: {error.strerror}') from error

    def _bag_entries(self, topics: Collection[str]) -> Iterator[Entry]:
        """Yield the messages of some topics of a bag of another storage, or in a directory."""
        try:
            from rosbags.rosbag2 import Reader, ReaderError
        except ImportError as error:
            raise UnreadableRecording(
                f'{self._path} needs the library rosbags: pip install rosbags'
            ) from error
        try:
            with Reader(self._path) as reader:
                self.topics = {c.topic: c.msgtype for c in reader.connections}
                wanted = [c for c in reader.connections if c.topic in topics]
                for connection, time, message in reader.messages(wanted) if wanted else ():
                    yield Entry(connection.topic, connection.msgtype, time, bytes(message))
        except (ReaderError, OSError) as error:
            raise UnreadableRecording(f'cannot read {self._path}: {error}') from error


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
