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
from time import process_time

from flat_planner_ros.core import (
    Goal,
    GoalPoint,
    JointLimits,
    MotionRequest,
    plan,
    PlannerSession,
    PlanningOptions,
    SessionSettings,
    Strategy,
    ViaPoint,
    with_via_times,
)
from flat_planner_ros.core.planning import Reason, RequestRejected
from flat_planner_ros.core.session import StartSource
from measurement import duration_text, Section, Timing, timing, verdict
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

TAKEOVERS = 60
"""Goals that take over from a motion, in each row."""

LIMITS = JointLimits.of(2, velocity=np.array([12.0, np.inf]))
"""Of the goals whose duration is the shortest [rad/s]."""


def sections(options: Namespace) -> list[Section]:
    """Return the tables of this benchmark."""
    del options
    tables = [_given(name) for name in OPTIONS] + [_chosen(name) for name in OPTIONS]
    return [*tables, _takeovers()]


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


def _takeovers() -> Section:
    """Return the table of goals in motion whose via points choose their times."""
    rows, worst, busy = [], 0.0, 0
    for name, options in OPTIONS.items():
        for what, changes in (
            ('5 s', {'default_duration': 5.0}),
            ('the shortest', {'limits': LIMITS}),
        ):
            settings = SessionSettings(
                joints=('joint1', 'joint2'),
                arm=problem.arm(),
                options=options,
                start_source=StartSource.PARAMETER,
                start_position=(0.0, 0.0),
                **changes,
            )
            for points in (2, 5, 10):
                _takeover(settings, points, TAKEOVERS)  # loads what is loaded late
                taken = [_takeover(settings, points, seed) for seed in range(TAKEOVERS)]
                late = sum(is_late for _, is_late in taken)
                times = Timing.of([time for time, _ in taken])
                busy, worst = busy + late, max(worst, times.worst)
                cells = duration_text(times.median), duration_text(times.worst)
                rows.append((f'{points} via points in {what}, {name}', *cells, f'{late}'))
    lookahead = SessionSettings.lookahead
    return Section(
        f'Goals with via points in motion, {duration_text(lookahead)} ahead',
        ('times chosen for', 'goal to motion, median', 'worst', 'BUSY'),
        rows,
        [
            f'{TAKEOVERS} random goals each, from the midst of another motion; never BUSY: '
            f'{verdict(busy == 0)}, the slowest takes {100.0 * worst / lookahead:.0f} % of the '
            f'lookahead',
            'times are of the processor: on a busy machine goals take longer',
        ],
    )


def _takeover(settings: SessionSettings, points: int, seed: int) -> tuple[float, bool]:
    """Return how long a goal in the midst of a motion takes [s], and if that is too long."""
    rng = np.random.default_rng([points, seed])
    session, begin = PlannerSession(settings), 100.0
    way = Goal(joint_names=('joint1',), points=(GoalPoint(time=2.0, positions=(2.0,)),))
    running = session.submit(replace(way, stamp=begin + 1.0), begin)
    now = running.start + rng.uniform(0.2, 1.5)
    angles = rng.normal(size=(points + 1, 1))
    through = tuple(GoalPoint(time=0.0, positions=tuple(angle.tolist())) for angle in angles)
    goal = replace(way, points=through)
    started = process_time()
    try:
        session.submit(goal, now, lambda: now + process_time() - started)
    except RequestRejected as error:
        # What overshoots on its way does so however long it takes.
        if error.reason not in (Reason.BUSY, Reason.VELOCITY_LIMIT):
            raise
        return process_time() - started, error.reason is Reason.BUSY
    return process_time() - started, False
