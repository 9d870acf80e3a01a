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

from dataclasses import replace
from math import inf
from typing import Any

from flat_planner_ros.core.arm import FloatArray, JointSample
from flat_planner_ros.core.planning import (
    Plan,
    PlanSamples,
    Reason,
    RequestRejected,
)
from flat_planner_ros.core.session.allowance import allowance_for, Clock, DELIVERY_SHARE
from flat_planner_ros.core.session.caught_start import is_moving
from flat_planner_ros.core.session.delivery import Delivery
from flat_planner_ros.core.session.execution import (
    Astray,
    check_carried_out,
    Ended,
    ExecutionWatch,
    Outcome,
    Shortfall,
)
from flat_planner_ros.core.session.goal import checked_goal, Goal
from flat_planner_ros.core.session.goal_plan import plan_of_goal, settling_plan, stopping_plan
from flat_planner_ros.core.session.motion_start import (
    check_stamp,
    check_time,
    motion_start,
    MotionStart,
    start_in_motion,
)
from flat_planner_ros.core.session.recent_states import RecentStates
from flat_planner_ros.core.session.remarks import (
    hurry_remarks,
    remarks_finder,
    turns_remarks,
)
from flat_planner_ros.core.session.settings import SessionSettings, StartSource
from flat_planner_ros.core.session.timeline import Motion, Timeline, Track


class PlannerSession:
    """
    Answer goals with motions; a new one replaces what was planned from its start on.

    Parameters
    ----------
    settings
        Valid for the goals to come.

    Attributes
    ----------
    lack
        Why joint states that come in parts give no present sample, a clause; to be set by whoever
        reads them. Empty where they do.
    source
        Topic of joint states, which refusals for want of one name.

    """

    def __init__(self, settings: SessionSettings) -> None:
        """Start at rest, without a measurement."""
        self.settings = settings
        self.lack = ''
        self._recent = RecentStates()
        self.source = 'joint_states'
        self._timeline = Timeline()
        self._motion: Motion | None = None
        self._ended: list[Ended] = []
        self._watch = ExecutionWatch()
        self._delivery = Delivery()
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
        return self._recent.last

    def measure(self, sample: JointSample, arrival: float | None = None) -> None:
        """Take a measured state, in the order of the joints; its arrival [s] tells of delays."""
        if arrival is not None:
            self._delivery.hear(arrival - sample.time)
        last = self._recent.last
        age = 0.0 if last is None else last.time - sample.time
        # Far back is no late message, but a clock that was set back.
        if not 0.0 < age <= self.settings.joint_state_timeout:
            self._recent.add(sample)

    @property
    def lateness(self) -> str:
        """Return why commands will come late, a clause; empty if they need not."""
        return self._delivery.doubt(self.settings)

    def drop(self, fault: Shortfall) -> int:
        """Give up all that is planned, and what is measured. Return how many motions fail."""
        last = self._recent.last
        self._ended += self._watch.take_arrived(self.settings, self._timeline, last, inf)
        failed = self.give_up(fault)
        self._recent, self._delivery = RecentStates(), Delivery()
        return failed

    def give_up(self, fault: Shortfall) -> int:
        """Give up all that is planned or was not seen to end. Return how many motions fail."""
        planned = [motion for motion in self._timeline.motions if motion.cut is None]
        failed = [*self._watch.expected, *planned]
        self._ended += [Ended(motion, Outcome.FAILED, fault) for motion in failed]
        self._timeline, self._motion, self._watch = Timeline(), None, ExecutionWatch()
        return len(failed)

    def answered(self, words: str) -> None:
        """Take what the controller says of a command that it has carried out, a clause."""
        self._watch.answer = words

    def knows_start(self, now: float) -> bool:
        """Tell whether goals can be judged: there is a time [s], and a state where one counts."""
        is_measured = self.settings.start_source in (StartSource.AUTO, StartSource.MEASURED)
        is_known = self._recent.last is not None or self._timeline.is_busy(now) or not is_measured
        return now > 0.0 and is_known

    def patience(self, goal: Goal, now: float) -> float:
        """
        Return how long a goal may wait until its start is known [s], until its stamp at most.

        Raises
        ------
        RequestRejected
            The goal breaks a rule whatever its start is.

        """
        asked = checked_goal(goal, self.settings.joints)
        self.settings.checked_duration(asked.duration)
        left = self.settings.start_wait
        if goal.stamp is not None:
            left = min(left, goal.stamp - now - self.settings.start_delay)
        return max(left, 0.0)

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
        settings = self._applied
        asked = checked_goal(goal, settings.joints)
        duration = settings.checked_duration(asked.duration)
        check_time(now)
        start = self._start(goal.stamp, now)
        if start.running is not None:
            check_carried_out(settings, self._timeline, self._recent.last, now)
        allowance = allowance_for(start, now, clock, settings.lookahead)
        try:
            found, exceeded = plan_of_goal(settings, start, asked, duration, allowance)
        except RequestRejected as error:
            turns = turns_remarks(settings, asked, start.pose)
            raise replace(error, message='; '.join([error.message, *turns])) from error
        is_gentle = duration is None and settings.duration_factor > 1.0
        hurry = hurry_remarks(settings, allowance)
        motion = self._motion_of(
            found,
            start,
            now,
            is_shortest=found.duration != duration and not (is_gentle or hurry),
            duration_factor=settings.duration_factor if is_gentle else 1.0,
            exceeded=exceeded,
            find_remarks=remarks_finder(settings, asked, start, now, hurry),
        )
        motion = self._accepted(motion, start, goal.stamp, clock)
        again = goal.without_start
        self._last_goal = again if again.stamp is None else replace(again, stamp=None)
        return motion

    def settle(self, now: float, clock: Clock | None = None) -> Motion | None:
        """
        Return the motion that brings the arm to rest from what is measured, None at rest.

        Parameters
        ----------
        now, clock
            As for `submit`.

        Raises
        ------
        RequestRejected
            Too little is known of the arm's motion, or the limits allow none to rest; all that is
            planned is untouched.

        """
        check_time(now)
        settings, timeline = self._applied, self._timeline
        if not timeline.is_busy(now) and not is_moving(settings, timeline, self._recent):
            return None
        time = timeline.splice_time(now + settings.lookahead)
        start = start_in_motion(settings, timeline, self._recent, time, now)
        if start is None or not settings.is_stamped:
            raise RequestRejected(
                Reason.START_STATE_UNKNOWN,
                'no free swing is measured: there are too few joint states, the passive joint '
                'stands beside its zero, or something else moves the arm'
                if start is None
                else 'commands have no stamp (command.stamp), so that no start can be foreseen',
            )
        found = settling_plan(settings, start, self._last_pose)
        number = self._count + 1 if start.running is None else start.running.plan_id
        motion = self._motion_of(found, start, now)
        motion = replace(motion, plan_id=number, is_stop=True, is_shortest=True)
        return self._accepted(motion, start, None, clock)

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
        check_time(now)
        if not self._timeline.is_busy(now):
            return None
        start = self._start(None, now)
        running = start.running
        if running is None or running.is_stop or (start.jets is None and now >= running.start):
            raise RequestRejected(
                Reason.BUSY, 'the arm comes to rest within replan.lookahead as it is'
            )
        motion = self._motion_of(stopping_plan(self.settings, start, running), start, now)
        motion = replace(motion, plan_id=running.plan_id, is_stop=True, swing=None)
        motion = replace(motion, replaced_strategy=None)
        return self._accepted(motion, start, None, clock)

    def take_ended(self, now: float) -> list[Ended]:
        """
        Return, once, the motions that have come to an end or been replaced.

        The end is said when the arm is seen there at rest, else when the patience is over; at once
        where it cannot be seen.
        """
        self._end_motions(now)
        ended = self._watch.take_arrived(self.settings, self._timeline, self._recent.last, now)
        ended += self._ended
        self._ended = []
        return ended

    def take_astray(self) -> list[Astray]:
        """Return, once, the motions under way that the arm has left."""
        if self.measured is not None:
            # Not with every sample: a comparison costs as much as hundreds of them.
            self._watch.follow(self.settings, self._timeline, self.measured)
        return self._watch.take_astray()

    def track(self, now: float) -> Track:
        """Return all that is still to be carried out, as an executor is to be sent it."""
        if self.settings.execute or self._motion is None:
            return self._timeline.track(now)
        return Timeline([self._motion]).track(now)

    def moves(self, since: float, until: float) -> bool:
        """Tell whether any motion is planned for part of a time [s]."""
        return self._timeline.moves(since, until)

    def under_way(self, now: float) -> Motion | None:
        """Return the motion in force at a time [s], or the first to come; None if none is left."""
        return self._timeline.at(now)

    def reference(self, now: float) -> PlanSamples | None:
        """Return what is planned for the present, at rest before and after; one sample."""
        motion = self.under_way(now) or self._motion
        return None if motion is None else motion.reference(now)

    def _motion_of(self, found: Plan, start: MotionStart, now: float, **known: Any) -> Motion:
        """Return a plan with its place in time, the next number and what else is known of it."""
        wanted = self.settings.options.strategy
        return Motion(
            plan_id=self._count + 1,
            plan=found,
            samples=found.sample(self.settings.period),
            start=start.time,
            planned_at=now,
            swing=None if start.swing is None else start.swing.amplitude,
            replaced_strategy=None if found.options.strategy is wanted else wanted,
            **known,
        )

    def _accepted(
        self, motion: Motion, start: MotionStart, stamp: float | None, clock: Clock | None
    ) -> Motion:
        """Return a motion with its place in time, which it takes unless planning took too long."""
        settings = self._applied
        now = motion.planned_at if clock is None else clock()
        if start.may_wait:
            check_stamp(stamp, now)
            if stamp is None:
                motion = replace(motion, start=now + settings.start_delay)
        elif start.time - now < DELIVERY_SHARE * settings.lookahead and clock is not None:
            raise RequestRejected(
                Reason.BUSY,
                f'planning took {now - motion.planned_at:.3f} s, too long for a start in motion '
                f'{settings.lookahead:g} s ahead (replan.lookahead); all goes on as it was',
                value=now - motion.planned_at,
                limit=(1.0 - DELIVERY_SHARE) * settings.lookahead,
            )
        if start.running is None:
            # From its next start on, nobody can tell any more where the arm has come to.
            self._end_motions(now)
            measured = self._recent.last
            self._ended += self._watch.take_arrived(settings, self._timeline, measured, inf)
        if settings.execute:
            for old in self._timeline.replaced(motion.start):
                if not (motion.is_stop and old.plan_id == motion.plan_id):
                    self._ended.append(Ended(old, Outcome.PREEMPTED))
            self._timeline = self._timeline.with_motion(motion)
            self._watch.answer = ''
        self._count = max(self._count, motion.plan_id)
        self._motion = motion
        return motion

    def _end_motions(self, now: float) -> None:
        """Take the motions whose time is over off the timeline."""
        for motion in self._timeline.motions:
            if motion.cut is None and motion.end <= now:
                self._watch.expect(motion)
        self._timeline = self._timeline.after(now)

    def _start(self, stamp: float | None, now: float) -> MotionStart:
        """Return where a motion starts."""
        lack = self.lack or (
            f'no joint state of this arm has been received yet on {self.source}'
            if self._recent.last is None
            else f'does anything publish on {self.source}?'
        )
        return motion_start(
            self._applied, self._timeline, self._recent, self._last_pose, stamp, now, lack
        )

    @property
    def _applied(self) -> SessionSettings:
        """Return the settings, with the delays that messages need where they are automatic."""
        return self._delivery.applied(self.settings)

    @property
    def _last_pose(self) -> FloatArray | None:
        """Return the end of the last motion, None if there has been none."""
        return None if self._motion is None else self._motion.plan.request.final
