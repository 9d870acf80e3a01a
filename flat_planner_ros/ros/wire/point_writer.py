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
Trajectory messages in serialised form, their points written as tables.

A point takes five microseconds to build as a Python object; in serialised form all points are one
table of numbers, which NumPy fills at once. The layout is that of trajectory_msgs/JointTrajectory
in CDR, as rmw_fastrtps and every other DDS middleware read it: each entry is aligned to its own
size, and each sequence begins with its length.
"""

from collections.abc import Sequence
from functools import lru_cache
import struct
import sys
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray, locked
import numpy as np
from numpy.typing import NDArray

ARRAYS = 4
"""Positions, velocities, accelerations and efforts of a point."""

ENCAPSULATION = bytes([0, sys.byteorder == 'little', 0, 0])
"""Front of a serialised message: plain CDR in the byte order of this machine; not aligned to."""

LARGEST = 8
"""Size of the longest entries, to which they are aligned [bytes]."""

TYPES_KEPT = 32
"""Types of points that are remembered."""

FORMS_KEPT = 4
"""Trajectories that are remembered with all but their numbers: goals of one duration share one."""

MOST_KEPT = 10_000
"""Points of the longest trajectory that is remembered; with `FORMS_KEPT`, 5 MB for four joints."""

LENGTH = struct.Struct('=I')
"""Number of entries of a sequence, or of characters with the zero at the end."""

ENDS = tuple([bytes(1 + -length % LENGTH.size) for length in range(LENGTH.size)])
"""What follows a string: the zero that its length includes, and padding; by length modulo 4."""

STAMP = struct.Struct('=iI')
"""Seconds and nanoseconds."""

NANOSECONDS = 1_000_000_000
"""Nanoseconds in one second."""


def trajectory_bytes(
    names: Sequence[str],
    stamp: tuple[int, int],
    times: FloatArray,
    tables: Sequence[FloatArray],
) -> bytes:
    """
    Return a serialised trajectory.

    Parameters
    ----------
    names
        Names of the joints.
    stamp
        Seconds and nanoseconds of the header.
    times
        Times of the points from the start [s], at least one, shape (m,).
    tables
        Fields of the points in the order of the message, each of shape (m, n); fields that are
        left out at the end are empty.

    """
    widths = [table.shape[1] for table in tables] + [0] * (ARRAYS - len(tables))
    find = _kept_form if len(times) <= MOST_KEPT else _form
    form = find(tuple(names), times.tobytes(), tuple(widths))
    message = form.message.copy()
    STAMP.pack_into(message.data, len(ENCAPSULATION), *stamp)
    points = message[form.begin :].view(form.point)
    for field, table in enumerate(tables):
        if widths[field]:
            points[f'values{field}'] = table
    return message.tobytes()


class _Form(NamedTuple):
    """
    A trajectory but for its stamp and the numbers of its points.

    Attributes
    ----------
    message
        All of it, with zeros for them, shape (bytes,).
    begin, point
        Where the points begin in it, all of one type.

    """

    message: NDArray[np.uint8]
    begin: int
    point: np.dtype


def _form(names: tuple[str, ...], times_as_bytes: bytes, widths: tuple[int, ...]) -> _Form:
    """Return the form of a trajectory; times as in `trajectory_bytes`."""
    times = np.frombuffer(times_as_bytes)
    text = [LENGTH.pack(len(names)), *map(string_bytes, names), LENGTH.pack(len(times))]
    front = b''.join([header_bytes((0, 0)), *text])
    # Every point but the first begins where one ends, hence they are all aligned alike.
    body = len(front) - len(ENCAPSULATION)
    first = point_type(body, widths)
    other = point_type(body + first.itemsize, widths)
    # From its first numbers on the first point is as the others are: only the length before them
    # may stand elsewhere, and what is written in its place gives way to what belongs there.
    begin = len(front) + first.itemsize - other.itemsize
    message = np.zeros(begin + len(times) * other.itemsize, dtype=np.uint8)
    points = message[begin:].view(other)
    for field, width in enumerate(widths):
        if width:
            points[f'length{field}'] = width
    points['sec'], points['nanosec'] = np.divmod(
        np.rint(times * NANOSECONDS).astype(np.int64), NANOSECONDS
    )
    head = front + LENGTH.pack(widths[0]) + bytes(max(begin - len(front), 0))
    message[: len(head)] = np.frombuffer(head, dtype=np.uint8)
    return _Form(locked(message), begin, other)


_kept_form = lru_cache(maxsize=FORMS_KEPT)(_form)


def header_bytes(stamp: tuple[int, int]) -> bytes:
    """Return how a message begins: its representation, and a header with a stamp and no frame."""
    return ENCAPSULATION + STAMP.pack(*stamp) + string_bytes('')


def string_bytes(text: str) -> bytes:
    """Return a string, filled up to the alignment of the length that comes next."""
    encoded = text.encode()
    length = len(encoded) + 1
    return LENGTH.pack(length) + encoded + ENDS[length % LENGTH.size]


def point_type(start: int, widths: Sequence[int], order: str = '=') -> np.dtype:
    """
    Return the type of a point that begins at an offset.

    Parameters
    ----------
    start
        Offset from the end of the encapsulation.
    widths
        Numbers in each of the four arrays; one without any is a length alone, unaligned.
    order
        Byte order as in struct: '=', '<' or '>'.

    """
    # Entries are aligned to eight bytes at most.
    return _point_type(start % LARGEST, tuple(widths), order)


@lru_cache(maxsize=TYPES_KEPT)
def _point_type(start: int, widths: tuple[int, ...], order: str) -> np.dtype:
    """Return the type of a point, as `point_type`."""
    entries: list[tuple[str, object]] = []
    for field, width in enumerate(widths):
        entries.append((f'length{field}', f'{order}u4'))
        if width:
            entries.append((f'values{field}', (f'{order}f8', (width,))))
    entries += [('sec', f'{order}i4'), ('nanosec', f'{order}u4')]
    names, kinds = zip(*entries, strict=True)
    formats, offsets, at = [np.dtype(kind) for kind in kinds], [], start
    for entry in formats:
        at += -at % entry.base.itemsize
        offsets.append(at - start)
        at += entry.itemsize
    return np.dtype(
        {'names': names, 'formats': formats, 'offsets': offsets, 'itemsize': at - start}
    )
