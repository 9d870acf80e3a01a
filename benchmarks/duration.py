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

"""Automatic duration: the shortest within limits, for new distances and strategies."""

from argparse import Namespace
from collections.abc import Callable
from itertools import count
from math import inf
from typing import NamedTuple

from flat_planner_ros.core import (
    JointLimits,
    MotionRequest,
    Plan,
    plan,
    PlanarArm,
    PlanningOptions,
    shortest_plan,
    Strategy,
)
from flat_planner_ros.core.planning import extrema_of, NoFeasibleDuration, shortest_known
from measurement import duration_text, Section, timing, verdict
import numpy as np
import problem

TARGET = 20e-3
"""Automatic duration of the paper's arm [s]."""

TORQUE = 0.015
"""Limit of the paper's arm [N m]."""

BANG_BANG = 0.832479
"""Shortest time of any motion over pi within it that leaves no oscillation [s]."""

RANGE = {'shortest': 0.05, 'longest': 600.0}
"""Durations that are considered, as by the planner node [s]."""

STRATEGIES = (
    Strategy.POLYNOMIAL,
    Strategy.MIN_CONTROL_EFFORT,
    Strategy.MIN_POTENTIAL_ENERGY,
    Strategy.MIXED,
    Strategy.MIN_PEAK_EFFORT,
)
"""Those whose law is known in closed form, with their default weights, and the fastest."""

STEP = 1e-3
"""Difference of two distances, so that no duration tried is known from before [rad]."""

_numbers = count(1)


class Case(NamedTuple):
    """
    What is timed.

    Attributes
    ----------
    name
        In the table.
    arm, limits, start, final
        What moves, within what, from where to where [rad].
    is_paper
        Whether it is the half turn that bang-bang bounds.
    feasible
        Whether there is an answer.

    """

    name: str
    arm: PlanarArm
    limits: JointLimits
    start: np.ndarray
    final: np.ndarray
    is_paper: bool = False
    feasible: bool = True


def sections(options: Namespace) -> list[Section]:
    """Return the tables of this benchmark."""
    del options
    rows, worst = [], 0.0
    for case in _cases():
        for strategy in STRATEGIES if case.is_paper else STRATEGIES[:2]:
            chosen = PlanningOptions(strategy=strategy)
            tried: list[int] = []
            measured = timing(
                lambda final, case=case, chosen=chosen, tried=tried: _search(
                    case, chosen, final, tried
                ),
                lambda case=case: case.final * (1.0 + STEP * next(_numbers)),
                budget=2.0,
                most=200,
            )
            found = _search(case, chosen, case.final, [])
            if case.is_paper:
                worst = max(worst, measured.median)
            rows.append(
                (
                    f'{case.name}, {strategy.value}',
                    duration_text(measured.median),
                    duration_text(measured.worst),
                    f'{np.median(tried):.0f}',
                    '-' if found is None else f'{found.duration:.4f} s',
                    f'{found.duration / BANG_BANG:.4f}' if case.is_paper and found else '-',
                )
            )
    header = ('case', 'median', 'worst', 'plans tried', 'duration', 'over bang-bang')
    target = f'target {duration_text(TARGET)} for the half turn: {verdict(worst <= TARGET)}'
    return [Section('Automatic duration', header, rows, [target]), _check_section()]


def _check_section() -> Section:
    """Return what finding the extrema of one plan takes."""
    rows = []
    for case in _cases():
        if case.feasible:
            made = _plans(case, PlanningOptions(strategy=STRATEGIES[1]), case.final)(1.0)
            measured = timing(extrema_of, lambda made=made: made, budget=1.0)
            rows.append((case.name, duration_text(measured.median), duration_text(measured.worst)))
    return Section('Extrema of a plan of 1 s', ('case', 'median', 'worst'), rows)


def _cases() -> list[Case]:
    """Return what is timed."""
    four = PlanarArm.reduced(
        inertia_star=(0.04, 0.01),
        stiffness=2.0,
        damping=0.01,
        link_length=[0.3, 0.3],
        link_com=[0.15, 0.15],
        link_mass=[1.0, 1.0],
        link_inertia=[0.01, 0.01],
        tip_mass=1.5,
        gravity=9.81,
    )
    low, high = np.array([-0.9, 0.0, 0.0, 0.0]), np.array([0.9, 0.5, -0.3, 0.0])
    rest, half_turn = np.zeros(2), np.array([problem.DISTANCE, 0.0])
    torque = JointLimits.of(2, effort=[TORQUE, inf])
    everything = JointLimits.of(
        2, effort=[TORQUE, inf], velocity=[4.5, inf], position_max=[inf, 0.3]
    )
    strong = JointLimits.of(4, effort=[25.0, 12.0, 0.5, inf], velocity=[3.0] * 4)
    # Its load can be held at both ends, but not on the way.
    weak = JointLimits.of(4, effort=[11.0, 12.0, 0.5, inf])
    return [
        Case('half turn, torque', problem.arm(), torque, rest, half_turn, is_paper=True),
        Case('half turn, all limits', problem.arm(), everything, rest, half_turn),
        Case('4 joints, vertical', four, strong, low, high),
        Case('4 joints, refused', four, weak, low, high, feasible=False),
    ]


def _search(
    case: Case, options: PlanningOptions, final: np.ndarray, tried: list[int]
) -> Plan | None:
    """Return the shortest plan, and note how many were tried."""
    plans = _plans(case, options, final)
    numbers = count()

    def counted(duration: float) -> Plan:
        next(numbers)
        return plans(duration)

    try:
        request = MotionRequest(start=case.start, final=final, duration=1.0)
        bound = shortest_known(request, case.arm, options, float(case.limits.effort[-2]))
        first = case.limits.likely_duration(final - case.start) or None
        found = shortest_plan(counted, case.limits, **RANGE, bound=bound, first=first)
        assert case.feasible
    except NoFeasibleDuration:
        assert not case.feasible
        found = None
    tried.append(next(numbers))
    return found


def _plans(case: Case, options: PlanningOptions, final: np.ndarray) -> Callable[[float], Plan]:
    """Return plans by their duration."""
    return lambda duration: plan(
        MotionRequest(start=case.start, final=final, duration=duration), case.arm, options
    )
