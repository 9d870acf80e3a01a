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

"""Takeover: where a motion starts that follows another one without a step."""

from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray, JointSample
from flat_planner_ros.core.planning import CONDITIONS, Reason, RequestRejected
from flat_planner_ros.core.session.settings import SessionSettings
from flat_planner_ros.core.session.timeline import Motion, Timeline
import numpy as np


class Origin(NamedTuple):
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
    before
        The motion in force then, if one is.

    """

    time: float
    pose: FloatArray
    jets: FloatArray | None = None
    before: Motion | None = None


def takeover(timeline: Timeline, stamp: float | None, soonest: float) -> Origin:
    """
    Return the start of a motion that takes over from what is planned.

    Parameters
    ----------
    timeline
        Busy: a motion is under way or waits for its start.
    stamp
        Absolute time at which it is to start [s]; None for as soon as possible.
    soonest
        Earliest time at which it can take over from a moving arm [s].

    Raises
    ------
    RequestRejected
        The arm moves then, and it is too soon.

    """
    time = timeline.seam(soonest) if stamp is None else stamp
    before = timeline.at(time)
    if before is None:  # is_busy says otherwise
        raise RequestRejected(Reason.INTERNAL, 'there is no motion to start from')
    elapsed = time - before.start
    request = before.plan.request
    if elapsed < 0.0 or (elapsed == 0.0 and request.start_jets is None):
        return Origin(time, request.start, before=before)
    if time >= before.end:
        return Origin(time, before.plan.request.final, before=before)
    if time < soonest:
        raise RequestRejected(
            Reason.OLD_HEADER_TIMESTAMP,
            f'motion {before.plan_id} is under way: another one can take over from '
            f'{soonest:.3f} s on (replan.lookahead), not at {time:.3f} s',
            value=time,
            limit=soonest,
        )
    if (
        elapsed == 0.0
    ):  # Two goals within one period of the command: the later one takes its place.
        return Origin(time, request.start, request.start_jets, before)
    times = np.array([elapsed])
    return Origin(
        time,
        before.plan.at(times).positions[0],
        before.plan.trajectory.jets(times)[:, :CONDITIONS, 0],
        before,
    )


def check_follows(
    settings: SessionSettings, timeline: Timeline, measured: JointSample | None, now: float
) -> None:
    """
    Refuse a takeover while the arm is far from what it is planned to do.

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
    limit = settings.replan_tolerance
    if limit == 0.0 or measured is None:
        return
    motion = timeline.at(measured.time)
    is_fresh = abs(now - measured.time) <= settings.measurement_timeout
    # What was planned before the first motion left is not known any more.
    if not is_fresh or motion is None or measured.time < motion.start:
        return
    planned = motion.reference(measured.time).positions[0]
    actuated = zip(settings.joints[:-1], measured.positions, planned, strict=False)
    for name, position, reference in actuated:
        if abs(position - reference) > limit:
            raise RequestRejected(
                Reason.START_STATE_MISMATCH,
                f'{name} is measured at {position:.4g} rad, but motion {motion.plan_id} is then '
                f'at {reference:.4g} rad (replan.tolerance {limit:g} rad): the arm does not carry '
                f'it out, call ~/stop or wait for its end at {motion.end:.3f} s',
                joint=name,
                value=float(position),
                limit=limit,
            )


def too_late(stamp: float, now: float) -> RequestRejected:
    """Return the refusal of a start in the past [s]."""
    return RequestRejected(
        Reason.OLD_HEADER_TIMESTAMP,
        f'the stamp {stamp:.3f} s lies {now - stamp:.3f} s in the past; 0 means as soon as '
        f'possible',
        value=stamp,
        limit=now,
    )
