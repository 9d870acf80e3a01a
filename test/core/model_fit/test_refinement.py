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

"""The linearisation of a long recording holds one block of it at a time."""

import tracemalloc

from flat_planner_ros.core.model_fit import Measurements
from flat_planner_ros.core.model_fit.observation import observed_of
from flat_planner_ros.core.model_fit.refinement import linearised
from flat_planner_ros.core.model_fit.signals import Segment
from flat_planner_ros.core.model_fit.simulation import Observed
import numpy as np

MODEL = np.array([7e-4, 3e-5, 2.7e-3, 2.5e-5, 2e-4, 5e-4, 0.0, 0.0])
SAMPLES = 60


def swinging(segments, period):
    """Return a recording of as many segments, sampled with a period [s]."""
    times = np.arange(segments * SAMPLES) * period
    angles = np.column_stack((np.sin(times), np.sin(11.0 * times)))
    return Observed(
        times=times,
        angles=angles,
        rates=np.zeros_like(angles),
        effort=0.01 * np.sin(2.0 * times),
        base=np.zeros_like(times),
        moves=np.ones(angles.shape, dtype=bool),
        rounding=np.zeros(2),
        segments=[Segment(SAMPLES * i, SAMPLES * (i + 1)) for i in range(segments)],
        refinement=0.3,
    )


def peak_memory(segments, period):
    """Return the most memory that a linearisation takes at a time [bytes]."""
    observed = swinging(segments, period)
    starts = np.zeros((segments, 4))
    tracemalloc.start()
    try:
        linearised(observed, MODEL, starts, range(8), np.abs(MODEL) + 1e-3, np.ones(2))
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_memory_grows_neither_with_segments_nor_with_their_length():
    few = peak_memory(20, 0.06)
    assert peak_memory(40, 0.06) < 1.1 * few
    assert peak_memory(20, 0.2) < 1.1 * few


def test_what_is_kept_of_a_recording_is_less_than_half_of_it():
    times = np.arange(40_000) * 0.005
    positions = 1e-4 * np.random.default_rng(1).standard_normal((times.size, 2))
    seen = Measurements(times=times, positions=positions, efforts=positions[:, :1])
    observed_of(seen, 0.5)  # what is imported on the way counts for nothing
    tracemalloc.start()
    try:
        kept = observed_of(seen, 0.5)
        held = tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()
    own = sum(each.nbytes for each in (seen.times, seen.positions, seen.efforts))
    assert kept.times.size == times.size
    assert held < 0.5 * own
