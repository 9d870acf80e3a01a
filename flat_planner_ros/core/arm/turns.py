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

"""Turns of joints whose encoders wrap their angles."""

from dataclasses import replace
from math import pi

from flat_planner_ros.core.arm.arrays import FloatArray
from flat_planner_ros.core.arm.samples import JointSample, JUMP, SampleTable, travel
import numpy as np
from numpy.typing import NDArray

BoolArray = NDArray[np.bool_]

RIM = 0.05
"""Angle by which noise may carry a wrapped angle beyond its range [rad]."""

SAME_PLACE = 0.5
"""Distance from a planned pose, turns apart, up to which an arm is taken to be there [rad]."""

MOVING = 0.05
"""Speed from which a joint surely moves [rad/s]."""

TURN = 2.0 * pi
"""Angle of a whole turn [rad]."""

HALVES = '+-pi'
WHOLE = '0 to 2 pi'


class TurnCounter:
    """
    Carries angles on where encoders wrap them, to +-pi or to 0 ... 2 pi.

    A step counts as a turn if both angles are in the range and if the joint can have moved by what
    the step lacks to 2 pi: an arm that is put elsewhere has not turned. From 2 pi to 0 goes an arm
    that is reset, too: that is a turn of a joint that moves on in the same direction, or was seen
    to step from 0 to 2 pi before.
    """

    def __init__(self) -> None:
        self._former: JointSample | None = None
        self._earlier: JointSample | None = None
        self._last: list[float] = []
        self._turns: FloatArray | None = None
        self._place: FloatArray | None = None
        self._is_whole: BoolArray | None = None

    def unwrapped(self, sample: JointSample) -> JointSample:
        """Return the next sample with its turns, the very same one where there are none."""
        positions = sample.positions.tolist()
        # Plain numbers: for a few joints an operation on arrays costs more than all of this.
        for now, before in zip(positions, self._last, strict=False):
            if not -pi <= now - before <= pi:  # a NaN, too
                with np.errstate(over='ignore'):  # of angles that are none
                    self._count(sample)
                break
        else:
            is_first = self._former is None
            if is_first and np.isinf(sample.positions).any():
                return sample
            self._earlier, self._former, self._last = self._former, sample, positions
            if is_first and self._place is not None:
                self.align(self._place)
        if self._turns is None:
            return sample
        return replace(sample, positions=sample.positions + TURN * self._turns)

    def unwrapped_table(self, samples: SampleTable) -> SampleTable | None:
        """Return the next samples with their turns; None, and none taken, where a joint turns."""
        former = self._former
        if former is None:
            return None
        with np.errstate(invalid='ignore', over='ignore'):  # infinite twice in a row is no step
            change = np.diff(samples.positions, axis=0, prepend=former.positions[None])
        if not np.abs(change).max() <= pi:
            return None
        if len(samples.times) > 1:
            former = samples.sample(-2)
        self._remember(former, samples.sample(-1))
        if self._turns is None:
            return samples
        return replace(samples, positions=samples.positions + TURN * self._turns)

    def align(self, place: FloatArray) -> None:
        """Count from the turns of a pose [rad] near which the arm is, or will be when heard."""
        self._place = place
        if self._former is None:
            return
        raw, turns = self._former.positions, self.turns
        wanted = np.round((place - raw) / TURN)
        is_there = np.abs(place - raw - TURN * wanted) <= SAME_PLACE
        is_there &= (raw >= -pi - RIM) & (raw <= TURN + RIM)
        # Below zero, and shown as nearly 2 pi: that is the other range.
        self._know(is_there & (wanted < 0.0) & (raw > pi + RIM))
        aligned = np.where(is_there, wanted, turns)
        if (aligned != turns).any():
            self._turns = aligned

    @property
    def turns(self) -> FloatArray:
        """Return by how many turns each angle is carried on, shape (n,) [-]."""
        if self._turns is not None:
            return self._turns
        return np.zeros(0 if self._former is None else len(self._former.positions))

    def range_of(self, index: int) -> str:
        """Return the range to which a joint is wrapped, in words."""
        is_whole = self._is_whole is not None and self._is_whole[index]
        return WHOLE if is_whole else HALVES

    def _remember(self, former: JointSample | None, sample: JointSample) -> None:
        """Compare the next sample with this one."""
        self._earlier, self._former = former, sample
        self._last = sample.positions.tolist()

    def _count(self, sample: JointSample) -> None:
        """Count the turns of a step."""
        former = self._former
        if former is None:
            return
        raw, last = sample.positions, former.positions
        change = raw - last
        lowest, highest = np.minimum(raw, last), np.maximum(raw, last)
        is_step = (np.abs(change) > pi) & (TURN - np.abs(change) <= JUMP + travel(former, sample))
        is_half = is_step & (lowest >= -pi - RIM) & (highest <= pi + RIM)
        is_whole = is_step & (lowest >= -RIM) & (highest <= TURN + RIM)
        if is_whole.any():
            known = self._know(is_whole & ((change > 0.0) | self._moves_up(former, sample)))
            is_half |= is_whole & known
        if is_half.any():
            self._turns = self.turns - np.sign(change) * is_half
        # Where an angle is unknown, what it was before is still to be compared with.
        angles = np.where(np.isfinite(raw), raw, last)
        self._remember(former, replace(sample, positions=angles))

    def _know(self, is_whole: BoolArray) -> BoolArray:
        """Keep in mind which joints are wrapped to 0 ... 2 pi; return all that are known."""
        self._is_whole = is_whole if self._is_whole is None else self._is_whole | is_whole
        return self._is_whole

    def _moves_up(self, former: JointSample, sample: JointSample) -> BoolArray:
        """Tell which joints move to larger angles before and, as far as is known, after a step."""
        earlier = self._earlier
        if former.velocities is not None and sample.velocities is not None:
            return (former.velocities > MOVING) & (sample.velocities > MOVING)
        if earlier is None or earlier.time >= former.time:
            return np.zeros(former.positions.shape, dtype=bool)
        elapsed = former.time - earlier.time
        return (former.positions - earlier.positions) / elapsed > MOVING
