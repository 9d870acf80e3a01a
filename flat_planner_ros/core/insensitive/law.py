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
The strategy `insensitive`: effort against the residual on arms other than the model.

What is prescribed, effort or residual, is met by the weight that it implies.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from math import log10, tau

from flat_planner_ros.core.arm import Drive, FloatArray, InvalidRequest, OutOfReach, PlanarArm
from flat_planner_ros.core.insensitive.insensitivity import (
    DEFAULT_WEIGHT,
    Insensitivity,
    MAX_INSENSITIVITY,
    Nominal,
)
from flat_planner_ros.core.insensitive.momentum_angle import (
    Course,
    least_effort,
    NO_POINTS,
    UNIT_COURSE,
)
from flat_planner_ros.core.insensitive.oscillator import Oscillator
from flat_planner_ros.core.insensitive.response import (
    flat_outputs,
    largest_miss,
    responses,
    SeriesLaw,
)
from flat_planner_ros.core.insensitive.trade import Compromise, Trade
import numpy as np

MIN_WEIGHT = 0.1
"""Weight at which the residual has no say any more."""

FIRST_WEIGHT = 60.0
"""Weight from which one is searched for that takes a prescribed effort."""

STRIDE = 0.5
"""Steps in which a weight is searched for, in its decimal logarithm [-]."""

SEARCH_TOLERANCE = 2e-3
"""Of the decimal logarithm of a weight that is searched for [-]."""

MARGIN = 1e-3
"""Share of a prescribed bound that is kept in reserve for roundoff and sampling [-]."""

REFRESHED = 0.05
"""Share of all weights that is spread evenly again between two steps of a search [-]."""

MAX_VIA_POINTS = 16
"""Most points of one motion; polynomials through more lose the promised accuracy."""

MOTIONS_KEPT = 64
"""Solved problems that are remembered."""


@dataclass(frozen=True, kw_only=True, eq=False)
class InsensitiveMotion:
    """
    An insensitive motion, from rest to rest over 1 rad.

    Attributes
    ----------
    law
        The planned variable from -1/2 to 1/2, or all of it from a start in motion.
    cost
        effort^2 + (weight * residual / rad)^2, the effort over the least one of any motion over
        1 rad, the residual taken by the criterion [-].
    boundary_residual
        Largest miss of a condition at the ends, relative to the derivative's peak [-].
    optimality_residual
        Gradient of the weighted sum of squares that the law minimises, relative to its terms [-].

    """

    law: SeriesLaw
    cost: float
    boundary_residual: float
    optimality_residual: float


def insensitive_motion(
    arm: PlanarArm,
    duration: float,
    wanted: Insensitivity,
    distance: float,
    drive: Drive = Drive.EFFORT,
) -> InsensitiveMotion:
    """
    Return the insensitive motion over 1 rad, for use over a distance.

    Parameters
    ----------
    arm
        Nominal model; must be flat.
    duration
        Length of the motion [s].
    wanted
        Uncertainty and trade.
    distance
        Of the planned variable; only prescribed bounds depend on it [rad].
    drive
        What moves joint n-1.

    Raises
    ------
    OutOfReach
        No motion meets the prescribed bound.
    InvalidRequest
        An arm in the box does not oscillate.
    NotFlat
        The arm is not flat.

    """
    return _solved(arm, duration, wanted, abs(distance) if wanted.is_bounded else 1.0, drive)


def check_insensitivity(
    arm: PlanarArm, wanted: Insensitivity, drive: Drive = Drive.EFFORT
) -> None:
    """
    Solve a problem of this kind, so that it is known to have a solution.

    Raises
    ------
    InvalidRequest
        An arm in the box does not oscillate.
    NotFlat
        The arm is not flat.

    """
    oscillator = Oscillator.of(arm, drive)
    Trade.of(oscillator, tau / oscillator.frequency, wanted).solve(DEFAULT_WEIGHT)


def insensitive_motion_from(
    arm: PlanarArm,
    duration: float,
    wanted: Insensitivity,
    start: FloatArray,
    final: float,
    drive: Drive = Drive.EFFORT,
    *,
    times: FloatArray = NO_POINTS,
    values: FloatArray = NO_POINTS,
) -> InsensitiveMotion:
    """
    Return the insensitive motion from a start at rest or in motion, through points, to rest.

    Parameters
    ----------
    arm, duration, wanted, drive
        As for `insensitive_motion`.
    start
        Derivatives 0 to 5 of the planned variable, shape (6,) [rad/s^k].
    final
        Where it comes to rest [rad].
    times, values
        Of via points on the way: from the start, and of the flat output y1, shape (v,) [s], [rad].

    Raises
    ------
    OutOfReach, InvalidRequest, NotFlat
        As by `insensitive_motion`.

    """
    if len(times) > MAX_VIA_POINTS:
        raise InvalidRequest(
            f'strategy insensitive has up to {MAX_VIA_POINTS} via points, got {len(times)}: use '
            f'another strategy, or several goals'
        )
    # Counted from the end, so that a distant place costs no digits of a short way.
    way = start * (0.5 * duration) ** np.arange(len(start))
    way[0] -= final
    course = Course(start=way, end=0.0, places=2.0 * times / duration - 1.0, values=values - final)
    found = _of_course(arm, duration, wanted, 1.0, drive, course)
    return replace(found, law=found.law.transformed(1.0, final))


@lru_cache(maxsize=MOTIONS_KEPT)
def _solved(
    arm: PlanarArm, duration: float, wanted: Insensitivity, distance: float, drive: Drive
) -> InsensitiveMotion:
    """Return the motion over 1 rad; arms count as equal if identical."""
    return _of_course(arm, duration, wanted, distance, drive, UNIT_COURSE)


def _of_course(
    arm: PlanarArm,
    duration: float,
    wanted: Insensitivity,
    factor: float,
    drive: Drive,
    course: Course,
) -> InsensitiveMotion:
    """Return the motion of a course, for use as a multiple of it."""
    problem = Trade.of(Oscillator.of(arm, drive), duration, wanted, course)
    least = least_effort(arm, factor, duration)
    if wanted.max_residual > 0.0:
        found = _within_residual(problem, factor, least)
    elif wanted.max_effort_rms > 0.0:
        found = _within_effort(problem, factor, least)
    else:
        found = problem.solve(wanted.weight or DEFAULT_WEIGHT)
    return _motion(problem, found)


def _within_residual(problem: Trade, distance: float, least: float) -> Compromise:
    """Return the compromise with the prescribed residual [rad]; refuse what none has."""
    bound = problem.wanted.max_residual
    limit = (1.0 - MARGIN) * bound / distance
    found = _search(problem, lambda c: problem.worst(c) / limit, 1.0 / limit, falls=1.0)
    reached = distance * problem.worst(found.c)
    if reached > bound:
        raise OutOfReach(
            'residual',
            reached,
            bound,
            f'no motion of {problem.duration:g} s is found that leaves at most {bound:g} rad over '
            f'the box; the least is {reached:.3g} rad, with {found.effort * least:.3g} N m RMS: '
            f'use a longer duration, insensitivity.nominal free, or more modes',
        )
    return found


def _within_effort(problem: Trade, distance: float, least: float) -> Compromise:
    """Return the compromise with the prescribed RMS effort [N m]; refuse what none has."""
    bound = problem.wanted.max_effort_rms
    limit = (1.0 - MARGIN) * bound / least
    found = _search(problem, lambda c: problem.effort(c) / limit, FIRST_WEIGHT, falls=-1.0)
    taken = found.effort * least
    if taken > bound:
        raise OutOfReach(
            'effort',
            taken,
            bound,
            f'no motion of {problem.duration:g} s is found with at most {bound:g} N m RMS; the '
            f'least is {taken:.4g} N m: use a longer duration',
        )
    return found


def _motion(problem: Trade, found: Compromise) -> InsensitiveMotion:
    """Return the law of a solution, with its certificate."""
    basis, course, equation = problem.basis, problem.course, problem.equation
    second = basis.second_start + basis.second_directions @ found.c
    fourth = basis.start + basis.directions @ found.c
    (law,) = responses(fourth[:, None], second[:, None], equation, problem.duration, course.start)
    is_exact = problem.wanted.nominal is Nominal.EXACT
    miss = largest_miss(law, second, equation, course.start, course.end, rests_at_end=is_exact)
    if len(course.places):
        passed = np.abs(flat_outputs(law, equation, course.places) - course.values).max()
        size = np.abs(np.append(course.values, course.start[0])).max()
        miss = max(miss, float(passed / (size or 1.0)))
    return InsensitiveMotion(
        law=law,
        cost=found.cost,
        boundary_residual=miss,
        optimality_residual=found.stationarity,
    )


def _search(
    problem: Trade, share: Callable[[FloatArray], float], guess: float, *, falls: float
) -> Compromise:
    """
    Return the compromise whose share of a bound is 1, or the nearest that there is.

    Parameters
    ----------
    problem
        What is solved for every weight.
    share
        Quantity over its bound, of the coefficients.
    guess
        Weight to begin with [-].
    falls
        Direction of the weight in which it falls: 1 for the residual, -1 for the effort.

    """
    from scipy.optimize import brentq

    known: dict[float, Compromise] = {}

    def miss(exponent: float) -> float:
        """Return the logarithm of the share at a weight, solved from its neighbour's shares."""
        if exponent not in known:
            shares = None
            if known and problem.is_minimax:
                near = known[min(known, key=lambda other: abs(other - exponent))]
                shares = (1.0 - REFRESHED) * near.shares + REFRESHED * problem.points[1]
            known[exponent] = problem.solve(10.0**exponent, shares)
        return log10(share(known[exponent].c))

    # From the guess towards the other side of the bound, until it is passed or out of reach.
    lowest, highest = log10(MIN_WEIGHT), log10(MAX_INSENSITIVITY)
    far = min(max(log10(guess), lowest), highest)
    near = far
    is_beyond = miss(near) > 0.0
    stride = falls * STRIDE if is_beyond else -falls * STRIDE
    while (miss(far) > 0.0) == is_beyond:
        near = far
        far = min(max(near + stride, lowest), highest)
        if near == far:
            return known[far]
    exponent = brentq(miss, near, far, xtol=SEARCH_TOLERANCE)
    step = falls * SEARCH_TOLERANCE
    # The root may be a little on the wrong side, and the share not quite smooth.
    while miss(exponent) > 0.0 and lowest < exponent < highest:
        exponent += step
        step *= 2.0
    return known[exponent]
