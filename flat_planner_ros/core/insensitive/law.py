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

In the basis of `momentum` effort is a plain sum of squares and every residual amplitude the
magnitude of one complex number, linear in the coefficients. A quadratic compromise is therefore
one small linear system, and the largest residual over a box is reached by reweighting a few dozen
points of its boundary (docs/derivation.md, section I).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import ceil, log10, sqrt, tau
from typing import NamedTuple

from flat_planner_ros.core.arm import (
    apply_row,
    flat_map,
    FlatMap,
    FlatModel,
    FloatArray,
    OutOfReach,
    PlanarArm,
)
from flat_planner_ros.core.insensitive.momentum_angle import (
    answer,
    CONTACT,
    JET_ORDER,
    LEAST_OF_ALL,
    momentum_basis,
    MomentumBasis,
    SeriesLaw,
)
from flat_planner_ros.core.insensitive.residual import largest, Oscillator, UncertaintyBox
from flat_planner_ros.core.insensitive.settings import (
    Criterion,
    DEFAULT_WEIGHT,
    Insensitivity,
    MAX_INSENSITIVITY,
    Nominal,
)
import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

ComplexArray = NDArray[np.complex128]

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

MEAN_NODES = 4
"""Gauss-Legendre nodes over either side of the box, plus one per radian of turn."""

MAX_MEAN_NODES = 24
"""Most of them."""

PROBES = 65
"""Times at which a law is certified."""

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
    weight
        The weight that was used, or that follows from a prescribed bound [-].
    effort
        RMS effort over the least one of any motion [-].
    cost
        effort^2 + (weight * residual / rad)^2, the residual taken by the criterion [-].
    gap
        Bound on how far the cost is above the optimum, relative to it [-].
    boundary_residual
        Largest miss of a condition at the ends, relative to the derivative's peak [-].
    stationarity
        Gradient of the weighted sum of squares that the law minimises, relative to its terms [-].

    """

    law: SeriesLaw
    weight: float
    effort: float
    cost: float
    gap: float
    boundary_residual: float
    stationarity: float


def least_effort(arm: PlanarArm, distance: float, duration: float) -> float:
    """Return the least RMS effort of joint n-1 of any motion from rest to rest [N m], (I5)."""
    return sqrt(12.0) * arm.inertia_star.both * abs(distance) / duration**2


def insensitive_motion(
    arm: PlanarArm, duration: float, wanted: Insensitivity, distance: float
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

    Raises
    ------
    OutOfReach
        No motion meets the prescribed bound.
    InvalidRequest
        An arm in the box does not oscillate.
    NotFlat
        The arm is not flat.

    """
    is_bounded = wanted.max_effort_rms > 0.0 or wanted.max_residual > 0.0
    return _solved(arm, duration, wanted, abs(distance) if is_bounded else 1.0)


def check_insensitivity(arm: PlanarArm, wanted: Insensitivity) -> None:
    """
    Solve a problem of this kind, so that it is known to have a solution and libraries are loaded.

    Raises
    ------
    InvalidRequest
        An arm in the box does not oscillate.
    NotFlat
        The arm is not flat.

    """
    if wanted.max_effort_rms > 0.0 or wanted.max_residual > 0.0:
        import scipy.optimize  # noqa: F401  What the search takes, a fifth of a second to load.
    period = tau / Oscillator.of(arm).frequency
    _Problem.of(arm, period, wanted).solve(DEFAULT_WEIGHT)


@lru_cache(maxsize=MOTIONS_KEPT)
def _solved(
    arm: PlanarArm, duration: float, wanted: Insensitivity, distance: float
) -> InsensitiveMotion:
    """Return the motion; arms count as equal if identical."""
    problem = _Problem.of(arm, duration, wanted)
    if wanted.max_residual > 0.0:
        limit = (1.0 - MARGIN) * wanted.max_residual / distance
        found = _search(problem, lambda c: problem.worst(c) / limit, 1.0 / limit, rises=False)
        if (reached := distance * problem.worst(found.c)) > wanted.max_residual:
            raise OutOfReach(
                'residual',
                reached,
                wanted.max_residual,
                f'no motion of {duration:g} s is found that leaves at most '
                f'{wanted.max_residual:g} rad over the box; the least is {reached:.3g} rad, with '
                f'{found.effort * least_effort(arm, distance, duration):.3g} N m RMS: use a '
                f'longer duration, insensitivity.nominal free, or more modes',
            )
    elif wanted.max_effort_rms > 0.0:
        least = least_effort(arm, distance, duration)
        limit = (1.0 - MARGIN) * wanted.max_effort_rms / least
        found = _search(problem, lambda c: problem.effort(c) / limit, FIRST_WEIGHT, rises=True)
        if (taken := found.effort * least) > wanted.max_effort_rms:
            raise OutOfReach(
                'effort',
                taken,
                wanted.max_effort_rms,
                f'no motion of {duration:g} s over {distance:.4g} rad is found with at most '
                f'{wanted.max_effort_rms:g} N m RMS; the least is {taken:.4g} N m: use a longer '
                f'duration',
            )
    else:
        found = problem.solve(wanted.weight or DEFAULT_WEIGHT)
    return problem.motion(found)


class _Compromise(NamedTuple):
    """Coefficients c, shape (m,), for a weight; the points' shares of it, and figures of merit."""

    c: FloatArray
    weight: float
    shares: FloatArray
    effort: float
    cost: float
    gap: float
    stationarity: float


@dataclass(frozen=True, kw_only=True, eq=False)
class _Problem:
    """
    Effort and residuals as functions of coefficients c; |c|^2 + least is the effort squared.

    Attributes
    ----------
    arm, duration, wanted
        What is asked for.
    basis
        From coefficients to the law.
    origin, directions
        Coefficients of the basis: origin + directions @ c.

    """

    arm: PlanarArm
    duration: float
    wanted: Insensitivity
    basis: MomentumBasis
    origin: FloatArray
    directions: FloatArray

    @classmethod
    def of(cls, arm: PlanarArm, duration: float, wanted: Insensitivity) -> '_Problem':
        """Return the problem, what is left on the nominal arm settled."""
        modes = wanted.modes
        problem = cls(
            arm=arm,
            duration=duration,
            wanted=wanted,
            basis=momentum_basis(modes),
            origin=np.zeros(modes),
            directions=np.eye(modes),
        )
        if wanted.nominal is Nominal.FREE:
            return problem
        matrix, start = problem.residuals(np.ones((1, 2)))
        left, sizes, right = np.linalg.svd(matrix)
        origin = right[:2].T @ (-(left.T @ start) / sizes)
        return replace(problem, origin=origin, directions=right[2:].T)

    @cached_property
    def least(self) -> float:
        """Return the effort squared of c = 0, in units of the basis."""
        return self.basis.least + float(self.origin @ self.origin)

    @cached_property
    def points(self) -> tuple[FloatArray, FloatArray]:
        """Return the arms that are weighed, (p, 2), and shares of weight to begin with, (p,)."""
        box, oscillator = self.wanted.box, Oscillator.of(self.arm)
        if self.wanted.criterion is Criterion.MEAN:
            return _box_nodes(box, oscillator, self.duration)
        edges = np.concatenate(box.edges(oscillator, self.duration, MAX_POINTS))
        return edges, np.full(len(edges), 1.0 / len(edges))

    def residuals(self, factors: FloatArray) -> tuple[FloatArray, FloatArray]:
        """
        Return residuals per rad as matrix @ c + start, real parts above imaginary ones.

        Parameters
        ----------
        factors
            Arms, as factors on stiffness and damping, shape (p, 2) [-].

        Returns
        -------
        tuple[FloatArray, FloatArray]
            Shapes (2 p, m) and (2 p,) [-].

        """
        basis, oscillator = self.basis, Oscillator.of(self.arm)
        rows = _residual_rows(oscillator, factors, self.duration, len(basis.torque_start))
        stacked = np.concatenate([rows.real, rows.imag])
        changes = stacked @ basis.torque_directions
        return changes @ self.directions, stacked @ basis.torque_start + changes @ self.origin

    def effort(self, c: FloatArray) -> float:
        """Return the RMS effort over the least one of any motion."""
        return sqrt((self.least + float(c @ c)) / LEAST_OF_ALL)

    def worst(self, c: FloatArray) -> float:
        """Return the largest residual on the edges of the box, per rad."""
        edges, (matrix, start) = self._edges
        amplitudes = np.hypot(*np.split(matrix @ c + start, 2))
        return largest(edges, amplitudes)[0]

    @cached_property
    def _edges(self) -> tuple[list[FloatArray], tuple[FloatArray, FloatArray]]:
        """Return the edges of the box and the residuals on them."""
        edges = self.wanted.box.edges(Oscillator.of(self.arm), self.duration)
        return edges, self.residuals(np.concatenate(edges))

    @cached_property
    def _weighed(self) -> tuple[FloatArray, FloatArray]:
        """Return the residuals of the arms that are weighed."""
        return self.residuals(self.points[0])

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
            cost = self.least + float(c @ c) + total * weighed
            # For any shares, the weighted sum is a lower bound on the minimax cost.
            gap = total * (weighed - mean) / cost
            if gap <= GAP:
                break
            shares = shares * np.sqrt(squares)
            shares /= shares.sum()
        terms = np.abs(hessian) @ np.abs(c) + np.abs(gradient)
        miss = np.abs(hessian @ c + gradient).max() / (terms.max() or 1.0)
        return _Compromise(
            c, weight, shares, self.effort(c), cost / LEAST_OF_ALL, gap, float(miss)
        )

    @property
    def is_minimax(self) -> bool:
        """Tell whether the largest residual is weighed."""
        return self.wanted.criterion is Criterion.WORST

    def motion(self, found: _Compromise) -> InsensitiveMotion:
        """Return the law of a solution, with its certificate."""
        basis, coefficients = self.basis, self.origin + self.directions @ found.c
        torque = basis.torque_start + basis.torque_directions @ coefficients
        fourth = basis.start + basis.directions @ coefficients
        mapping = flat_map(self.arm, FlatModel.EXACT)
        law = answer(fourth, torque, mapping, self.duration)
        is_exact = self.wanted.nominal is Nominal.EXACT
        return InsensitiveMotion(
            law=law,
            weight=found.weight,
            effort=found.effort,
            cost=found.cost,
            gap=found.gap,
            boundary_residual=_miss(law, torque, mapping, is_exact),
            stationarity=found.stationarity,
        )


def _residual_rows(
    oscillator: Oscillator, factors: FloatArray, duration: float, terms: int
) -> ComplexArray:
    """
    Return the residual that each Legendre term of sigma'' leaves per rad, shape (p, terms).

    The integral of P_j(x) exp(z (1 - x)) is a modified spherical Bessel function of z ((I9) of
    docs/derivation.md), here with its growth taken out.
    """
    # Imported here: it takes longer than planning with any other strategy.
    from scipy.special import ive

    half = 0.5 * duration
    poles = oscillator.poles(factors)
    z, order = half * poles[:, None], np.arange(terms)
    bessel = np.sqrt(np.pi / (2.0 * z)) * ive(order + 0.5, z)
    integrals = 2.0 * (-1.0) ** order * bessel * np.exp(1j * z.imag)
    both = oscillator.inertia
    gain = both / (half * oscillator.free_inertia * poles.imag)
    rows: ComplexArray = gain[:, None] * integrals
    return rows


def _box_nodes(
    box: UncertaintyBox, oscillator: Oscillator, duration: float
) -> tuple[FloatArray, FloatArray]:
    """Return points inside the box, shape (p, 2), and weights of a mean over it, shape (p,)."""
    axes = []
    for i, width in enumerate((box.stiffness, box.damping)):
        ends = np.ones((2, 2))
        ends[:, i] += (-width, width)
        turn = duration * float(np.abs(np.diff(oscillator.poles(ends)))[0])
        nodes, weights = legendre.leggauss(min(MEAN_NODES + ceil(turn), MAX_MEAN_NODES))
        axes.append((1.0 + width * nodes, 0.5 * weights))
    (k, k_weights), (c, c_weights) = axes
    points = np.stack(np.meshgrid(k, c, indexing='ij'), axis=-1).reshape(-1, 2)
    return points, np.multiply.outer(k_weights, c_weights).ravel()


def _search(
    problem: _Problem, share: Callable[[FloatArray], float], guess: float, *, rises: bool
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
    rises
        Whether it rises with the weight, as the effort does; the residual falls.

    """
    from scipy.optimize import brentq

    known: dict[float, _Compromise] = {}

    def miss(exponent: float) -> float:
        """Return the logarithm of the share at a weight, solved from its neighbour's shares."""
        if exponent in known:
            return log10(share(known[exponent].c))
        shares = None
        if known and problem.is_minimax:
            near = known[min(known, key=lambda other: abs(other - exponent))]
            shares = (1.0 - REFRESHED) * near.shares + REFRESHED * problem.points[1]
        known[exponent] = problem.solve(10.0**exponent, shares)
        return log10(share(known[exponent].c))

    # From the guess towards the other side of the bound, until it is passed or out of reach.
    lowest, highest = log10(MIN_WEIGHT), log10(MAX_INSENSITIVITY)
    near = far = min(max(log10(guess), lowest), highest)
    is_beyond = miss(near) > 0.0
    stride = STRIDE if is_beyond is not rises else -STRIDE
    while (miss(far) > 0.0) is is_beyond:
        near, far = far, min(max(far + stride, lowest), highest)
        if near == far:
            return known[far]
    exponent = brentq(miss, near, far, xtol=SEARCH_TOLERANCE)
    step = -SEARCH_TOLERANCE if rises else SEARCH_TOLERANCE
    # The root may be a little on the wrong side, and the share not quite smooth.
    while miss(exponent) > 0.0 and lowest < exponent < highest:
        exponent += step
        step *= 2.0
    return known[exponent]


def _miss(law: SeriesLaw, torque: FloatArray, mapping: FlatMap, is_exact: bool) -> float:
    """Return the largest miss at the ends, and of the effort in between, relative to peaks."""
    half = 0.5 * law.duration
    times = np.linspace(0.0, law.duration, PROBES)
    jet = law.jet(times, JET_ORDER)
    both = mapping.effort[2]
    # sigma and its derivatives from w, by the row that takes w to I sigma''.
    sigma = np.array([apply_row(mapping.effort[2:] / both, jet, k) for k in range(CONTACT + 1)])
    expected = legendre.legval(times / half - 1.0, torque) / half**2
    effort = apply_row(mapping.effort, jet) / both
    misses = [np.abs(effort - expected).max() / np.abs(expected).max()]
    misses += [_end_miss(jet[:JET_ORDER], 0), _end_miss(sigma, -1)]
    if is_exact:
        misses.append(_end_miss(jet[:JET_ORDER], -1))
    return float(max(misses))


def _end_miss(table: FloatArray, end: int) -> float:
    """Return how far derivatives at an end are from rest at -1/2 or 1/2, relative to peaks."""
    rest = np.zeros(len(table))
    rest[0] = 0.5 if end else -0.5
    size = np.abs(table).max(axis=1)
    size[0] += 0.5
    return float((np.abs(table[:, end] - rest) / size).max())
