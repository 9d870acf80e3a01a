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

"""A monitor that is fed from a recording, and its reports."""

from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import groupby
import json
from math import inf
from typing import Any

from flat_planner_ros.core.arm import FlatPlannerError, FloatArray, SampleTable
from flat_planner_ros.core.monitor import (
    MonitorSettings,
    Phase,
    PlannedMotion,
    VibrationMonitor,
    VibrationReport,
)
from flat_planner_ros.ros.parameters import monitor as monitor_parameters
from flat_planner_ros.ros.recording.recent_samples import RecentSamples, table_of
from flat_planner_ros.ros.recording.recording import Recording
from flat_planner_ros.ros.recording.sent_efforts import (
    ArrivalClock,
    EffortRecord,
    FLOAT_ARRAY,
    SentEfforts,
)
from flat_planner_ros.ros.recording.storage import Entry
from flat_planner_ros.ros.wire import conversions, stamps
from flat_planner_ros.ros.wire.interfaces import (
    DIAGNOSTICS,
    EFFORT_COMMANDS,
    JOINT_STATES,
    MONITOR,
    PLAN,
    PLANNER,
    PLANT,
    PUSH,
    topic_of,
    TRACKER,
)
from flat_planner_ros.ros.wire.joint_states import JointStateReader
from flat_planner_ros.ros.wire.point_writer import NANOSECONDS
from flat_planner_ros.ros.wire.state_table import read_states
from flat_planner_ros.ros.wire.tracker_word import hear_tracker
import numpy as np
from rclpy.parameter import Parameter

JOINT_STATE = 'sensor_msgs/msg/JointState'
JOINT_TRAJECTORY = 'trajectory_msgs/msg/JointTrajectory'

DIAGNOSTIC_ARRAY = 'diagnostic_msgs/msg/DiagnosticArray'

SILENCE = 1.001
"""Time after the last sample of a recording, relative to what counts as silence [-]."""

SHOWN_BEFORE = 0.1
"""Time before a motion of which samples are kept, relative to the motion [-]."""

LONGEST = 600.0
"""Duration of a motion whose time before is kept whole, at most [s]."""


class NothingToJudge(FlatPlannerError):
    """A recording without the topics that a report needs; the message names those it has."""


@dataclass(frozen=True, kw_only=True)
class Sources:
    """Names of the topics with the planned motions and with the measured joint states."""

    plan: str
    joint_states: str

    @property
    def namespace(self) -> str:
        """Return the namespace of the nodes, without a slash at its end."""
        return self.plan.removesuffix('/' + topic_of(PLANNER, PLAN))

    @property
    def tracker_efforts(self) -> str:
        """Return the topic of what a tracker sends."""
        return f'{self.namespace}/{topic_of(TRACKER, EFFORT_COMMANDS)}'

    @property
    def pushes(self) -> str:
        """Return the topic of pushes."""
        return f'{self.namespace}/{topic_of(PLANT, PUSH)}'


@dataclass(frozen=True, kw_only=True, eq=False)
class Judgement:
    """
    A report and what it is about.

    Attributes
    ----------
    report, motion
        The verdict on what the motion left, and the motion.
    times
        Times of the samples, from shortly before the motion to the end of the window [s],
        shape (m,).
    positions, efforts
        Measured [rad], [N m], shape (m, n); efforts are NaN where unknown.
    tracked, pushes
        Efforts that a tracker has sent, and those of whoever pushed the arm.

    """

    report: VibrationReport
    motion: PlannedMotion
    times: FloatArray
    positions: FloatArray
    efforts: FloatArray
    tracked: SentEfforts
    pushes: SentEfforts


def find_sources(
    recording: Recording, *, namespace: str = '', plan: str = '', joint_states: str = ''
) -> Sources:
    """
    Return the topics to judge by.

    Parameters
    ----------
    recording
        Recording with the topics.
    namespace
        Namespace of the nodes, where the recording has several.
    plan, joint_states
        Names to take instead of the usual ones.

    Raises
    ------
    NothingToJudge
        There is no such topic, or more than one.

    """
    usual = topic_of(PLANNER, PLAN)
    return Sources(
        plan=find_topic(recording, JOINT_TRAJECTORY, plan, namespace, usual, '--plan'),
        joint_states=find_topic(
            recording, JOINT_STATE, joint_states, namespace, JOINT_STATES, '--joint-states'
        ),
    )


def recorded_settings(recording: Recording, sources: Sources) -> list[tuple[int, MonitorSettings]]:
    """Return the monitor's settings as recorded, each with the time from which it held [ns]."""
    # A recording of an earlier version does not know all of them.
    defaults = {
        row.name: row.default
        for row in monitor_parameters.ROWS
        if not isinstance(row.default, Parameter.Type)
    }
    known = {row.name for row in monitor_parameters.ROWS}
    settings = []
    for time, node, text in recording.parameters:
        if node == f'{sources.namespace}/{MONITOR}':
            values = {k: v for k, v in json.loads(text).items() if k in known}
            try:
                settings.append((time, monitor_parameters.build({**defaults, **values})))
            except (TypeError, ValueError) as error:
                raise NothingToJudge(
                    f'the recorded parameters of {node} cannot be read ({error}); give '
                    '--params-file'
                ) from error
    return settings


def replay(
    recording: Recording,
    sources: Sources,
    settings: Sequence[tuple[int, MonitorSettings]],
    remark: Callable[[str], object] = lambda text: None,
    other: Callable[[Entry], object] = lambda entry: None,
    topics: Collection[str] = (),
) -> Iterator[Judgement]:
    """
    Yield a report on each motion that a recording shows, as the monitor node makes it.

    Parameters
    ----------
    recording
        Recording of what was planned and measured.
    sources
        Topics with both.
    settings
        At least one; each holds from its time on [ns], the first from the start.
    remark
        Is told what is remarkable about the joint states, each once.
    other, topics
        Is given the entries of these topics, in the order of time with the others.

    """
    player = _Player(recording, sources, settings, remark)
    own = {sources.plan, sources.joint_states}
    if recording.topics.get(DIAGNOSTICS) == DIAGNOSTIC_ARRAY:
        own.add(DIAGNOSTICS)
    sent = {t for t in player.sent if recording.topics.get(t) == FLOAT_ARRAY}
    batches = player.without_sent(recording.batches({*own, *sent, *topics}))
    for entries in stretches(batches):
        if entries[0].topic in own:
            yield from player.take(entries)
        else:
            for entry in entries:
                other(entry)
    yield from player.end()


def stretches(batches: Iterator[Sequence[Entry]]) -> Iterator[list[Entry]]:
    """Yield entries of one topic and one length that come one after the other."""
    for batch in batches:
        for _, alike in groupby(batch, _form):
            yield list(alike)


def _form(entry: Entry) -> tuple[str, int]:
    """Return what entries that are looked at together have in common."""
    return entry.topic, len(entry.message)


class _Player:
    """
    Feeds a monitor as its node does, but for the time: that comes with the stamps alone.

    A recorder may have been late where the joint states were not.
    """

    def __init__(
        self,
        recording: Recording,
        sources: Sources,
        settings: Sequence[tuple[int, MonitorSettings]],
        remark: Callable[[str], object],
    ) -> None:
        self._namespace = sources.namespace
        self.monitor = VibrationMonitor(settings[0][1])
        self._changes = list(settings[1:])
        self._recording = recording
        self._remark = remark
        self._stamp = -inf
        self._reader: JointStateReader | None = None
        self._motions: list[PlannedMotion] = []
        self._samples = RecentSamples()
        self._clock = ArrivalClock()
        efforts = (sources.tracker_efforts, sources.pushes)
        self.sent = {topic: EffortRecord(recording) for topic in efforts}

    def without_sent(self, batches: Iterator[Sequence[Entry]]) -> Iterator[Sequence[Entry]]:
        """Yield batches without the efforts that are sent, which are kept."""
        for batch in batches:
            for topic, record in self.sent.items():
                record.take([entry for entry in batch if entry.topic == topic])
            if self._is_between_motions():
                self._forget_sent(self._stamp - SHOWN_BEFORE * LONGEST)
            yield [entry for entry in batch if entry.topic not in self.sent]

    def take(self, entries: Sequence[Entry]) -> Iterator[Judgement]:
        """Take messages of one topic and one length; those that cannot be used are left out."""
        is_changed = bool(self._changes) and self._changes[0][0] <= entries[-1].time
        table = None
        if len(entries) > 1 and entries[0].kind == JOINT_STATE and not is_changed:
            table = self._table(entries)
        if table is None:
            for entry in entries:
                yield from self._take_one(entry)
        else:
            yield from self._take_table(table, [entry.time / NANOSECONDS for entry in entries])

    def end(self) -> Iterator[Judgement]:
        """Judge a motion that is still watched: nothing more will come."""
        if self._stamp > -inf:
            silence = SILENCE * self.monitor.settings.timeout
            yield from self._judged(self.monitor.tick(self._stamp + silence))

    def _take_one(self, entry: Entry) -> Iterator[Judgement]:
        """Take a message with the settings of its time."""
        while self._changes and self._changes[0][0] <= entry.time:
            self._apply(self._changes.pop(0)[1])
        msg = self._recording.read(entry)
        if msg is None:
            return
        if entry.topic == DIAGNOSTICS:
            hear_tracker(msg, self._namespace, self.monitor.feedback)
            return
        take = self._take_plan if entry.kind == JOINT_TRAJECTORY else self._take_state
        with suppress(FlatPlannerError):
            yield from take(msg, entry.time / NANOSECONDS)

    def _apply(self, settings: MonitorSettings) -> None:
        """Judge with changed settings from now on."""
        self.monitor.settings = settings
        if self._reader is not None:
            self._reader.rules = settings.joint_states

    def _table(self, entries: Sequence[Entry]) -> SampleTable | None:
        """Return joint states as a table, None where they must be looked at one by one."""
        if self._reader is None:
            return None
        states = read_states([entry.message for entry in entries])
        return None if states is None else self._reader.read_table(*states)

    def _take_table(self, samples: SampleTable, arrivals: Sequence[float]) -> Iterator[Judgement]:
        """Take joint states that arrived then [s]."""
        heard = np.array(arrivals)
        while len(samples):
            taken, reports = self.monitor.add_table(samples, heard)
            self._samples.add(samples.rows(slice(taken)))
            self._clock.hear(heard[:taken], samples.times[:taken])
            self._stamp = float(samples.times[taken - 1])
            yield from self._judged(reports)
            samples, heard = samples.rows(slice(taken, None)), heard[taken:]
        self._forget_old()

    def _take_plan(self, msg: Any, arrival: float) -> Iterator[Judgement]:
        """Take a plan that arrived then [s], for whatever joints it names."""
        if not stamps.is_stamped(msg):
            msg.header.stamp = stamps.time_msg(arrival)
        motion = conversions.planned_motion_from_trajectory(msg)
        if self._reader is None or tuple(self._reader.joints) != motion.joint_names:
            self.monitor.reset()
            self._reader = JointStateReader(motion.joint_names, self.monitor.settings.joint_states)
            self._samples = RecentSamples()
        self._reader.align(motion.positions[0])
        self._motions.append(motion)
        yield from self._judged(self.monitor.watch(motion, arrival))
        started = self.monitor.motion
        if started is not None:
            self._motions = [each for each in self._motions if each.start >= started.start]

    def _take_state(self, msg: Any, arrival: float) -> Iterator[Judgement]:
        """Take a joint state that arrived then [s]."""
        if self._reader is None:
            return
        if stamps.is_stamped(msg):
            self.monitor.hear(stamps.seconds(msg.header.stamp), arrival)
        for sample in self._reader.read(msg, lambda: arrival):
            self._stamp = sample.time
            self._samples.add(table_of(sample))
            self._clock.hear(np.array([arrival]), np.array([sample.time]))
            yield from self._judged(self.monitor.add(sample))
        self._forget_old()
        for text in self._reader.take_remarks():
            self._remark(text)

    def _judged(self, reports: Sequence[VibrationReport]) -> Iterator[Judgement]:
        """Yield reports, each with its motion and samples."""
        for report in reports:
            motion = next(m for m in reversed(self._motions) if m.start == report.start_time)
            yield self._judgement(report, motion)
            # The next motion needs what came since this one began, at most.
            begin = motion.start + (report.clock_offset or 0.0)
            self._samples.forget(begin)
            self._forget_sent(begin)

    def _forget_old(self) -> None:
        """Forget samples that no figure will show."""
        if self._is_between_motions():
            self._samples.forget(self._stamp - SHOWN_BEFORE * LONGEST)

    def _is_between_motions(self) -> bool:
        """Return whether there is a time, and nothing is watched."""
        return self._stamp > -inf and self.monitor.phase in (Phase.IDLE, Phase.DONE)

    def _forget_sent(self, until: float) -> None:
        """Forget what was sent before a stamp [s]."""
        for record in self.sent.values():
            record.forget(until, self._clock)
        self._clock.forget(until)

    def _judgement(self, report: VibrationReport, motion: PlannedMotion) -> Judgement:
        """Return a report with its motion and the samples around it."""
        ahead = report.clock_offset or 0.0
        first = motion.start - SHOWN_BEFORE * (motion.end - motion.start)
        last = motion.end + self.monitor.settings.window
        shown = self._samples.between(first + ahead, last + ahead, len(motion.joint_names))
        efforts = np.full_like(shown.positions, np.nan) if shown.efforts is None else shown.efforts
        tracked, pushes = (
            record.between(first + ahead, last + ahead, self._clock)
            for record in self.sent.values()
        )
        return Judgement(
            report=report,
            motion=motion,
            times=shown.times - ahead,
            positions=shown.positions,
            efforts=efforts,
            tracked=tracked.earlier(ahead),
            pushes=pushes.earlier(ahead),
        )


def find_topic(
    recording: Recording, kind: str, given: str, namespace: str, usual: str, option: str
) -> str:
    """Return the one topic of a type by its given or its usual name."""
    of_kind = sorted(topic for topic, its in recording.topics.items() if its == kind)
    if given:
        wanted = '/' + given.strip('/')
        found = [topic for topic in of_kind if topic == wanted]
    elif namespace:
        wanted = f'/{namespace.strip("/")}/{usual}'
        found = [topic for topic in of_kind if topic == wanted]
    else:
        wanted = usual
        found = [topic for topic in of_kind if topic.endswith('/' + usual)]
    if len(found) == 1:
        return found[0]
    if found:
        raise NothingToJudge(
            f'several topics end in {usual}: {", ".join(found)}; choose with --namespace or '
            f'{option}'
        )
    there = ', '.join(of_kind) or 'none'
    raise NothingToJudge(
        f'no topic {wanted} of type {kind}; name one with {option} (there: {there})'
    )
