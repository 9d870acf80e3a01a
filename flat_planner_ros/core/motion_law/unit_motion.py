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
Unit motion: the certified optimal law from -1/2 to 1/2 in normalised time.

From rest to rest, everything about a law but its size, place and duration follows from the six
normalised coefficients of its equation (docs/derivation.md, (23)). Unit motions are therefore
computed once and kept: other distances, and other arms with the same numbers, are multiples.
"""

from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.motion_law.basis import CONDITIONS
from flat_planner_ros.core.motion_law.extremal import (
    costate,
    stationarity_residual,
    unit_modes,
)
from flat_planner_ros.core.motion_law.law import ExponentialLaw
from flat_planner_ros.core.motion_law.quadrature import half_quadrature
import numpy as np

JET_ORDER = 6
"""Highest derivative of the planned variable that joint motions and the flat plan need."""

PROBES = 8
"""Evenly spaced times of half a motion at which a law is certified, besides those near the end."""

PROBE_DEPTH = 36
"""Halvings of the distance to the start at which a law is certified."""

KEY_BITS = 48
"""
Leading bits of the normalised coefficients under which a unit motion is kept.

Coefficients are computed with errors of a few units in their last, 53rd bit. What is left of them
differs for equal numbers of two arms only where such an error crosses a multiple of 2^-48.
"""

SAME = 2.0**-49
"""Relative difference up to which coefficients count as equal; at most this adds to (32) [-]."""

UNITS_KEPT = 64
"""Unit motions in the cache; the one unused for longest makes room."""

GRIDS_KEPT = 32
"""Sampled unit motions in the cache."""

MAX_KEPT_INTERVALS = 10_000
"""Longest grid that is kept; with `GRIDS_KEPT` it bounds the caches to 24 MB."""


_ENDS = np.multiply.outer(np.eye(CONDITIONS)[0], [-0.5, 0.5])


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
    law: ExponentialLaw
    boundary_residual: float
    optimality_residual: float
    costate: float
    peaks: FloatArray

    def jet(self, after_start: FloatArray, before_end: FloatArray) -> FloatArray:
        """Return the derivatives 0 to 6 at x + 1 and 1 - x, shape (7, m)."""
        return self.law.terms.at(np.array([after_start, before_end]), JET_ORDER)

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
        self.law.terms.fill_odd_grid(table, rates)
        table[1:CONDITIONS, 0] = table[1:CONDITIONS, -1] = 0.0
        table[0, 0], table[0, -1] = -0.5 * rates[0], 0.5 * rates[0]

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
        odd, even = rows[:, 2::2] @ jet[2::2], rows[:, 1::2] @ jet[1::2]
        return Mean((odd**2 + even**2) @ weights, (np.abs(odd) + np.abs(even)).max(axis=1))

    @cached_property
    def _fine(self) -> tuple[FloatArray, FloatArray]:
        """Return weights and derivatives at the nodes of a quadrature of the first half."""
        times, weights = half_quadrature(self.law)
        return weights, self.jet(times, 2.0 - times)


def rounded(coefficients: FloatArray) -> FloatArray:
    """Return numbers to `KEY_BITS` leading bits, by Dekker's splitting."""
    shifted = coefficients * (2.0 ** (53 - KEY_BITS) + 1.0)
    result: FloatArray = shifted - (shifted - coefficients)
    return result


def unit_motion(coefficients: FloatArray) -> UnitMotion:
    """
    Return the unit motion of an equation, one that is known if its numbers are the same.

    Parameters
    ----------
    coefficients
        a_0 ... a_6 in normalised time, shape (7,) [-].

    Raises
    ------
    UncertifiedPlan
        The boundary conditions are singular in double precision.

    """
    kept = kept_units(rounded(coefficients).tobytes())
    for unit in kept:
        if (np.abs(unit.coefficients - coefficients) <= SAME * np.abs(coefficients)).all():
            return unit
    unit = _certified(coefficients)
    # In one step: threads that come together compute the same and one of them is kept.
    kept[:] = [unit]
    return unit


@lru_cache(maxsize=UNITS_KEPT)
def kept_units(key: bytes) -> list[UnitMotion]:
    """Return the last unit motion that was found under some leading bits, if there is one."""
    del key
    return []


def _certified(coefficients: FloatArray) -> UnitMotion:
    """Return a unit motion with its residuals."""
    law = ExponentialLaw(duration=2.0, modes=unit_modes(coefficients))
    jet = law.terms.at(probes(), 2 * CONDITIONS)
    peaks = np.abs(jet[: JET_ORDER + 1]).max(axis=1)
    # Relative to the start, as the value's own peak is the distance.
    ends, sizes = jet[:CONDITIONS, :: jet.shape[1] - 1], peaks[:CONDITIONS] + _ENDS[:, 1]
    miss = np.abs(ends - _ENDS) / sizes[:, None]
    return UnitMotion(
        coefficients=coefficients,
        law=law,
        boundary_residual=float(miss.max()),
        optimality_residual=stationarity_residual(coefficients, jet) + SAME,
        costate=float(costate(coefficients, jet[:, -2])),
        peaks=peaks,
    )


@cache
def probes() -> FloatArray:
    """
    Return x + 1 and 1 - x at times that crowd towards the start as fast as boundary layers can.

    Those from 0 to 1, of which one half of a motion has enough, and last the end, 2.
    """
    layers = 0.5 ** np.arange(0.0, PROBE_DEPTH + 1.0)
    times = np.union1d(layers, np.linspace(0.0, 1.0, PROBES + 1))
    times = np.append(times, 2.0)
    return np.array([times, 2.0 - times])
