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
from dataclasses import dataclass
from math import inf
from types import MappingProxyType
from typing import Protocol

from flat_planner_ros.core.arm import (
    Drive,
    flat_map,
    FlatModel,
    FloatArray,
    InvalidRequest,
    PlanarArm,
)
from flat_planner_ros.core.insensitive import check_insensitivity, insensitive_motion
from flat_planner_ros.core.motion_law import Law, Strategy, strategy_cost
from flat_planner_ros.core.peak import (
    check_peak,
    peak_motion,
    peak_motion_from,
    PeakMotion,
    shortest_peak_duration,
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
    knots
        Even times between which the law is smooth, both ends included, which every sampled
        command has to contain, shape (m,) [s]; None where any times will do.

    """

    law: TransformableLaw
    cost: float
    boundary_residual: float
    optimality_residual: float
    knots: FloatArray | None = None


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
        variable at the start [rad/s^k] and its value at the end [rad] to the motion; None where
        `in_motion` stands in.
    in_motion
        Strategy of the same cost, which stands in where the start is in motion.
    shortest
        From the arm, the options, the distance [rad] and the limit on the effort of joint n-1
        [N m] to the shortest duration from rest to rest within it [s]; None where a search has to
        find it.

    """

    motion: Callable[[PlanarArm, PlanningOptions, float, float], OwnMotion]
    check: Callable[[PlanarArm, PlanningOptions], None]
    motion_from: (
        Callable[[PlanarArm, PlanningOptions, float, FloatArray, float], OwnMotion] | None
    ) = None
    in_motion: Strategy = Strategy.POLYNOMIAL
    shortest: Callable[[PlanarArm, PlanningOptions, float, float], float] | None = None


def _insensitive(
    arm: PlanarArm, options: PlanningOptions, duration: float, distance: float
) -> OwnMotion:
    """Return the insensitive motion; only the exact flat map tells what it leaves."""
    _check_flat_model(options)
    found = insensitive_motion(arm, duration, options.insensitivity, distance, options.drive)
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


def _of_peak(found: PeakMotion, cost: float) -> OwnMotion:
    """Return a motion of least peak as one of a strategy."""
    return OwnMotion(
        law=found.law,
        cost=cost,
        boundary_residual=found.boundary_residual,
        optimality_residual=found.optimality_residual,
        knots=found.law.knots,
    )


def _check_least_peak(arm: PlanarArm, options: PlanningOptions) -> None:
    """Refuse another flat map, and arms that do not oscillate."""
    _check_flat_model(options)
    check_peak(arm, options.drive)


def _shortest_least_peak(
    arm: PlanarArm, options: PlanningOptions, distance: float, limit: float
) -> float:
    """Return the shortest duration within a limit on the effort."""
    return shortest_peak_duration(arm, options.peak, distance, limit)


OWN_LAWS: Mapping[Strategy, OwnLaw] = MappingProxyType(
    {
        Strategy.INSENSITIVE: OwnLaw(motion=_insensitive, check=_check_insensitive),
        Strategy.MIN_PEAK_EFFORT: OwnLaw(
            motion=_least_peak,
            check=_check_least_peak,
            motion_from=_least_peak_from,
            shortest=_shortest_least_peak,
        ),
    }
)
"""Strategies that are more than a quadratic cost."""


def shortest_at_rest(
    request: MotionRequest, arm: PlanarArm, options: PlanningOptions, limit: float
) -> float | None:
    """
    Return the duration below which no motion from rest to rest keeps a limit.

    Parameters
    ----------
    request, arm, options
        As for `plan`.
    limit
        On the effort of joint n-1 [N m].

    Returns
    -------
    float | None
        None where nobody knows one: for other strategies, starts in motion, and where the effort
        is not what the strategy shapes.

    """
    own = OWN_LAWS.get(options.strategy)
    is_shaped = options.drive is Drive.EFFORT and not options.compensate_friction
    if own is None or own.shortest is None or not is_shaped or not 0.0 < limit < inf:
        return None
    if request.start_jets is not None or request.via:
        return None
    distance = planned_at_rest(request.final)[0] - planned_at_rest(request.start)[0]
    return own.shortest(arm, options, abs(distance), limit) if distance else None


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
    strategy_cost(
        options.strategy,
        flat_map(arm, options.flat_model),
        r=options.r,
        p=options.p,
        custom=options.custom,
    )
