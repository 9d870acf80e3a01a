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

"""Insensitive motions for both drives: what they take to plan, and effort at equal worst case."""

from argparse import Namespace
from itertools import count
from typing import NamedTuple

from flat_planner_ros.core import (
    Drive,
    Insensitivity,
    MotionRequest,
    Plan,
    plan,
    PlanarArm,
    PlanningOptions,
    Strategy,
)
from flat_planner_ros.core.insensitive import Criterion
from flat_planner_ros.core.planning import residual_of_plan
from measurement import duration_text, Section, timing, verdict
import numpy as np
import problem

TARGET = 2e-3
"""A plan that nothing is known of [s]."""

RESIDUAL = 0.02
"""Worst residual that is prescribed for the comparison of efforts [rad]."""

EFFORT_TARGET = 1.1
"""RMS effort over the least of a conic programme at equal worst residual [-]."""

INERTIA = {'paper': (6.4e-4, 3.3e-5, 3e-3), 'heavy': (6.4e-4, 2.5e-4, 2.3e-2)}
"""I*_(n-1), I*_n and stiffness of the arms; the damping is the paper's [kg m^2], [N m/rad]."""

STEP = 1e-6
"""Difference of two durations, so that no motion is known from before [s]."""

_numbers = count(1)


class Case(NamedTuple):
    """Arm, duration [s], drive, and the least RMS effort within RESIDUAL [N m]."""

    arm: str
    duration: float
    drive: Drive
    least: float


# From test/core/insensitive/test_drives.py, with where they come from.
CASES = (
    Case('paper', 1.0, Drive.EFFORT, 0.01206),
    Case('paper', 1.0, Drive.POSITION, 0.01273),
    Case('paper', 1.2, Drive.EFFORT, 0.00546),
    Case('paper', 1.2, Drive.POSITION, 0.00549),
    Case('heavy', 1.0, Drive.EFFORT, 0.00786),
    Case('heavy', 1.0, Drive.POSITION, 0.00851),
    Case('heavy', 1.2, Drive.EFFORT, 0.00565),
    Case('heavy', 1.2, Drive.POSITION, 0.00527),
    Case('heavy', 1.5, Drive.POSITION, 0.00346),
)


def sections(options: Namespace) -> list[Section]:
    """Return the table of this benchmark."""
    del options
    rows, slowest, most = [], 0.0, 0.0
    for case in CASES:
        times = [_median(case, Insensitivity(criterion=criterion)) for criterion in Criterion]
        bounded = Insensitivity(max_residual=RESIDUAL)
        made = _plan(case, bounded)
        left = residual_of_plan(made).worst
        assert left <= RESIDUAL * (1.0 + 1e-6)
        ratio = float(made.rms_effort[0]) / case.least
        slowest, most = max(slowest, *times), max(most, ratio)
        texts = [duration_text(time) for time in (*times, _median(case, bounded))]
        name = f'{case.arm}, {case.duration:g} s, {case.drive.value}'
        rows.append((name, *texts, f'{ratio:.3f}', f'{left:.4f} rad'))
    wanted = [criterion.value for criterion in Criterion]
    header = ('arm', *wanted, f'{RESIDUAL:g} rad', 'RMS effort over the least', 'worst residual')
    notes = [
        f'target {duration_text(TARGET)} for worst and mean: {verdict(slowest <= TARGET)}',
        f'target {EFFORT_TARGET:g} for the effort: {verdict(most <= EFFORT_TARGET)}',
    ]
    return [Section('Insensitive motions, cold, median', header, rows, notes)]


def _median(case: Case, wanted: Insensitivity) -> float:
    """Return the median time of a plan that nothing is known of [s]."""
    return timing(lambda _: _plan(case, wanted), budget=0.5).median


def _plan(case: Case, wanted: Insensitivity) -> Plan:
    """Return a plan of a new arm and a new duration."""
    both, last, stiffness = INERTIA[case.arm]
    arm = PlanarArm.reduced(inertia_star=(both, last), stiffness=stiffness, damping=2e-5)
    request = MotionRequest(
        start=np.zeros(2),
        final=np.array([problem.DISTANCE, 0.0]),
        duration=case.duration + STEP * next(_numbers),
    )
    options = PlanningOptions(
        strategy=Strategy.INSENSITIVE, insensitivity=wanted, drive=case.drive
    )
    return plan(request, arm, options)
