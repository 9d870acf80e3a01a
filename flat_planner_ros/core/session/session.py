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

"""Session of a planner: goals and measurements in, motions out, in the order of time."""

from collections.abc import Callable
from dataclasses import replace
from enum import Enum
from typing import NamedTuple

from flat_planner_ros.core.arm import JointSample
from flat_planner_ros.core.planning import PlanSamples, Reason, RequestRejected, stop_plan
from flat_planner_ros.core.session.answer import answer
from flat_planner_ros.core.session.goal import Goal, rest_target
from flat_planner_ros.core.session.rest_start import RestStart
from flat_planner_ros.core.session.settings import SessionSettings
from flat_planner_ros.core.session.takeover import check_follows, Origin, takeover, too_late
from flat_planner_ros.core.session.timeline import Motion, Timeline, Track
import numpy as np

Clock = Callable[[], float]

HANDOVER = 0.25
"""Part of the lookahead that is left for a command to reach its executor [-]."""


class Outcome(Enum):
    """How an accepted goal ended."""

    FINISHED = 'FINISHED'
    """At its final pose."""

    STOPPED = 'STOPPED'
    """At rest on the way."""

    PREEMPTED = 'PREEMPTED'
    """Replaced by another goal."""


class Ended(NamedTuple):
    """A motion that has ended, and how."""

    motion: Motion
    outcome: Outcome


class PlannerSession:
    """
    Answer goals with motions; a new one replaces what was planned from its start on.

    Parameters
    ----------
    settings
        Valid for the goals to come.

    """

    def __init__(self, settings: SessionSettings) -> None:
        """Start at rest, without a measurement."""
        self.settings = settings
        self._rest = RestStart()
        self._timeline = Timeline()
        self._motion: Motion | None = None
        self._ended: list[Ended] = []
        self._count = 0
        self._last_goal: Goal | None = None

    @property
    def motion(self) -> Motion | None:
        """Return the motion accepted last."""
        return self._motion

    @property
    def last_goal(self) -> Goal:
        """
        Return the goal accepted last, to be started as soon as possible.

        Raises
        ------
        RequestRejected
            There has been none.

        """
        if self._last_goal is None:
            raise RequestRejected(Reason.EMPTY_GOAL, 'no goal has been accepted yet')
        return self._last_goal

    @property
    def measured(self) -> JointSample | None:
        """Return the last measured state, None before the first."""
        return self._rest.measured

    def measure(self, sample: JointSample) -> None:
        """Take the measured state, in the order of the session's joints, unless it comes late."""
        self._rest.measure(sample, self.settings.measurement_timeout)

    def submit(self, goal: Goal, now: float, clock: Clock | None = None) -> Motion:
        """
        Return the motion that answers a goal.

        Parameters
        ----------
        goal
            The request.
        now
            Present time [s].
        clock
            Tells the time after planning, which decides when the motion can start; None if
            planning is to take no time.

        Raises
        ------
        RequestRejected
            The goal breaks a rule; all that is planned already is untouched.
        FlatPlannerError
            The settings allow no plan.

        """
        _check_time(now)
        settings = self.settings
        target = rest_target(goal, settings.joints)
        duration = settings.checked_duration(target.duration)
        origin = self._origin(goal.stamp, now)
        if origin.before is not None:
            check_follows(settings, self._timeline, self._rest.measured, now)
        timed = answer(settings, origin, target, duration)
        wanted = settings.options.strategy
        motion = Motion(
            plan_id=self._count + 1,
            plan=timed.plan,
            samples=timed.plan.sample(settings.period),
            start=origin.time,
            planned_at=now,
            duration_min=timed.duration_min,
            exceeded=timed.exceeded,
            replaced_strategy=None if timed.plan.options.strategy is wanted else wanted,
        )
        motion = self._launched(motion, origin, goal.stamp, clock)
        self._last_goal = Goal(joint_names=goal.joint_names, points=goal.points)
        return motion

    def stop(self, now: float, clock: Clock | None = None) -> Motion | None:
        """
        Return the motion that brings the arm to rest early, None if nothing is under way.

        Parameters
        ----------
        now, clock
            As for `submit`.

        Raises
        ------
        RequestRejected
            The arm cannot be brought to rest any sooner; all that is planned is untouched.

        """
        _check_time(now)
        if not self._timeline.is_busy(now):
            return None
        origin = self._origin(None, now)
        running = origin.before
        if running is None or running.stops or (origin.jets is None and now >= running.start):
            raise RequestRejected(
                Reason.BUSY, 'the arm comes to rest within replan.lookahead as it is'
            )
        limits = self.settings.duration_rules(origin.pose).limits
        remaining = running.end - origin.time
        planned = stop_plan(running.plan, origin.pose, origin.jets, remaining, limits)
        motion = Motion(
            plan_id=running.plan_id,
            plan=planned,
            samples=planned.sample(self.settings.period),
            start=origin.time,
            planned_at=now,
            stops=True,
        )
        return self._launched(motion, origin, None, clock)

    def ended(self, now: float) -> list[Ended]:
        """Return, once, the motions that have come to an end or been replaced."""
        ended = [
            Ended(motion, Outcome.STOPPED if motion.stops else Outcome.FINISHED)
            for motion in self._timeline.motions
            if motion.cut is None and motion.end <= now
        ]
        ended += self._ended
        self._ended = []
        self._timeline = self._timeline.after(now)
        return ended

    def track(self, now: float) -> Track:
        """Return all that is still to be carried out, as an executor is to be sent it."""
        if self.settings.execute or self._motion is None:
            return self._timeline.track(now)
        return Timeline([self._motion]).track(now)

    def moves(self, since: float, until: float) -> bool:
        """Tell whether any motion is planned for part of a time [s]."""
        return self._timeline.moves(since, until)

    def reference(self, now: float) -> PlanSamples | None:
        """Return what is planned for the present, at rest before and after; one sample."""
        motion = self._timeline.at(now) or self._motion
        return None if motion is None else motion.reference(now)

    def _launched(
        self, motion: Motion, origin: Origin, stamp: float | None, clock: Clock | None
    ) -> Motion:
        """Return a motion with its place in time, which it takes unless planning took too long."""
        settings = self.settings
        now = motion.planned_at if clock is None else clock()
        if origin.before is None:
            if stamp is None:
                motion = replace(motion, start=now + settings.start_delay)
            elif stamp < now:
                raise too_late(stamp, now)
        elif origin.time - now < HANDOVER * settings.lookahead and clock is not None:
            raise RequestRejected(
                Reason.BUSY,
                f'planning took {now - motion.planned_at:.3f} s, too long for a start in motion '
                f'{settings.lookahead:g} s ahead (replan.lookahead); the motion goes on',
                value=now - motion.planned_at,
                limit=(1.0 - HANDOVER) * settings.lookahead,
            )
        if settings.execute:
            for old in self._timeline.replaced(motion.start):
                if not (motion.stops and old.plan_id == motion.plan_id):
                    self._ended.append(Ended(old, Outcome.PREEMPTED))
            self._timeline = self._timeline.with_motion(motion)
        self._count = motion.plan_id if not motion.stops else self._count
        self._motion = motion
        return motion

    def _origin(self, stamp: float | None, now: float) -> Origin:
        """Return where a motion starts."""
        settings = self.settings
        if stamp is not None and stamp < now:
            raise too_late(stamp, now)
        if not self._timeline.is_busy(now):
            time = now + settings.start_delay if stamp is None else stamp
            reference = None if self._motion is None else self._motion.plan.request.final.tolist()
            pose = self._rest.pose(settings, reference, now)
            return Origin(time, np.array(pose))
        if not settings.is_stamped:
            raise RequestRejected(
                Reason.BUSY,
                'another motion is under way; none can take over from it as commands have no '
                'stamp (command.stamp)',
            )
        return takeover(self._timeline, stamp, now + settings.lookahead)


def _check_time(now: float) -> None:
    """Refuse to plan before there is a time."""
    if now <= 0.0:
        raise RequestRejected(
            Reason.START_STATE_UNKNOWN,
            'there is no time yet: use_sim_time is set, but no /clock has been received',
        )
