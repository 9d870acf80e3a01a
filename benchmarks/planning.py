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

"""Planning the paper's motion: cold, from the cached law, and beside other libraries."""

from argparse import Namespace
from importlib.util import find_spec
from itertools import count
from typing import NamedTuple
import warnings

from flat_planner_ros.core import MotionRequest, Plan, plan, PlanarArm, PlanningOptions, Strategy
from floor import array_operations
from measurement import duration_text, Section, Timing, timing, verdict
import numpy as np
from peers import Peer, PEERS, Solver
import problem

COLD_TARGET = 250e-6
"""Cold plan with its samples [s]."""

CACHED_TARGET = 10e-6
"""New distance from the cached law [s]."""

OWN_ERROR = 1e-9
"""Largest error of our answer relative to each derivative's peak [-]."""

PEER_TARGETS = {
    'SciPy solve_bvp, 1e-3, in seconds': 100.0,
    'SciPy solve_bvp, 1e-3, scaled': 100.0,
    'SciPy solve_bvp, 1e-3, scaled and tuned': 100.0,
    'CasADi, collocation (IPOPT)': 100.0,
    'python-control point_to_point': 1000.0,
}
"""How many times longer than our cold plan these are to take."""

PEER_BUDGET = 3.0
"""Time for the calls of one peer [s]; one call at least."""

STEP = 1e-6
"""Difference of two durations [s] and stiffnesses [-], so that no law is known from before."""

_CROWDED = np.outer([0.0, 49.0**2, 0.0, -98.0, 0.0, 1.0], [0.0, 49.0**2, 0.0, -98.0, 0.0, 1.0])

COSTS = {
    'polynomial': PlanningOptions(strategy=Strategy.POLYNOMIAL),
    'min potential energy, p = 17': PlanningOptions(
        strategy=Strategy.MIN_POTENTIAL_ENERGY, p=17.0
    ),
    'mixed': PlanningOptions(strategy=Strategy.MIXED),
    'min control effort, r = 30: twelve roots around zero': PlanningOptions(
        strategy=Strategy.MIN_CONTROL_EFFORT, r=30.0
    ),
    'custom: a fourfold real root': PlanningOptions(strategy=Strategy.CUSTOM, custom=_CROWDED),
}
"""Costs besides the one that all libraries share."""

_numbers = count(1)


class Row(NamedTuple):
    """One line of the table of libraries."""

    name: str
    cold: Timing
    warm: Timing
    error: float


class Task(NamedTuple):
    """What a plan is made from."""

    request: MotionRequest
    arm: PlanarArm


def sections(options: Namespace) -> list[Section]:
    """Return the tables of this benchmark."""
    del options
    own = _own_rows()
    cold = own[1]
    rows = [cold, *(row for peer in PEERS if (row := _peer_row(peer)) is not None)]
    missing = [peer.name for peer in PEERS if find_spec(peer.module) is None]
    return [_own_section(own), _costs_section(), _peer_section(rows, missing)]


def answer(made: Plan) -> problem.Answer:
    """Return y to y^(6) and the torque of a plan at the 1001 times."""
    samples = made.sample(made.request.duration / (problem.SAMPLES - 1))
    return problem.Answer(samples.planned[0], samples.driving_effort)


def new_task() -> Task:
    """Return a task that nothing can be known of: an arm and a duration never asked for."""
    arm = problem.arm().scaled(stiffness=1.0 + STEP * next(_numbers))
    return Task(new_duration().request, arm)


def new_duration() -> Task:
    """Return a task that differs from the last ones in its duration alone."""
    duration = problem.DURATION + STEP * next(_numbers)
    return Task(problem.request(duration=duration), _KNOWN_ARM)


def new_distance() -> Task:
    """Return a task that differs from the last ones in its distance alone."""
    return Task(problem.request(distance=0.5 + 1e-3 * (next(_numbers) % 1000)), _KNOWN_ARM)


_KNOWN_ARM = problem.arm()


def _plan(task: Task) -> Plan:
    return plan(task.request, task.arm, problem.OPTIONS)


def _own_rows() -> list[Row]:
    """Return our own planner with more and more of what a caller wants."""
    known = _plan(Task(problem.request(), _KNOWN_ARM))
    error = problem.error(answer(known))
    assert error <= OWN_ERROR, f'the plan is wrong by {error:.3g}'
    far = answer(_plan(Task(problem.request(distance=2.0 * problem.DISTANCE), _KNOWN_ARM)))
    halved = problem.error(problem.Answer(0.5 * far.jet, 0.5 * far.effort))
    assert halved <= OWN_ERROR, f'the rescaled plan is wrong by {halved:.3g}'
    steps = {
        'the certified law': lambda task: _plan(task),
        'and 1001 samples of y to y^(6), torque': lambda task: answer(_plan(task)),
        'and 1001 samples of all joints and y': lambda task: _joints(_plan(task)),
        'and its peaks and RMS values': lambda task: _with_peaks(_plan(task)),
    }
    return [
        Row(name, timing(step, new_task), timing(step, new_distance), error)
        for name, step in steps.items()
    ]


def _joints(made: Plan) -> object:
    samples = made.sample(made.request.duration / (problem.SAMPLES - 1))
    return samples.positions, samples.velocities, samples.accelerations, samples.flat


def _with_peaks(made: Plan) -> object:
    return made.rms_effort, made.peak_effort, made.peak_velocity


def _peer_row(peer: Peer) -> Row | None:
    """Return a peer's times, nothing if it is not installed."""
    if find_spec(peer.module) is None:
        return None
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')
        solve = peer.prepare()
        error = problem.error(solve())
        assert error <= peer.error, f'{peer.name} is wrong by {error:.3g}'
        cold = timing(lambda _: peer.prepare()(), budget=PEER_BUDGET, warm_up=0, least=1)
        warm = _warm(solve)
    return Row(peer.name, cold, warm, error)


def _warm(solve: Solver) -> Timing:
    return timing(lambda _: solve(), budget=PEER_BUDGET, warm_up=0, least=1)


def _own_section(rows: list[Row]) -> Section:
    """Return the table of our own times."""
    cold_met = rows[1].cold.median <= COLD_TARGET
    cached_met = rows[0].warm.median <= CACHED_TARGET
    return Section(
        "Planning the paper's motion",
        ('plan', 'cold: best', 'median', 'new distance: best', 'median', 'worst', 'error'),
        [
            (
                row.name,
                duration_text(row.cold.best),
                duration_text(row.cold.median),
                duration_text(row.warm.best),
                duration_text(row.warm.median),
                duration_text(row.warm.worst),
                f'{row.error:.1g}',
            )
            for row in rows
        ],
        [
            f'cold plan with 1001 samples, target {duration_text(COLD_TARGET)}: '
            f'{verdict(cold_met)}',
            f'new distance from the cached law, target {duration_text(CACHED_TARGET)}: '
            f'{verdict(cached_met)}',
            _floor_note(rows[1].cold, _plan(Task(problem.request(), _KNOWN_ARM))),
        ],
    )


def _floor_note(cold: Timing, made: Plan) -> str:
    """Return what the array operations of a cold plan cost by themselves."""
    bare, cold_bare = _floors(made, problem.OPTIONS)
    return (
        f'the array operations of a cold plan with its samples alone: '
        f'{duration_text(cold_bare.best)} at best where a plan was made before, as before a cold '
        f'plan, of which it takes {cold.best / cold_bare.best:.2f} times; '
        f'{duration_text(bare.best)} in a row, {cold.best / bare.best:.2f} times'
    )


def _floors(made: Plan, options: PlanningOptions) -> tuple[Timing, Timing]:
    """Return the times of a plan's array operations alone: in a row, and after another plan."""
    operations = array_operations(made)

    def between() -> None:
        # What the processor holds of NumPy and Python is then what it holds for a cold plan.
        task = new_task()
        answer(plan(task.request, task.arm, options))

    return (
        timing(lambda _: operations(), budget=0.5),
        timing(lambda _: operations(), between, budget=0.5),
    )


def _costs_section() -> Section:
    """Return the times of cold plans of other costs, whose roots lie in other ways."""
    rows = []
    for name, options in COSTS.items():

        def step(task: Task, options: PlanningOptions = options) -> object:
            return answer(plan(task.request, task.arm, options))

        time = timing(step, new_task)
        bare, cold_bare = _floors(plan(problem.request(), _KNOWN_ARM, options), options)
        known = timing(step, new_duration)
        times = (time.best, time.median, time.worst, known.median, cold_bare.best, bare.best)
        ratios = (time.best / cold_bare.best, time.best / bare.best)
        rows.append((name, *map(duration_text, times), *(f'{ratio:.2f}' for ratio in ratios)))
    return Section(
        'Cold plans with 1001 samples of other costs',
        (
            'cost',
            'best',
            'median',
            'worst',
            'another duration: median',
            'array operations after a plan',
            'in a row',
            'ratio of best',
            'in a row',
        ),
        rows,
    )


def _peer_section(rows: list[Row], missing: list[str]) -> Section:
    """Return the table of all libraries, ratios first."""
    own = rows[0]
    notes = []
    for row in rows[1:]:
        if row.name in PEER_TARGETS:
            ratio, target = row.cold.median / own.cold.median, PEER_TARGETS[row.name]
            is_met = ratio >= target and own.error < row.error
            notes.append(f'{row.name}, target {target:g} times: {verdict(is_met)}')
    notes += [f'{name}: not installed' for name in missing]
    return Section(
        'Beside other libraries',
        ('solver', 'cold / ours', 'prepared / ours', 'cold', 'prepared', 'error'),
        [
            (
                'this planner' if row is own else row.name,
                f'{row.cold.median / own.cold.median:.3g}',
                f'{row.warm.median / own.warm.median:.3g}',
                duration_text(row.cold.median),
                duration_text(row.warm.median),
                f'{row.error:.1g}',
            )
            for row in rows
        ],
        notes,
    )
