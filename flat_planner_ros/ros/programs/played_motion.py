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

"""What the plant did in a run of the experiment, and whether it was what was planned."""

from collections.abc import Sequence
from typing import Any

from flat_planner_ros.core.arm import Drive, FloatArray
from flat_planner_ros.core.monitor import PlannedMotion
from flat_planner_ros.figures.paper_example import DURATION, Recording
from flat_planner_ros.ros.parameters.arm_model import EXAMPLE_ARM
from flat_planner_ros.ros.wire.joint_states import JointStateReader
import numpy as np

PLAYED_TOLERANCE = 1e-3
"""Largest difference of applied and planned effort in a valid run, relative to the peak [-]."""

FOLLOWED_TOLERANCE = 1e-4
"""The same for the angle of a joint with a servo; angles begin far more gently than efforts."""


class ExperimentFailed(Exception):
    """The experiment cannot go on; the message says why."""


class NotFound(ExperimentFailed):
    """Nodes do not find each other; the message says what is missing."""


class Interrupted(Exception):
    """SIGINT or SIGTERM has come."""


class TooBusy(ExperimentFailed):
    """The machine does not keep up."""


def recording(states: Sequence[Any], start: float) -> Recording:
    """Return the joint states of one run on the time axis of its motion."""
    reader = JointStateReader(EXAMPLE_ARM['joints'])
    samples = [sample for state in states for sample in reader.read(state, lambda: 0.0)]
    return Recording(
        times=np.array([sample.time for sample in samples]) - start,
        positions=np.array([sample.positions for sample in samples]),
        efforts=np.array([of_joint_1(sample.efforts) for sample in samples]),
    )


def is_played(recording: Recording, motion: PlannedMotion, drive: Drive) -> bool:
    """Return whether joint 1 was given what is planned, from the first point on."""
    # Compared where there are joint states: a busy machine loses some of them.
    moving = (recording.times >= 0.0) & (recording.times <= DURATION)
    times = recording.times[moving]
    if drive is Drive.POSITION:
        # Imported here: SciPy's splines take as long to load as all else together.
        from scipy.interpolate import CubicSpline

        # What a servo needs depends on the true arm; where it has to be does not.
        wanted = CubicSpline(motion.times, motion.positions[:, 0])(times)
        given, tolerance = recording.positions[moving, 0], FOLLOWED_TOLERANCE
    else:
        wanted = np.interp(times, motion.times, of_joint_1(motion.efforts))
        given, tolerance = recording.efforts[moving], PLAYED_TOLERANCE
    peak = np.abs(wanted).max(initial=0.0)
    return bool(peak > 0.0 and (np.abs(given - wanted) <= tolerance * peak).all())


def of_joint_1(efforts: FloatArray | None) -> FloatArray:
    """Return the effort of joint 1, of one sample or of all points of a plan."""
    if efforts is None:
        raise ExperimentFailed('there are no efforts to compare')
    return efforts[..., 0]
