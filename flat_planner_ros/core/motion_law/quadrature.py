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

"""Quadrature over a motion: nodes that resolve boundary layers and oscillations of a law."""

from collections.abc import Sequence
from functools import cache
from itertools import pairwise
from math import ceil, log2

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.motion_law.law import ExponentialLaw
import numpy as np
from numpy.typing import NDArray

ComplexArray = NDArray[np.complex128]

NODES_PER_PANEL = 16
"""Gauss-Legendre nodes on each panel."""

MIN_PANELS = 8
"""Panels over half a motion whose law is slow throughout."""

RADIANS_PER_PANEL = 8.0
"""Most that a mode turns or decays on one panel; sixteen nodes then miss 1e-11 of its square."""

NEGLIGIBLE_DECAY = 18.0
"""Natural logarithm of the decay from which the square of a mode adds nothing to an integral."""

MAX_PANELS = 2048
"""Bound on the panels, reached by some thousand oscillations within one motion."""


def half_quadrature(law: ExponentialLaw) -> tuple[FloatArray, FloatArray]:
    """
    Return Gauss-Legendre nodes and weights over the first half of a motion.

    Returns
    -------
    tuple[FloatArray, FloatArray]
        Normalised times x + 1 in (0, 1), and weights whose sum is 1, shape (m,) [-].

    """
    return _half_nodes(np.array([mode.rate for mode in law.modes]))


def motion_quadrature(
    rates: ComplexArray, travel: float, edges: Sequence[float]
) -> tuple[FloatArray, FloatArray]:
    """
    Return Gauss-Legendre nodes and weights over a motion of several pieces.

    Parameters
    ----------
    rates
        Characteristic roots of its laws, in units of 2 / duration, shape (m,) [-].
    travel
        Distance that the joints cover: dynamics turn with it [rad].
    edges
        Times from start to end between which the laws are smooth [s].

    Returns
    -------
    tuple[FloatArray, FloatArray]
        Times [s], and weights whose sum is 1, shape (m,).

    """
    # A motion's peak velocity is about twice the mean one.
    rates = np.append(rates, 2j * travel)
    begin, duration = edges[0], edges[-1] - edges[0]
    times, weights = [], []
    for start, end in pairwise(edges):
        share = (end - start) / duration
        nodes, halves = _half_nodes(share * rates)
        reach = 0.5 * (end - start) * nodes
        times += [start + reach - begin, end - reach - begin]
        weights += 2 * [0.5 * share * halves]
    return np.concatenate(times), np.concatenate(weights)


def _half_nodes(rates: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """Return nodes and weights over the first half, for given roots, as `half_quadrature`."""
    depth = ceil(log2(np.abs(rates).max() + 1.0)) + 1
    # Halved towards the start as deep as layers go, even where the law is slow.
    layers = 0.5 ** np.arange(depth, 0.0, -1.0)
    edges = np.union1d(layers, np.linspace(0.0, 1.0, MIN_PANELS + 1))
    # A mode may oscillate many times within its layer: split panels that it still reaches.
    is_alive = np.multiply.outer(edges[:-1], np.abs(rates.real)) < NEGLIGIBLE_DECAY
    turns = np.diff(edges) * (is_alive * np.abs(rates)).max(axis=1)
    parts = 1.0 + np.floor(turns / RADIANS_PER_PANEL)
    counts = np.ceil(parts * min(1.0, MAX_PANELS / parts.sum())).astype(int)
    widths = np.repeat(np.diff(edges) / counts, counts)
    starts = np.cumsum(widths) - widths
    nodes, weights = _gauss()
    times = starts[:, None] + np.multiply.outer(widths, nodes)
    return times.ravel(), np.multiply.outer(widths, weights).ravel()


@cache
def _gauss() -> tuple[FloatArray, FloatArray]:
    """Return the nodes and weights of one panel from 0 to 1."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES_PER_PANEL)
    return 0.5 * (nodes + 1.0), 0.5 * weights
