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

"""Samples of the last motion and of the time before it."""

from flat_planner_ros.core.arm import JointSample, SampleTable
import numpy as np

PART = 1024
"""Samples up to which parts are joined: few arrays, and little to copy."""


class RecentSamples:
    """Keeps positions and efforts of samples until they are forgotten."""

    def __init__(self) -> None:
        self._parts: list[SampleTable] = []

    def add(self, samples: SampleTable) -> None:
        """Keep some more."""
        part = with_efforts(samples)
        if self._parts and len(self._parts[-1]) + len(part) <= PART:
            part = joined([self._parts.pop(), part])
        self._parts.append(part)

    def forget(self, until: float) -> None:
        """Forget samples from before a time [s]."""
        while self._parts and self._parts[0].times.max() < until:
            del self._parts[0]
        if self._parts and self._parts[0].times.min() < until:
            self._parts[0] = _chosen(self._parts[0], until, np.inf)

    def between(self, first: float, last: float, joints: int) -> SampleTable:
        """Return the samples of a time [s], of so many joints."""
        parts = [_chosen(part, first, last) for part in self._parts]
        return joined([with_efforts(nothing(joints)), *parts])


def nothing(joints: int) -> SampleTable:
    """Return no samples of so many joints."""
    return SampleTable(times=np.empty(0), positions=np.empty((0, joints)))


def with_efforts(samples: SampleTable) -> SampleTable:
    """Return samples without velocities, with NaN for efforts that they do not have."""
    efforts = samples.efforts
    if efforts is None:
        efforts = np.full_like(samples.positions, np.nan)
    return SampleTable(times=samples.times, positions=samples.positions, efforts=efforts)


def table_of(sample: JointSample) -> SampleTable:
    """Return a single sample as a table."""
    return SampleTable(
        times=np.array([sample.time]),
        positions=sample.positions[None],
        velocities=None if sample.velocities is None else sample.velocities[None],
        efforts=None if sample.efforts is None else sample.efforts[None],
    )


def _chosen(samples: SampleTable, first: float, last: float) -> SampleTable:
    """Return the samples of a time [s]."""
    return samples.rows(np.flatnonzero((samples.times >= first) & (samples.times <= last)))


def joined(parts: list[SampleTable]) -> SampleTable:
    """Return samples that have efforts, one after the other."""
    return SampleTable(
        times=np.concatenate([part.times for part in parts]),
        positions=np.concatenate([part.positions for part in parts]),
        efforts=np.concatenate([part.efforts for part in parts if part.efforts is not None]),
    )
