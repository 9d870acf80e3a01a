"""
Solutions of the Euler-Lagrange equation, cluster by cluster, and their derivatives at the end.

Roots that crowd together would make separate exponentials nearly dependent; such a cluster is
spanned by the solutions of its own small equation with unit initial values: an exponential times a
power series ((28) of docs/derivation.md).
"""

from cmath import exp
from functools import cache, lru_cache
from typing import NamedTuple

from flat_planner_ros.core.modes import series_derivatives
from flat_planner_ros.core.roots import Cluster
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

CONDITIONS = 6
"""Conditions at either end: the value and five derivatives."""

SERIES_LENGTH = 64
"""Terms of a cluster's power series; clusters as wide as the links allow need about fifty."""

FAR = 300.0
"""Decay from which a boundary layer leaves nothing at the other end [-]."""

ALTERNATING = (-1.0) ** np.arange(CONDITIONS)
"""Signs of the derivatives of a function run backwards."""

CENTRES_KEPT = 32
"""Solutions around zero that are remembered, mostly 1, x, x^2, x^3."""


class Block(NamedTuple):
    """
    The solutions of one parity that a cluster contributes.

    Attributes
    ----------
    growth
        How fast they grow with the order of the derivative, at least 1 [-].
    columns
        Their derivatives 0 to 5 at x = 1, a list of six numbers each.
    rate, origin
        Of their modes; those with an origin at the end have a mirror image.
    series
        Coefficients of the modes, one in each row, shape (functions, terms); None if they are the
        real and the imaginary part of one exponential.

    """

    growth: float
    columns: list[list[float]]
    rate: complex
    origin: int
    series: ComplexArray | None

    def combined(self, weights: list[float]) -> tuple[complex, ...]:
        """Return the coefficients of a combination of the solutions."""
        if self.series is None:
            return (complex(weights[0], -weights[1] if len(weights) > 1 else 0.0),)
        return tuple((np.array(weights) @ self.series).tolist())


def block_of(cluster: Cluster, parity: float) -> Block:
    """Return the solutions of one parity that a cluster contributes."""
    centre = cluster.centre
    if centre == 0.0:
        return _central(cluster.factor.real.tobytes(), parity)
    if centre.real != 0.0 and len(cluster.factor) == 2 and cluster.factor[1] == 0.0:
        return _exponentials(centre, parity)
    series = _power_series(cluster.factor)
    if centre.real == 0.0:
        # conj(f_j(-x)) = (-1)^j f_j(x): Re f_j has the parity of j, Im f_j the other one.
        even = np.arange(len(series)) % 2 == 0
        series = np.where(even == (parity > 0.0), 1.0, -1j)[:, None] * series
        ends, origin = _derivatives(centre, series, 1.0), 0
    else:
        if centre.imag != 0.0:
            series = np.concatenate([series, -1j * series])
        ends, origin = _derivatives(centre, series, 0.0), 1
        if centre.real < FAR:
            image = _derivatives(centre, series, -2.0)
            ends = ends + parity * ALTERNATING * image
    growth = max(1.0, abs(centre), _spread(cluster.factor))
    return Block(growth, ends.real.tolist(), centre, origin, series)


@lru_cache(maxsize=CENTRES_KEPT)
def _central(factor: bytes, parity: float) -> Block:
    """Return the solutions around zero; a law with fast roots has just a power or two there."""
    coefficients = np.frombuffer(factor).astype(complex)
    # The equation of this cluster is even itself: every second solution has the parity.
    series = _power_series(coefficients)[(0 if parity > 0.0 else 1) :: 2]
    columns = _derivatives(0j, series, 1.0).real.tolist()
    return Block(max(1.0, _spread(coefficients)), columns, 0j, 0, series)


def _exponentials(beta: complex, parity: float) -> Block:
    """Return exp(beta (x - 1)) with its mirror image, real and imaginary part."""
    image = parity * exp(-2.0 * beta) if beta.real < FAR else 0.0
    values, power = [], 1.0 + 0.0j
    for order in range(CONDITIONS):
        values.append(power * (1.0 - image if order % 2 else 1.0 + image))
        power *= beta
    columns = [[value.real for value in values]]
    if beta.imag == 0.0:
        return Block(abs(beta), columns, beta, 1, None)
    columns.append([value.imag for value in values])
    return Block(abs(beta), columns, beta, 1, None)


def _derivatives(rate: complex, series: ComplexArray, u: float) -> ComplexArray:
    """Return the derivatives 0 to 5 of exp(rate u) times power series at u, shape (rows, 6)."""
    powers = u ** np.arange(series.shape[1], dtype=float)
    table = series_derivatives(series, CONDITIONS - 1)  # (rows, terms, 6)
    plain = np.einsum('rtk,t->rk', table, powers)
    # Leibniz's rule, one order at a time.
    binomial = np.zeros((CONDITIONS, CONDITIONS), dtype=complex)
    binomial[0, 0] = exp(rate * u)
    for k in range(1, CONDITIONS):
        binomial[k] = rate * binomial[k - 1]
        binomial[k, 1:] += binomial[k - 1, :-1]
    result: ComplexArray = plain @ binomial.T
    return result


def _spread(factor: ComplexArray) -> float:
    """Return a bound on the distance of a factor's roots from its centre, within 2 (Fujiwara)."""
    sizes = np.abs(factor[1:]).tolist()
    return float(max(size ** (1.0 / n) for n, size in enumerate(sizes, start=1)))


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
    return np.cumprod(np.maximum(np.arange(count, dtype=float), 1.0))
