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

"""Execution: whether the arm does what is planned, on the way and at the end."""

from enum import Enum
from math import inf
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray, JointSample
from flat_planner_ros.core.planning import Reason, RequestRejected
from flat_planner_ros.core.session.settings import SessionSettings
from flat_planner_ros.core.session.timeline import Motion, Timeline
import numpy as np

CHECK_SPAN = 0.02
"""Time between two comparisons on the way [s]: each costs as much as hundreds of messages."""

REST_SPAN = 0.1
"""Time over which rest is judged where velocities are not measured [s]."""

STILL = 1e-3
"""Change of every joint angle up to which an arm has not moved [rad]; encoders are coarser."""

UNSEEN = 'no joint state tells whether the arm is there'
"""What is said of an end that nobody has seen."""


class Outcome(Enum):
    """How an accepted goal ended."""

    FINISHED = 'FINISHED'
    """At its final pose."""

    STOPPED = 'STOPPED'
    """At rest on the way."""

    PREEMPTED = 'PREEMPTED'
    """Replaced by another goal."""

    FAILED = 'FAILED'
    """Elsewhere, or still moving, when its time was over."""


class Shortfall(NamedTuple):
    """
    What an arm does instead of what is planned.

    Attributes
    ----------
    reason
        Name of the fault.
    message
        A clause with the numbers.
    joint
        The first that is off; empty where it is the clock.
    value, limit
        What was measured and what is allowed, [rad] or [rad/s]; the jump of a clock [s], and 0.

    """

    reason: Reason
    message: str
    joint: str
    value: float
    limit: float


class Ended(NamedTuple):
    """
    A motion that has ended, and how.

    Attributes
    ----------
    motion, outcome
        The motion and its end.
    shortfall
        Why it has failed, None if it has not.
    remark
        What else is to be said, a clause; empty for nothing.

    """

    motion: Motion
    outcome: Outcome
    shortfall: Shortfall | None = None
    remark: str = ''


class Astray(NamedTuple):
    """A motion under way that the arm does not follow, and what it does instead."""

    motion: Motion
    shortfall: Shortfall


def check_carried_out(
    settings: SessionSettings, timeline: Timeline, measured: JointSample | None, now: float
) -> None:
    """
    Refuse a splice while the arm is far from what it is planned to do.

    Its executor has then lost the motion, restarted perhaps, and would refuse what continues it.
    Without a fresh measured state there is nothing to compare.

    Parameters
    ----------
    settings
        With the tolerance.
    timeline
        What is planned.
    measured
        Last measured state, None before the first.
    now
        Present time [s].

    Raises
    ------
    RequestRejected
        An actuated joint is beyond the tolerance.

    """
    if measured is None or abs(now - measured.time) > settings.joint_state_timeout:
        return
    astray = _astray(settings, timeline, measured)
    if astray is not None:
        off = astray.shortfall
        raise RequestRejected(
            Reason.START_STATE_MISMATCH,
            f'{off.message}: the arm does not carry it out, call ~/stop or wait for its end at '
            f'{astray.motion.end:.3f} s',
            joint=off.joint,
            value=off.value,
            limit=off.limit,
        )


def clock_fault(why: str, jump: float) -> Shortfall:
    """Return why a motion has failed that was planned for the times of a clock that jumps [s]."""
    message = f'{why}: nothing that was planned counts any more'
    return Shortfall(Reason.CLOCK_JUMPED, message, '', jump, 0.0)


class ExecutionWatch:
    """
    Compares what is measured with what is planned; whatever it finds is said once.

    Attributes
    ----------
    answer
        What the controller says of the last command that it was sent, a clause; empty before.

    """

    def __init__(self) -> None:
        """Watch nothing."""
        self.answer = ''
        self._arrivals: list[_Arrival] = []
        self._checked = -inf
        self._told = 0
        self._astray: list[Astray] = []

    def follow(self, settings: SessionSettings, timeline: Timeline, sample: JointSample) -> None:
        """Compare a sample with the motion under way, once in CHECK_SPAN."""
        if 0.0 <= sample.time - self._checked < CHECK_SPAN:
            return
        self._checked = sample.time
        if not timeline.moves(sample.time, sample.time):
            return
        astray = _astray(settings, timeline, sample)
        if astray is not None and astray.motion.plan_id != self._told:
            self._told = astray.motion.plan_id
            self._astray.append(astray)

    def take_astray(self) -> list[Astray]:
        """Return, once, the motions that the arm has left."""
        astray, self._astray = self._astray, []
        return astray

    @property
    def expected(self) -> list[Motion]:
        """Return the motions whose time is over, and of whose end nothing was said yet."""
        return [arrival.motion for arrival in self._arrivals]

    def expect(self, motion: Motion) -> None:
        """Look for the arm at the end of a motion whose time is over."""
        self._arrivals.append(_Arrival(motion))

    def take_arrived(
        self,
        settings: SessionSettings,
        timeline: Timeline,
        measured: JointSample | None,
        now: float,
    ) -> list[Ended]:
        """
        Return, once and in order, the motions of whose end something can be said.

        Parameters
        ----------
        settings
            With tolerances and patience.
        timeline
            What is under way since.
        measured
            Last measured state, None before the first.
        now
            Present time [s]; infinite where nothing more can be waited for.

        """
        ended = []
        while self._arrivals:
            verdict = self._arrivals[0].verdict(settings, timeline, measured, now)
            if verdict is None or self._awaits_answer(settings, timeline, now):
                break
            ended.append(self._with_answer(settings, timeline, verdict))
            del self._arrivals[0]
        return ended

    def _awaits_answer(self, settings: SessionSettings, timeline: Timeline, now: float) -> bool:
        """Tell whether the controller is to say something of the last motion, and may still."""
        if not settings.awaits_answer or self.answer or timeline.last is not None:
            return False
        last = self._arrivals[-1].motion
        return len(self._arrivals) == 1 and now < last.end + settings.finish_patience

    def _with_answer(self, settings: SessionSettings, timeline: Timeline, ended: Ended) -> Ended:
        """Return the end of a motion with what the controller says of it, if it is the last."""
        if not settings.awaits_answer or timeline.last is not None or len(self._arrivals) > 1:
            return ended
        said = self.answer or 'the controller has not answered'
        return ended._replace(remark='; '.join(filter(None, (ended.remark, said))))


class _Arrival:
    """A motion whose time is over, until it is known whether the arm is there."""

    def __init__(self, motion: Motion) -> None:
        self.motion = motion
        self._base: tuple[float, FloatArray] | None = None
        self._drift: FloatArray | float = np.nan

    def verdict(
        self,
        settings: SessionSettings,
        timeline: Timeline,
        measured: JointSample | None,
        now: float,
    ) -> Ended | None:
        """Return how the motion has ended, None while that is not to be said yet."""
        motion = self.motion
        as_planned = Outcome.STOPPED if motion.is_stop else Outcome.FINISHED
        if settings.finish_tolerance == 0.0:
            return Ended(motion, as_planned)
        if measured is None or measured.time < motion.end - settings.joint_state_timeout:
            return Ended(motion, as_planned, remark=UNSEEN)
        is_over = now >= motion.end + settings.finish_patience
        if measured.time < motion.end and now < inf:
            return Ended(motion, as_planned, remark=UNSEEN) if is_over else None
        shortfall = self._shortfall(settings, timeline, measured, is_over=is_over)
        if shortfall is None:
            return Ended(motion, as_planned)
        return Ended(motion, Outcome.FAILED, shortfall) if is_over else None

    def _shortfall(
        self,
        settings: SessionSettings,
        timeline: Timeline,
        measured: JointSample,
        *,
        is_over: bool,
    ) -> Shortfall | None:
        """Return what the arm lacks of being there at rest; where it is to be may move on."""
        wanted = (timeline.at(measured.time) or self.motion).reference(measured.time)
        off = (measured.positions - wanted.positions[0])[:-1]
        tolerance = settings.finish_tolerance
        for joint, name in enumerate(settings.joints[:-1]):
            # Written so that NaN is not there.
            if not abs(off[joint]) <= tolerance:
                position = float(measured.positions[joint])
                place = wanted.positions[0, joint]
                return Shortfall(
                    Reason.GOAL_TOLERANCE_VIOLATED,
                    f'{name} is at {position:.4g} rad, not at {place:.4g} rad '
                    f'(finish.position_tolerance {tolerance:g} rad){self._stillness(measured)}',
                    name,
                    position,
                    tolerance,
                )
        speeds = self._speeds(measured, wanted.velocities[0], off)
        speeds = np.nan_to_num(speeds, nan=0.0 if is_over else inf)
        limit = settings.velocity_tolerance
        for name, speed in zip(settings.joints[:-1], speeds.tolist(), strict=True):
            if abs(speed) > limit:
                return Shortfall(
                    Reason.GOAL_TOLERANCE_VIOLATED,
                    f'{name} does not come to rest: it moves at {speed:.4g} rad/s '
                    f'(start.velocity_tolerance {limit:g} rad/s)',
                    name,
                    speed,
                    limit,
                )
        return None

    def _stillness(self, measured: JointSample) -> str:
        """Return that nothing has moved, if so."""
        start = self.motion.plan.request.start
        moved = np.abs(measured.positions - start)[:-1].max()
        return ': the arm has not moved' if moved <= STILL else ''

    def _speeds(self, measured: JointSample, wanted: FloatArray, off: FloatArray) -> FloatArray:
        """Return the actuated joints' velocities beside the wanted ones, NaN while unknown."""
        known = np.full(len(off), np.nan)
        if measured.velocities is not None:
            known = (measured.velocities - wanted)[:-1]
        if not np.isnan(known).any():
            return known
        if self._base is None:
            self._base = measured.time, off
        time, former = self._base
        elapsed = measured.time - time
        if elapsed >= REST_SPAN:
            self._base = measured.time, off
            self._drift = (off - former) / elapsed
        return np.where(np.isnan(known), self._drift, known)


def _astray(settings: SessionSettings, timeline: Timeline, sample: JointSample) -> Astray | None:
    """Return the motion in force at the time of a sample, if an actuated joint is far from it."""
    limit = settings.replan_tolerance
    motion = timeline.at(sample.time)
    # What was planned before the first motion left is not known any more.
    if limit == 0.0 or motion is None or sample.time < motion.start:
        return None
    planned = motion.reference(sample.time).positions[0]
    for name, position, reference in zip(
        settings.joints[:-1], sample.positions.tolist(), planned.tolist(), strict=False
    ):
        if abs(position - reference) > limit:
            message = (
                f'{name} is measured at {position:.4g} rad, but motion {motion.plan_id} is then '
                f'at {reference:.4g} rad (replan.tolerance {limit:g} rad)'
            )
            reason = Reason.PATH_TOLERANCE_VIOLATED
            return Astray(motion, Shortfall(reason, message, name, position, limit))
    return None
