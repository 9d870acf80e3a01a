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

from functools import partial
import tracemalloc

from flat_planner_ros.core.arm import InvalidRequest
from flat_planner_ros.core.model_fit import Measurements
from flat_planner_ros.core.model_fit.last_fit import even_signals
from flat_planner_ros.core.model_fit.last_links import VISCOUS
from flat_planner_ros.core.model_fit.observation import (
    noise_of_links,
    observed_of,
    smoothed_rates,
)
from flat_planner_ros.core.model_fit.refinement import linearised, refine
from flat_planner_ros.core.model_fit.signals import Even, Segment
from flat_planner_ros.core.model_fit.simulation import Observed
from flat_planner_ros.core.model_fit.weak_form import weak_guess
import numpy as np
import pytest

MODEL = np.array([7e-4, 3e-5, 2.7e-3, 2.5e-5, 2e-4, 5e-4, 0.0, 0.0])
SAMPLES = 60


def swinging(segments, period):
    """Return a recording of as many segments, sampled with a period [s]."""
    times = np.arange(segments * SAMPLES) * period
    angles = np.column_stack((np.sin(times), np.sin(11.0 * times)))
    return Observed(
        times=times,
        angles=angles,
        rates=np.zeros((segments, 2)),
        rate_spread=1.0,
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


def test_a_model_that_runs_away_is_refused_without_a_warning():
    observed, away = swinging(2, 0.06), MODEL.copy()
    away[VISCOUS] = -1.0  # speeds grow by e in 0.7 ms
    with pytest.raises(InvalidRequest, match='runs away.* units and signs'):
        refine(observed, away, range(8), np.abs(MODEL) + 1e-3, np.ones(2))


def noise(samples):
    """Return a recording in which little but noise is to be seen."""
    times = np.arange(samples) * 0.005
    positions = 1e-4 * np.random.default_rng(1).standard_normal((times.size, 2))
    return Measurements(times=times, positions=positions, efforts=positions[:, :1])


def traced(call, seen):
    """Return what a call holds in the end, and the most it takes meanwhile [bytes]."""
    tracemalloc.start()
    try:
        kept = call(seen)
        assert kept is not None
        return tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()


def guessed(seen):
    """Return what the fit makes of a recording before it simulates anything."""
    observed = observed_of(seen, 0.5)
    noise_of_links(seen)
    grid = Even(float(seen.times[0]), float(seen.times[-1]), seen.times.size)
    rates = smoothed_rates(seen.times, observed.angles, 0.5)
    weak_guess(partial(even_signals, observed, grid, rates), seen.times.size, 0.5)
    return observed


def test_little_more_than_the_recording_is_kept_or_taken_before_anything_is_simulated():
    guessed(noise(1000))  # what is imported on the way counts for nothing
    few, many = (traced(guessed, noise(samples)) for samples in (40_000, 80_000))
    held, most = (np.array(many) - few) / 40_000
    assert held < 4.0  # Of 32 bytes that a sample has itself.
    assert most < 24.0
