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
import json
from pathlib import Path
from typing import Any

from flat_planner_ros.ros.recording.storage import (
    Entry,
    Item,
    items,
    Note,
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

    Attributes
    ----------
    topics
        Types of the topics by name.
    parameters : list[tuple]
        Parameters of nodes: time [ns since 1970], name with namespace, JSON text of the values.
    damage
        What is not whole, empty for a complete recording.

    Raises
    ------
    UnreadableRecording
        The path is neither.

    """

    def __init__(self, path: Path) -> None:
        self._files = storage_files(path)
        self._damages: list[str] = []
        self._damaged: set[tuple[str, int]] = set()
        self.topics: dict[str, str] = {}
        self.parameters: list[tuple[int, str, str]] = []
        for item in self._items():
            if isinstance(item, Topic):
                self.topics[item.name] = item.kind
            elif isinstance(item, Note) and item.name == PARAMETERS:
                self._keep_parameters(item.values)

    @property
    def damage(self) -> str:
        """Return what is not whole, a clause; empty for a complete recording."""
        damages = list(self._damages)
        if self._damaged:
            topics = ', '.join(sorted({topic for topic, _ in self._damaged}))
            damages.append(f'{len(self._damaged)} messages cannot be read, on {topics}')
        return '; '.join(damages)

    def entries(self, topics: Collection[str]) -> list[Entry]:
        """Return the messages of some topics in the order of their arrival."""
        entries = (item for item in self._items() if isinstance(item, Entry))
        wanted = [entry for entry in entries if entry.topic in topics]
        return sorted(wanted, key=lambda entry: entry.time)

    def messages(self, topics: Collection[str]) -> Iterator[tuple[Entry, Any]]:
        """Yield the entries of some topics with their messages; damaged ones are counted."""
        for entry in self.entries(topics):
            try:
                msg = deserialize_message(entry.message, message_class(entry.kind))
            except UNREADABLE:
                self._damaged.add((entry.topic, entry.time))
                continue
            yield entry, msg

    def _items(self) -> Iterator[Item]:
        """Yield what all files have in them."""
        for file in self._files:
            yield from items(file, self._complain)

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
