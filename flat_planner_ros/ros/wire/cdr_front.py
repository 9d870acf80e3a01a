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

"""Serialised messages: the part before their numbers, read with every length checked."""

from struct import Struct, unpack_from

from flat_planner_ros.ros.wire.point_writer import ARRAYS, NANOSECONDS

HEADER = 4
"""Bytes of the encapsulation; offsets count from its end."""

ORDERS = {b'\0\0\0\0': '>', b'\0\1\0\0': '<'}
"""
Byte order by the representation that a message states: plain CDR, big or little endian.

With options it is another form: some implementations count bytes there that do not belong to it.
"""

LENGTH, DOUBLE = 4, 8
"""Bytes of a sequence's length and of a number; each is aligned to its own size."""


class Unusual(Exception):
    """The message is not of the form that is read here."""


class Front:
    """
    Reads what stands before the points, checking every length against what is left.

    Parameters
    ----------
    data
        The message.

    Attributes
    ----------
    order
        Byte order of the message.
    at
        Offset of the next entry from the end of the encapsulation.
    padding
        Bytes that were passed for alignment: they mean nothing, and may be anything.

    Raises
    ------
    Unusual
        The message is not in plain CDR; of the methods, it does not go on as it has to.

    """

    def __init__(self, data: bytes) -> None:
        order = ORDERS.get(data[:HEADER])
        if order is None:
            raise Unusual
        self.order = order
        self._data = data
        self._length = Struct(f'{order}I')
        self._stamp = f'{order}iI'
        self.at = 0
        self.padding: list[slice] = []

    def stamp(self) -> float:
        """Return the stamp of the header [s]."""
        begin = self.taken(2 * LENGTH)
        sec, nanosec = unpack_from(self._stamp, self._data, begin)
        return float(sec + nanosec / NANOSECONDS)

    def trajectory(self) -> tuple[float, tuple[str, ...], int]:
        """Return the stamp of a JointTrajectory [s], its joints and how many points follow."""
        return *self.joints(), self.length(ARRAYS * LENGTH)

    def joints(self) -> tuple[float, tuple[str, ...]]:
        """Return the stamp of a header [s], and the names of joints that follow."""
        stamp = self.stamp()
        self.string()
        return stamp, tuple([self.string() for _ in range(self.length(LENGTH))])

    def length(self, size: int) -> int:
        """Return the length of a sequence whose entries take at least some bytes each."""
        self._align(LENGTH)
        (entry,) = self._length.unpack_from(self._data, self.taken(LENGTH))
        length = int(entry)
        if length * size > len(self._data):
            raise Unusual
        return length

    def string(self) -> str:
        """Return a string; it ends with its only zero."""
        length = self.length(1)
        begin = self.taken(length)
        text = self._data[begin : begin + length]
        if text.find(0) != length - 1:
            raise Unusual
        try:
            return text[:-1].decode()
        except UnicodeDecodeError:
            raise Unusual from None

    def numbers(self, arrays: int) -> list[tuple[int, int]]:
        """Return where each of some arrays of numbers begins in the message, and its length."""
        places = []
        for _ in range(arrays):
            width = self.length(DOUBLE)
            if width:
                self._align(DOUBLE)
            places.append((self.taken(DOUBLE * width), width))
        return places

    def _align(self, size: int) -> None:
        """Go on to the next multiple of a size."""
        gap = -self.at % size
        if gap:
            begin = HEADER + self.at
            self.padding.append(slice(begin, begin + gap))
        self.at += gap

    def taken(self, size: int) -> int:
        """Return where the next bytes begin in the message and go past them."""
        begin = HEADER + self.at
        if begin + size > len(self._data):
            raise Unusual
        self.at += size
        return begin
