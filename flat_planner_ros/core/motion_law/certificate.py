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

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.motion_law.basis import CONDITIONS
from flat_planner_ros.core.motion_law.law import JET_ORDER
import numpy as np

PROBES = 8
"""Evenly spaced times of half a motion at which a law is certified, besides those near the end."""

PROBE_DEPTH = 36
"""Halvings of the distance to the start at which a law is certified."""

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


def peaks_of(jets: FloatArray) -> FloatArray:
    """Return the largest magnitudes of the derivatives 0 to 6 over the last axis, (..., 7)."""
    largest: FloatArray = np.abs(jets[..., : JET_ORDER + 1, :]).max(axis=-1)
    return largest


def boundary_residual(jets: FloatArray, peaks: FloatArray) -> FloatArray:
    """
    Return (31) of docs/derivation.md for unit motions.

    Parameters
    ----------
    jets
        Derivatives from 0 on at `probes`, shape (..., orders, m).
    peaks
        `peaks_of` them.

    """
    last = jets.shape[-1] - 1
    # Relative to the start, as the value's own peak is the distance.
    sizes = peaks[..., :CONDITIONS] + UNIT_ENDS[:, 1]
    miss = np.abs(jets[..., :CONDITIONS, ::last] - UNIT_ENDS) / sizes[..., None]
    worst: FloatArray = miss.max(axis=(-2, -1))
    return worst


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
