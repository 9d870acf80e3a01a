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
Strategies that are more than a cost: how each is planned, and what it refuses.

How to add a strategy:

1. Make it a member of `Strategy` (motion_law/cost.py), whose values are the choices of the
   parameter, with the squares of its cost: that is all, if it is a quadratic cost.
2. If the first planned variable has a law of its own, write a function for it in a file of its
   wing, and an entry of `OWN_LAWS` here: how it is called, what it refuses, what stands in for it.
3. What it can be told is a field of `PlanningOptions` (request.py), with rows in ros/parameters.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import inf
from types import MappingProxyType
from typing import Protocol

from flat_planner_ros.core.arm import (
    apply_row,
    Drive,
    flat_map,
    FlatModel,
    FloatArray,
    InvalidRequest,
    PlanarArm,
)
from flat_planner_ros.core.insensitive import (
    check_insensitivity,
    insensitive_motion,
    insensitive_motion_from,
    InsensitiveMotion,
)
from flat_planner_ros.core.motion_law import Law, PathConditions, Strategy
from flat_planner_ros.core.peak import (
    check_peak,
    peak_motion,
    peak_motion_from,
    PeakMotion,
    shortest_peak_duration,
    shortest_peak_duration_from,
)
from flat_planner_ros.core.planning.request import MotionRequest, planned_at_rest, PlanningOptions


class TransformableLaw(Law, Protocol):
    """A law that serves any distance and any place."""

    def transformed(self, factor: float, offset: float) -> Law:
        """Return offset + factor times this law."""


@dataclass(frozen=True, kw_only=True, eq=False)
class OwnMotion:
    """
    A motion of the first planned variable, and its certificate.

    Attributes
    ----------
    law
        Its law [rad]; from -1/2 to 1/2 where the start is at rest.
    cost
        What it minimises.
    boundary_residual, optimality_residual
        As a plan states them [-].
    peak
        The same as a motion of least peak, with its dual certificate; None where it is none.

    """

    law: TransformableLaw
    cost: float
    boundary_residual: float
    optimality_residual: float
    peak: PeakMotion | None = None


@dataclass(frozen=True, kw_only=True)
class OwnLaw:
    """
    A strategy with a law of its own from rest to rest; other planned variables follow its cost.

    Attributes
    ----------
    motion
        From the arm, the options, the duration [s] and the distance [rad] to the motion over
        1 rad.
    check
        Refuses an arm and options with which no motion can be planned.
    motion_from
        From the arm, the options, the duration [s], the derivatives 0 to 5 of the first planned
        variable at the start [rad/s^k] and its value at the end [rad] to the motion.
    through
        From the arm, the options and the path of the first planned variable to the motion through
        its points; None where there is none.
    stand_in
        Strategy of the same cost, which stands in where the law cannot: where the motion that it
        continues is of another flat map, and in a stop without `stop`.
    stop
        From the arm, the options, the duration [s] and the derivatives at the start, as above, to
        the place where a stop takes least [rad]; None where that of `stand_in` serves.
    shortest
        From the arm, the options, the distance [rad] and the limit on the effort of joint n-1
        [N m] to the shortest duration from rest to rest within it [s]; None where a search has to
        find it.
    shortest_from
        The same from the derivatives at the start and the value at the end in place of the
        distance.

    """

    motion: Callable[[PlanarArm, PlanningOptions, float, float], OwnMotion]
    check: Callable[[PlanarArm, PlanningOptions], None]
    motion_from: Callable[[PlanarArm, PlanningOptions, float, FloatArray, float], OwnMotion]
    through: Callable[[PlanarArm, PlanningOptions, PathConditions], OwnMotion] | None = None
    stand_in: Strategy = Strategy.POLYNOMIAL
    stop: Callable[[PlanarArm, PlanningOptions, float, FloatArray], float] | None = None
    shortest: Callable[[PlanarArm, PlanningOptions, float, float], float] | None = None
    shortest_from: (
        Callable[[PlanarArm, PlanningOptions, FloatArray, float, float], float] | None
    ) = None


def _insensitive(
    arm: PlanarArm, options: PlanningOptions, duration: float, distance: float
) -> OwnMotion:
    """Return the insensitive motion; only the exact flat map tells what it leaves."""
    _check_flat_model(options)
    found = insensitive_motion(arm, duration, options.insensitivity, distance, options.drive)
    return _of_insensitive(found)


def _insensitive_from(
    arm: PlanarArm, options: PlanningOptions, duration: float, start: FloatArray, final: float
) -> OwnMotion:
    """Return the same from a start in motion."""
    found = insensitive_motion_from(
        arm, duration, options.insensitivity, start, final, options.drive
    )
    return _of_insensitive(found)


def _insensitive_through(
    arm: PlanarArm, options: PlanningOptions, path: PathConditions
) -> OwnMotion:
    """Return the same through the points of a path of one variable."""
    _check_flat_model(options)
    found = insensitive_motion_from(
        arm,
        float(path.edges[-1]),
        options.insensitivity,
        path.start[0],
        float(path.values[0, -1]),
        options.drive,
        times=path.edges[1:-1],
        values=path.values[0, :-1],
    )
    return _of_insensitive(found)


def _of_insensitive(found: InsensitiveMotion) -> OwnMotion:
    """Return an insensitive motion as one of a strategy."""
    return OwnMotion(
        law=found.law,
        cost=found.cost,
        boundary_residual=found.boundary_residual,
        optimality_residual=found.optimality_residual,
    )


def _check_insensitive(arm: PlanarArm, options: PlanningOptions) -> None:
    """Refuse another flat map, and arms that do not oscillate."""
    _check_flat_model(options)
    check_insensitivity(arm, options.insensitivity, options.drive)


def _check_flat_model(options: PlanningOptions) -> None:
    """Refuse a flat map of which nobody knows what it leaves."""
    if options.flat_model is not FlatModel.EXACT:
        raise InvalidRequest(f'strategy {options.strategy.value} needs flat_model: exact')


def _least_peak(
    arm: PlanarArm, options: PlanningOptions, duration: float, distance: float
) -> OwnMotion:
    """Return the motion of least peak; its conditions are those of the exact flat map."""
    _check_flat_model(options)
    found = peak_motion(arm, duration, options.peak, distance, options.drive)
    return _of_peak(found, abs(distance) * found.peak)


def _least_peak_from(
    arm: PlanarArm, options: PlanningOptions, duration: float, start: FloatArray, final: float
) -> OwnMotion:
    """Return the same from a start in motion."""
    found = peak_motion_from(arm, duration, options.peak, start, final, options.drive)
    return _of_peak(found, found.peak)


def _least_peak_stop(
    arm: PlanarArm, options: PlanningOptions, duration: float, start: FloatArray
) -> float:
    """Return where a motion comes to rest with the least peak."""
    found = peak_motion_from(arm, duration, options.peak, start, None, options.drive)
    return float(found.law.jet(duration, 0)[0, 0])


def _of_peak(found: PeakMotion, cost: float) -> OwnMotion:
    """Return a motion of least peak as one of a strategy."""
    return OwnMotion(
        law=found.law,
        cost=cost,
        boundary_residual=found.boundary_residual,
        optimality_residual=found.optimality_residual,
        peak=found,
    )


def _check_least_peak(arm: PlanarArm, options: PlanningOptions) -> None:
    """Refuse another flat map, and arms that do not oscillate."""
    _check_flat_model(options)
    check_peak(arm, options.peak, options.drive)


def _shortest_least_peak(
    arm: PlanarArm, options: PlanningOptions, distance: float, limit: float
) -> float:
    """Return the shortest duration within a limit on the effort."""
    return shortest_peak_duration(arm, options.peak, distance, limit)


def _shortest_least_peak_from(
    arm: PlanarArm, options: PlanningOptions, start: FloatArray, final: float, limit: float
) -> float:
    """Return the same from a start in motion."""
    return shortest_peak_duration_from(arm, options.peak, start, final, limit)


OWN_LAWS: Mapping[Strategy, OwnLaw] = MappingProxyType(
    {
        Strategy.INSENSITIVE: OwnLaw(
            motion=_insensitive,
            check=_check_insensitive,
            motion_from=_insensitive_from,
            through=_insensitive_through,
        ),
        Strategy.MIN_PEAK_EFFORT: OwnLaw(
            motion=_least_peak,
            check=_check_least_peak,
            motion_from=_least_peak_from,
            stop=_least_peak_stop,
            shortest=_shortest_least_peak,
            shortest_from=_shortest_least_peak_from,
        ),
    }
)
"""Strategies that are more than a quadratic cost."""


def shortest_known(
    request: MotionRequest, arm: PlanarArm, options: PlanningOptions, limit: float
) -> float | None:
    """
    Return the duration below which no motion of a strategy keeps a limit.

    Parameters
    ----------
    request, arm, options
        As for `plan`.
    limit
        On the effort of joint n-1 [N m].

    Returns
    -------
    float | None
        None where nobody knows one: for other strategies, and where the effort is not what the
        strategy shapes.

    """
    own = OWN_LAWS.get(options.strategy)
    is_shaped = options.drive is Drive.EFFORT and not options.compensate_friction
    if own is None or own.shortest is None or not is_shaped or not 0.0 < limit < inf:
        return None
    final = planned_at_rest(request.final)[0]
    if request.via or options.flat_model is not FlatModel.EXACT:
        return None
    if request.start_jets is None:
        distance = final - planned_at_rest(request.start)[0]
        return own.shortest(arm, options, abs(distance), limit) if distance else None
    start = request.start_jets[0]
    effort = abs(float(apply_row(flat_map(arm).effort, start[:5, None])[0]))
    is_at_rest = start[0] == final and not start[1:].any()
    if own.shortest_from is None or effort >= limit or is_at_rest:
        return None
    return own.shortest_from(arm, options, start, final, limit)


def with_quadratic_cost(options: PlanningOptions) -> PlanningOptions:
    """Return options whose strategy is a cost and no more."""
    own = OWN_LAWS.get(options.strategy)
    return options if own is None else replace(options, strategy=own.stand_in)


def check_options(arm: PlanarArm, options: PlanningOptions) -> None:
    """
    Refuse options with which no motion of an arm can be planned.

    Raises
    ------
    InvalidCost
        The weights define no admissible cost.
    InvalidRequest
        The strategy needs another flat map, or an arm that oscillates.
    NotFlat
        The arm is not flat.

    """
    own = OWN_LAWS.get(options.strategy)
    if own is not None:
        own.check(arm, options)
    options.cost(arm, flat_map(arm, options.flat_model))
