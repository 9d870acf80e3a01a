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

"""What samples are of a motion at all, and which of them are nothing special."""

from flat_planner_ros.core.arm import (
    InvalidRequest,
    JointSample,
    JUMP,
    SampleTable,
    travel,
    UNUSABLE,
)
from flat_planner_ros.core.monitor.course import DEGREES
from flat_planner_ros.core.monitor.motion_record import PlannedMotion
import numpy as np
from numpy.typing import NDArray


def check_size(sample: JointSample, motion: PlannedMotion) -> None:
    """Refuse a sample of other joints than the motion's."""
    shape = (len(motion.joint_names),)
    for values in (sample.positions, sample.velocities, sample.efforts):
        if values is not None and values.shape != shape:
            raise InvalidRequest(f'sample of shape {values.shape} for the joints {shape}')


def jump(former: JointSample, sample: JointSample, motion: PlannedMotion) -> str:
    """Return which joint has come further than it can have moved, if one has."""
    if former.positions.shape != sample.positions.shape:
        return ''
    change = sample.positions - former.positions
    if np.abs(change).max() <= JUMP:
        return ''
    planned = motion.reference(sample.time)[0] - motion.reference(former.time)[0]
    elapsed = sample.time - former.time
    # A joint may stand still, follow the plan, or do so in degrees, which the report will say.
    least = np.min([np.abs(change - factor * planned) for factor in (0.0, 1.0, DEGREES)], axis=0)
    excess = least - travel(former, sample)
    joint = int(np.argmax(excess))
    if excess[joint] <= JUMP:
        return ''
    return (
        f'{motion.joint_names[joint]} jumped by {change[joint]:.3g} rad within '
        f'{1e3 * elapsed:.3g} ms at {sample.time:.3f} s'
    )


def unremarkable(
    samples: SampleTable, former: JointSample | None, timeout: float
) -> NDArray[np.bool_]:
    """
    Return which samples just follow the one before, shape (m,): usable, soon after it and near it.

    Parameters
    ----------
    samples
        One after the other.
    former
        The one before them, if there is one.
    timeout
        Time from which a gap is silence [s].

    """
    times, positions = samples.times, samples.positions
    plain = np.zeros(len(samples), dtype=bool)
    if former is None or former.positions.shape != positions.shape[1:]:
        return plain
    # A NaN is not below anything.
    usable = np.abs(positions).max(axis=1) < UNUSABLE
    steps = np.diff(times, prepend=former.time)
    changes = np.abs(np.diff(positions, axis=0, prepend=former.positions[None])).max(axis=1)
    plain[:] = usable & (steps > 0.0) & (steps <= timeout) & (changes <= JUMP)
    return plain
