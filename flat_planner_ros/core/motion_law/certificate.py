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

"""How well laws from rest to rest over one unit of distance meet their ends and equation."""

from functools import cache
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.motion_law.basis import CONDITIONS
from flat_planner_ros.core.motion_law.law import JET_ORDER
import numpy as np

PROBES = 8
"""Evenly spaced times of half a motion at which a law is certified, besides those near the end."""

PROBE_DEPTH = 36
"""Halvings of the distance to the start at which a law is certified."""

SAME = 2.0**-49
"""Relative difference up to which coefficients count as equal; at most this adds to (32) [-]."""

UNIT_ENDS = np.multiply.outer(np.eye(CONDITIONS)[0], [-0.5, 0.5])
"""Derivatives 0 to 5 of a unit motion at its ends, shape (6, 2) [-]."""


@cache
def probes(depth: int = PROBE_DEPTH) -> FloatArray:
    """
    Return x + 1 and 1 - x at times that crowd towards the start as fast as boundary layers can.

    They run from 0 to 1, as one half of a motion has enough; the last one is the end, 2.

    Parameters
    ----------
    depth
        Halvings of the distance to the start.

    """
    layers = 0.5 ** np.arange(0.0, depth + 1.0)
    times = np.union1d(layers, np.linspace(0.0, 1.0, PROBES + 1))
    times = np.append(times, 2.0)
    return np.array([times, 2.0 - times])


class Quality(NamedTuple):
    """
    Of unit motions, or of one.

    Attributes
    ----------
    boundary_residual, optimality_residual
        (31) and (32), or (32a), of docs/derivation.md, the latter at most, for all coefficients
        that count as equal, shape (...).
    peaks
        Largest magnitudes of the derivatives 0 to 6 at the times of the certificate, (..., 7).

    """

    boundary_residual: FloatArray
    optimality_residual: FloatArray
    peaks: FloatArray


def quality(coefficients: FloatArray, jets: FloatArray, parts: FloatArray) -> Quality:
    """
    Return how well unit motions meet their ends and equations.

    Parameters
    ----------
    coefficients
        a_0 ... a_6 of their equations, shape (..., 7).
    jets
        Derivatives from 0 on, the sixth among them, at `probes`, shape (..., orders, m).
    parts
        What adds up to zero there with the factors a_1 ... a_6, shape (..., 6, m).

    """
    peaks = np.abs(jets[..., : JET_ORDER + 1, :]).max(axis=-1)
    last = jets.shape[-1] - 1
    # Relative to the start, as the value's own peak is the distance.
    sizes = peaks[..., :CONDITIONS] + UNIT_ENDS[:, 1]
    miss = np.abs(jets[..., :CONDITIONS, ::last] - UNIT_ENDS) / sizes[..., None]
    return Quality(
        boundary_residual=miss.max(axis=(-2, -1)),
        optimality_residual=relative_sum(coefficients[..., 1:], parts) + SAME,
        peaks=peaks,
    )


def relative_sum(factors: FloatArray, terms: FloatArray) -> FloatArray:
    """
    Return how far terms are from adding up to zero, relative to the largest magnitudes.

    Parameters
    ----------
    factors
        Of the terms, shape (..., n).
    terms
        At some times, shape (..., n, m).

    Returns
    -------
    FloatArray
        Zero where there are no terms at all, shape (...) [-].

    """
    rows = factors[..., None, :]
    sums = np.abs(rows @ terms).max(axis=(-2, -1))
    sizes = (np.abs(rows) @ np.abs(terms)).max(axis=(-2, -1))
    relative: FloatArray = sums / np.where(sizes > 0.0, sizes, 1.0)
    return relative
