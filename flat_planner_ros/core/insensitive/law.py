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

In a basis of `momentum_angle` effort is a plain sum of squares and every residual amplitude the
magnitude of one complex number, linear in the coefficients. A quadratic compromise is therefore
a small linear system, and the largest residual over a box takes a few dozen points of its edges
that are reweighted (docs/derivation.md, section I).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import log10, sqrt, tau
from typing import NamedTuple

from flat_planner_ros.core.arm import Drive, FloatArray, OutOfReach, PlanarArm
from flat_planner_ros.core.insensitive.insensitivity import (
    Criterion,
    DEFAULT_WEIGHT,
    Insensitivity,
    MAX_INSENSITIVITY,
    Nominal,
)
from flat_planner_ros.core.insensitive.momentum_angle import (
    basis_for,
    largest_miss,
    least_effort,
    LEAST_OF_ALL,
    MomentumBasis,
    response,
    SeriesLaw,
)
from flat_planner_ros.core.insensitive.oscillator import largest, Oscillator
from flat_planner_ros.core.insensitive.residual import legendre_residuals
import numpy as np

GAP = 5e-3
"""Distance from the optimum of the minimax problem at which reweighting ends [-]."""

MAX_ROUNDS = 150
"""Reweightings after which the law is taken with the gap that it has."""

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

MAX_POINTS = 65
"""Most points of an edge that are weighed; those of the prediction may be more."""

MOTIONS_KEPT = 64
"""Solved problems that are remembered."""


@dataclass(frozen=True, kw_only=True, eq=False)
class InsensitiveMotion:
    """
    An insensitive motion over 1 rad.

    Attributes
    ----------
    law
        The planned variable from -1/2 to 1/2.
    cost
        effort^2 + (weight * residual / rad)^2, the effort over the least one of any motion, the
        residual taken by the criterion [-].
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
    _Problem.of(oscillator, tau / oscillator.frequency, wanted).solve(DEFAULT_WEIGHT)


@lru_cache(maxsize=MOTIONS_KEPT)
def _solved(
    arm: PlanarArm, duration: float, wanted: Insensitivity, distance: float, drive: Drive
) -> InsensitiveMotion:
    """Return the motion; arms count as equal if identical."""
    problem = _Problem.of(Oscillator.of(arm, drive), duration, wanted)
    least = least_effort(arm, distance, duration)
    if wanted.max_residual > 0.0:
        found = _within_residual(problem, distance, least)
    elif wanted.max_effort_rms > 0.0:
        found = _within_effort(problem, distance, least)
    else:
        found = problem.solve(wanted.weight or DEFAULT_WEIGHT)
    return _motion(problem, found)


def _within_residual(problem: '_Problem', distance: float, least: float) -> '_Compromise':
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


def _within_effort(problem: '_Problem', distance: float, least: float) -> '_Compromise':
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
            f'no motion of {problem.duration:g} s over {distance:.4g} rad is found with at most '
            f'{bound:g} N m RMS; the least is {taken:.4g} N m: use a longer duration',
        )
    return found


class _Compromise(NamedTuple):
    """Coefficients c, shape (m,); the points' shares of the weight, and figures of merit."""

    c: FloatArray
    shares: FloatArray
    effort: float
    cost: float
    stationarity: float


@dataclass(frozen=True, kw_only=True, eq=False)
class _Problem:
    """
    Effort and residuals as functions of the coefficients c of a basis.

    Attributes
    ----------
    oscillator, duration, wanted
        What is asked for.
    basis
        Laws that leave on the nominal arm what is wanted.

    """

    oscillator: Oscillator
    duration: float
    wanted: Insensitivity
    basis: MomentumBasis

    @classmethod
    def of(cls, oscillator: Oscillator, duration: float, wanted: Insensitivity) -> '_Problem':
        """Return the problem, what is left on the nominal arm settled."""
        basis = basis_for(oscillator, duration, wanted.modes)
        problem = cls(oscillator=oscillator, duration=duration, wanted=wanted, basis=basis)
        if wanted.nominal is Nominal.FREE:
            return problem
        matrix, start = problem.residuals(np.ones((1, 3)))
        left, sizes, right = np.linalg.svd(matrix)
        origin = right[:2].T @ (-(left.T @ start) / sizes)
        return replace(problem, basis=basis.changed(origin, right[2:].T))

    @cached_property
    def points(self) -> tuple[FloatArray, FloatArray]:
        """Return the arms that are weighed, (p, 3), and shares of weight to begin with, (p,)."""
        if not self.is_minimax:
            return self.oscillator.nodes(self.wanted.box, self.duration)
        edges = self.oscillator.edges(self.wanted.box, self.duration, MAX_POINTS)
        points = np.concatenate(edges)
        return points, np.full(len(points), 1.0 / len(points))

    def effort(self, c: FloatArray) -> float:
        """Return the RMS effort over the least one of any motion."""
        return sqrt((self.basis.least + float(c @ c)) / LEAST_OF_ALL)

    def worst(self, c: FloatArray) -> float:
        """Return the largest residual on the edges of the box, per rad."""
        edges, (matrix, start) = self._edges
        amplitudes = np.hypot(*np.split(matrix @ c + start, 2))
        return largest(edges, amplitudes)[0]

    @cached_property
    def _edges(self) -> tuple[list[FloatArray], tuple[FloatArray, FloatArray]]:
        """Return the edges of the box and the residuals on them."""
        edges = self.oscillator.edges(self.wanted.box, self.duration)
        return edges, self.residuals(np.concatenate(edges))

    @cached_property
    def _weighed(self) -> tuple[FloatArray, FloatArray]:
        """Return the residuals of the arms that are weighed."""
        return self.residuals(self.points[0])

    def residuals(self, factors: FloatArray) -> tuple[FloatArray, FloatArray]:
        """
        Return residuals per rad as matrix @ c + start, real parts above imaginary ones.

        Parameters
        ----------
        factors
            Arms, as for `Oscillator.poles`, shape (p, 3) [-].

        Returns
        -------
        tuple[FloatArray, FloatArray]
            Shapes (2 p, modes) and (2 p,) [-].

        """
        basis = self.basis
        rows = legendre_residuals(self.oscillator, factors, self.duration, len(basis.second_start))
        stacked = np.concatenate([rows.real, rows.imag])
        return stacked @ basis.second_directions, stacked @ basis.second_start

    def solve(self, weight: float, shares: FloatArray | None = None) -> _Compromise:
        """Return the best coefficients for a weight; the shares are a first guess."""
        total = LEAST_OF_ALL * weight**2
        shares = self.points[1] if shares is None else shares
        (matrix, start), points = self._weighed, len(shares)
        is_minimax, identity = self.is_minimax, np.eye(matrix.shape[1])
        for _ in range(MAX_ROUNDS):
            weighted = matrix.T * np.tile(total * shares, 2)
            hessian, gradient = identity + weighted @ matrix, weighted @ start
            c = np.asarray(-np.linalg.solve(hessian, gradient), dtype=float)
            residuals = matrix @ c + start
            squares = residuals[:points] ** 2 + residuals[points:] ** 2
            mean = float(shares @ squares)
            weighed = float(squares.max()) if is_minimax else mean
            cost = self.basis.least + float(c @ c) + total * weighed
            # For any shares, the weighted sum is a lower bound on the minimax cost.
            if total * (weighed - mean) <= GAP * cost:
                break
            shares = shares * np.sqrt(squares)
            shares /= shares.sum()
        terms = np.abs(hessian) @ np.abs(c) + np.abs(gradient)
        miss = np.abs(hessian @ c + gradient).max() / (terms.max() or 1.0)
        return _Compromise(c, shares, self.effort(c), cost / LEAST_OF_ALL, float(miss))

    @property
    def is_minimax(self) -> bool:
        """Tell whether the largest residual is weighed."""
        return self.wanted.criterion is Criterion.WORST


def _motion(problem: _Problem, found: _Compromise) -> InsensitiveMotion:
    """Return the law of a solution, with its certificate."""
    basis = problem.basis
    second = basis.second_start + basis.second_directions @ found.c
    fourth = basis.start + basis.directions @ found.c
    oscillator = problem.oscillator
    law = response(fourth, second, oscillator, problem.duration)
    is_exact = problem.wanted.nominal is Nominal.EXACT
    return InsensitiveMotion(
        law=law,
        cost=found.cost,
        boundary_residual=largest_miss(law, second, oscillator, rests_at_end=is_exact),
        optimality_residual=found.stationarity,
    )


def _search(
    problem: _Problem, share: Callable[[FloatArray], float], guess: float, *, falls: float
) -> _Compromise:
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

    known: dict[float, _Compromise] = {}

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
