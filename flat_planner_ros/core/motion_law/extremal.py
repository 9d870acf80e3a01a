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
Extremals of a quadratic cost: the Euler-Lagrange equation solved for given ends.

The equation has constant coefficients and only even derivatives, sum_k a_k y^(2k) = 0, so its
solutions split into odd and even ones about the middle of the motion and its roots come as +-beta
(docs/derivation.md, section 5). One root alone gives the paper's exponential, a multiple root an
exponential times a polynomial, and twelve roots near zero the polynomial law: one mechanism
without a special case. A slow motion from rest to rest has its equation solved as a series, which
needs no roots.

From rest to rest, everything about a law but its size, place and duration follows from the six
normalised coefficients of its equation ((23)). Unit motions, from -1/2 to 1/2 in normalised time,
are therefore certified once and kept: other distances, and other arms with the same numbers, are
multiples.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache
from typing import NamedTuple

from flat_planner_ros.core.arm import ComplexArray, FloatArray, locked, UncertifiedPlan
from flat_planner_ros.core.motion_law.basis import ALTERNATING, CONDITIONS, SERIES_LENGTH
from flat_planner_ros.core.motion_law.boundary_solver import boundary_solver, BoundarySolver
from flat_planner_ros.core.motion_law.certificate import (
    probes,
    Quality,
    quality,
    relative_sum,
    SAME,
    UNIT_ENDS,
)
from flat_planner_ros.core.motion_law.law import half_quadrature, JET_ORDER, Sum, SummedLaw
from flat_planner_ros.core.motion_law.roots import Cluster, Spectrum
from flat_planner_ros.core.motion_law.series_basis import (
    FASTEST,
    probed,
    solved,
    speeds,
    terms_for,
)
from flat_planner_ros.core.motion_law.series_sum import SeriesSum
from flat_planner_ros.core.motion_law.term_sum import ascending_powers, CHUNK, term_sum, TermSum
from flat_planner_ros.core.motion_law.terms import Term
import numpy as np

KEY_BITS = 48
"""
Leading bits of the normalised coefficients under which a unit motion is kept.

Coefficients are computed with errors of a few units in their last, 53rd bit. What is left of them
differs for equal numbers of two arms only where such an error crosses a multiple of 2^-48.
"""

LONG = 2 * CHUNK
"""Most samples that a series gives sooner than exponentials do."""

SAME_LAW = 1e-12
"""Residuals of a law found by its roots up to which it is the one found as a series [-]."""

UNITS_KEPT = 64
"""Unit motions in the cache; the one unused for longest makes room."""

_ORDERS = np.arange(CONDITIONS + 1.0)

Clusters = Callable[[], Sequence[Cluster]]
"""Gives clusters of roots when they are asked for."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BoundaryConditions:
    """
    Value and five derivatives at both ends.

    Attributes
    ----------
    start, end
        Derivatives of orders 0 to 5, shape (6,) [rad/s^k].

    """

    start: FloatArray
    end: FloatArray


def extremals(
    coefficients: FloatArray, duration: float, conditions: Sequence[BoundaryConditions]
) -> list[SummedLaw]:
    """
    Return the stationary laws of one equation that meet boundary conditions, one for each.

    Parameters
    ----------
    coefficients
        a_0 ... a_6 of the Euler-Lagrange equation in physical time, as given by
        `QuadraticCost.characteristic`, shape (7,) [s^(2k - 12)].
    duration
        Length of the motions [s].
    conditions
        What each law must meet.

    Raises
    ------
    UncertifiedPlan
        The boundary conditions are singular in double precision.

    """
    half = 0.5 * duration
    powers = half**_ORDERS
    equation = coefficients.tobytes()
    laws = []
    for ends in conditions:
        start = ends.start * powers[:CONDITIONS]
        end = ends.end * powers[:CONDITIONS]
        middle = 0.5 * (ends.start[0] + ends.end[0])
        terms = []
        if middle:
            terms.append(Term(rate=0j, origin=0, coefficients=(complex(middle),)))
        mirrored = ALTERNATING * start
        for parity in (-1.0, 1.0):
            # Right-hand side of the law's odd or even part about the middle, at the end x = 1.
            target = 0.5 * (end + parity * mirrored)
            if parity > 0.0:
                target[0] -= middle
            if target.any():
                terms.extend(boundary_solver(equation, half, parity).terms(target))
        laws.append(SummedLaw(duration=duration, total=term_sum(terms)))
    return laws


def stationarity_residual(coefficients: FloatArray, jet: FloatArray) -> float:
    """
    Return how far derivatives are from fulfilling the Euler-Lagrange equation.

    Parameters
    ----------
    coefficients
        a_0 ... a_6, shape (7,).
    jet
        Derivatives 0 to 12 at some times, shape (13, m).

    Returns
    -------
    float
        Largest ``|sum_k a_k y^(2k)|`` over the times, relative to the largest sum of the terms'
        magnitudes [-].

    """
    return float(relative_sum(coefficients[1:], jet[2::2]))


def costate(coefficients: FloatArray, jet: FloatArray) -> FloatArray:
    """
    Return half the costate of the value, -sum_k a_k y^(2k - 1), which an extremal conserves.

    Times the distance it is the cost of a rest-to-rest motion ((33) and (35) of
    docs/derivation.md).

    Parameters
    ----------
    coefficients
        a_0 ... a_6, shape (7,).
    jet
        Derivatives 0 to 11 at some times, shape (12, m) or more rows.

    Returns
    -------
    FloatArray
        Half the costate at each of the times, shape (m,) [rad s^-11].

    """
    value: FloatArray = -coefficients[1:] @ jet[1::2]
    return value


class Mean(NamedTuple):
    """Means and peaks over a motion, of linear combinations of derivatives."""

    mean_square: FloatArray
    peak: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class UnitMotion:
    """
    Optimal law of one unit of distance and its quality, all in normalised time [-].

    Attributes
    ----------
    coefficients
        a_0 ... a_6 of its equation, shape (7,).
    law
        From -1/2 at t = 0 to 1/2 at t = 2; odd about the middle.
    rates
        Of its exponentials; of a series how fast it is, shape (m,) [-].
    boundary_residual
        (31) of docs/derivation.md.
    optimality_residual
        (32) of docs/derivation.md, at most, for all coefficients that count as equal.
    costate
        (33) of docs/derivation.md, here also the cost.
    peaks
        Largest magnitudes of the derivatives 0 to 6 at the times of the certificate.

    """

    coefficients: FloatArray
    law: SummedLaw
    rates: ComplexArray
    boundary_residual: float
    optimality_residual: float
    costate: float
    peaks: FloatArray

    def law_over(self, duration: float, distance: float, middle: float) -> SummedLaw:
        """Return the law in physical time [s] over a distance about a place [rad]."""
        return replace(self.law, duration=duration, factor=distance, offset=middle)

    def jet(self, after_start: FloatArray, before_end: FloatArray) -> FloatArray:
        """Return the derivatives 0 to 6 at x + 1 and 1 - x, shape (7, m)."""
        return self.law.normalised_jet(np.array([after_start, before_end]), JET_ORDER)

    def fill_grid(self, table: FloatArray, rates: FloatArray) -> None:
        """
        Write the derivatives 0 to 6 at even times, the residuals at the ends removed.

        Parameters
        ----------
        table
            Takes the derivatives, shape (7, m), m > 1.
        rates
            Their factors, shape (7,).

        """
        total = self.law.total if table.shape[1] <= LONG else self._in_blocks
        total.fill_odd_grid(table, rates)
        table[1:CONDITIONS, 0] = 0.0
        table[1:CONDITIONS, -1] = 0.0
        table[0, 0] = -0.5 * rates[0]
        table[0, -1] = 0.5 * rates[0]

    @cached_property
    def _in_blocks(self) -> Sum:
        """Return the law by its roots, if they are apart: a few exponentials make a long table."""
        if not isinstance(self.law.total, SeriesSum):
            return self.law.total
        try:
            found = by_roots(self.coefficients)
        except UncertifiedPlan:
            return self.law.total
        total = found.law.total
        is_exact = max(found.boundary_residual, found.optimality_residual) <= SAME_LAW
        is_apart = isinstance(total, TermSum) and not total.others
        return total if is_exact and is_apart else self.law.total

    def mean(self, rows: FloatArray) -> Mean:
        """
        Return mean squares and peaks of combinations of derivatives over the motion.

        Parameters
        ----------
        rows
            Factors of the derivatives 0 to 6, none of the value itself, shape (m, 7).

        """
        weights, jet = self._fine
        # Derivatives of even order are odd about the middle: the other half has their sign turned.
        odd = rows[:, 2::2] @ jet[2::2]
        even = rows[:, 1::2] @ jet[1::2]
        return Mean((odd**2 + even**2) @ weights, (np.abs(odd) + np.abs(even)).max(axis=1))

    @cached_property
    def _fine(self) -> tuple[FloatArray, FloatArray]:
        """Return weights and derivatives at the nodes of a quadrature of the first half."""
        times, weights = half_quadrature(self.rates)
        return weights, self.jet(times, 2.0 - times)


def rounded(coefficients: FloatArray) -> FloatArray:
    """Return numbers to `KEY_BITS` leading bits, by Dekker's splitting."""
    shifted = coefficients * (2.0 ** (53 - KEY_BITS) + 1.0)
    result: FloatArray = shifted - (shifted - coefficients)
    return result


def unit_motion(coefficients: FloatArray, clusters: Clusters | None = None) -> UnitMotion:
    """
    Return the unit motion of an equation, one that is known if its numbers are the same.

    Parameters
    ----------
    coefficients
        a_0 ... a_6 in normalised time, shape (7,) [-].
    clusters
        Gives the clusters of its roots, if they are needed; found from the coefficients if None.

    Raises
    ------
    UncertifiedPlan
        The boundary conditions are singular in double precision.

    """
    kept = kept_units(rounded(coefficients).tobytes())
    for unit in kept:
        if (np.abs(unit.coefficients - coefficients) <= SAME * np.abs(coefficients)).all():
            return unit
    fastest = float(speeds(coefficients))
    if fastest <= FASTEST:
        unit = _as_series(coefficients, fastest)
    else:
        unit = by_roots(coefficients, clusters)
    # In one step: threads that come together compute the same and one of them is kept.
    kept[:] = [unit]
    return unit


@lru_cache(maxsize=UNITS_KEPT)
def kept_units(key: bytes) -> list[UnitMotion]:
    """Return the last unit motion that was found under some leading bits, if there is one."""
    del key
    return []


def _as_series(coefficients: FloatArray, speed: float) -> UnitMotion:
    """Return the unit motion of an equation that is slow enough for a series."""
    terms = terms_for(speed)
    amplitudes, cost = solved(coefficients, terms)
    total = SeriesSum(coefficients=coefficients, amplitudes=amplitudes)
    found = quality(coefficients, *probed(amplitudes))
    return _unit(coefficients, total, np.array([complex(speed)]), float(cost), found)


def by_roots(coefficients: FloatArray, clusters: Clusters | None = None) -> UnitMotion:
    """Return the unit motion of an equation as a sum of exponentials, as `unit_motion`."""
    solver = BoundarySolver(
        Spectrum(coefficients).clusters() if clusters is None else clusters(), -1.0
    )
    total = solver.total(UNIT_ENDS[:, 1])
    jet = total.at(probes(), 2 * CONDITIONS, _powers_at_probes())
    cost = float(costate(coefficients, jet[:, -2]))
    return _unit(coefficients, total, solver.rates, cost, quality(coefficients, jet, jet[2::2]))


def _unit(
    coefficients: FloatArray, total: Sum, rates: ComplexArray, cost: float, found: Quality
) -> UnitMotion:
    """Return a unit motion with its certificate."""
    return UnitMotion(
        coefficients=coefficients,
        law=SummedLaw(duration=2.0, total=total),
        rates=rates,
        boundary_residual=float(found.boundary_residual),
        optimality_residual=float(found.optimality_residual),
        costate=cost,
        peaks=found.peaks,
    )


@cache
def _powers_at_probes() -> FloatArray:
    """Return powers of x at the times of the certificate, as many as a law can have."""
    return locked(ascending_powers(probes(), SERIES_LENGTH))
