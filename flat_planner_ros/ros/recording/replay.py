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

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
import json
from typing import Any

from flat_planner_ros.core.arm import FlatPlannerError, FloatArray, JointSample
from flat_planner_ros.core.monitor import (
    MonitorSettings,
    PlannedMotion,
    VibrationMonitor,
    VibrationReport,
)
from flat_planner_ros.ros.parameters import monitor as monitor_parameters
from flat_planner_ros.ros.recording.recording import Recording
from flat_planner_ros.ros.recording.storage import Entry
from flat_planner_ros.ros.wire import conversions, stamps
from flat_planner_ros.ros.wire.interfaces import JOINT_STATES, MONITOR, PLAN, PLANNER, topic_of
from flat_planner_ros.ros.wire.joint_states import JointStateReader
from flat_planner_ros.ros.wire.point_writer import NANOSECONDS
import numpy as np
from rclpy.parameter import Parameter

JOINT_STATE = 'sensor_msgs/msg/JointState'
JOINT_TRAJECTORY = 'trajectory_msgs/msg/JointTrajectory'

SILENCE = 1.001
"""Time after the last sample of a recording, relative to what counts as silence [-]."""

SHOWN_BEFORE = 0.1
"""Time before a motion of which samples are kept, relative to the motion [-]."""


class NothingToJudge(FlatPlannerError):
    """A recording without the topics that a report needs; the message names those it has."""


@dataclass(frozen=True, kw_only=True)
class Sources:
    """Names of the topics with the planned motions and with the measured joint states."""

    plan: str
    joint_states: str


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

    """

    report: VibrationReport
    motion: PlannedMotion
    times: FloatArray
    positions: FloatArray
    efforts: FloatArray


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
    namespace = sources.plan.removesuffix('/' + topic_of(PLANNER, PLAN))
    # A recording of an earlier version does not know all of them.
    defaults = {
        row.name: row.default
        for row in monitor_parameters.ROWS
        if not isinstance(row.default, Parameter.Type)
    }
    known = {row.name for row in monitor_parameters.ROWS}
    settings = []
    for time, node, text in recording.parameters:
        if node == f'{namespace}/{MONITOR}':
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
) -> list[Judgement]:
    """
    Return a report on each motion that a recording shows, as the monitor node makes it.

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

    """
    player = _Player(settings[0][1], remark)
    changes = list(settings[1:])
    for entry, msg in recording.messages({sources.plan, sources.joint_states}):
        while changes and changes[0][0] <= entry.time:
            player.apply(changes.pop(0)[1])
        player.take(entry, msg)
    player.end()
    return player.judgements


class _Player:
    """
    Feeds a monitor as its node does, but for the time: that comes with the stamps alone.

    A recorder may have been late where the joint states were not.
    """

    def __init__(self, settings: MonitorSettings, remark: Callable[[str], object]) -> None:
        self.monitor = VibrationMonitor(settings)
        self._remark = remark
        self.judgements: list[Judgement] = []
        self._stamp: float | None = None
        self._reader: JointStateReader | None = None
        self._motions: list[PlannedMotion] = []
        self._samples: list[JointSample] = []

    def apply(self, settings: MonitorSettings) -> None:
        """Judge with changed settings from now on."""
        self.monitor.settings = settings
        if self._reader is not None:
            self._reader.rules = settings.joint_states

    def take(self, entry: Entry, msg: Any) -> None:
        """Take a message; one that cannot be used is left out, as in the node."""
        take = self._take_plan if entry.kind == JOINT_TRAJECTORY else self._take_state
        with suppress(FlatPlannerError):
            take(msg, entry.time / NANOSECONDS)

    def end(self) -> None:
        """Judge a motion that is still watched: nothing more will come."""
        if self._stamp is not None:
            silence = SILENCE * self.monitor.settings.timeout
            self._keep(self.monitor.tick(self._stamp + silence))

    def _take_plan(self, msg: Any, arrival: float) -> None:
        """Take a plan that arrived then [s], for whatever joints it names."""
        if not stamps.is_stamped(msg):
            msg.header.stamp = stamps.time_msg(arrival)
        motion = conversions.planned_motion_from_trajectory(msg)
        if self._reader is None or tuple(self._reader.joints) != motion.joint_names:
            self.monitor.reset()
            self._reader = JointStateReader(motion.joint_names, self.monitor.settings.joint_states)
            self._samples.clear()
        self._reader.align(motion.positions[0])
        self._motions.append(motion)
        self._keep(self.monitor.watch(motion, arrival))

    def _take_state(self, msg: Any, arrival: float) -> None:
        """Take a joint state that arrived then [s]."""
        if self._reader is None:
            return
        if stamps.is_stamped(msg):
            self.monitor.hear(stamps.seconds(msg.header.stamp), arrival)
        for sample in self._reader.read(msg, lambda: arrival):
            self._stamp = sample.time
            self._samples.append(sample)
            self._keep(self.monitor.add(sample))
        for text in self._reader.take_remarks():
            self._remark(text)

    def _keep(self, reports: Sequence[VibrationReport]) -> None:
        """Keep reports, each with its motion and samples."""
        for report in reports:
            motion = next(m for m in reversed(self._motions) if m.start == report.start_time)
            self.judgements.append(self._judgement(report, motion))
            ahead = report.clock_offset or 0.0
            # The next motion needs what came since this one began, at most.
            self._samples = [
                sample for sample in self._samples if sample.time - ahead >= motion.start
            ]

    def _judgement(self, report: VibrationReport, motion: PlannedMotion) -> Judgement:
        """Return a report with its motion and the samples around it."""
        ahead = report.clock_offset or 0.0
        first = motion.start - SHOWN_BEFORE * (motion.end - motion.start)
        last = motion.end + self.monitor.settings.window
        shown = [sample for sample in self._samples if first <= sample.time - ahead <= last]
        unknown = np.full(len(motion.joint_names), np.nan)
        return Judgement(
            report=report,
            motion=motion,
            times=np.array([sample.time - ahead for sample in shown]),
            positions=np.array([sample.positions for sample in shown]),
            efforts=np.array([unknown if s.efforts is None else s.efforts for s in shown]),
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
