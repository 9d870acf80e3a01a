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
Basis of the Euler-Lagrange equation's solutions, cluster by cluster, and its derivatives at ends.

Roots that crowd together would make separate exponentials nearly dependent; such a cluster is
spanned by the solutions of its own small equation with unit initial values: an exponential times a
power series ((28) of docs/derivation.md). From rest to rest, one parity suffices and derivatives 0
to 5 at one end.
"""

from cmath import exp
from collections.abc import Iterable, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

from flat_planner_ros.core.arm import ComplexArray, FloatArray
from flat_planner_ros.core.motion_law.roots import Cluster
from flat_planner_ros.core.motion_law.term_sum import power_factors
from flat_planner_ros.core.motion_law.terms import leibniz, Number, series_derivatives, Term
import numpy as np
from numpy.typing import NDArray

CONDITIONS = 6
"""Conditions at either end: the value and five derivatives."""

SOLUTIONS = 2 * CONDITIONS
"""Solutions of the equation, and derivatives of each that knots join: orders 0 to 11."""

SERIES_LENGTH = 64
"""Terms of a cluster's power series; clusters as wide as the links allow need about fifty."""

FAR = 300.0
"""Decay from which a boundary layer leaves nothing at the other end [-]."""

ALTERNATING = (-1.0) ** np.arange(CONDITIONS)
"""Signs of the derivatives of a function run backwards."""

CENTRES_KEPT = 32
"""Solutions around zero that are remembered, mostly 1, x, x^2, x^3."""

_FACTORIALS = np.cumprod(np.maximum(np.arange(SERIES_LENGTH, dtype=float), 1.0))

_END = np.array([1.0])

_FAR_END = np.array([-2.0])


class Solutions(NamedTuple):
    """
    Solutions that a cluster contributes, as terms.

    Attributes
    ----------
    rate, origin
        What their terms have in common; with an origin at the end they have a mirror image.
    series
        Coefficients of ascending powers, one solution in each row, shape (functions, powers); None
        if they are the real and the imaginary part of one exponential.

    """

    rate: complex
    origin: int
    series: FloatArray | ComplexArray | None

    @property
    def size(self) -> int:
        """Return how many there are, without mirror images."""
        if self.series is not None:
            return len(self.series)
        return 1 if self.rate.imag == 0.0 else 2

    def combined(self, amplitudes: list[float]) -> Term:
        """Return a combination of the solutions, without mirror images."""
        if self.series is not None:
            coefficients = tuple((np.array(amplitudes) @ self.series).tolist())
        elif len(amplitudes) == 1:
            coefficients = (complex(amplitudes[0], 0.0),)
        else:
            coefficients = (complex(amplitudes[0], -amplitudes[1]),)
        return Term(self.rate, self.origin, coefficients)


def combined(blocks: Iterable[Solutions], amplitudes: list[float]) -> list[Term]:
    """Return the term of each block in a combination of all their solutions."""
    terms = []
    first = 0
    for block in blocks:
        last = first + block.size
        terms.append(block.combined(amplitudes[first:last]))
        first = last
    return terms


class Block(NamedTuple):
    """
    The solutions of one parity that a cluster contributes, for the conditions at an end.

    Attributes
    ----------
    growth
        How fast they grow with the order of the derivative, at least 1 [-].
    columns
        Their derivatives 0 to 5 at x = 1, a list of six numbers each.
    solutions
        The solutions; those with an origin at the end without their mirror images.
    powers
        Of those around zero, factors of ascending powers in the derivatives 0 to 12, shape
        (functions, 13, terms); None for others.

    """

    growth: float
    columns: list[list[float]]
    solutions: Solutions
    powers: FloatArray | None = None


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
        is_odd = np.arange(len(table)) % 2
        table = np.where(is_odd == _lowest_power(parity), 1.0, -1j)[:, None] * table
        series = table / _FACTORIALS
        origin = 0
        [ends] = _derivatives(centre, series, _END, CONDITIONS - 1)
    else:
        if centre.imag != 0.0:
            table = np.concatenate([table, -1j * table])
        series = table / _FACTORIALS
        origin = 1
        ends = table[:, :CONDITIONS] @ leibniz(centre, CONDITIONS - 1).T
        if centre.real < FAR:
            [image] = _derivatives(centre, series, _FAR_END, CONDITIONS - 1)
            ends = ends + parity * ALTERNATING * image
    growth = max(1.0, growth_of(cluster))
    return Block(growth, ends.real.tolist(), Solutions(centre, origin, series))


def growth_of(cluster: Cluster) -> float:
    """Return how fast a cluster's solutions grow with the order of the derivative [-]."""
    return max(abs(cluster.centre), _spread(cluster.factor))


@lru_cache(maxsize=CENTRES_KEPT)
def _central(factor: bytes, parity: float) -> Block:
    """Return the solutions around zero; a law with fast roots has just a power or two there."""
    # The equation is even itself: from one power to the next but one it is of half the degree.
    even = np.frombuffer(factor)
    terms = np.zeros((len(even) // 2, SERIES_LENGTH))
    half = unit_solutions(even[::2], SERIES_LENGTH // 2)
    terms[:, _lowest_power(parity) :: 2] = half
    last = np.flatnonzero(terms.any(axis=0))[-1]
    series = terms[:, : last + 1] / _FACTORIALS[: last + 1]
    columns = series_derivatives(series, CONDITIONS - 1).sum(axis=1).tolist()
    growth = max(1.0, _spread(even))
    return Block(growth, columns, Solutions(0j, 0, series), power_factors(series))


def _exponentials(beta: complex, parity: float) -> Block:
    """Return exp(beta (x - 1)) with its mirror image, real and imaginary part."""
    image = parity * exp(-2.0 * beta) if beta.real < FAR else 0.0
    sums = (1.0 + image, 1.0 - image)
    values = []
    power = 1.0 + 0.0j
    for order in range(CONDITIONS):
        values.append(power * sums[order % 2])
        power *= beta
    columns = [[value.real for value in values]]
    if beta.imag == 0.0:
        return Block(abs(beta), columns, Solutions(beta, 1, None))
    columns.append([value.imag for value in values])
    return Block(abs(beta), columns, Solutions(beta, 1, None))


def _lowest_power(parity: float) -> int:
    """Return the lowest power of x that has a parity."""
    return 0 if parity > 0.0 else 1


def _derivatives(
    rate: complex, series: NDArray[Number], places: FloatArray, order: int
) -> list[ComplexArray]:
    """Return the derivatives of exp(rate u) times power series at each u, (functions, orders)."""
    powers = places[:, None] ** np.arange(series.shape[1], dtype=float)
    plain = powers @ series_derivatives(series, order)  # (functions, places, orders)
    factors = leibniz(rate, order).T
    return [exp(rate * u) * plain[:, i] @ factors for i, u in enumerate(places.tolist())]


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


def row_factors(rates: Sequence[float]) -> FloatArray:
    """
    Return factors of the conditions after which each solution is largest in its own one.

    The k-th derivative of a solution grows like its rate to the power k. With rates b in ascending
    order and factors e_k / e_(k-1) = 1 / sqrt(b_(k-1) b_k), entry e_k b_i^k is largest at k = i:
    fast solutions meet the high derivatives and slow ones the low, whatever their rates.
    """
    factors = [1.0]
    for slow, fast in pairwise(rates):
        factors.append(factors[-1] / (slow * fast) ** 0.5)
    return np.array(factors)
