"""Quadrature over a motion: nodes that resolve boundary layers and oscillations of a law."""

from functools import cache
from math import ceil, log2

from flat_planner_ros.core.motion_law import MotionLaw
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

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


def half_quadrature(law: MotionLaw) -> tuple[FloatArray, FloatArray]:
    """
    Return Gauss-Legendre nodes and weights over the first half of a motion.

    Returns
    -------
    tuple[FloatArray, FloatArray]
        Normalised times x + 1 in (0, 1), and weights whose sum is 1, shape (m,) [-].

    """
    rates = np.array([mode.rate for mode in law.modes])
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
