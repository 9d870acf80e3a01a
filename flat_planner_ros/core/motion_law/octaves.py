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

"""Quadratures for exponentials in arrays: panels that double in width away from the start."""

from collections.abc import Iterator

from flat_planner_ros.core.arm import ComplexArray, FloatArray
from flat_planner_ros.core.motion_law.law import (
    gauss_panel,
    MIN_PANELS,
    NEGLIGIBLE_DECAY,
    RADIANS_PER_PANEL,
)
from flat_planner_ros.core.motion_law.unit_motions import IntArray
import numpy as np

COARSEST = 3
"""Halvings of half a motion that give its widest panel, one of `MIN_PANELS`."""

MAX_PARTS = 256
"""Bound on the panels in an octave."""


def octaves_for(decays: ComplexArray) -> IntArray:
    """
    Return how fine the octaves of motions have to be.

    Parameters
    ----------
    decays
        Rates of their exponentials, in units of 2 / duration, shape (p, m) [-].

    Returns
    -------
    IntArray
        How often half a motion is halved until the first panel, and the panels in an octave, a
        power of two, shape (p, 2).

    """
    sizes = np.abs(decays)
    depth = np.ceil(np.log2(sizes.max(axis=1) + 1.0)) + 1.0
    # An exponential is alive where it has not decayed yet; there it turns on every panel.
    reach = np.minimum(NEGLIGIBLE_DECAY / decays.real, 1.0 / MIN_PANELS)
    turns = (reach * sizes).max(axis=1)
    parts = np.clip(turns / RADIANS_PER_PANEL, 1.0, MAX_PARTS)
    table = np.column_stack([np.maximum(depth, COARSEST), 2.0 ** np.ceil(np.log2(parts))])
    return table.astype(np.int64)


def octaves(depth: int, parts: int) -> Iterator[tuple[float, FloatArray, FloatArray]]:
    """
    Return the panels over the first half of a motion, those of equal width together.

    Parameters
    ----------
    depth, parts
        As `octaves_for` has them.

    Returns
    -------
    Iterator[tuple[float, FloatArray, FloatArray]]
        Their width, twice that of the ones before; their starts, x + 1; weights of all their
        nodes, of sum 1 for all octaves together.

    """
    _, weights = gauss_panel()
    for level in range(depth, COARSEST - 1, -1):
        width = 0.5**level / parts
        first = 0 if level == depth else parts
        last = parts * 2**COARSEST if level == COARSEST else 2 * parts
        starts = width * np.arange(first, last)
        yield width, starts, np.tile(width * weights, len(starts))
