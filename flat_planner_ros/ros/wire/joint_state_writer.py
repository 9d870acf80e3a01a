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
Joint states and times in serialised form.

A joint state takes seven microseconds to build as a Python object and three more to be serialised;
a plant that makes the time shows thousands of them per second. The layouts are those of
sensor_msgs/JointState and rosgraph_msgs/Clock in CDR.
"""

from collections.abc import Sequence
from struct import Struct

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.ros.wire.point_writer import (
    ENCAPSULATION,
    header_bytes,
    LARGEST,
    LENGTH,
    STAMP,
    string_bytes,
)


class JointStateWriter:
    """
    Writes joint states with full arrays of the same joints.

    All but the stamp and the numbers is made once.

    Parameters
    ----------
    joints
        Their names, at least one.

    """

    def __init__(self, joints: Sequence[str]) -> None:
        count = len(joints)
        width = LENGTH.pack(count)
        front = b''.join([header_bytes((0, 0)), width, *map(string_bytes, joints), width])
        front += bytes((len(ENCAPSULATION) - len(front)) % LARGEST)
        # Arrays of numbers end where numbers may begin: the next length is alone in its eight.
        self._between = width + bytes(LARGEST - len(width))
        self._names = front[len(ENCAPSULATION) + STAMP.size :]
        numbers, gap = f'{count}d', f'{LARGEST}s'
        self._layout = Struct(
            f'={len(ENCAPSULATION)}s iI {len(self._names)}s {numbers} {gap} {numbers} {gap} '
            f'{numbers}'
        )

    def message(
        self,
        stamp: tuple[int, int],
        position: FloatArray,
        velocity: FloatArray,
        effort: FloatArray,
    ) -> bytes:
        """
        Return a serialised `sensor_msgs/JointState`.

        Parameters
        ----------
        stamp
            Seconds and nanoseconds of the header.
        position, velocity, effort
            One number per joint, shape (n,) [rad], [rad/s], [N m].

        """
        return self._layout.pack(
            ENCAPSULATION,
            *stamp,
            self._names,
            *position.tolist(),
            self._between,
            *velocity.tolist(),
            self._between,
            *effort.tolist(),
        )


def clock_bytes(stamp: tuple[int, int]) -> bytes:
    """Return a serialised `rosgraph_msgs/Clock` of seconds and nanoseconds."""
    return ENCAPSULATION + STAMP.pack(*stamp)
