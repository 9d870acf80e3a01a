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
Verdicts and reports in serialised form.

A pair of key and value takes five microseconds as a Python message and as long again to be
serialised; a verdict has some forty. The layout is that of diagnostic_msgs/DiagnosticArray in CDR.
"""

from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

from flat_planner_ros.ros.wire.point_writer import header_bytes, LENGTH, string_bytes

KEYS_KEPT = 256
"""Keys that are remembered in serialised form."""

_key_bytes = lru_cache(maxsize=KEYS_KEPT)(string_bytes)


class Pair(NamedTuple):
    """A value under its key, as `diagnostic_msgs/KeyValue` has them."""

    key: str
    value: str


@dataclass(kw_only=True)
class Status:
    """
    What `diagnostic_msgs/DiagnosticStatus` says; attributes are named as there.

    Attributes
    ----------
    level
        One byte.
    name, message, hardware_id
        Words.
    values
        Keys and values, in this order.

    """

    level: bytes
    name: str
    message: str
    hardware_id: str = ''
    values: list[Pair] = field(default_factory=list)


def array_bytes(status: Status, stamp: tuple[int, int]) -> bytes:
    """
    Return a serialised `diagnostic_msgs/DiagnosticArray` with one status.

    Parameters
    ----------
    status
        The one.
    stamp
        Seconds and nanoseconds of the header.

    """
    parts = [header_bytes(stamp), LENGTH.pack(1)]
    parts += [status.level, bytes(LENGTH.size - len(status.level))]
    parts += map(string_bytes, (status.name, status.message, status.hardware_id))
    parts.append(LENGTH.pack(len(status.values)))
    for key, value in status.values:
        parts += (_key_bytes(key), string_bytes(value))
    return b''.join(parts)
