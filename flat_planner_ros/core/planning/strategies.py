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
from types import MappingProxyType
from typing import Protocol

from flat_planner_ros.core.arm import flat_map, FlatModel, InvalidRequest, PlanarArm
from flat_planner_ros.core.insensitive import check_insensitivity, insensitive_motion
from flat_planner_ros.core.motion_law import Law, Strategy, strategy_cost
from flat_planner_ros.core.planning.request import PlanningOptions


class TransformableLaw(Law, Protocol):
    """A law that serves any distance and any place."""

    def transformed(self, factor: float, offset: float) -> Law:
        """Return offset + factor times this law."""


class OwnMotion(Protocol):
    """
    A motion of the first planned variable from -1/2 to 1/2, and its certificate.

    Attributes
    ----------
    law
        Its law [rad].
    cost
        What it minimises.
    boundary_residual, optimality_residual
        As a plan states them [-].

    """

    @property
    def law(self) -> TransformableLaw:
        """Return the law."""

    @property
    def cost(self) -> float:
        """Return its cost."""

    @property
    def boundary_residual(self) -> float:
        """Return its largest miss at the ends."""

    @property
    def optimality_residual(self) -> float:
        """Return how far it is from stationary."""


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
    in_motion
        Strategy of the same cost, which stands in where the start is in motion.

    """

    motion: Callable[[PlanarArm, PlanningOptions, float, float], OwnMotion]
    check: Callable[[PlanarArm, PlanningOptions], None]
    in_motion: Strategy = Strategy.POLYNOMIAL


def _insensitive(
    arm: PlanarArm, options: PlanningOptions, duration: float, distance: float
) -> OwnMotion:
    """Return the insensitive motion; only the exact flat map tells what it leaves."""
    _check_flat_model(options)
    return insensitive_motion(arm, duration, options.insensitivity, distance, options.drive)


def _check_insensitive(arm: PlanarArm, options: PlanningOptions) -> None:
    """Refuse another flat map, and arms that do not oscillate."""
    _check_flat_model(options)
    check_insensitivity(arm, options.insensitivity, options.drive)


def _check_flat_model(options: PlanningOptions) -> None:
    """Refuse a flat map of which nobody knows what it leaves."""
    if options.flat_model is not FlatModel.EXACT:
        raise InvalidRequest(f'strategy {options.strategy.value} needs flat_model: exact')


OWN_LAWS: Mapping[Strategy, OwnLaw] = MappingProxyType(
    {Strategy.INSENSITIVE: OwnLaw(motion=_insensitive, check=_check_insensitive)}
)
"""Strategies that are more than a quadratic cost."""


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
