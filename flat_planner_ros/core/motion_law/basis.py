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
Solutions of the Euler-Lagrange equation, cluster by cluster, and their derivatives at the end.

Roots that crowd together would make separate exponentials nearly dependent; such a cluster is
spanned by the solutions of its own small equation with unit initial values: an exponential times a
power series ((28) of docs/derivation.md).
"""

from cmath import exp
from functools import cache, lru_cache
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.motion_law.modes import leibniz, Number, series_derivatives
from flat_planner_ros.core.motion_law.roots import Cluster
import numpy as np
from numpy.typing import NDArray

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
    series: FloatArray | ComplexArray | None

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
    table = unit_solutions(cluster.factor, SERIES_LENGTH)
    if centre.real == 0.0:
        # conj(f_j(-x)) = (-1)^j f_j(x): Re f_j has the parity of j, Im f_j the other one.
        even = np.arange(len(table)) % 2 == 0
        table = np.where(even == (parity > 0.0), 1.0, -1j)[:, None] * table
        series, origin = table / _factorials(SERIES_LENGTH), 0
        ends = _derivatives(centre, series, 1.0)
    else:
        if centre.imag != 0.0:
            table = np.concatenate([table, -1j * table])
        series, origin = table / _factorials(SERIES_LENGTH), 1
        ends = table[:, :CONDITIONS] @ leibniz(centre, CONDITIONS - 1).T
        if centre.real < FAR:
            ends = ends + parity * ALTERNATING * _derivatives(centre, series, -2.0)
    growth = max(1.0, abs(centre), _spread(cluster.factor))
    return Block(growth, ends.real.tolist(), centre, origin, series)


@lru_cache(maxsize=CENTRES_KEPT)
def _central(factor: bytes, parity: float) -> Block:
    """Return the solutions around zero; a law with fast roots has just a power or two there."""
    # The equation is even itself: from one power to the next but one it is of half the degree.
    even = np.frombuffer(factor)
    terms = np.zeros((len(even) // 2, SERIES_LENGTH))
    half = unit_solutions(even[::2], SERIES_LENGTH // 2)
    terms[:, (0 if parity > 0.0 else 1) :: 2] = half
    last = np.flatnonzero(terms.any(axis=0))[-1]
    series = terms[:, : last + 1] / _factorials(SERIES_LENGTH)[: last + 1]
    columns = series_derivatives(series, CONDITIONS - 1).sum(axis=1).tolist()
    return Block(max(1.0, _spread(even)), columns, 0j, 0, series)


def _exponentials(beta: complex, parity: float) -> Block:
    """Return exp(beta (x - 1)) with its mirror image, real and imaginary part."""
    image = parity * exp(-2.0 * beta) if beta.real < FAR else 0.0
    sums, values, power = (1.0 + image, 1.0 - image), [], 1.0 + 0.0j
    for order in range(CONDITIONS):
        values.append(power * sums[order % 2])
        power *= beta
    columns = [[value.real for value in values]]
    if beta.imag == 0.0:
        return Block(abs(beta), columns, beta, 1, None)
    columns.append([value.imag for value in values])
    return Block(abs(beta), columns, beta, 1, None)


def _derivatives(rate: complex, series: ComplexArray, u: float) -> ComplexArray:
    """Return the derivatives 0 to 5 of exp(rate u) times power series at u, shape (rows, 6)."""
    table = series_derivatives(series, CONDITIONS - 1)  # (rows, terms, 6)
    powers = u ** np.arange(series.shape[1], dtype=float)
    result: ComplexArray = exp(rate * u) * (powers @ table) @ leibniz(rate, CONDITIONS - 1).T
    return result


def _spread(factor: NDArray[Number]) -> float:
    """Return a bound on the distance of a factor's roots from its centre, within 2 (Fujiwara)."""
    sizes = np.abs(factor[1:]).tolist()
    return float(max(size ** (1.0 / n) for n, size in enumerate(sizes, start=1)))


def unit_solutions(factor: NDArray[Number], terms: int) -> NDArray[Number]:
    """
    Return the derivatives at 0 of the solutions of an equation with unit initial values.

    Parameters
    ----------
    factor
        Monic characteristic polynomial, descending, shape (m + 1,).
    terms
        Derivatives wanted, more than m.

    Returns
    -------
    NDArray
        Row j: the solution whose j-th derivative is 1 and all others below m are zero, shape
        (m, terms).

    """
    size = len(factor) - 1
    table = np.zeros((size, terms), dtype=factor.dtype)
    table[:, :size] = np.eye(size)
    if not factor[1:].any():
        return table
    table[:, size] = -factor[:0:-1]
    known = size + 1
    while known < terms:
        # The equation shifts with time: m derivatives in a row begin a known solution each.
        shift = known - size
        more = min(known, terms - shift)
        table[:, known : shift + more] = table[:, shift:known] @ table[:, size:more]
        known = shift + more
    return table


@cache
def _factorials(count: int) -> FloatArray:
    """Return 0! ... (count - 1)!."""
    return np.cumprod(np.maximum(np.arange(count, dtype=float), 1.0))
