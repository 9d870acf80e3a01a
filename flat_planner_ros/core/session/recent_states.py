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

"""What the joints have done lately: the state of an arm in motion, and what it will be."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from math import tau
from typing import TYPE_CHECKING

from flat_planner_ros.core.arm import Drive, FloatArray, JointSample, PlanarArm
from flat_planner_ros.core.planning import PlanSamples
from flat_planner_ros.core.session.timeline import Motion
import numpy as np

if TYPE_CHECKING:
    from flat_planner_ros.core.tracking import Estimate

KEPT = 4000
"""Samples that are kept: 2 s at the fastest rate."""

LOOKED_AT = 200
"""Samples that an estimate is made of at most: no more is gained by more, but time is lost."""

LEAST_SWINGS = 0.5
"""Swings that must have been seen: half of one shows what is a swing and what is an offset [-]."""

MOST_SWINGS = 1.0
"""Swings that are looked at, before which other things may have happened [-]."""

RELATIVE_BANDWIDTH = 4.0
"""Bandwidth of the observer in terms of the free oscillation's frequency [-]."""

FASTEST = 0.5
"""Bandwidth of the observer times the spacing of samples at most [-]."""

PRIOR_ERROR = 0.25
"""Error of the model's stiffness that is expected before a swing is seen [-]."""

LARGEST_CHANGE = 0.6
"""A stiffness further from the model's is not believed [-]."""


class Inputs:
    """
    What is planned to act on an arm.

    Parameters
    ----------
    arm, drive
        The model, and what moves joint n-1.
    motions
        What is planned, in the order of time.

    """

    def __init__(self, arm: PlanarArm, drive: Drive, motions: Iterable[Motion]) -> None:
        self.is_held = drive is Drive.POSITION
        self._inner = arm.n - 2
        self._motions = list(motions)

    def at(self, times: FloatArray) -> FloatArray:
        """Return effort of joint n-1, or acceleration of link n-1, and those before, (m, n-1)."""
        found = np.zeros((len(times), 1 + self._inner))
        for motion in self._motions:
            during = (motion.start <= times) & (times < motion.end)
            if during.any():
                found[during] = self._of(motion.plan.at(times[during] - motion.start))
        return found

    def _of(self, planned: PlanSamples) -> FloatArray:
        """Return the same of a plan."""
        last = planned.accelerations[:, :-1].sum(axis=1)
        driving = last if self.is_held else planned.driving_effort
        return np.column_stack([driving, planned.accelerations[:, : self._inner]])


class RecentStates:
    """The last measured states of an arm."""

    def __init__(self) -> None:
        self._samples: deque[JointSample] = deque(maxlen=KEPT)

    @property
    def last(self) -> JointSample | None:
        """Return the last measured state, None before the first."""
        return self._samples[-1] if self._samples else None

    def add(self, sample: JointSample) -> None:
        """Take a state; one that is earlier than the last comes from a clock that was set back."""
        if self._samples and sample.time <= self._samples[-1].time:
            self._samples.clear()
        self._samples.append(sample)

    def estimate(self, arm: PlanarArm, inputs: Inputs, time: float) -> Estimate | None:
        """
        Return the state of the arm at a time [s] to come.

        None if less than half a swing has been seen, or if the passive joint stands beside its
        zero: no model explains that.
        """
        # Imported here: a node starts sooner without it, and is to need it for a swing only.
        from flat_planner_ros.core.tracking import ArmObserver

        frequency = arm.natural_mode(held=inputs.is_held).frequency
        swing = tau / frequency
        seen = self._since(MOST_SWINGS * swing)
        times = np.array([sample.time for sample in seen])
        if len(seen) < 3 or times[-1] - times[0] < LEAST_SWINGS * swing:
            return None
        passive = np.array([sample.positions[-1] for sample in seen])
        if np.ptp(passive) < abs(passive.mean()):
            return None
        period = float(np.diff(times).mean())
        bandwidth = min(RELATIVE_BANDWIDTH * frequency, FASTEST / period)
        arm = _as_it_swings(arm, seen, swing)
        observer = ArmObserver(arm, period, bandwidth, held=inputs.is_held)
        observer.restart(seen[0])
        known = inputs.at(times + 0.5 * period)
        for before, acts, sample in zip(seen, known, seen[1:], strict=False):
            observer.note(before.time, float(acts[0]), acts[1:])
            observer.correct(sample)
        # Estimated from so few samples it is noise: carried ahead it would do more harm than good.
        observer.forget_disturbances()
        ahead = np.arange(times[-1], time, period)
        for at, acts in zip(ahead, inputs.at(ahead + 0.5 * period), strict=True):
            observer.note(at, float(acts[0]), acts[1:])
        return observer.predicted(time)

    def _since(self, duration: float) -> list[JointSample]:
        """Return the finite samples of the last time [s], thinned out."""
        if not self._samples:
            return []
        since = self._samples[-1].time - duration
        seen = [s for s in self._samples if s.time >= since and np.isfinite(s.positions).all()]
        return seen[:: -(-len(seen) // LOOKED_AT) or 1]


def _as_it_swings(arm: PlanarArm, seen: list[JointSample], swing: float) -> PlanarArm:
    """
    Return the model with the stiffness that the last swing shows, as far as it shows one.

    Carried forward by a spring 10 % off, a swing would soon be 5 % of itself beside the arm.
    """
    # Loaded where an arm swings: a tenth of what a planner loads, which need not wait for it.
    from flat_planner_ros.core.model_fit import seen_stiffness

    times = np.array([sample.time for sample in seen])
    angles = np.array([sample.positions for sample in seen])
    factor, error = seen_stiffness(times, angles.sum(axis=1), angles[:, -1], arm, swing)
    trust = 1.0 / (1.0 + (error / PRIOR_ERROR) ** 2)
    factor = 1.0 + trust * (factor - 1.0)
    return arm.scaled(stiffness=factor) if abs(factor - 1.0) < LARGEST_CHANGE else arm
