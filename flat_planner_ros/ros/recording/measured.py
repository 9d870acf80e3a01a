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

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from flat_planner_ros.core.arm import FlatPlannerError, FloatArray, InvalidRequest, JointSample
from flat_planner_ros.core.model_fit import Measurements
from flat_planner_ros.ros.recording.recording import Recording
from flat_planner_ros.ros.recording.replay import find_topic, JOINT_STATE
from flat_planner_ros.ros.wire.interfaces import JOINT_STATES
from flat_planner_ros.ros.wire.joint_states import JointStateReader
from flat_planner_ros.ros.wire.point_writer import NANOSECONDS
import numpy as np

APART = 10.0
"""Time put between two recordings [s]: a gap that no segment spans."""


class NothingMeasured(FlatPlannerError):
    """Recordings without joint states that have efforts; the message says what they have."""


def measured(
    paths: Sequence[Path], joints: Sequence[str], *, namespace: str = '', topic: str = ''
) -> Measurements:
    """
    Return what recordings show of an arm, one after the other with a gap between them.

    Parameters
    ----------
    paths
        Recordings, each as `Recording` reads it.
    joints
        Names, the passive joint last.
    namespace, topic
        Of the joint states, where a recording has several.

    Raises
    ------
    NothingMeasured
        No joint state has the efforts of the actuated joints.
    FlatPlannerError
        A recording cannot be read or has no joint states.

    """
    times: list[float] = []
    positions: list[FloatArray] = []
    efforts: list[FloatArray] = []
    for path in paths:
        samples = _samples(Recording(path), joints, namespace, topic)
        if not samples:
            raise NothingMeasured(
                f'{path} has no joint states of {", ".join(joints)} with efforts: the driver must '
                'report what its motors apply'
            )
        # Each recording has a time of its own.
        shift = (times[-1] + APART if times else 0.0) - samples[0].time
        times += [sample.time + shift for sample in samples]
        positions += [sample.positions for sample in samples]
        efforts += [sample.efforts[:-1] for sample in samples if sample.efforts is not None]
    return Measurements(
        times=np.array(times), positions=np.array(positions), efforts=np.array(efforts)
    )


def _samples(
    recording: Recording, joints: Sequence[str], namespace: str, topic: str
) -> list[JointSample]:
    """Return the complete samples of a recording in the order of their stamps."""
    name = find_topic(recording, JOINT_STATE, topic, namespace, JOINT_STATES, '--joint-states')
    reader = JointStateReader(joints)
    samples: list[JointSample] = []
    for entry, msg in recording.messages({name}):
        try:
            found = reader.read(msg, partial(float, entry.time / NANOSECONDS))
        except InvalidRequest:
            continue  # none of the joints, as several drivers on one topic send it
        for sample in found:
            is_later = not samples or sample.time > samples[-1].time
            if is_later and _is_complete(sample):
                samples.append(sample)
    return samples


def _is_complete(sample: JointSample) -> bool:
    """Tell a sample with all angles and the efforts of all motors."""
    return sample.efforts is not None and bool(
        np.isfinite(sample.positions).all() and np.isfinite(sample.efforts[:-1]).all()
    )
