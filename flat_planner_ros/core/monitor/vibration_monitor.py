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

"""Monitor of the oscillation after planned motions, fed with times and samples."""

from dataclasses import replace
from enum import Enum
from math import inf, isfinite, nan

from flat_planner_ros.core.arm import (
    FloatArray,
    is_noticed,
    JointSample,
    OffsetFilter,
    SampleTable,
    UNUSABLE,
)
from flat_planner_ros.core.monitor.feedback_times import FeedbackTimes
from flat_planner_ros.core.monitor.motion_record import Measured, PlannedMotion, Residual
from flat_planner_ros.core.monitor.report import assess, VibrationReport
from flat_planner_ros.core.monitor.sample_checks import (
    check_size,
    jump,
    unremarkable,
)
from flat_planner_ros.core.monitor.settings import MonitorSettings
from flat_planner_ros.core.monitor.stamp_offset import SampleClock
import numpy as np

SAME_CLOCK = 3600.0
"""Time before its start within which a plan that arrives is of the node's own clock [s]."""


class Phase(Enum):
    """What a monitor is waiting for."""

    IDLE = 'idle'
    """A motion to start."""
    MOVING = 'moving'
    """The end of the motion."""
    SETTLING = 'settling'
    """The end of the window after it."""
    DONE = 'done'
    """The next motion; the last one is closed."""


class VibrationMonitor:
    """
    Judge what each planned motion leaves behind, one report per motion.

    Time comes with samples and ticks alone, plans start when it reaches their start. A plan
    replaces the one that still waits for its start; one that has started is judged on what was
    measured until the next starts, or dropped without a report if it was still moving then. A
    plan that is first seen after its window gives no report: nothing was watched. Only samples
    end a window; silence ends it as stale, and a joint that jumps, as an arm that is reset does,
    ends it there.

    Parameters
    ----------
    settings
        Window, tolerances and expectations; may be replaced at any time.

    Attributes
    ----------
    feedback
        When somebody's feedback acts on the arm, as far as it is told.

    """

    def __init__(self, settings: MonitorSettings) -> None:
        """Wait for a motion."""
        self.settings = settings
        self.reset()

    def reset(self) -> None:
        """Forget motions, samples and times."""
        self._phase = Phase.IDLE
        self._motion: PlannedMotion | None = None
        self._pending: PlannedMotion | None = None
        self._now = -inf
        self._last_sample = -inf
        self._heard = -inf
        self._last: JointSample | None = None
        self._dropped = 0
        self._dropped_told = 0
        self._set_back = 0.0
        self._reports: list[VibrationReport] = []
        self.feedback = FeedbackTimes()
        self._measured = Measured(0)
        self._offset = OffsetFilter()
        self._correction = 0.0
        self._is_own_clock = False
        self._is_in_time = False

    @property
    def phase(self) -> Phase:
        """Return the phase of the motion that started last."""
        return self._phase

    @property
    def motion(self) -> PlannedMotion | None:
        """Return the motion that started last."""
        return self._motion

    @property
    def clock_offset(self) -> float | None:
        """Return by how much stamps are ahead of their arrival [s], None if nobody has told."""
        return self._offset.offset

    @property
    def dropped(self) -> int:
        """Return the number of unusable samples since the last reset [-]."""
        return self._dropped

    def take_warnings(self) -> list[str]:
        """Return what was wrong with the samples since this was last asked, a sentence each."""
        warnings = []
        if self._set_back:
            warnings.append(
                f'the time of the joint states was set back by {self._set_back:.3f} s: plans and '
                'samples from before are forgotten'
            )
        new = self._dropped - self._dropped_told
        if new:
            warnings.append(f'{new} joint states dropped: late, repeated or not finite')
        self._dropped_told = self._dropped
        self._set_back = 0.0
        return warnings

    def hear(self, stamp: float, arrival: float) -> None:
        """
        Learn how stamps and time agree; to be told before the sample is added.

        Parameters
        ----------
        stamp
            Of a message with joint states [s].
        arrival
            When it came, by the clock of the plans [s].

        """
        self._offset.hear(stamp, arrival)
        if self._is_in_time and not self._is_watching():
            offset = self._offset.offset or 0.0
            self._correct_by(-offset if is_noticed(offset) else 0.0)

    def watch(self, motion: PlannedMotion, arrival: float | None = None) -> list[VibrationReport]:
        """
        Take a planned motion, to be watched from its start.

        Parameters
        ----------
        motion
            The motion; without effect if it is the present or the waiting one again.
        arrival
            When it came [s]. A plan that came while it could still be judged is of the clock by
            which it came; stamps of samples may be of another one.

        Returns
        -------
        list of VibrationReport
            Report on the former motion, if the new one has started and thereby cuts it short.

        """
        known = (self._pending, self._motion)
        if any(other is not None and other.is_same(motion) for other in known):
            return []
        self._pending = motion
        last = motion.end + self.settings.window
        self._is_own_clock = arrival is not None and motion.start - SAME_CLOCK < arrival < last
        # Late ones come by a slow transport, as the samples may, or to a monitor that came late.
        self._is_in_time = self._is_own_clock and arrival is not None and arrival <= motion.start
        self._start_pending(self._now)
        return self._take_reports()

    def add(self, sample: JointSample) -> list[VibrationReport]:
        """
        Take a sample; late, repeated and undefined ones are dropped and counted.

        Parameters
        ----------
        sample
            Joint state in the order of the motion's joints.

        Returns
        -------
        list of VibrationReport
            Reports on the motions that this sample ends or cuts short, in order.

        Raises
        ------
        InvalidRequest
            If the number of joints is not the motion's. No report is lost: the next call has it.

        """
        if self._correction:
            sample = replace(sample, time=sample.time + self._correction)
        time, positions = sample.time, sample.positions
        if time < self._last_sample - self.settings.timeout:
            self._reset_by(self._last_sample - time)
        # NaN is not below anything.
        is_known = bool(np.abs(positions).max() < UNUSABLE)
        if not (is_known and time > self._last_sample and isfinite(time)):
            self._dropped += 1
            return []
        self._advance(time)
        former = self._last
        self._last = sample
        self._last_sample = time
        self._heard = time
        motion = self._motion
        if motion is None or self._phase is Phase.DONE:
            return self._take_reports()
        check_size(sample, motion)
        # Between two motions an arm may be put elsewhere, and nobody minds.
        since = max(motion.start, time - self.settings.timeout)
        if former is not None and former.time >= since:
            cause = jump(former, sample, motion)
            if cause:
                self._close(time, cause)
                return self._take_reports()
        if time <= motion.end:
            self._measured.efforts.append(time, nan if sample.efforts is None else sample.efforts)
        self._measured.add(time, positions, is_after=time >= motion.end)
        if self.settings.fits_model and time >= motion.start:
            efforts = np.full_like(positions, nan) if sample.efforts is None else sample.efforts
            self._measured.motors.append(time, np.concatenate((positions, efforts)))
        if time >= motion.end + self.settings.window:
            self._close(time)
        return self._take_reports()

    def add_table(
        self, samples: SampleTable, arrivals: FloatArray
    ) -> tuple[int, list[VibrationReport]]:
        """
        Hear and take samples one after the other, up to the first that makes a report.

        Where nothing happens, many are taken at once: a recording has millions.

        Parameters
        ----------
        samples
            At least one, in the order of the motion's joints.
        arrivals
            When each came, by the clock of the plans [s].

        Returns
        -------
        tuple
            How many were taken, and the reports as of `add`.

        Raises
        ------
        InvalidRequest
            As `add`.

        """
        plain = unremarkable(samples, self._last, self.settings.timeout)
        ends = np.append(np.flatnonzero(~plain), len(samples))
        row = 0
        while row < len(samples):
            end = int(ends[np.searchsorted(ends, row)])
            count = self._uneventful(samples.times[row:end], arrivals[row:end])
            if count:
                rows = slice(row, row + count)
                self._add_rows(samples.rows(rows), arrivals[rows])
                row += count
                continue
            self.hear(float(samples.times[row]), float(arrivals[row]))
            reports = self.add(samples.sample(row))
            row += 1
            if reports:
                return row, reports
        return row, []

    def tick(self, now: float) -> list[VibrationReport]:
        """
        Take the time, so that silence is noticed.

        Parameters
        ----------
        now
            Present time of the samples' clock [s].

        Returns
        -------
        list of VibrationReport
            Stale report on a motion whose samples stopped, or report on one cut short.

        """
        now += self._correction
        latest = self._last_sample if isfinite(self._last_sample) else self._now
        if now < latest - self.settings.timeout:
            self._reset_by(latest - now)
        # Samples that come late after all leave the time behind what it was told to be meanwhile.
        self._now = min(self._now, max(now, latest))
        self._advance(now)
        return self._take_reports()

    def residual(self, sample: JointSample) -> Residual | None:
        """
        Return measured minus planned during, measured minus final state after the motion.

        Parameters
        ----------
        sample
            Joint state in the order of the motion's joints.

        Returns
        -------
        Residual or None
            Deviations of positions and velocities, ``None`` before the first motion.

        Raises
        ------
        InvalidRequest
            If the number of joints is not the motion's.

        """
        if self._motion is None:
            return None
        check_size(sample, self._motion)
        position, velocity = self._motion.reference(sample.time + self._correction)
        return Residual(
            sample.positions - position,
            None if sample.velocities is None else sample.velocities - velocity,
        )

    def _uneventful(self, times: FloatArray, arrivals: FloatArray) -> int:
        """Return how many samples that just follow each other start or end nothing."""
        motion = self._motion
        if self._correction or not times.size:
            return 0
        until = inf if self._pending is None else self._pending.start
        if motion is not None and self._is_watching():
            is_moving = self._phase is Phase.MOVING
            until = min(until, motion.end + (0.0 if is_moving else self.settings.window))
            # Time may have been told to be later than samples are.
            if times[0] < motion.start or not (is_moving or times[0] > motion.end):
                return 0
        count = int(np.searchsorted(times, until))
        return self._offset.unnoticed(times[:count], arrivals[:count])

    def _add_rows(self, samples: SampleTable, arrivals: FloatArray) -> None:
        """Take uneventful samples as `hear` and `add` do."""
        self._offset.hear_all(samples.times, arrivals)
        self._last = samples.sample(-1)
        self._last_sample = self._heard = self._last.time
        self._now = max(self._now, self._last.time)
        motion = self._motion
        if motion is None or not self._is_watching():
            return
        check_size(self._last, motion)
        self._measured.add_table(
            samples,
            is_after=self._phase is Phase.SETTLING,
            with_motors=self.settings.fits_model,
        )

    def _take_reports(self) -> list[VibrationReport]:
        """Return the reports made since this was last asked."""
        reports = self._reports
        self._reports = []
        return reports

    def _advance(self, now: float) -> None:
        """Let time reach now: notice silence, the motion's end, the next motion's start."""
        self._now = max(self._now, now)
        silence = now - self._heard
        if self._is_watching() and silence > self.settings.timeout:
            self._close(now, f'no samples for {silence:.3g} s', stale=True)
        if self._phase is Phase.MOVING and self._motion is not None and now >= self._motion.end:
            self._phase = Phase.SETTLING
        self._start_pending(self._now)

    def _reset_by(self, step: float) -> None:
        """Start again after a step back in time [s]."""
        self.reset()
        self._set_back = step

    def _correct_by(self, correction: float) -> None:
        """Add a time to all stamps, those heard included [s]."""
        step = correction - self._correction
        self._correction = correction
        self._now += step
        self._last_sample += step
        self._heard += step
        if step:
            self._last = None

    def _is_watching(self) -> bool:
        """Return whether a motion has started and has no report yet."""
        return self._phase in (Phase.MOVING, Phase.SETTLING)

    def _start_pending(self, now: float) -> None:
        """Start the waiting motion if it is time, and report on a former still settling."""
        motion, former = self._pending, self._motion
        if motion is None or now < motion.start:
            return
        is_spliced = False
        if former is not None and self._is_watching():
            is_spliced = motion.start <= former.end
            if not is_spliced:
                is_cut = motion.start < former.end + self.settings.window
                cause = 'window cut short by the next motion' if is_cut else ''
                self._close(motion.start, cause)
        efforts = self._measured.efforts
        self._measured = Measured(len(motion.joint_names))
        # A motion spliced into a running one starts with what that one has measured.
        if is_spliced and former and former.joint_names == motion.joint_names:
            self._measured.efforts = efforts
        self._motion = motion
        self._pending = None
        self._heard = now
        if now < motion.end:
            self._phase = Phase.MOVING
        else:
            is_past = now > motion.end + self.settings.window
            self._phase = Phase.DONE if is_past else Phase.SETTLING

    def _close(self, until: float, cause: str = '', *, stale: bool = False) -> None:
        """End the watch of the present motion and judge it on the samples before `until`."""
        if self._motion is None:
            return
        report = self._assessed(self._motion, until, cause, stale=stale)
        if self._correction > 0.0 and not _shows_motion(report):
            # Stamps that seemed behind were right perhaps, and the transport slow.
            until -= self._correction
            self._measured.shift(-self._correction)
            self._correct_by(0.0)
            if not (stale or cause):
                return
            report = self._assessed(self._motion, until, cause, stale=stale)
        self._phase = Phase.DONE
        self._reports.append(report)

    def _assessed(
        self, motion: PlannedMotion, until: float, cause: str, *, stale: bool
    ) -> VibrationReport:
        """Return what is to be said of a motion by the samples before `until`."""
        offset = self._offset.offset if self._is_own_clock else None
        clock = SampleClock(offset, self._correction)
        return assess(
            motion,
            self.settings,
            self._measured,
            until,
            clock,
            feedback=self.feedback,
            cause=cause,
            stale=stale,
        )


def _shows_motion(report: VibrationReport) -> bool:
    """Return whether the motion is seen about when it was planned."""
    course = report.course
    return course is not None and course.shift is not None and not course.is_late
