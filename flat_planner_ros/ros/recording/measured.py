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

"""Angles and efforts of an arm from recordings."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

from flat_planner_ros.core.arm import FlatPlannerError, InvalidRequest, SampleTable
from flat_planner_ros.core.model_fit import Measurements
from flat_planner_ros.core.monitor import FeedbackTimes
from flat_planner_ros.ros.recording.csv_table import csv_samples, SUFFIXES
from flat_planner_ros.ros.recording.recent_samples import (
    joined,
    nothing,
    table_of,
    with_efforts,
)
from flat_planner_ros.ros.recording.recording import Recording
from flat_planner_ros.ros.recording.replay import find_topic, JOINT_STATE, stretches
from flat_planner_ros.ros.recording.storage import Entry
from flat_planner_ros.ros.wire.interfaces import DIAGNOSTICS, JOINT_STATES
from flat_planner_ros.ros.wire.joint_states import JointStateReader
from flat_planner_ros.ros.wire.point_writer import NANOSECONDS
from flat_planner_ros.ros.wire.state_table import read_states
from flat_planner_ros.ros.wire.tracker_word import hear_tracker
import numpy as np

APART = 10.0
"""Time put between two recordings [s]: a gap that no segment spans."""


class NothingMeasured(FlatPlannerError):
    """Recordings without joint states that have efforts; the message says what they have."""


def measured(
    paths: Sequence[Path],
    joints: Sequence[str],
    *,
    namespace: str = '',
    topic: str = '',
    advance: Callable[[float], object] = float,
) -> Measurements:
    """
    Return what recordings show of an arm, one after the other with a gap between them.

    Efforts count as held if a tracker acted in one of them: a table does not say so.

    Parameters
    ----------
    paths
        Recordings, each as `Recording` reads it, or a table as `csv_samples` does.
    joints
        Names, the passive joint last.
    namespace, topic
        Of the joint states, where a recording has several.
    advance
        Is told which share of a file has been read since it was last told.

    Raises
    ------
    NothingMeasured
        No joint state has the efforts of the actuated joints.
    FlatPlannerError
        A recording cannot be read or has no joint states.

    """
    parts: list[SampleTable] = []
    are_held = False
    for path in paths:
        if path.suffix.lower() in SUFFIXES:
            samples = csv_samples(path, joints)
            advance(1.0)
        else:
            feedback = FeedbackTimes()
            samples = _samples(Recording(path, advance), joints, namespace, topic, feedback)
            stamps = samples.times
            are_held |= bool(len(stamps)) and feedback.has_acted(stamps[0], stamps[-1])
        if not len(samples):
            raise NothingMeasured(
                f'{path} has no joint states of {", ".join(joints)} with efforts: the driver must '
                'report what its motors apply'
            )
        # Each recording has a time of its own.
        begin = parts[-1].times[-1] + APART if parts else 0.0
        parts.append(replace(samples, times=samples.times - samples.times[0] + begin))
    whole = joined(parts)
    efforts = np.empty_like(whole.positions) if whole.efforts is None else whole.efforts
    return Measurements(
        times=whole.times,
        positions=whole.positions,
        efforts=efforts[:, :-1],
        are_held=are_held,
    )


def _samples(
    recording: Recording,
    joints: Sequence[str],
    namespace: str,
    topic: str,
    feedback: FeedbackTimes,
) -> SampleTable:
    """Return the complete samples in the order of their stamps; note when a tracker acted."""
    name = find_topic(recording, JOINT_STATE, topic, namespace, JOINT_STATES, '--joint-states')
    reader = JointStateReader(joints)
    parts = [with_efforts(nothing(len(joints)))]
    home = f'/{namespace.strip("/")}' if namespace else name.rpartition('/')[0]
    for entries in stretches(recording.batches({name, DIAGNOSTICS})):
        if entries[0].topic == DIAGNOSTICS:
            _hear(recording, entries, home, feedback)
            continue
        states = read_states([entry.message for entry in entries])
        table = None if states is None else reader.read_table(*states)
        found = _read_singly(recording, reader, entries) if table is None else [table]
        parts += map(with_efforts, found)
    samples = joined(parts)
    efforts = np.empty_like(samples.positions) if samples.efforts is None else samples.efforts
    known = np.isfinite(np.hstack((samples.positions, efforts[:, :-1])))
    samples = samples.rows(np.flatnonzero(known.all(axis=1)))
    latest = np.maximum.accumulate(samples.times)
    is_later = np.append(True, samples.times[1:] > latest[:-1])[: len(samples)]
    return samples.rows(np.flatnonzero(is_later))


def _hear(
    recording: Recording, entries: Sequence[Entry], namespace: str, feedback: FeedbackTimes
) -> None:
    """Note when a namespace's tracker acted."""
    for entry in entries:
        msg = recording.read(entry)
        if msg is not None:
            hear_tracker(msg, namespace, feedback)


def _read_singly(
    recording: Recording, reader: JointStateReader, entries: Sequence[Entry]
) -> Iterator[SampleTable]:
    """Yield the samples in messages that are not alike."""
    for entry in entries:
        msg = recording.read(entry)
        arrival = partial(float, entry.time / NANOSECONDS)
        # None of the joints, as several drivers on one topic send it, is no error.
        with suppress(InvalidRequest):
            if msg is not None:
                yield from map(table_of, reader.read(msg, arrival))
