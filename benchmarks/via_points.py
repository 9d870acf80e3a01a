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

"""Cost of plans through via points over their number."""

from argparse import Namespace
from dataclasses import replace
from itertools import count

from flat_planner_ros.core import (
    MotionRequest,
    plan,
    PlanningOptions,
    Strategy,
    ViaPoint,
    with_via_times,
)
from measurement import duration_text, Section, timing
import numpy as np
import problem

COUNTS = (1, 2, 5, 10, 20, 50)
"""Numbers of via points."""

CHOSEN = (1, 2, 5, 10)
"""Numbers of via points whose times are chosen."""

OPTIONS = {
    'polynomial': PlanningOptions(strategy=Strategy.POLYNOMIAL),
    'min_control_effort': problem.OPTIONS,
}
"""The first has one basis for all segments, the second one for each length."""

SAMPLES = 1001
"""Points at which the motion is sampled, as in the other tables."""


def sections(options: Namespace) -> list[Section]:
    """Return the tables of this benchmark."""
    del options
    return [_given(name) for name in OPTIONS] + [_chosen(name) for name in OPTIONS]


def _requests(points: int):
    """Return motions through random points, their times never asked for before."""
    for seed in count():
        rng = np.random.default_rng([points, seed])
        times = np.cumsum(rng.uniform(0.3, 0.7, points + 1))
        angles = rng.normal(size=points + 1)
        via = tuple(
            ViaPoint(time=float(time), values=np.array([angle]))
            for time, angle in zip(times[:-1], angles[:-1], strict=True)
        )
        final = np.array([angles[-1], 0.0])
        yield MotionRequest(start=np.zeros(2), final=final, duration=float(times[-1]), via=via)


def _given(name: str) -> Section:
    """Return the table of one strategy with prescribed times."""
    arm, rows = problem.arm(), []
    for points in COUNTS:
        requests = _requests(points)
        made = plan(next(requests), arm, OPTIONS[name])
        times = np.array([point.time for point in made.request.via])
        expected = [point.values[0] for point in made.request.via]
        assert np.abs(made.at(times).flat[0, 0] - expected).max() < 1e-11
        solved = timing(
            lambda request: plan(request, arm, OPTIONS[name]),
            lambda requests=requests: next(requests),
            budget=1.5,
        )
        grid = np.linspace(0.0, made.duration, SAMPLES)
        sampled = timing(made.at, lambda grid=grid: grid, budget=0.5)
        rows.append(
            (
                f'{points}',
                duration_text(solved.median),
                duration_text(solved.worst),
                f'{1e6 * solved.median / (points + 1):.0f} µs',
                duration_text(sampled.median),
            )
        )
    header = ('via points', 'plan, median', 'worst', 'per segment', f'{SAMPLES} samples')
    return Section(f'Via points at given times, {name}', header, rows)


def _chosen(name: str) -> Section:
    """Return the table of one strategy with times of the planner's choice."""
    arm, rows = problem.arm(), []
    for points in CHOSEN:
        requests = _requests(points)
        request = next(requests)
        best = plan(with_via_times(request, arm, OPTIONS[name]), arm, OPTIONS[name])
        edges = np.linspace(0.0, request.duration, points + 2)[1:-1]
        even = replace(
            request,
            via=tuple(
                replace(point, time=float(time))
                for point, time in zip(request.via, edges, strict=True)
            ),
        )
        ratio = plan(even, arm, OPTIONS[name]).cost_value / best.cost_value
        assert ratio >= 1.0
        found = timing(
            lambda request: with_via_times(request, arm, OPTIONS[name]),
            lambda requests=requests: next(requests),
            budget=1.5,
        )
        rows.append(
            (
                f'{points}',
                duration_text(found.median),
                duration_text(found.worst),
                f'{ratio:.3g}',
            )
        )
    header = ('via points', 'times, median', 'worst', 'cost at even times / at these, one case')
    return Section(f'Times of via points, {name}', header, rows)
