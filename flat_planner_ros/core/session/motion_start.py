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

"""Start of a motion: at rest, or in the midst of another motion, spliced to it without a step."""

from math import nan
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray, JointSample
from flat_planner_ros.core.planning import CONDITIONS, Reason, RequestRejected
from flat_planner_ros.core.session.caught_start import (
    is_driven,
    is_moving,
    measured_start,
    Swing,
    swing_time,
)
from flat_planner_ros.core.session.recent_states import RecentStates
from flat_planner_ros.core.session.settings import (
    ReplanFrom,
    SessionSettings,
    StartSource,
    WhenMoving,
)
from flat_planner_ros.core.session.timeline import Motion, Timeline
import numpy as np

AHEAD = 0.2
"""How far ahead of the present a state may be stamped, relative to the age that is stale [-]."""


MAX_AHEAD = 3600.0
"""Longest time to its start for which a goal is taken [s]: beyond, it came by another clock."""


class MotionStart(NamedTuple):
    """
    Where a motion starts.

    Attributes
    ----------
    time
        Absolute [s].
    pose
        Angles of all joints, shape (n,) [rad].
    jets
        Derivatives 0 to 5 of the planned variables where the arm is planned to move then, shape
        (n - 1, 6) [rad/s^k]; None at rest.
    running
        The motion in force then, if one is.
    swing
        What the arm does, where the start is a measured one in motion; else None.

    """

    time: float
    pose: FloatArray
    jets: FloatArray | None = None
    running: Motion | None = None
    swing: Swing | None = None

    @property
    def may_wait(self) -> bool:
        """Tell whether the motion may as well start later: the arm rests until then."""
        return self.running is None and self.jets is None


def motion_start(
    settings: SessionSettings,
    timeline: Timeline,
    recent: RecentStates,
    last: FloatArray | None,
    stamp: float | None,
    now: float,
    lack: str = '',
) -> MotionStart:
    """
    Return where a motion starts: at rest, in a swing, or spliced to what is planned.

    Parameters
    ----------
    settings
        Source of a start at rest, tolerances, delays.
    timeline
        Motions that are planned.
    recent
        Measured states.
    last
        Angles at the end of the last motion, shape (n,) [rad]; None if there has been none.
    stamp
        Absolute time at which it is to start [s]; None for as soon as possible.
    now
        Present time [s].
    lack
        Why there is no present state, if that is known: a clause for the refusal.

    Raises
    ------
    RequestRejected
        The stamp is past, the start not known, the arm does not rest there, or it moves and
        cannot be taken over then.

    """
    check_stamp(stamp, now)
    if not timeline.is_busy(now):
        caught = _caught(settings, timeline, recent, stamp, now)
        if caught is not None:
            return caught
        time = now + settings.start_delay if stamp is None else stamp
        return MotionStart(time, _pose_at_rest(settings, recent.last, last, now, lack))
    if not settings.is_stamped:
        raise RequestRejected(
            Reason.BUSY,
            'another motion is under way; none can take over from it as commands have no '
            'stamp (command.stamp)',
        )
    start = _splice(timeline, stamp, now + settings.lookahead)
    if settings.replan_from is ReplanFrom.REFERENCE or start.jets is None:
        return start
    return start_in_motion(settings, timeline, recent, start.time, now) or start


def start_in_motion(
    settings: SessionSettings,
    timeline: Timeline,
    recent: RecentStates,
    time: float,
    now: float,
) -> MotionStart | None:
    """
    Return the measured start at an absolute time [s].

    None if too little is known for it, or if something else than what is planned moves the arm.
    """
    measured = recent.last
    if measured is None or abs(now - measured.time) > settings.joint_state_timeout:
        return None
    if not timeline.is_busy(now) and is_driven(settings, measured):
        return None
    found = measured_start(settings, recent, timeline, time)
    if found is None:
        return None
    running = timeline.at(time) if timeline.is_busy(time) else None
    return MotionStart(time, found.pose, found.jets, running, found.swing)


def _caught(
    settings: SessionSettings,
    timeline: Timeline,
    recent: RecentStates,
    stamp: float | None,
    now: float,
) -> MotionStart | None:
    """Return the start in a swing, None if the arm is at rest or swings are not to be caught."""
    is_measured = settings.start_source in (StartSource.AUTO, StartSource.MEASURED)
    is_wanted = settings.when_moving is WhenMoving.CATCH and is_measured and settings.is_stamped
    if not is_wanted or recent.last is None or not is_moving(settings, timeline, recent):
        return None
    soonest = now + settings.lookahead
    time = soonest if stamp is None else stamp
    latest = now + swing_time(settings)
    if time > latest:
        return None
    if time < soonest:
        raise RequestRejected(
            Reason.OLD_HEADER_TIMESTAMP,
            f'the arm moves: a motion can take over from {soonest:.3f} s on (replan.lookahead), '
            f'not at {time:.3f} s',
            value=time,
            limit=soonest,
        )
    return start_in_motion(settings, timeline, recent, time, now)


def _pose_at_rest(
    settings: SessionSettings,
    measured: JointSample | None,
    last: FloatArray | None,
    now: float,
    lack: str,
) -> FloatArray:
    """Return the pose from which a motion starts at rest, checked against what is measured."""
    timeout = settings.joint_state_timeout
    if settings.start_source in (StartSource.AUTO, StartSource.MEASURED):
        measured = _fresh(measured, timeout, now, lack)
        pose = measured.positions.copy()
        pose[-1] = 0.0
    else:
        if settings.start_source is StartSource.PARAMETER:
            pose = np.array(settings.start_position)
        elif last is not None:
            pose = last
        else:
            raise RequestRejected(
                Reason.START_STATE_UNKNOWN,
                'start.source is reference, but there has been no motion yet',
            )
        if measured is None:
            return pose
        measured = _fresh(measured, timeout, now, lack)
    _check_at_rest(settings, measured, pose)
    return pose


def _splice(timeline: Timeline, stamp: float | None, soonest: float) -> MotionStart:
    """
    Return the start of a motion in the midst of what is planned, which must be busy.

    Before `soonest` the moving arm cannot be taken over.
    """
    time = timeline.splice_time(soonest) if stamp is None else stamp
    running = timeline.at(time)
    if running is None:  # is_busy says otherwise
        raise RequestRejected(Reason.INTERNAL, 'there is no motion to start from')
    elapsed = time - running.start
    request = running.plan.request
    if elapsed <= 0.0 and request.start_jets is None:
        return MotionStart(time, request.start, running=running)
    if elapsed < 0.0:  # it waits to catch a swing, whose state is known for its start
        return _waiting(running, stamp)
    if time >= running.end:
        return MotionStart(time, request.final, running=running)
    if time < soonest:
        raise RequestRejected(
            Reason.OLD_HEADER_TIMESTAMP,
            f'motion {running.plan_id} is under way: another one can take over from '
            f'{soonest:.3f} s on (replan.lookahead), not at {time:.3f} s',
            value=time,
            limit=soonest,
        )
    if elapsed == 0.0:
        # Two goals within one period of the command: the later one takes its place.
        return MotionStart(time, request.start, request.start_jets, running)
    samples = running.reference(time)
    return MotionStart(time, samples.positions[0], samples.planned[:, :CONDITIONS, 0], running)


def _waiting(running: Motion, stamp: float | None) -> MotionStart:
    """Return the start of a motion in the place of one that waits for its start in a swing."""
    time = running.start
    if stamp is not None:
        raise RequestRejected(
            Reason.BUSY,
            f'motion {running.plan_id} catches the arm at {time:.3f} s: another one can take over '
            f'from then on',
        )
    request = running.plan.request
    return MotionStart(time, request.start, request.start_jets, running)


def check_time(now: float) -> None:
    """Refuse to plan before there is a time."""
    if now <= 0.0:
        raise RequestRejected(
            Reason.START_STATE_UNKNOWN,
            'there is no time yet: use_sim_time is set, but no /clock has been received',
        )


def check_stamp(stamp: float | None, now: float) -> None:
    """Refuse a start in the past, or so far ahead that nobody waits for it [s]."""
    if stamp is not None and stamp - now > MAX_AHEAD:
        raise RequestRejected(
            Reason.INVALID_GOAL,
            f'the stamp {stamp:.3f} s lies {stamp - now:.0f} s ahead of the present {now:.3f} s, '
            f'more than {MAX_AHEAD:g} s: do the sender and the planner go by the same clock '
            f'(use_sim_time)?',
            value=stamp,
            limit=now + MAX_AHEAD,
        )
    if stamp is not None and stamp < now:
        raise RequestRejected(
            Reason.OLD_HEADER_TIMESTAMP,
            f'the stamp {stamp:.3f} s lies {now - stamp:.3f} s in the past; 0 means as soon as '
            f'possible',
            value=stamp,
            limit=now,
        )


def _fresh(measured: JointSample | None, limit: float, now: float, lack: str) -> JointSample:
    """Return the measured state unless there is none, or only an old one."""
    if measured is None:
        raise RequestRejected(
            Reason.START_STATE_UNKNOWN, lack or 'no joint state of this arm has been received yet'
        )
    age, ahead = now - measured.time, AHEAD * limit
    if age < -ahead:
        raise RequestRejected(
            Reason.START_STATE_STALE,
            f'the last joint state is stamped {-age:.3f} s ahead of the present, more than '
            f'{ahead:g} s: the planner and its source must go by the same clock (use_sim_time; '
            f'synchronised clocks of two computers)',
            value=age,
            limit=-ahead,
        )
    if not age <= limit:
        raise RequestRejected(
            Reason.START_STATE_STALE,
            f'the last joint state is {age:.3f} s old, more than {limit:g} s'
            f'{": " if lack else ""}{lack}',
            value=age,
            limit=limit,
        )
    return measured


def _check_at_rest(settings: SessionSettings, measured: JointSample, planned: FloatArray) -> None:
    """Refuse to start from another place, or while the arm still moves."""
    known = measured.velocities
    velocities = [nan] * len(planned) if known is None else known.tolist()
    for name, position, velocity, start in zip(
        settings.joints, measured.positions.tolist(), velocities, planned.tolist(), strict=True
    ):
        # Written so that a NaN position is refused and a NaN velocity is not.
        if not abs(position - start) <= settings.position_tolerance:
            raise RequestRejected(
                Reason.START_STATE_MISMATCH,
                f'{name} is measured at {position:.4g} rad, not at the start {start:.4g} rad '
                f'(tolerance {settings.position_tolerance:g} rad)',
                joint=name,
                value=position,
                limit=settings.position_tolerance,
            )
        if abs(velocity) > settings.velocity_tolerance:
            raise RequestRejected(
                Reason.NOT_AT_REST,
                f'{name} moves at {velocity:.4g} rad/s, more than '
                f'{settings.velocity_tolerance:g} rad/s',
                joint=name,
                value=velocity,
                limit=settings.velocity_tolerance,
            )
