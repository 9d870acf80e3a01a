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

"""Efforts that are sent without a stamp, in a recording: by a tracker, and by who pushes."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.monitor import PlannedMotion
from flat_planner_ros.ros.recording.recording import Recording
from flat_planner_ros.ros.recording.storage import Entry
from flat_planner_ros.ros.wire.point_writer import NANOSECONDS
import numpy as np

FLOAT_ARRAY = 'std_msgs/msg/Float64MultiArray'

PLANNED = 'planned_peak.'
"""What keys begin with that are followed by an actuated joint."""


class SentEfforts(NamedTuple):
    """
    Efforts over time.

    Attributes
    ----------
    times
        By the clock of the joint states [s], shape (m,).
    efforts
        Of the joints that they are for, in the arm's order [N m], shape (m, k).

    """

    times: FloatArray
    efforts: FloatArray

    def earlier(self, time: float) -> 'SentEfforts':
        """Return the same, so much earlier [s]."""
        return self._replace(times=self.times - time)

    def added_to(self, motion: PlannedMotion) -> FloatArray | None:
        """Return what is sent besides the planned efforts [N m], None if those are not known."""
        count = self.efforts.shape[1]
        if motion.efforts is None or count != motion.efforts.shape[1] - 1:
            return None
        elapsed = self.times - motion.start
        planned = [
            np.interp(elapsed, motion.times, column, left=0.0, right=0.0)
            for column in motion.efforts[:, :count].T
        ]
        added: FloatArray = self.efforts - np.column_stack(planned)
        return added


class EffortRecord:
    """
    Keeps what is sent on a topic until it is forgotten.

    Messages have times of arrival; the stamps of joint states that arrive then tell the others.

    Parameters
    ----------
    recording
        Where the messages are from.

    """

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._sent: list[tuple[float, tuple[float, ...]]] = []

    def take(self, entries: Sequence[Entry]) -> None:
        """Keep messages; damaged ones, and those of another length, are left out."""
        for entry in entries:
            msg = self._recording.read(entry)
            if msg is not None and len(msg.data):
                self._sent.append((entry.time / NANOSECONDS, tuple(msg.data)))

    def between(self, first: float, last: float, clock: 'ArrivalClock') -> SentEfforts:
        """Return what was sent between two stamps [s], of as many joints as most of it."""
        times = clock.stamps([time for time, _ in self._sent])
        inside = [
            (time, efforts)
            for time, (_, efforts) in zip(times, self._sent, strict=True)
            if first <= time <= last
        ]
        counts = [len(efforts) for _, efforts in inside]
        usual = max(set(counts), key=counts.count, default=0)
        kept = [(time, efforts) for time, efforts in inside if len(efforts) == usual]
        return SentEfforts(
            np.array([time for time, _ in kept]),
            np.array([efforts for _, efforts in kept]).reshape(len(kept), usual),
        )

    def forget(self, until: float, clock: 'ArrivalClock') -> None:
        """Forget what was sent before a stamp [s]."""
        times = clock.stamps([time for time, _ in self._sent])
        self._sent = [sent for time, sent in zip(times, self._sent, strict=True) if time >= until]


class ArrivalClock:
    """Tells the stamp of what arrived at a time from joint states that arrived about then."""

    def __init__(self) -> None:
        self._arrivals: list[FloatArray] = []
        self._stamps: list[FloatArray] = []

    def hear(self, arrivals: FloatArray, stamps: FloatArray) -> None:
        """Take joint states in the order of arrival [s]."""
        self._arrivals.append(arrivals)
        self._stamps.append(stamps)

    def stamps(self, arrivals: Sequence[float]) -> FloatArray:
        """Return the stamps for arrivals [s]; infinite beyond the joint states."""
        if not self._arrivals or not arrivals:
            return np.full(len(arrivals), np.inf)
        known, stamps = np.concatenate(self._arrivals), np.concatenate(self._stamps)
        self._arrivals, self._stamps = [known], [stamps]
        return np.interp(arrivals, known, stamps, left=-np.inf, right=np.inf)

    def forget(self, until: float) -> None:
        """Forget joint states from before a stamp [s]."""
        if self._arrivals:
            known, stamps = np.concatenate(self._arrivals), np.concatenate(self._stamps)
            kept = stamps >= until
            self._arrivals, self._stamps = [known[kept]], [stamps[kept]]


def told(motion: PlannedMotion, tracked: SentEfforts, pushes: SentEfforts) -> dict[str, Any]:
    """Return in numbers what feedback added to a plan from its start on, and how it was pushed."""
    found: dict[str, Any] = {}
    added = tracked.added_to(motion)
    since = tracked.times >= motion.start
    if added is not None and motion.efforts is not None and since.any():
        for joint, name in enumerate(motion.joint_names[:-1]):
            column = added[since, joint]
            found[f'feedback_peak.{name}'] = float(np.abs(column).max())
            found[f'feedback_rms.{name}'] = float(np.sqrt(np.mean(column**2)))
            found[PLANNED + name] = float(np.abs(motion.efforts[:, joint]).max())
    if pushes.times.size:
        found['push_first'] = float(pushes.times[0] - motion.start)
        found['push_last'] = float(pushes.times[-1] - motion.start)
        found['push_peak'] = float(np.abs(pushes.efforts).max())
    return found


def sentences(found: Mapping[str, Any]) -> list[str]:
    """Return the same in words."""
    names = [key.removeprefix(PLANNED) for key in found if key.startswith(PLANNED)]
    said = [
        f'{name}: feedback up to {found[f"feedback_peak.{name}"]:.3g} N m, '
        f'RMS {found[f"feedback_rms.{name}"]:.3g}; the plan up to {found[PLANNED + name]:.3g}'
        for name in names
    ]
    if 'push_first' in found:
        first, last = found['push_first'], found['push_last']
        said.append(
            f'pushed from {first:.3g} to {last:.3g} s after the start, '
            f'up to {found["push_peak"]:.3g} N m'
        )
    return said
