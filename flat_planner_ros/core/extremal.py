"""
Extremals of a quadratic cost: the Euler-Lagrange equation solved for given ends.

The equation has constant coefficients and only even derivatives, sum_k a_k y^(2k) = 0, so its
solutions split into odd and even ones about the middle of the motion and its roots come as +-beta
(docs/derivation.md, section 5). Roots that crowd together would make separate exponentials nearly
dependent; such a cluster is spanned by the solutions of its own small equation with unit initial
values: an exponential times a power series. One root alone gives the paper's exponential, a
multiple root an exponential times a polynomial, and twelve roots near zero the polynomial law: one
mechanism without a special case.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

from flat_planner_ros.core.errors import UncertifiedPlan
from flat_planner_ros.core.motion_law import Mode, MotionLaw, normalised_jet
from flat_planner_ros.core.roots import Cluster, clusters
import numpy as np
from numpy.typing import NDArray
from scipy.special import factorial

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

CONDITIONS = 6
"""Conditions at either end: the value and five derivatives."""

SERIES_LENGTH = 64
"""Terms of a cluster's power series; clusters as wide as the links allow need about fifty."""

EQUILIBRATIONS = 12
"""Sweeps that scale rows and columns of the boundary conditions to unit size."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Jets:
    """
    Value and five derivatives at both ends.

    Attributes
    ----------
    start, end
        Derivatives of orders 0 to 5, shape (6,) [rad/s^k].

    """

    start: FloatArray
    end: FloatArray


def extremal(coefficients: FloatArray, duration: float, jets: Jets) -> MotionLaw:
    """
    Return the stationary motion law with given ends.

    Parameters
    ----------
    coefficients
        a_0 ... a_6 of the Euler-Lagrange equation in physical time, as given by
        `QuadraticCost.characteristic`, shape (7,) [s^(2k - 12)].
    duration
        Length of the motion [s].
    jets
        What the law must meet.

    Raises
    ------
    UncertifiedPlan
        The boundary conditions are singular in double precision.

    """
    half = 0.5 * duration
    powers = half ** np.arange(CONDITIONS, dtype=float)
    start, end = jets.start * powers, jets.end * powers
    alternating = (-1.0) ** np.arange(CONDITIONS)
    found = clusters(coefficients * half ** (2.0 * np.arange(CONDITIONS, -1, -1)))
    middle = 0.5 * (jets.start[0] + jets.end[0])
    modes = [Mode(rate=0j, origin=0, coefficients=np.array([complex(middle)]))]
    for parity in (-1.0, 1.0):
        # Right-hand side of the law's odd or even part about the middle, at the end x = 1.
        target = 0.5 * (end + parity * alternating * start)
        target[0] -= middle if parity > 0.0 else 0.0
        if target.any():
            modes.extend(_fitted(_basis(found, parity), target))
    return MotionLaw(duration=duration, modes=tuple(modes))


def euler_lagrange_residual(coefficients: FloatArray, law: MotionLaw, t: FloatArray) -> float:
    """
    Return how far a law is from stationary.

    Returns
    -------
    float
        Largest |sum_k a_k y^(2k)| over the times, relative to the largest sum of the terms'
        magnitudes [-].

    """
    orders = 2 * np.flatnonzero(coefficients)
    terms = coefficients[orders // 2, None] * law.jet(t, 2 * CONDITIONS)[orders]
    size = np.abs(terms).sum(axis=0).max()
    return float(np.abs(terms.sum(axis=0)).max() / size) if size > 0.0 else 0.0


def conserved_momentum(coefficients: FloatArray, law: MotionLaw, t: FloatArray) -> FloatArray:
    """
    Return the first integral -sum_k a_k y^(2k - 1) of the Euler-Lagrange equation.

    Constant along an extremal; times the distance it is the cost of a rest-to-rest motion
    ((35) of docs/derivation.md), shape of t.

    """
    orders = 2 * np.arange(1, CONDITIONS + 1) - 1
    momentum: FloatArray = -coefficients[1:] @ law.jet(t, orders[-1])[orders]
    return momentum


Function = tuple[Mode, ...]
"""One odd or even solution: a mode, with its mirror image unless it is symmetric by itself."""


def _basis(found: Sequence[Cluster], parity: float) -> list[Function]:
    """Return six independent solutions of one parity, slow ones first."""
    ordered = sorted(found, key=lambda cluster: abs(cluster.centre))
    return [f for cluster in ordered for f in _functions(cluster, parity)]


def _functions(cluster: Cluster, parity: float) -> list[Function]:
    """Return the solutions of one parity that a cluster contributes."""
    centre = cluster.centre
    if centre == 0.0:
        # The equation of this cluster is even itself: every second solution has the parity.
        table = _power_series(cluster.factor)[(0 if parity > 0.0 else 1) :: 2]
        return [(Mode(rate=0j, origin=0, coefficients=row),) for row in table]
    table = _power_series(cluster.factor)
    if centre.real == 0.0:
        # conj(f_j(-x)) = (-1)^j f_j(x): Re f_j has the parity of j, Im f_j the other one.
        even = np.arange(len(table)) % 2 == 0
        factors = np.where(even == (parity > 0.0), 1.0, -1j)
        rows = factors[:, None] * table
        return [(Mode(rate=centre, origin=0, coefficients=row),) for row in rows]
    if centre.imag != 0.0:
        table = np.concatenate([table, -1j * table]).astype(complex)
    modes = [Mode(rate=centre, origin=1, coefficients=row) for row in table]
    return [(mode, mode.mirrored(parity)) for mode in modes]


def _power_series(factor: ComplexArray) -> ComplexArray:
    """
    Return the solutions of a cluster's own equation as power series.

    Parameters
    ----------
    factor
        Monic characteristic polynomial, descending, shape (m + 1,).

    Returns
    -------
    ComplexArray
        Row j has its j-th derivative 1 and all others below m zero at 0, shape (m, terms).

    """
    size = len(factor) - 1
    table = np.zeros((size, SERIES_LENGTH), dtype=complex)
    table[:, :size] = np.eye(size)
    tail = -factor[:0:-1]
    if tail.any():
        for k in range(size, SERIES_LENGTH):
            table[:, k] = table[:, k - size : k] @ tail
    else:
        table = table[:, :size]
    return np.asarray(table / _factorials(table.shape[1]), dtype=complex)


@cache
def _factorials(count: int) -> FloatArray:
    """Return 0! ... (count - 1)!."""
    return np.asarray(factorial(np.arange(count)), dtype=float)


def _fitted(basis: Sequence[Function], target: FloatArray) -> list[Mode]:
    """Return the modes of the combination of a basis that meets a jet at x = 1."""
    end = (np.array([2.0]), np.array([0.0]))
    matrix = np.array([normalised_jet(f, *end, CONDITIONS - 1)[:, 0] for f in basis]).T
    rows, columns = _equilibration(matrix)
    try:
        scaled = np.linalg.solve(rows[:, None] * matrix * columns, rows * target)
    except np.linalg.LinAlgError as error:
        raise UncertifiedPlan('boundary residual', np.inf, 0.0) from error
    weights = columns * scaled
    return [
        mode.scaled(weight)
        for weight, function in zip(weights, basis, strict=True)
        for mode in function
    ]


def _equilibration(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return row and column factors: fast and slow modes differ by powers of their rates."""
    rows, columns = np.ones(len(matrix)), np.ones(len(matrix))
    size = np.abs(matrix)
    columns = 1.0 / size.max(axis=0)
    for _ in range(EQUILIBRATIONS):
        rows = rows / np.sqrt((rows[:, None] * size * columns).max(axis=1))
        columns = columns / np.sqrt((rows[:, None] * size * columns).max(axis=0))
    return rows, columns
