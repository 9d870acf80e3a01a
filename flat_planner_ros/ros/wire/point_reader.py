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
Serialised trajectory messages, their points read as tables.

The inverse of point_writer.py: what takes ten microseconds for each point as Python objects is one
table of numbers where all points have arrays of equal lengths. Whatever is not exactly of that
form is left to the middleware.
"""

from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray, InvalidRequest
from flat_planner_ros.ros.wire.cdr_front import Front, HEADER, Unusual
from flat_planner_ros.ros.wire.point_writer import ARRAYS, NANOSECONDS, point_type
import numpy as np

FIELDS = ('positions', 'velocities', 'accelerations', 'effort')
"""Arrays of a point in the order of the message."""


def joints_in_words(count: int) -> str:
    """Return a number of joints in words."""
    return '1 joint' if count == 1 else f'{count} joints'


class PointTable(NamedTuple):
    """
    A trajectory, its points as tables.

    Attributes
    ----------
    joint_names
        Names of the joints.
    stamp
        Stamp of the header [s], 0 if there is none.
    times
        Times of the points from the start [s], shape (m,).
    fields
        Tables by the names of the arrays, each of shape (m, width), width 0 if no point has any.
    misfits
        Sentences on the arrays that are no table, by their names.

    """

    joint_names: tuple[str, ...]
    stamp: float
    times: FloatArray
    fields: dict[str, FloatArray]
    misfits: dict[str, str]

    def table(self, field: str) -> FloatArray:
        """Return one field of all points, shape (points, joints); InvalidRequest if it misfits."""
        if field in self.misfits:
            raise InvalidRequest(self.misfits[field])
        table, count = self.fields[field], len(self.joint_names)
        if len(table) and table.shape[1] != count:
            raise InvalidRequest(
                f'point 0 has {table.shape[1]} {field} for {joints_in_words(count)}'
            )
        return table.reshape(len(table), count)

    def optional_table(self, field: str) -> FloatArray | None:
        """Return one field of all points, None where no point has it."""
        if field in self.fields and not self.fields[field].shape[1]:
            return None
        return self.table(field)


def read_points(data: bytes) -> PointTable | None:
    """
    Return a trajectory from its bytes; None if only the middleware can tell what they mean.

    Parameters
    ----------
    data
        A trajectory_msgs/JointTrajectory with its encapsulation. Bytes after the last point are
        not looked at, by the middleware neither: rclpy leaves room there.

    """
    try:
        front = Front(data)
        stamp, names, count = front.trajectory()
        if not count:
            return None
        start = front.at
        widths = [width for _, width in front.numbers(ARRAYS)]
    except Unusual:
        return None
    first = point_type(start, widths, front.order)
    other = point_type(start + first.itemsize, widths, front.order)
    rest = HEADER + start + first.itemsize
    if rest + (count - 1) * other.itemsize > len(data):
        return None
    parts = (
        np.frombuffer(data, first, count=1, offset=HEADER + start),
        np.frombuffer(data, other, count=count - 1, offset=rest),
    )
    for field, width in enumerate(widths):
        if (parts[1][f'length{field}'] != width).any():
            return None
    times = np.concatenate([part['sec'] + part['nanosec'] / NANOSECONDS for part in parts])
    fields = {
        name: np.concatenate([part[f'values{field}'] for part in parts], dtype=float)
        if width
        else np.empty((count, 0))
        for field, (name, width) in enumerate(zip(FIELDS, widths, strict=True))
    }
    return PointTable(names, stamp, times, fields, misfits={})
