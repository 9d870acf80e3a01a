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
Serialised joint states of one form, read as tables.

A recording has a thousand of them a second, which differ in their stamps and numbers alone: what
takes ten microseconds each as Python objects is one table. Whatever is not exactly of that form is
left to the middleware.
"""

from collections.abc import Sequence
from typing import NamedTuple

from flat_planner_ros.core.arm import SampleTable
from flat_planner_ros.ros.wire.cdr_front import DOUBLE, Front, HEADER, LENGTH, Unusual
from flat_planner_ros.ros.wire.point_writer import NANOSECONDS
import numpy as np
from numpy.typing import NDArray

ARRAYS = 3
"""Arrays of numbers of a joint state: position, velocity, effort."""

STAMP = slice(HEADER, HEADER + 2 * LENGTH)
"""Bytes of the stamp."""

Bytes = NDArray[np.uint8]
"""Bytes of messages of one length, a row each."""


class StateTable(NamedTuple):
    """Names of joints, and their states in messages one after the other."""

    names: list[str]
    samples: SampleTable


def read_states(messages: Sequence[bytes]) -> StateTable | None:
    """
    Return joint states from their bytes; None if only the middleware can tell what they mean.

    Parameters
    ----------
    messages
        Each a sensor_msgs/JointState with its encapsulation, all of one length.

    """
    first = messages[0]
    try:
        front = Front(first)
        _, names = front.joints()
        places = front.numbers(ARRAYS)
    except Unusual:
        return None
    numbers = np.frombuffer(bytearray().join(messages), np.uint8)
    table = numbers.reshape(len(messages), len(first))
    for gap in front.padding:
        table[:, gap] = 0
    if places[0][1] != len(names) or not _is_one_form(table, places):
        return None
    seconds, parts = (_column(table, STAMP, f'{front.order}{kind}4') for kind in 'iu')
    times = seconds[:, 0] + parts[:, 1] / NANOSECONDS
    if not times.all():
        return None  # Without a stamp: the time of arrival counts.
    position, velocity, effort = (
        _column(table, slice(begin, begin + DOUBLE * width), f'{front.order}f8')
        if width == len(names)
        else None
        for begin, width in places
    )
    if position is None:
        return None
    samples = SampleTable(times=times, positions=position, velocities=velocity, efforts=effort)
    return StateTable(list(names), samples)


def _is_one_form(table: Bytes, places: Sequence[tuple[int, int]]) -> bool:
    """Return whether messages differ from the first in stamp and numbers at most."""
    begins = [0, STAMP.stop, *(begin + DOUBLE * width for begin, width in places)]
    ends = [STAMP.start, *(begin for begin, _ in places)]
    return all(
        bool((table[:, begin:end] == table[0, begin:end]).all())
        for begin, end in zip(begins, ends, strict=False)
    )


def _column(table: Bytes, place: slice, kind: str) -> NDArray[np.float64]:
    """Return the numbers that stand at a place of all messages."""
    column: NDArray[np.float64] = np.ascontiguousarray(table[:, place]).view(kind)
    return column
