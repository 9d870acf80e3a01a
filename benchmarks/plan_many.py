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

"""Many plans in one call beside plans one by one: time with the same figures, and memory."""

from argparse import Namespace
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from time import perf_counter, process_time
import tracemalloc

from flat_planner_ros.core import (
    MotionRequest,
    plan,
    plan_many,
    PlanningOptions,
    PlanTable,
    residual_of_plan,
    Strategy,
)
from measurement import duration_text, Section, verdict
import numpy as np
import problem

ARM = problem.arm()
"""The paper's."""

ROWS = 4096
"""Motions in one call."""

SINGLE = 400
"""Motions of them that are planned one by one; none is known from the time before."""

REPEATS = 3
"""Runs, of which the fastest counts."""

RATIO = 20.0
"""Goal: faster than one by one, with the same figures [-]."""

RATE = 20_000.0
"""Goal: motions a second on two cores [1/s]."""

STRATEGIES = (
    Strategy.POLYNOMIAL,
    Strategy.MIN_CONTROL_EFFORT,
    Strategy.MIN_POTENTIAL_ENERGY,
    Strategy.MIXED,
)

CLOSE = 2e-3
"""Largest difference of a figure that is not an error: peaks are found at nodes [-]."""


def sections(options: Namespace) -> Iterator[Section]:
    """Return the tables."""
    del options
    yield Section(
        f'Many plans in one call: certificate, peaks, RMS values and worst residual, {ROWS} rows',
        ('strategy', 'one by one', 'in one call', 'ratio', f'goal {RATIO:g}', 'memory per row'),
        [_row(strategy) for strategy in STRATEGIES],
        [
            "a row: the paper's arm, a random distance, a random duration of 0.3 to 8 periods",
            'times are of the processor, so that what else the machine does counts for neither',
            'memory: of the table with its figures; 512 rows are worked on at once',
            _parallel(),
        ],
    )


def numbers(rows: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Return distances [rad] and durations [s]."""
    rng = np.random.default_rng(seed)
    period = 2.0 * np.pi / ARM.natural_mode().frequency
    return rng.uniform(0.5, 3.0, rows), period * np.exp(
        rng.uniform(np.log(0.3), np.log(8.0), rows)
    )


def in_one_call(options: PlanningOptions, rows: int, seed: int = 0) -> PlanTable:
    """Return the table with all that is compared."""
    table = plan_many(ARM, *numbers(rows, seed), options)
    assert table.is_certified.all()
    table.figures, table.residuals  # noqa: B018 - computed when first asked for
    return table


def one_by_one(request: MotionRequest, options: PlanningOptions) -> tuple[float, ...]:
    """Return RMS and peak of the effort, peak velocity and worst residual of one plan."""
    planned = plan(request, ARM, options)
    return (
        planned.rms_effort[0],
        planned.peak_effort[0],
        planned.peak_velocity[0],
        residual_of_plan(planned).worst,
    )


def _row(strategy: Strategy) -> list[str]:
    """Return a row of the table, its figures checked against single plans."""
    options = PlanningOptions(strategy=strategy)
    ways, durations = numbers(ROWS)
    table = in_one_call(options, ROWS)
    residuals = table.residuals
    for row in range(0, ROWS, ROWS // 16):
        request = _request(ways[row], durations[row])
        found = [table.rms_effort[row, 0], table.peak_effort[row, 0]]
        found += [table.peak_velocity[row, 0], residuals.worst[row]]
        np.testing.assert_allclose(
            found, one_by_one(request, options), rtol=CLOSE, atol=1e-6 * ways[row]
        )
    requests = [_request(ways[row], durations[row]) for row in range(SINGLE)]
    single = _seconds(lambda: [one_by_one(request, options) for request in requests]) / SINGLE
    many = _seconds(lambda: in_one_call(options, ROWS)) / ROWS
    ratio = single / many
    return [
        strategy.value,
        duration_text(single),
        duration_text(many),
        f'{ratio:.0f}',
        verdict(ratio >= RATIO),
        f'{_memory(options):.0f} B',
    ]


def _seconds(work: Callable[[], object]) -> float:
    """Return the least time of the processor that a piece of work takes [s]."""
    times = []
    for _ in range(REPEATS):
        start = process_time()
        work()
        times.append(process_time() - start)
    return min(times)


def _request(way: float, duration: float) -> MotionRequest:
    """Return a motion of the arm."""
    return MotionRequest(start=[0.0, 0.0], final=[way, 0.0], duration=duration)


def _memory(options: PlanningOptions) -> float:
    """Return what a row of a table keeps [B]."""
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        table = in_one_call(options, ROWS)
        return (tracemalloc.get_traced_memory()[0] - before) / len(table)
    finally:
        tracemalloc.stop()


def _work(seed: int) -> int:
    """Return the number of motions of a piece of work."""
    options = PlanningOptions(strategy=STRATEGIES[seed % len(STRATEGIES)])
    return len(in_one_call(options, ROWS, seed))


def _parallel() -> str:
    """Return how many motions two processes plan and predict in a second."""
    with ProcessPoolExecutor(2, mp_context=get_context('spawn')) as executor:
        list(executor.map(_work, range(4)))
        start = perf_counter()
        done = sum(executor.map(_work, range(24)))
        rate = done / (perf_counter() - start)
    goal = f'goal {RATE:.0f}: {verdict(rate >= RATE)}'
    return f'two processes, strategies in turn: {rate:.0f} motions a second ({goal})'
