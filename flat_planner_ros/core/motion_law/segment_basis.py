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
Basis of a segment: the twelve solutions of the Euler-Lagrange equation between two via points.

Unlike a whole motion from rest to rest, a segment meets no condition at its ends by itself; its
neighbours share them. What the coupling needs are the derivatives of every solution at both ends,
up to the eleventh ((V4) of docs/derivation.md).
"""

from cmath import exp
from dataclasses import dataclass
from functools import lru_cache

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.motion_law.basis import ALTERNATING, Block, block_of, CONDITIONS
from flat_planner_ros.core.motion_law.modes import leibniz, Mode, series_derivatives
from flat_planner_ros.core.motion_law.roots import Spectrum
import numpy as np

SOLUTIONS = 2 * CONDITIONS
"""Solutions of the equation, and derivatives of each that are coupled: orders 0 to 11."""

BASES_KEPT = 256
"""Bases that are remembered: those of several paths of fifty via points."""

SPECTRA_KEPT = 64
"""Sets of roots that are remembered, one for each combination of arm and cost."""

_ENDS = np.array([-1.0, 1.0])

_MIRRORED = np.tile(ALTERNATING, 2)

_ALONE = np.array([[1.0 + 0.0j], [-1j]])
"""Series of one exponential: its real and its imaginary part."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SegmentBasis:
    """
    Solutions on a segment, in normalised time x from -1 to 1.

    Attributes
    ----------
    groups
        Blocks of solutions, each with whether its mirror image is meant; columns below follow
        this order.
    at_start, at_end
        Derivatives 0 to 11 of every solution at x = -1 and x = 1, shape (12, 12) [-].
    rates
        How fast solutions of one parity grow with the order of the derivative, ascending, at
        least 1, shape (6,) [-].

    """

    groups: tuple[tuple[Block, bool], ...]
    at_start: FloatArray
    at_end: FloatArray
    rates: FloatArray

    def modes(self, weights: FloatArray) -> tuple[Mode, ...]:
        """Return the modes of a combination of the solutions, shape of the weights (12,)."""
        modes, first, numbers = [], 0, weights.tolist()
        for block, is_image in self.groups:
            last = first + len(block.columns)
            mode = Mode(block.rate, block.origin, block.combined(numbers[first:last]))
            modes.append(mode.mirrored(1.0) if is_image else mode)
            first = last
        return tuple(modes)


@lru_cache(maxsize=BASES_KEPT)
def segment_basis(key: bytes, reference: bytes) -> SegmentBasis:
    """
    Return the solutions of an equation.

    Parameters
    ----------
    key
        The bytes of the coefficients a_0 ... a_6 in normalised time.
    reference
        The same in another unit of time, common to all segments of a path: in it the roots are
        found.

    """
    scale = _scale(np.frombuffer(key), np.frombuffer(reference))
    found = sorted(_spectrum(reference).clusters(scale), key=lambda cluster: abs(cluster.centre))
    groups: list[tuple[Block, bool]] = []
    rates: list[float] = []
    starts, ends = [], []
    for cluster in found:
        even = block_of(cluster, 1.0)
        rates += [even.growth] * len(even.columns)
        if even.origin == 0:
            for block in (even, block_of(cluster, -1.0)):
                groups.append((block, False))
                at_start, at_end = _derivatives(block, _ENDS)
                starts.append(at_start)
                ends.append(at_end)
            continue
        far, near = _derivatives(even, _ENDS - 1.0)
        # Each solution by itself, not odd and even ones: a boundary layer stays at its own end.
        groups += [(even, False), (even, True)]
        starts += [far, _MIRRORED * near]
        ends += [near, _MIRRORED * far]
    return SegmentBasis(
        groups=tuple(groups),
        at_start=np.concatenate(starts).T,
        at_end=np.concatenate(ends).T,
        rates=np.array(sorted(rates)),
    )


@lru_cache(maxsize=SPECTRA_KEPT)
def _spectrum(reference: bytes) -> Spectrum:
    """Return the roots of an equation in its reference unit of time."""
    return Spectrum(np.frombuffer(reference))


def _scale(coefficients: FloatArray, reference: FloatArray) -> float:
    """Return the roots of an equation in units of those of the reference."""
    # The lowest coefficient carries the highest power of the unit, and least of its rounding.
    lowest = int(np.flatnonzero(reference)[0])
    if lowest == CONDITIONS:
        return 1.0
    ratio = float(coefficients[lowest] / reference[lowest])
    return float(ratio ** (0.5 / (CONDITIONS - lowest)))


def _derivatives(block: Block, places: FloatArray) -> list[FloatArray]:
    """Return derivatives 0 to 11 of a block's solutions at distances from their origin."""
    series = _ALONE[: len(block.columns)] if block.series is None else block.series
    powers = places[:, None] ** np.arange(series.shape[1])
    plain = powers @ series_derivatives(series, SOLUTIONS - 1)  # (functions, places, 12)
    factors = leibniz(block.rate, SOLUTIONS - 1).T
    return [
        (exp(block.rate * u) * plain[:, i] @ factors).real for i, u in enumerate(places.tolist())
    ]
