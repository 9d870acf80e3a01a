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

"""A block of segments as a recording of its own: what is made of it need not be kept for all."""

from dataclasses import replace

from flat_planner_ros.core.model_fit.last_links import FREE_STEP
from flat_planner_ros.core.model_fit.signals import Segment
from flat_planner_ros.core.model_fit.simulation import Observed
import numpy as np

MARGIN = 16
"""Samples on either side that interpolation may look at [-]."""

ALIGNED = 4
"""Samples of which one begins a part, so that every second and fourth of them stay the same."""


def part_of(observed: Observed, block: slice, delay: float) -> Observed:
    """
    Return a block of segments, with the samples of the effort that act on it.

    Parameters
    ----------
    observed
        The whole recording.
    block
        Of its segments, as of `simulation.blocks`.
    delay
        By which efforts act later than they are stamped [s].

    """
    times, segments = observed.times, observed.segments[block]
    begin, end = times[segments[0].first], times[segments[-1].last - 1] + FREE_STEP
    first = max(int(np.searchsorted(times, begin - max(delay, 0.0))) - MARGIN, 0)
    first -= first % ALIGNED
    inside = slice(first, int(np.searchsorted(times, end - min(delay, 0.0))) + MARGIN)
    errors, turning = observed.base_errors, observed.turning
    return replace(
        observed,
        times=times[inside],
        angles=observed.angles[inside],
        rates=observed.rates[block],
        effort=observed.effort[inside],
        base=observed.base[inside],
        moves=observed.moves[inside],
        segments=[Segment(each.first - first, each.last - first) for each in segments],
        turning=None if turning is None else turning[inside],
        base_errors=None if errors is None else errors.of(block),
        before=observed.before + first,
    )
