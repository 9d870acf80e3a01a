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

"""As fast as the motor allows: time over what is proven, beside rigid planners, and planning."""

from argparse import Namespace
from collections.abc import Callable, Iterator
from functools import partial
from importlib.util import find_spec
from itertools import count
from math import inf
from typing import NamedTuple

from flat_planner_ros.core import (
    EffortProfile,
    JointLimits,
    MotionRequest,
    Plan,
    plan,
    PlanarArm,
    PlanningOptions,
    rollout,
    Strategy,
)
from flat_planner_ros.core.peak import (
    peak_motion,
    PeakMotion,
    PeakSettings,
    shortest_peak_duration,
)
from flat_planner_ros.core.planning import DurationRules, OnViolation
from measurement import duration_text, Section, Timing, timing, verdict
import numpy as np
import problem

TORQUE = 0.015
"""Limit of the paper's arm [N m]."""

BANG_BANG = 0.832479
"""Shortest time over pi within it that leaves no oscillation [s]."""

INSENSITIVE_BANG_BANG = 1.022530
"""The same with a vanishing derivative of the oscillation [s]."""

WAYS = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0)
"""Distances [rad]."""

SPEED = 6.0
"""Limit on the velocity, where there is one [rad/s]."""

FROM_NOTHING = 50e-3
"""Target of a plan of a new arm [s]."""

NEAR_LAST = 15e-3
"""Target of a plan of a distance or a duration near the last one [s]."""

FINE = 128
"""Intervals of a spline that comes nearer to what is proven."""

SETTLED = 1.0
"""Time that is looked at after a motion [s]."""

GRID = 2001
"""Samples of the commands of other planners."""

STEP = 1e-4
"""Difference of two distances or durations, relative to them [-]."""

_numbers = count(1)


def sections(options: Namespace) -> Iterator[Section]:
    """Return the tables of this benchmark."""
    del options
    yield _race_section()
    yield _ways_section()
    yield _planning_section()


class Runner(NamedTuple):
    """A motion over pi within the torque: its duration, and its efforts at even times."""

    name: str
    duration: float
    efforts: np.ndarray
    planning: float


def _race_section() -> Section:
    """Return the shortest motions of several planners, and what they leave on the arm."""
    runners = [
        _own(f'min_peak_effort, {n} intervals', PeakSettings(intervals=n)) for n in (48, 96)
    ]
    runners += [
        _own('min_peak_effort, insensitive', PeakSettings(insensitive=True)),
        _own('min_peak_effort, residual 0.03 rad', PeakSettings(max_residual=0.03)),
    ]
    runners += [
        _strategy(strategy) for strategy in (Strategy.POLYNOMIAL, Strategy.MIN_CONTROL_EFFORT)
    ]
    missing = []
    for name, module, solve in PEERS:
        if find_spec(module) is None:
            missing.append(f'{name}: not installed')
            continue
        runners.append(_rigid(name, solve))
    assert BANG_BANG < runners[0].duration < 1.02 * BANG_BANG
    assert BANG_BANG < runners[1].duration < 1.01 * BANG_BANG
    assert runners[2].duration < 1.03 * INSENSITIVE_BANG_BANG
    return Section(
        "Shortest motion over a half turn, the paper's arm within 0.015 N m",
        ('planner', 'duration', 'over bang-bang', 'swing left', 'miss', 'planning'),
        [_race_row(runner) for runner in runners],
        [
            f'bang-bang: {BANG_BANG} s without, {INSENSITIVE_BANG_BANG} s with a vanishing '
            'derivative of the oscillation',
            'Ruckig and TOPP-RA are told of a rigid arm: they do not know springs',
            *missing,
        ],
    )


def _race_row(runner: Runner) -> tuple[str, ...]:
    """Return a row, with what is left when the arm plays it."""
    times = np.linspace(0.0, runner.duration, len(runner.efforts))
    command = EffortProfile(start=0.0, times=times, efforts=runner.efforts[:, None])
    played = rollout(problem.arm(), command, runner.duration + SETTLED)
    after = played.times > runner.duration
    swing = np.abs(played.positions[after, 1]).max()
    miss = abs(np.mean(played.positions[after, 0]) - problem.DISTANCE)
    return (
        runner.name,
        f'{runner.duration:.4f} s',
        f'{runner.duration / BANG_BANG:.4f}',
        f'{swing:.2g} rad',
        f'{miss:.2g} rad',
        duration_text(runner.planning),
    )


def _own(name: str, settings: PeakSettings) -> Runner:
    """Return the shortest motion of least peak."""
    options = PlanningOptions(strategy=Strategy.MIN_PEAK_EFFORT, peak=settings)
    found = _fastest(problem.arm(), problem.DISTANCE, options)
    measured = timing(lambda arm: _fastest(arm, problem.DISTANCE, options), problem.arm, most=20)
    return _of_plan(name, found, measured)


def _strategy(strategy: Strategy) -> Runner:
    """Return the shortest motion of another strategy."""
    options = PlanningOptions(strategy=strategy)
    found = _fastest(problem.arm(), problem.DISTANCE, options)
    measured = timing(lambda arm: _fastest(arm, problem.DISTANCE, options), problem.arm, most=20)
    return _of_plan(strategy.value, found, measured)


def _of_plan(name: str, found: Plan, measured: Timing) -> Runner:
    """Return a plan as it is played every 5 ms."""
    samples = found.sample(0.005)
    return Runner(name, found.duration, samples.driving_effort, measured.median)


def _rigid(name: str, solve: Callable[[float], tuple[float, np.ndarray]]) -> Runner:
    """Return the motion of a planner that knows one rigid inertia."""
    both, _ = problem.arm().inertia_star
    duration, accelerations = solve(TORQUE / both)
    measured = timing(lambda _: solve(TORQUE / both), most=50)
    # The plant plays no command that ends with an effort.
    efforts = np.append(both * accelerations[:-1], 0.0)
    return Runner(name, duration, efforts, measured.median)


def _ruckig(acceleration: float) -> tuple[float, np.ndarray]:
    """Return duration and accelerations of Ruckig's motion."""
    from ruckig import InputParameter, Ruckig, Trajectory

    wanted = InputParameter(1)
    wanted.current_position, wanted.target_position = [0.0], [problem.DISTANCE]
    wanted.max_velocity, wanted.max_acceleration, wanted.max_jerk = [inf], [acceleration], [inf]
    found = Trajectory(1)
    Ruckig(1).calculate(wanted, found)
    times = np.linspace(0.0, found.duration, GRID)
    return found.duration, np.array([found.at_time(time)[2][0] for time in times])


def _toppra(acceleration: float) -> tuple[float, np.ndarray]:
    """Return the same of TOPP-RA, along the straight path of joint 1."""
    from toppra import setup_logging, SplineInterpolator
    from toppra.algorithm import TOPPRA
    from toppra.constraint import JointAccelerationConstraint

    setup_logging('ERROR')
    share = np.linspace(0.0, 1.0, 3)
    path = SplineInterpolator(share, problem.DISTANCE * share[:, None])
    bound = JointAccelerationConstraint(np.array([[-acceleration, acceleration]]))
    posed = TOPPRA(
        [bound],
        path,
        gridpoints=np.linspace(0.0, 1.0, 101),
        parametrizer='ParametrizeConstAccel',
    )
    found = posed.compute_trajectory(0, 0)
    times = np.linspace(0.0, found.duration, GRID)
    return found.duration, found(times, 2)[:, 0]


PEERS = (('Ruckig', 'ruckig', _ruckig), ('TOPP-RA', 'toppra', _toppra))
"""Planners of fast motions, of which each may be missing."""


def _ways_section() -> Section:
    """Return durations over what is proven, over the distance."""
    rows = []
    for way in WAYS:
        cells = [f'{way:g} rad']
        for speed in (inf, SPEED):
            found, fine = (
                _shortest(PeakSettings(intervals=count, velocity=speed), way)
                for count in (PeakSettings.intervals, FINE)
            )
            # Whatever proves it, it holds for every motion.
            bound = max(found.least_duration, fine.least_duration)
            ratios = [motion.problem.duration / bound for motion in (found, fine)]
            assert 1.0 < ratios[1] < ratios[0] < 1.1
            cells += [f'{found.problem.duration:.4f} s', *(f'{ratio:.4f}' for ratio in ratios)]
        cells.append(_cruise(found, way))
        rows.append(tuple(cells))
    speed = f'at most {SPEED:g} rad/s'
    return Section(
        "Shortest duration over its proven bound, the paper's arm within 0.015 N m",
        ('way', 'duration', 'over bound', 'finer', speed, 'over bound', 'finer', 'at full speed'),
        rows,
        [
            f'finer: {FINE} intervals in place of {PeakSettings.intervals}',
            'at full speed: share of the duration within 2 % of the velocity limit',
        ],
    )


def _shortest(settings: PeakSettings, way: float) -> PeakMotion:
    """Return the shortest motion over a way."""
    arm = problem.arm()
    duration = shortest_peak_duration(arm, settings, way, TORQUE)
    return peak_motion(arm, duration, settings, way)


def _cruise(found: PeakMotion, way: float) -> str:
    """Return the share of the time at full speed."""
    times = np.linspace(0.0, found.problem.duration, GRID)
    return f'{100.0 * np.mean(way * found.velocities(times) > 0.98 * SPEED):.0f} %'


def _fastest(
    arm: PlanarArm, distance: float, options: PlanningOptions, speed: float = inf
) -> Plan:
    """Return the shortest plan, as the planner node makes it."""
    rules = DurationRules(
        joints=('joint1', 'joint2'),
        limits=JointLimits.of(2, effort=np.array([TORQUE, inf]), velocity=np.array([speed, inf])),
        on_violation=OnViolation.REJECT,
        shortest=0.05,
        longest=600.0,
    )
    request = MotionRequest(start=np.zeros(2), final=np.array([distance, 0.0]), duration=1.0)
    return rules.plan_within(request, arm, options, is_prescribed=False)[0]


def _planning_section() -> Section:
    """Return what planning takes, from nothing and near what was planned before."""
    known = problem.arm()

    def options(**settings: float) -> PlanningOptions:
        return PlanningOptions(strategy=Strategy.MIN_PEAK_EFFORT, peak=PeakSettings(**settings))

    def near() -> float:
        return problem.DISTANCE * (1.0 + STEP * next(_numbers))

    def given(duration: float) -> Plan:
        return plan(problem.request(duration=duration), known, options())

    fastest = partial(_fastest, distance=problem.DISTANCE)
    cases = [
        (
            'shortest, from nothing',
            FROM_NOTHING,
            lambda arm: fastest(arm, options=options()),
            problem.arm,
        ),
        ('shortest, near the last', NEAR_LAST, lambda way: _fastest(known, way, options()), near),
        ('given duration, near the last', NEAR_LAST, given, near),
        (
            'shortest, insensitive, from nothing',
            FROM_NOTHING,
            lambda arm: fastest(arm, options=options(insensitive=True)),
            problem.arm,
        ),
        (
            'shortest, at most 4 rad/s',
            None,
            lambda way: _fastest(known, way, options(velocity=4.0), 4.0),
            near,
        ),
        (
            'shortest, 0.03 rad left at most',
            None,
            lambda way: _fastest(known, way, options(max_residual=0.03)),
            near,
        ),
        (
            'shortest, 30 rad at most 2 rad/s',
            None,
            lambda way: _fastest(known, 10.0 * way, options(velocity=2.0), 2.0),
            near,
        ),
    ]
    rows, notes = [], []
    for name, target, step, arguments in cases:
        measured = timing(step, arguments, most=50)
        rows.append((name, *map(duration_text, (measured.best, measured.median, measured.worst))))
        if target is not None:
            is_met = measured.median <= target
            notes.append(f'{name}, target {duration_text(target)}: {verdict(is_met)}')
    return Section(
        'Planning with min_peak_effort', ('what', 'best', 'median', 'worst'), rows, notes
    )
