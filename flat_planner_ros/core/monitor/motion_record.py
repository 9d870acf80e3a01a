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

"""What a monitor is told: the planned motion, the measured samples, and their bounded record."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

from flat_planner_ros.core.arm import (
    check_number,
    checked_array,
    FloatArray,
    InvalidRequest,
    SampledMotion,
    SampleTable,
    UNUSABLE,
)
import numpy as np
from numpy.typing import NDArray

RECORD_LIMIT = 8192
"""Most rows of a record; a longer one keeps every second, fourth, ... row [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedMotion:
    """
    Motion of n joints as planned, ending at rest.

    All times, those of samples too, count from one origin of the caller's choice. A near one is
    better: a float holds seconds since 1970 to 0.2 microseconds only.

    Attributes
    ----------
    joint_names
        Names of the joints in kinematic order, the passive one last, length n.
    start
        Absolute time of the start [s].
    times
        Times of the points since the start [s], shape (m,), ascending.
    positions
        Joint positions [rad], shape (m, n).
    velocities
        Joint velocities [rad/s], shape (m, n), or ``None``.
    efforts
        Joint efforts [N m], shape (m, n), or ``None``.

    """

    joint_names: tuple[str, ...]
    start: float
    times: FloatArray
    positions: FloatArray
    velocities: FloatArray | None = None
    efforts: FloatArray | None = None

    def __post_init__(self) -> None:
        """Refuse what is no motion, and lock the arrays."""
        names = tuple(self.joint_names)
        if not names or len(set(names)) != len(names):
            raise InvalidRequest(f'joint names must be unique and at least one, got {names}')
        check_number('start', self.start, 's', error=InvalidRequest)
        times = self._lock('times', (np.size(self.times),), 's')
        if times.size == 0 or times[0] < 0.0 or not (np.diff(times) > 0.0).all():
            raise InvalidRequest('times of a motion must be ascending from 0 s or later')
        shape = (times.size, len(names))
        object.__setattr__(self, 'joint_names', names)
        self._lock_joints('positions', shape, 'rad')
        if self.velocities is not None:
            self._lock_joints('velocities', shape, 'rad/s')
        if self.efforts is not None:
            self._lock_joints('efforts', shape, 'N m')

    @property
    def end(self) -> float:
        """Return the absolute time T of the last point [s]."""
        return self.start + float(self.times[-1])

    @property
    def final(self) -> FloatArray:
        """Return the last positions [rad], shape (n,)."""
        final: FloatArray = self.positions[-1]
        return final

    def shifted(self, delay: float) -> 'PlannedMotion':
        """Return the motion with another start, later by a delay [s]."""
        return replace(self, start=self.start + delay) if delay else self

    def is_same(self, other: 'PlannedMotion') -> bool:
        """Return whether the other motion is this one, received again."""
        return (
            self.joint_names == other.joint_names
            and self.start == other.start
            and all(
                _equal(mine, its)
                for mine, its in (
                    (self.times, other.times),
                    (self.positions, other.positions),
                    (self.velocities, other.velocities),
                    (self.efforts, other.efforts),
                )
            )
        )

    def reference(self, time: float) -> tuple[FloatArray, FloatArray]:
        """
        Return what is planned at an absolute time; at rest before and after the motion.

        Parameters
        ----------
        time
            Absolute time [s].

        Returns
        -------
        tuple of FloatArray
            Positions [rad] and velocities [rad/s], both of shape (n,), by cubic Hermite
            interpolation if velocities are planned, else by linear interpolation.

        """
        return self._motion.at(time - self.start)

    def _lock(self, name: str, shape: tuple[int, ...], unit: str) -> FloatArray:
        """Put a locked copy in the place of an array; return it."""
        values = getattr(self, name)
        array = checked_array(name, values, unit, shape=shape, error=InvalidRequest)
        object.__setattr__(self, name, array)
        return array

    def _lock_joints(self, name: str, shape: tuple[int, ...], unit: str) -> None:
        """Lock what joints do, and refuse what none does."""
        largest = float(np.abs(self._lock(name, shape, unit)).max())
        if largest > UNUSABLE:
            raise InvalidRequest(f'{name} of {largest:.3g} {unit} are beyond {UNUSABLE:g} {unit}')

    @cached_property
    def _motion(self) -> SampledMotion:
        """Return the motion between the points."""
        return SampledMotion(self.times, self.positions, self.velocities)


class Residual(NamedTuple):
    """Measured minus wanted positions [rad] and velocities [rad/s] or ``None``, shape (n,)."""

    positions: FloatArray
    velocities: FloatArray | None


class Record:
    """
    Times and rows in the order of arrival, in bounded memory.

    Parameters
    ----------
    width
        Length of a row [-].

    """

    def __init__(self, width: int) -> None:
        """Start empty."""
        self._table = np.empty((RECORD_LIMIT, 1 + width))
        self._count = 0
        self._stride = 1
        self._skip = 0

    def __len__(self) -> int:
        """Return the number of rows held."""
        return self._count

    def append(self, time: float, row: FloatArray | float) -> None:
        """Add a row; a full record first drops every second one and goes on half as dense."""
        if self._skip:
            self._skip -= 1
            return
        if self._count == RECORD_LIMIT:
            thinned = self._table[::2].copy()
            self._count = len(thinned)
            self._table[: self._count] = thinned
            self._stride *= 2
        target = self._table[self._count]
        target[0] = time
        target[1:] = row
        self._count += 1
        self._skip = self._stride - 1

    def extend(self, times: FloatArray, rows: FloatArray) -> None:
        """Add rows as `append` does, shapes (m,) and (m, width)."""
        place = 0
        while place < len(times):
            skipped = min(self._skip, len(times) - place)
            self._skip -= skipped
            place += skipped
            if place == len(times):
                return
            if self._count == RECORD_LIMIT:
                self.append(float(times[place]), rows[place])
                place += 1
                continue
            chosen = slice(
                place, place + self._stride * (RECORD_LIMIT - self._count), self._stride
            )
            added = self._table[self._count : self._count + len(times[chosen])]
            added[:, 0] = times[chosen]
            added[:, 1:] = rows[chosen]
            self._count += len(added)
            # The last one added leaves out the same number as each before.
            place += (len(added) - 1) * self._stride + 1
            self._skip = self._stride - 1

    def shift(self, delay: float) -> None:
        """Set all times later [s]."""
        self._table[: self._count, 0] += delay

    def between(self, start: float, end: float) -> tuple[FloatArray, FloatArray]:
        """Return copies of the times [s], shape (m,), and rows, shape (m, width), in between."""
        table = self._table[: self._count]
        inside = table[(table[:, 0] >= start) & (table[:, 0] <= end)]
        return inside[:, 0], inside[:, 1:]


class Measured:
    """
    What is kept of the samples of a motion.

    A long motion thins out its own record, not that of what it leaves.

    Parameters
    ----------
    width
        Number of joints [-].

    Attributes
    ----------
    efforts
        Of the time of the motion [N m].
    motors
        Positions [rad] and efforts [N m] side by side from the start on, if they are wanted.

    """

    def __init__(self, width: int) -> None:
        self.efforts = Record(width)
        self.motors = Record(2 * width)
        self._during = Record(width)
        self._after = Record(width)

    def add(self, time: float, positions: FloatArray, *, is_after: bool) -> None:
        """Keep positions [rad] during or after the motion, times ascending."""
        record = self._after if is_after else self._during
        record.append(time, positions)

    def add_table(self, samples: SampleTable, *, is_after: bool, with_motors: bool) -> None:
        """Keep samples from before or from after the end of the motion."""
        times, positions = samples.times, samples.positions
        efforts = np.full_like(positions, np.nan) if samples.efforts is None else samples.efforts
        (self._after if is_after else self._during).extend(times, positions)
        if not is_after:
            self.efforts.extend(times, efforts)
        if with_motors:
            self.motors.extend(times, np.hstack((positions, efforts)))

    def shift(self, delay: float) -> None:
        """Set all times later [s]."""
        for record in (self.efforts, self._during, self._after):
            record.shift(delay)

    def positions(self, start: float, end: float) -> tuple[FloatArray, FloatArray]:
        """Return times [s], shape (m,), and positions [rad], shape (m, n), in between."""
        parts = [record.between(start, end) for record in (self._during, self._after)]
        times = np.concatenate([part[0] for part in parts])
        rows = np.concatenate([part[1] for part in parts])
        order = np.argsort(times, kind='stable')
        return times[order], rows[order]


def joint_indices(names: Sequence[str], wanted: Sequence[str]) -> NDArray[np.intp]:
    """
    Return where each wanted joint stands among the names.

    Parameters
    ----------
    names
        Joint names as measured, in any order, more than wanted or not.
    wanted
        Joint names in the order of the motion, length n.

    Returns
    -------
    ndarray of int
        Indices into `names`, shape (n,).

    Raises
    ------
    InvalidRequest
        If a wanted joint is missing.

    """
    place = {name: index for index, name in enumerate(names)}
    missing = [name for name in wanted if name not in place]
    if missing:
        raise InvalidRequest(f'no joint {", ".join(missing)} among {", ".join(names) or "none"}')
    return np.array([place[name] for name in wanted], dtype=np.intp)


def _equal(mine: FloatArray | None, its: FloatArray | None) -> bool:
    """Return whether both are missing or equal in every number."""
    if mine is None or its is None:
        return mine is its
    return np.array_equal(mine, its)
