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
Tracking without ROS: efforts from joint samples, and the rules by which it gives up.

It is idle until its first command. What it does not understand ends in efforts that go to zero
along a straight line in time, one reason, and idleness until the next command.
"""

from dataclasses import replace
from enum import Enum
from math import inf, pi, remainder, tau

from flat_planner_ros.core.arm import (
    FloatArray,
    InvalidCommand,
    JointSample,
    PlanarArm,
    UNUSABLE,
)
from flat_planner_ros.core.tracking.arm_observer import Estimate
from flat_planner_ros.core.tracking.certificate import certify
from flat_planner_ros.core.tracking.settings import TrackerSettings
from flat_planner_ros.core.tracking.state_feedback import distance, StateFeedback
from flat_planner_ros.core.tracking.tracked_motion import TrackedMotion
from flat_planner_ros.core.tracking.watches import AgeWatch, GrowthWatch
import numpy as np

EARLY = 0.5
"""Share of a period after an effort in which no other one is sent [-]."""


class Phase(Enum):
    """What the tracker does."""

    IDLE = 'idle'
    """Nothing: it listens."""

    TRACKING = 'tracking'
    """It follows a motion, or holds its end."""

    RELEASING = 'releasing'
    """The effort goes to zero."""


class Tracker:
    """
    State feedback around planned motions.

    Times are absolute, in seconds, and given by the caller; samples carry their own.

    Parameters
    ----------
    arm
        The model; must be flat.
    settings
        The loop, its bandwidths, and when it gives up.

    Raises
    ------
    UncertifiedLoop
        The loop would not be stable enough for all arms of the box of uncertainty.
    NotFlat, InvalidRequest
        There is no such loop.

    """

    def __init__(self, arm: PlanarArm, settings: TrackerSettings) -> None:
        """Compute and certify the gains; be idle."""
        self.certificate = certify(arm, settings)
        settings = replace(settings, bandwidth=self.certificate.bandwidth)
        self._max_age = settings.max_age or max(self.certificate.late, settings.period)
        self.ages, self._growth = AgeWatch(settings.period), GrowthWatch(arm.n)
        self._settings, self._joints = settings, arm.n
        self._feedback = StateFeedback(arm, settings)
        self._observer = self._feedback.observer
        self._motion: TrackedMotion | None = None
        self._next: TrackedMotion | None = None
        self._now, self._heard, self._sent = -inf, -inf, -inf
        self._efforts = self._last = np.zeros(arm.n - 1)
        self._released = -inf
        self._clipped_since = inf
        self._fault, self.error = '', 0.0
        self.phase = Phase.IDLE

    def follow(self, motion: TrackedMotion, now: float) -> None:
        """
        Follow a motion from its start on, in the place of the present one.

        Until that start joint samples may be missing; if they still are, it is not begun.

        Raises
        ------
        InvalidCommand
            It is another arm's, over, or nobody knows where the arm is; the present one goes on.

        """
        if motion.joints != self._joints:
            raise InvalidCommand(
                f'the arm has {self._joints} joints, the motion {motion.joints}: tracking needs '
                'the passive joint too'
            )
        if motion.end <= now:
            raise InvalidCommand(f'the motion ended {now - motion.end:.3f} s ago')
        is_due = self.phase is Phase.TRACKING or motion.start <= now + self._settings.delay
        if is_due and now - self._heard > self._settings.timeout:
            raise InvalidCommand(self._unseen(now))
        if self.ages.mean > self._max_age:
            raise InvalidCommand(f'{self._lateness}: the motion is not begun')
        self.ages.restart()
        self._next = motion

    def is_moving(self, now: float) -> bool:
        """Tell whether a motion is under way; one that waits is not yet."""
        is_due = self._next is not None and self._next.start <= now + self._settings.delay
        return is_due or (self._motion is not None and now < self._motion.end)

    def continue_from(self, other: 'Tracker') -> None:
        """Go on where another tracker of the same joints is, with one's own gains."""
        self._observer.continue_from(other._observer)
        self._motion, self._next, self.phase = other._motion, other._next, other.phase
        self._heard, self._sent, self._released = other._heard, other._sent, other._released
        self._now = other._now
        self._efforts, self._last = other._efforts, other._last
        self._clipped_since, self.error = other._clipped_since, other.error
        self._fault, self.ages = other._fault, other.ages

    def release(self, now: float, fault: str = '') -> None:
        """Let the effort go to zero and be idle until the next command; for a fault, say why."""
        if self.phase is Phase.TRACKING or self._next is not None:
            self._fault = fault
        self._motion = self._next = None
        self._clipped_since = inf
        if self.phase is Phase.TRACKING:
            self.phase, self._released, self._last = Phase.RELEASING, now, self._efforts

    def drop(self, now: float, fault: str = '') -> FloatArray | None:
        """Return zero efforts, from now on and without a ramp; None if none were applied."""
        was_idle = self.phase is Phase.IDLE
        self.release(now, fault)
        self.phase = Phase.IDLE
        self._efforts = np.zeros(self._joints - 1)
        return None if was_idle else self._efforts

    def take_fault(self) -> str:
        """Return why tracking was given up since this was last asked; nothing if it was not."""
        fault, self._fault = self._fault, ''
        return fault

    def hear(self, sample: JointSample, now: float) -> FloatArray | None:
        """
        Take in a sample; return the efforts to apply.

        Parameters
        ----------
        sample
            Measured angles; velocities are used only where the estimate starts.
        now
            Present time [s].

        Returns
        -------
        FloatArray | None
            Shape (n-1,) [N m], to act the loop's delay from now on; None if nothing is to be sent.

        """
        self._look_at_clock(now)
        if not (np.abs(sample.positions) < UNUSABLE).all():
            is_finite = bool(np.isfinite(sample.positions).all())
            what = f'beyond {UNUSABLE:g} rad' if is_finite else 'not finite'
            self._give_up(now, f'a joint sample is {what}: {sample.positions.tolist()} rad')
        elif sample.time > self._heard or sample.time < self._heard - self._settings.timeout:
            self._measure(sample, now)
            if self.ages.mean > self._max_age:
                self._give_up(now, self._lateness)
        return self._act(now)

    def watch(self, now: float) -> FloatArray | None:
        """Return the efforts to apply if no sample has come lately, None if there are none."""
        self._look_at_clock(now)
        if now - self._heard <= self._settings.timeout and self.phase is not Phase.RELEASING:
            return None
        return self._act(now)

    def state(self, time: float) -> Estimate:
        """Return the estimate for a time [s]."""
        return self._observer.predicted(time)

    @property
    def _lateness(self) -> str:
        """Return in words how late the loop is."""
        return (
            f'joint samples are {1e3 * self.ages.mean:.3g} ms old when they are used, beyond '
            f'{1e3 * self._max_age:.3g} ms; if efforts act as late, the loop may be unstable: '
            'lower bandwidth, or see what keeps this machine busy or its clock apart'
        )

    def _unseen(self, now: float) -> str:
        """Return in words that joint samples are missing, and what follows."""
        silent = now - self._heard
        missing = f'no joint sample for {silent:.3g} s' if silent < inf else 'no joint sample yet'
        return f'{missing}, the timeout is {self._settings.timeout:g} s: the motion is not begun'

    def _measure(self, sample: JointSample, now: float) -> None:
        """Correct the estimate, or start it anew where it has nothing to do with the sample."""
        limit, gap = self._settings.jump, sample.time - self._heard
        self._heard = sample.time
        if not 0.0 < gap <= self._settings.timeout:
            if gap <= 0.0:
                self._go_back(now, f'a joint sample is {-gap:.3g} s older than the last one')
            elif not self._waits(now):
                self._give_up(now, f'no joint sample for {gap:.3g} s')
            self._observer.restart(sample)
            return
        self.ages.note(now - sample.time, gap)
        surprise = self._observer.correct(sample)
        if self.phase is Phase.IDLE and surprise > pi and abs(remainder(surprise, tau)) <= limit:
            # Turns are counted from those of the motion that is to begin.
            self._observer.restart(sample)
        elif surprise > limit:
            self._give_up(
                now,
                f'a joint jumped by {surprise:.3g} rad, beyond {limit:g} rad',
            )
            self._observer.restart(sample)

    def _act(self, now: float) -> FloatArray | None:
        """Return the efforts of the present phase."""
        silent = now - self._heard
        if silent > self._settings.timeout and self.phase is Phase.TRACKING:
            self._give_up(now, f'the last joint sample is {silent:.3g} s old')
        elif silent > self._settings.timeout and not self._waits(now):
            self.release(now, self._unseen(now))
        time = now + self._settings.delay
        self._begin(time, now)
        if self.phase is Phase.IDLE or now - self._sent < EARLY * self._settings.period:
            return None
        self._sent = now
        if self.phase is Phase.TRACKING and self._motion is not None:
            self._track(time, now, self._motion)
        if self.phase is Phase.RELEASING:
            self._fade(time, now)
        return self._efforts

    def _waits(self, now: float) -> bool:
        """Tell whether the arm is left alone until a motion that is yet to begin."""
        is_ahead = self._next is not None and now + self._settings.delay < self._next.start
        return is_ahead and self.phase is not Phase.TRACKING

    def _begin(self, time: float, now: float) -> None:
        """Go over to the next motion where its time has come."""
        if self._next is None or time < self._next.start:
            return
        if self.phase is not Phase.TRACKING:
            limit = self._settings.jump
            miss = distance(self._observer.predicted(time), self._next.at(time))
            if miss > limit:
                self._give_up(
                    now,
                    f'the motion begins {miss:.3g} rad from the arm, beyond {limit:g} rad',
                )
                return
            self._observer.forget_disturbances()
        self._motion, self._next = self._next, None
        if self.phase is not Phase.TRACKING:
            self._growth = GrowthWatch(self._joints)
        self.phase = Phase.TRACKING

    def _track(self, time: float, now: float, motion: TrackedMotion) -> None:
        """Compute the efforts of a motion, or find a reason to give it up."""
        if time > motion.end and not self._settings.hold and self._next is None:
            self.release(now)
            return
        command = self._feedback.command(time, motion)
        self.error, limit = command.error, self._settings.max_error
        self._clipped_since = min(self._clipped_since, now) if command.is_clipped else inf
        clipped, grown = now - self._clipped_since, self._growth.note(command.errors)
        if not command.error <= limit:
            self._give_up(now, f'the arm is {command.error:.3g} rad from its plan')
        elif clipped > self._settings.saturation_timeout:
            self._give_up(now, f'an effort has been at its limit for {clipped:.3g} s')
        elif grown:
            self._give_up(now, f'its errors grow from swing to swing, to {grown:.3g} rad')
        else:
            self._efforts = command.efforts

    def _fade(self, time: float, now: float) -> None:
        """Let the effort go to zero."""
        left = max(0.0, self._released + self._settings.ramp - now)
        if left == 0.0:
            self._efforts = np.zeros(self._joints - 1)
            self._observer.note(time, 0.0, np.zeros(self._joints - 2))
            self.phase = Phase.IDLE
            return
        self._efforts = self._last * min(1.0, left / self._settings.ramp)
        self._observer.note_efforts(time, self._efforts)

    def _look_at_clock(self, now: float) -> None:
        """Notice that the clock was set back."""
        # Its own times are compared: those of samples may be another computer's.
        if now < self._now - self._settings.timeout:
            self._go_back(now, f'the clock was set back by {self._now - now:.3g} s')
        self._now = now

    def _go_back(self, now: float, reason: str) -> None:
        """Release the arm by a clock that was set back; efforts do not wait for its old times."""
        self._give_up(now, reason)
        self._sent = -inf
        if now < self._released:
            self._released, self._last = now, self._efforts

    def _give_up(self, now: float, reason: str) -> None:
        """Release the arm for a reason, if it is held."""
        ramp = self._settings.ramp
        self.release(now, f'tracking given up: {reason}; the effort goes to zero in {ramp:g} s')
