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
Timeline: the motions that are still to be carried out, and the one command that states them all.

A goal replaces whatever was planned from its start on. The start of the new motion is the state
that the old one plans for that time, so that the effort has no step, and what is left of the old
one until then is sent along with the new one: an executor that skips past points cannot notice the
splice (docs/derivation.md, section S).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.planning import LimitUse, Plan, PlanSamples, Strategy
import numpy as np

SPLICE_TOLERANCE = 1e-6
"""Points of an old motion this close to the start of the next one give way to its first [s]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """
    A plan with its place in time.

    Attributes
    ----------
    plan_id
        Counts the accepted goals from 1.
    plan
        What is carried out.
    samples
        The plan on the command's grid.
    start
        Absolute time of its start [s].
    planned_at
        Absolute time at which it was accepted [s].
    cut
        Absolute time at which another motion is spliced on [s]; None if none does.
    is_stop
        Whether it brings a motion of the same number, or an arm that moves by itself, to rest.
    is_shortest
        Whether its duration is the shortest within the limits, which was looked for.
    duration_factor
        How often it takes the shortest duration, where that was looked for [-].
    exceeded
        What the prescribed duration would have exceeded, if the motion was stretched.
    swing
        Amplitude of the measured swing that it starts from [rad]; None for another start.
    find_remarks
        Tells the remarks on it; None where there are none.
    replaced_strategy
        The strategy that was asked for, where the plan had to take another one.

    """

    plan_id: int
    plan: Plan
    samples: PlanSamples
    start: float
    planned_at: float
    cut: float | None = None
    is_stop: bool = False
    is_shortest: bool = False
    exceeded: LimitUse | None = None
    swing: float | None = None
    replaced_strategy: Strategy | None = None
    find_remarks: 'Callable[[Motion], tuple[str, ...]] | None' = None
    duration_factor: float = 1.0

    @cached_property
    def end(self) -> float:
        """Return the absolute time from which it has no say [s]."""
        return self.start + self.plan.duration if self.cut is None else self.cut

    @cached_property
    def remarks(self) -> tuple[str, ...]:
        """Return clauses on what looks like a mistake about the goal."""
        return () if self.find_remarks is None else self.find_remarks(self)

    def reference(self, now: float) -> PlanSamples:
        """Return what is planned at an absolute time, at rest before and after; one sample."""
        return self.plan.at(np.array([now - self.start]))


class Piece(NamedTuple):
    """Points of a motion: its samples, and which of them."""

    samples: PlanSamples
    chosen: slice


@dataclass(frozen=True, kw_only=True, eq=False)
class Track:
    """
    What an executor is sent: a table of points from an absolute time on.

    Attributes
    ----------
    start
        Absolute time of the first point [s].
    times
        Time of each point from the start, strictly increasing from 0, shape (m,) [s].
    pieces
        Where the points come from, in the order of time.

    """

    start: float
    times: FloatArray
    pieces: tuple[Piece, ...]

    @property
    def positions(self) -> FloatArray:
        """Angles of all joints, shape (m, n) [rad]."""
        positions: FloatArray = self._joint_motion[0]
        return positions

    @property
    def velocities(self) -> FloatArray:
        """First derivatives of the positions, shape (m, n) [rad/s]."""
        velocities: FloatArray = self._joint_motion[1]
        return velocities

    @property
    def accelerations(self) -> FloatArray:
        """Second derivatives of the positions, shape (m, n) [rad/s^2]."""
        accelerations: FloatArray = self._joint_motion[2]
        return accelerations

    @cached_property
    def efforts(self) -> FloatArray:
        """Efforts of all joints, shape (m, n) [N m]."""
        return _joined([samples.efforts[chosen] for samples, chosen in self.pieces], 0)

    @cached_property
    def flat(self) -> FloatArray:
        """Return derivatives 0 to 5 of every flat output, shape (n - 1, 6, m) [rad/s^k]."""
        return _joined([samples.flat[:, :, chosen] for samples, chosen in self.pieces], 2)

    @cached_property
    def _joint_motion(self) -> FloatArray:
        """Return positions, velocities and accelerations, shape (3, m, n)."""
        return _joined([samples.joint_motion[:, chosen] for samples, chosen in self.pieces], 1)


class Timeline:
    """
    Motions in the order of time, each until its own end or until the next one is spliced on.

    Parameters
    ----------
    motions
        None overlaps another.
    past
        The last one that has ended, if any has.

    """

    def __init__(self, motions: Sequence[Motion] = (), past: Motion | None = None) -> None:
        self.motions = tuple(motions)
        self._past = past

    @property
    def known(self) -> tuple[Motion, ...]:
        """Return the motions, and before them the last one that has ended, if any has."""
        return self.motions if self._past is None else (self._past, *self.motions)

    @property
    def last(self) -> Motion | None:
        """Return the motion that ends last."""
        return self.motions[-1] if self.motions else None

    def is_busy(self, now: float) -> bool:
        """Tell whether anything is still to be carried out."""
        return self.last is not None and now < self.last.end

    def at(self, time: float) -> Motion | None:
        """Return the motion in force at a time: the last one that has started, else the first."""
        started = [motion for motion in self.motions if motion.start <= time]
        return started[-1] if started else next(iter(self.motions), None)

    def splice_time(self, time: float) -> float:
        """Return the first time from a given one on at which another motion may be spliced on."""
        motion = self.at(time)
        if motion is None or not motion.start < time < motion.end:
            return time
        # A point that is sent anyway, so that the spacing of points stays what it is.
        times = motion.samples.times
        index = int(times.searchsorted(time - motion.start))
        return motion.start + float(times[index])

    def after(self, now: float) -> 'Timeline':
        """Return the timeline without what has come to its end."""
        ended = [motion for motion in self.known if motion.end <= now]
        if not ended or ended[-1] is self._past:
            return self
        left = [motion for motion in self.motions if now < motion.end]
        return Timeline(left, ended[-1])

    def with_motion(self, motion: Motion) -> 'Timeline':
        """Return the timeline in which a motion replaces all that was planned from its start."""
        kept = [
            replace(old, cut=motion.start) if motion.start < old.end else old
            for old in self.motions
            if old.start < motion.start
        ]
        return Timeline([*kept, motion], self._past)

    def moves(self, since: float, until: float) -> bool:
        """Tell whether any motion is planned for part of a time [s]."""
        return any(motion.start < until and since < motion.end for motion in self.motions)

    def replaced(self, time: float) -> list[Motion]:
        """Return the motions that would not come to their end if another one started then."""
        return [motion for motion in self.motions if time < motion.end]

    def track(self, now: float) -> Track:
        """
        Return the points of all that is still to be carried out.

        Begins at the last point that is not after the present one or, if nothing has begun, with
        the first motion.
        """
        left = self.after(now).motions or self.motions[-1:]
        first = left[0]
        if len(left) == 1 and now < first.start:
            piece = Piece(first.samples, slice(None))
            return Track(start=first.start, times=first.samples.times, pieces=(piece,))
        begun = int(first.samples.times.searchsorted(now - first.start, side='right')) - 1
        begun = max(begun, 0)
        # Later points stay on the old grid to the last bit: what is being played does not change.
        origin = float(first.samples.times[begun])
        start = first.start + origin
        times, pieces = [], []
        for motion, after in zip(left, [*left[1:], None], strict=True):
            grid, is_first = motion.samples.times, motion is first
            end = len(grid)
            if after is not None:
                end = int(grid.searchsorted(after.start - SPLICE_TOLERANCE - motion.start))
            chosen = slice(begun if is_first else 0, end)
            times.append(grid[chosen] + (-origin if is_first else motion.start - start))
            pieces.append(Piece(motion.samples, chosen))
        return Track(start=start, times=_joined(times, 0), pieces=tuple(pieces))


def _joined(parts: Sequence[FloatArray], axis: int) -> FloatArray:
    """Return arrays one after the other; one alone is taken as it is."""
    return parts[0] if len(parts) == 1 else np.concatenate(parts, axis)
