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

"""A recording in parts, one block of segments each, tells the same as the whole of it."""

from functools import partial
import tracemalloc

from flat_planner_ros.core.model_fit.base_errors import BaseErrors
from flat_planner_ros.core.model_fit.doubts import changes_by, straighter, Way
from flat_planner_ros.core.model_fit.observation import with_fewer_efforts, with_other_times
from flat_planner_ros.core.model_fit.parts import part_of
from flat_planner_ros.core.model_fit.refinement import left_in, linearised, Refined
from flat_planner_ros.core.model_fit.signals import Segment
from flat_planner_ros.core.model_fit.simulation import blocks, Observed
import numpy as np
import pytest

MODEL = np.array([7e-4, 3e-5, 2.7e-3, 2.5e-5, 2e-4, 5e-4, 0.0, 3e-3])
SCALES = np.abs(MODEL) + 1e-3
SPREAD = np.array([1e-2, 2e-2])
SEGMENTS, SAMPLES = 45, 60


def swinging(*, has_errors=False, segments=SEGMENTS):
    """Return a recording of so many segments with a gap in the second block."""
    count = segments * SAMPLES
    times = 0.01 * np.arange(count) + np.where(np.arange(count) >= 30 * SAMPLES, 5.0, 0.0)
    angles = np.column_stack((np.sin(times), np.sin(11.0 * times)))
    cut = [Segment(SAMPLES * i, SAMPLES * (i + 1)) for i in range(segments)]
    nodes = np.array([times[each.first + 20] + 0.03 * np.arange(2) for each in cut])
    roots = np.tile(0.1 * np.eye(2), (segments, 1, 1))
    return Observed(
        times=times,
        angles=angles,
        rates=np.zeros((segments, 2)),
        rate_spread=1.0,
        effort=0.01 * np.sin(2.0 * times),
        base=0.1 * np.sin(3.0 * times),
        moves=np.random.default_rng(0).random(angles.shape) < 0.5,
        rounding=np.array([1e-3, 1e-3]),
        segments=cut,
        refinement=0.3,
        turning=np.cos(angles),
        base_errors=BaseErrors(nodes, roots, 0.03) if has_errors else None,
    )


def around_of(observed):
    """Return a fit to a recording, or what counts as one, and which parameters are free."""
    starts = 0.1 * np.random.default_rng(1).standard_normal(
        (len(observed.segments), observed.unknowns)
    )
    free = [0, 2, 5, 7]
    around = linearised(observed, MODEL, starts, free, SCALES, SPREAD)
    return Refined(MODEL, starts, SPREAD, around), free


@pytest.mark.parametrize('has_errors', [False, True])
def test_parts_add_up_to_the_whole(has_errors):
    observed = swinging(has_errors=has_errors)
    found, free = around_of(observed)
    whole = found.around
    parts = [
        linearised(
            part_of(observed, block, MODEL[-1]), MODEL, found.starts[block], free, SCALES, SPREAD
        )
        for block in blocks(observed)
    ]
    assert len(parts) == 3
    for name in ('cost', 'gradient', 'normal', 'scatter', 'rounding', 'samples', 'products'):
        total = sum(getattr(part, name) for part in parts)
        assert total == pytest.approx(getattr(whole, name), rel=1e-9, abs=1e-9 * np.max(total))


@pytest.mark.parametrize(
    'view',
    [straighter, *(partial(with_fewer_efforts, every=k) for k in (2, 4))]
    + [partial(with_other_times, seed=3)],
)
def test_a_view_of_a_part_is_that_of_the_whole(view):
    observed = swinging()
    whole = view(observed)
    for block in blocks(observed):
        part = view(part_of(observed, block, MODEL[-1]))
        assert part.straightness == whole.straightness
        for own, each in zip(part.segments, observed.segments[block], strict=True):
            expected = whole.effort[each.first : each.last]
            assert part.effort[own.first : own.last] == pytest.approx(expected, abs=1e-14)


def test_changes_are_those_of_residuals_that_are_held():
    observed = swinging()
    found, free = around_of(observed)
    fewer = partial(with_fewer_efforts, every=4)
    first, second = changes_by(
        [Way(lambda part: part, found.around), Way(straighter), Way(fewer)],
        observed,
        found,
        free,
        SCALES,
    )
    here = np.concatenate(found.around.residuals, dtype=float)
    for change, view in ((first, straighter), (second, fewer)):
        there = linearised(view(observed), MODEL, found.starts, free, SCALES, SPREAD)
        by_view = (np.concatenate(there.residuals, dtype=float) - here) / SPREAD
        along = (by_view * here / SPREAD).sum(axis=0)
        assert change.samples == len(here)
        assert change.power == pytest.approx((by_view**2).sum(axis=0), rel=1e-6)
        assert change.on_residuals == pytest.approx(along, rel=1e-6)
        assert change.gradient == pytest.approx(there.gradient - found.around.gradient, rel=1e-6)
        assert change.normal == pytest.approx(there.normal, rel=1e-6)


def test_residuals_that_were_not_kept_are_found_again():
    observed = swinging()
    found, _ = around_of(observed)
    forgotten = found._replace(around=found.around._replace(residuals=[]))
    for block in blocks(observed):
        again = left_in(part_of(observed, block, MODEL[-1]), block, forgotten)
        for one, other in zip(again, found.around.residuals[block], strict=True):
            assert one == pytest.approx(other, rel=1e-5, abs=1e-9)


def peak_of_changes(segments):
    """Return the most memory that changes take whose residuals were not kept [bytes]."""
    observed = swinging(segments=segments)
    found, free = around_of(observed)
    found = found._replace(around=found.around._replace(residuals=[]))
    ways = [Way(lambda part: part, found.around), Way(straighter)]
    tracemalloc.start()
    try:
        changes_by(ways, observed, found, free, SCALES)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_memory_of_changes_does_not_grow_with_the_recording():
    assert peak_of_changes(80) < 1.1 * peak_of_changes(20)
