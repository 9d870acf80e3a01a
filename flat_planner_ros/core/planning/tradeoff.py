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

"""
Effort against residual: what a motion leaves behind, what others would, and what time buys.

Nothing here is simulated: every residual is an integral over the effort (`insensitive.residual`).
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

from flat_planner_ros.core.arm import (
    Drive,
    FlatPlannerError,
    FloatArray,
    InvalidRequest,
    PlanarArm,
)
from flat_planner_ros.core.insensitive import (
    Nominal,
    predict_residual,
    PredictedResidual,
    servo_effort,
    shaped_quintic,
    Shaper,
    UncertaintyBox,
)
from flat_planner_ros.core.motion_law import Strategy
from flat_planner_ros.core.planning.certified_plan import Plan, PlanSamples
from flat_planner_ros.core.planning.limits import JointLimits
from flat_planner_ros.core.planning.planner import plan
from flat_planner_ros.core.planning.request import MotionRequest, PlanningOptions
from flat_planner_ros.core.planning.shortest_duration import shortest_plan
from flat_planner_ros.core.planning.strategies import OWN_LAWS, shortest_known
import numpy as np

INTERVALS = 1000
"""
Parts of a motion over which its effort is taken to be linear.

The residual is then good to 1e-7 rad for motions of about a period and 16 coefficients.
"""

ADVICE_INTERVALS = 200
"""The same for advice, where 1e-3 of the residual does not matter."""

STRETCHES = (1.05, 1.1, 1.2)
"""Longer durations that advice considers, over the present one [-]."""

PAYS = 0.5
"""Share of the worst residual, or less, that must be left for a stretch to pay [-]."""

ADVICES_KEPT = 16
"""Residuals of longer motions over 1 rad that are remembered."""

DURATIONS = (0.01, 600.0)
"""Range in which the shortest duration is looked for [s]."""

WORTHWHILE = 0.95
"""Share of the duration, or less, that another strategy must take to be advised [-]."""

NOTICEABLE = 1e-3
"""Worst residual below which there is nothing to advise [rad]."""

STRATEGIES = (
    Strategy.POLYNOMIAL,
    Strategy.MIN_CONTROL_EFFORT,
    Strategy.MIN_POTENTIAL_ENERGY,
)
"""Those of the paper, which the trade is compared with."""

FASTEST = Strategy.MIN_PEAK_EFFORT.value
"""Series of the shortest motion."""

FASTEST_INSENSITIVE = f'{FASTEST}, insensitive'
"""The same with a vanishing derivative of the residual."""

FASTEST_WITHIN = f'{FASTEST}, residual bounded'
"""Series of the shortest motions within less and less of its worst residual."""

SHARES = (0.7, 0.4, 0.2, 0.1, 0.05, 0.02)
"""Of that residual [-]."""

WEIGHTS = tuple(10.0 ** (0.125 * step) for step in range(8, 29))
"""Weights of a sweep, from nearly the least effort to nearly the least residual."""


@dataclass(frozen=True, kw_only=True)
class TradeoffPoint:
    """
    One motion in the plane of effort and residual.

    Attributes
    ----------
    series
        What it belongs to, e.g. a strategy.
    duration
        Its length [s].
    weight
        That of a sweep, 0 elsewhere [-].
    rms_effort, peak_effort
        Of joint n-1 [N m].
    nominal, worst
        Predicted residual amplitudes [rad].

    """

    series: str
    duration: float
    weight: float
    rms_effort: float
    peak_effort: float
    nominal: float
    worst: float


def residual_of_plan(planned: Plan, samples: PlanSamples | None = None) -> PredictedResidual:
    """
    Return what a plan leaves behind, as it is played.

    Parameters
    ----------
    planned
        The motion; its options say what may differ from the model, and what drives the arm.
    samples
        The even grid of a command whose efforts are joined linearly; None for one that is as good
        as continuous, which a servo always follows.

    Raises
    ------
    InvalidRequest
        An arm within the uncertainty does not oscillate.

    """
    arm, box = planned.problem.arm, planned.options.insensitivity.box
    return residual_on(arm, box, planned, samples)


def residual_on(
    arm: PlanarArm, box: UncertaintyBox, planned: Plan, samples: PlanSamples | None = None
) -> PredictedResidual:
    """
    Return what a plan leaves behind on an arm of one's choice, and on the worst of a box about it.

    Parameters
    ----------
    arm
        That plays it, flat.
    box
        What may differ from this arm.
    planned, samples
        As for `residual_of_plan`; the miss is that of an arm of the box about this one.

    Raises
    ------
    InvalidRequest
        An arm within the uncertainty does not oscillate.

    """
    drive = planned.options.drive
    is_coarse = samples is None or len(samples.times) <= INTERVALS
    if samples is None or (drive is Drive.POSITION and is_coarse):
        samples = planned.sample(planned.duration / INTERVALS)
    start = None
    if planned.request.start_jets is not None:
        start = (float(samples.positions[0, -1]), float(samples.velocities[0, -1]))
    return predict_residual(
        arm,
        samples.driving_effort if drive is Drive.EFFORT else samples.driving_velocity,
        planned.duration,
        box,
        start,
        drive=drive,
    )


def duration_advice(planned: Plan, residual: PredictedResidual) -> str | None:
    """
    Return a line on what a little more time would do, None where it does not pay.

    Parameters
    ----------
    planned
        A motion from rest to rest without via points; for any other there is no advice.
    residual
        What it leaves behind.

    """
    request = planned.request
    if residual.worst < NOTICEABLE or request.via or request.start_jets is not None:
        return None
    line = None
    way = float(np.sum(request.final) - np.sum(request.start))
    # The longest first: where that does not pay, nothing does.
    for stretch in sorted(STRETCHES, reverse=True):
        duration = stretch * request.duration
        try:
            left = _worst_residual(planned.problem.arm, planned.options, duration, way)
        except FlatPlannerError:
            return line
        if left > PAYS * residual.worst:
            return line
        line = (
            f'{100.0 * (stretch - 1.0):.0f} % longer ({duration:.4g} s) cuts the worst residual '
            f'from {residual.worst:.2g} to {left:.2g} rad'
        )
    return line


def _worst_residual(
    arm: PlanarArm, options: PlanningOptions, duration: float, way: float
) -> float:
    """Return the worst residual of a motion from rest to rest, whose y1 goes a way [rad]."""
    if options.strategy in OWN_LAWS:
        return _worst_at_rest(arm, options, duration, way)
    # In proportion, so that goals of one duration are advised at once.
    return abs(way) * _worst_of_unit(arm, options, duration)


def _worst_at_rest(arm: PlanarArm, options: PlanningOptions, duration: float, way: float) -> float:
    """Return the same, from a plan of joint n-1 alone."""
    final = np.zeros(arm.n)
    final[-2] = way
    planned = plan(
        MotionRequest(start=np.zeros(arm.n), final=final, duration=duration), arm, options
    )
    return residual_of_plan(planned, planned.sample(duration / ADVICE_INTERVALS)).worst


@lru_cache(maxsize=ADVICES_KEPT)
def _worst_of_unit(arm: PlanarArm, options: PlanningOptions, duration: float) -> float:
    """Return that of a way of 1 rad; arms and options count as equal if identical."""
    return _worst_at_rest(arm, options, duration, 1.0)


def time_advice(planned: Plan) -> str | None:
    """
    Return a line on the time that the strategy of least peak would save at the same peak effort.

    Parameters
    ----------
    planned
        A motion from rest to rest without via points that took the shortest duration within the
        limits; for any other there is no advice.

    """
    request, arm = planned.request, planned.problem.arm
    options = replace(planned.options, strategy=Strategy.MIN_PEAK_EFFORT)
    peak = float(planned.peak_effort[-2])
    if planned.options.strategy is Strategy.MIN_PEAK_EFFORT:
        return None
    try:
        duration = shortest_known(request, arm, options, peak)
    except FlatPlannerError:
        return None
    if duration is None or duration > WORTHWHILE * request.duration:
        return None
    return f'strategy min_peak_effort takes {duration:.4g} s with the same peak effort'


def baselines(planned: Plan) -> tuple[TradeoffPoint, ...]:
    """
    Return what simpler methods would do in place of a plan: polynomial law and shaped quintics.

    Those that need more time than there is are left out; so are all for an arm that does not
    oscillate, and for motions that do not start at rest.
    """
    request, arm = planned.request, planned.problem.arm
    if request.via or request.start_jets is not None:
        return ()
    options = replace(planned.options, strategy=Strategy.POLYNOMIAL)
    try:
        found = [_point_of('polynomial', plan(request, arm, options))]
    except InvalidRequest:
        return ()
    drive, box = planned.options.drive, planned.options.insensitivity.box
    times = np.linspace(0.0, request.duration, INTERVALS + 1)
    distance = float(np.sum(request.final) - np.sum(request.start))
    for shaper in Shaper:
        try:
            signal = shaped_quintic(arm, distance, request.duration, shaper, times, drive)
        except InvalidRequest:
            continue
        residual = predict_residual(arm, signal, request.duration, box, drive=drive)
        effort = signal if drive is Drive.EFFORT else servo_effort(arm, signal, request.duration)
        name = 'quintic' if shaper is Shaper.NONE else f'{shaper.name.lower()}_quintic'
        found.append(_point(name, request.duration, effort, residual))
    return tuple(found)


def tradeoff_points(
    request: MotionRequest,
    arm: PlanarArm,
    options: PlanningOptions,
    *,
    stretches: Sequence[float] = (1.0, 1.1, 1.25, 1.5),
    weights: Sequence[float] = WEIGHTS,
    advance: Callable[[float], object] = float,
) -> tuple[TradeoffPoint, ...]:
    """
    Return effort and residual of strategies, baselines and sweeps of `insensitive`.

    Parameters
    ----------
    request
        A motion from rest to rest.
    arm, options
        Model, weights of the strategies, uncertainty.
    stretches
        Durations of the sweeps, over that of the request [-].
    weights
        Of the sweeps [-].
    advance
        Is told which share of the sweeps has been computed since it was last told.

    Raises
    ------
    FlatPlannerError
        The arm or the request allows no plan.

    """
    points = [
        _point_of(strategy.value, plan(request, arm, replace(options, strategy=strategy)))
        for strategy in STRATEGIES
    ]
    reference = plan(request, arm, replace(options, strategy=Strategy.POLYNOMIAL))
    points += baselines(reference)[1:]
    for stretch in stretches:
        stretched = replace(request, duration=stretch * request.duration)
        for nominal in Nominal:
            points += _sweep(stretched, arm, options, nominal, weights)
            advance(1.0 / (len(stretches) * len(Nominal)))
    return tuple(points)


def fastest_points(
    request: MotionRequest, arm: PlanarArm, options: PlanningOptions, limit: float
) -> tuple[TradeoffPoint, ...]:
    """
    Return the shortest motion of each strategy within a limit, and what it leaves.

    Parameters
    ----------
    request
        A motion from rest to rest; its duration does not matter.
    arm, options
        As for `tradeoff_points`.
    limit
        On the effort of joint n-1 [N m].

    Raises
    ------
    NoFeasibleDuration
        No motion of `DURATIONS` keeps the limit.
    FlatPlannerError
        The arm or the request allows no plan.

    """
    effort = np.full(arm.n, np.inf)
    effort[-2] = limit
    limits = JointLimits.of(arm.n, effort=effort)
    peak = replace(options, strategy=Strategy.MIN_PEAK_EFFORT)
    plain = replace(options.peak, insensitive=False, max_residual=0.0)
    fastest = replace(peak, peak=plain)
    wanted = {
        **{strategy.value: replace(options, strategy=strategy) for strategy in STRATEGIES},
        FASTEST: fastest,
        FASTEST_INSENSITIVE: replace(peak, peak=replace(plain, insensitive=True)),
    }

    def shortest(name: str, chosen: PlanningOptions) -> TradeoffPoint:
        """Return the shortest motion with some options."""
        found = shortest_plan(
            lambda duration: plan(request.stretched(duration), arm, chosen),
            limits,
            shortest=DURATIONS[0],
            longest=DURATIONS[1],
            bound=shortest_known(request, arm, chosen, limit),
        )
        return _point_of(name, found)

    points = [shortest(name, chosen) for name, chosen in wanted.items()]
    worst = next(point.worst for point in points if point.series == FASTEST)
    # What less of the residual costs in time.
    for share in SHARES:
        bounded = replace(plain, max_residual=share * worst, box=options.insensitivity.box)
        points.append(shortest(FASTEST_WITHIN, replace(peak, peak=bounded)))
    return tuple(points)


def _sweep(
    request: MotionRequest,
    arm: PlanarArm,
    options: PlanningOptions,
    nominal: Nominal,
    weights: Sequence[float],
) -> Iterator[TradeoffPoint]:
    """Return insensitive motions of one duration over the weights."""
    for weight in weights:
        wanted = replace(
            options.insensitivity,
            nominal=nominal,
            weight=weight,
            max_effort_rms=0.0,
            max_residual=0.0,
        )
        planned = plan(
            request,
            arm,
            replace(options, strategy=Strategy.INSENSITIVE, insensitivity=wanted),
        )
        yield _point_of(f'insensitive_{nominal.value}', planned, weight)


def _point_of(series: str, planned: Plan, weight: float = 0.0) -> TradeoffPoint:
    """Return a plan as a point."""
    samples = planned.sample(planned.duration / INTERVALS)
    residual = residual_of_plan(planned, samples)
    return _point(series, planned.duration, samples.driving_effort, residual, weight)


def _point(
    series: str,
    duration: float,
    effort: FloatArray,
    residual: PredictedResidual,
    weight: float = 0.0,
) -> TradeoffPoint:
    """Return a point from an effort that is zero at both ends, on an even grid."""
    return TradeoffPoint(
        series=series,
        duration=duration,
        weight=weight,
        rms_effort=float(np.sqrt((effort @ effort) / (len(effort) - 1))),
        peak_effort=float(np.abs(effort).max()),
        nominal=residual.nominal,
        worst=residual.worst,
    )
