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
to 5 at one end. A segment between via points needs all twelve solutions, with derivatives up to
the eleventh at both ends, since neighbours share the conditions there ((V4)).
"""

from cmath import exp
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

from flat_planner_ros.core.arm import ComplexArray, FloatArray
from flat_planner_ros.core.motion_law.roots import Cluster, Spectrum
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

BASES_KEPT = 256
"""Bases that are remembered: those of several paths of fifty via points."""

SPECTRA_KEPT = 64
"""Sets of roots that are remembered, one for each combination of arm and cost."""

_FACTORIALS = np.cumprod(np.maximum(np.arange(SERIES_LENGTH, dtype=float), 1.0))

_END = np.array([1.0])

_FAR_END = np.array([-2.0])

_PLACES = np.array([-1.0, 0.0, 1.0])

_MIRRORED = np.tile(ALTERNATING, 2)

_ALONE = np.array([[1.0 + 0.0j], [-1j]])
"""Series of one exponential: its real and its imaginary part."""


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
        What their terms have in common; with an origin at the end they have a mirror image.
    series
        Coefficients of ascending powers, one solution in each row, shape (functions, powers); None
        if they are the real and the imaginary part of one exponential.

    """

    growth: float
    columns: list[list[float]]
    rate: complex
    origin: int
    series: FloatArray | ComplexArray | None

    def combined(self, amplitudes: list[float]) -> Term:
        """Return a combination of the solutions, without mirror images."""
        if self.series is not None:
            coefficients = tuple((np.array(amplitudes) @ self.series).tolist())
        elif len(amplitudes) == 1:
            coefficients = (complex(amplitudes[0], 0.0),)
        else:
            coefficients = (complex(amplitudes[0], -amplitudes[1]),)
        return Term(self.rate, self.origin, coefficients)


def combined(blocks: Iterable[Block], amplitudes: list[float]) -> list[Term]:
    """Return the term of each block in a combination of all their solutions."""
    terms = []
    first = 0
    for block in blocks:
        last = first + len(block.columns)
        terms.append(block.combined(amplitudes[first:last]))
        first = last
    return terms


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
    growth = max(1.0, abs(centre), _spread(cluster.factor))
    return Block(growth, ends.real.tolist(), centre, origin, series)


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
    return Block(max(1.0, _spread(even)), columns, 0j, 0, series)


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
        return Block(abs(beta), columns, beta, 1, None)
    columns.append([value.imag for value in values])
    return Block(abs(beta), columns, beta, 1, None)


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


@dataclass(frozen=True, kw_only=True, eq=False)
class SegmentBasis:
    """
    Solutions on a segment, in normalised time x from -1 to 1.

    Attributes
    ----------
    groups
        Blocks of solutions, each with whether its mirror image is meant; columns below follow
        this order.
    at_start, at_middle, at_end
        Derivatives 0 to 11 of every solution at x = -1, 0 and 1, shape (12, 12) [-].
    rates
        How fast solutions of one parity grow with the order of the derivative, ascending, at
        least 1, shape (6,) [-].

    """

    groups: tuple[tuple[Block, bool], ...]
    at_start: FloatArray
    at_middle: FloatArray
    at_end: FloatArray
    rates: FloatArray

    def combined(self, amplitudes: FloatArray) -> tuple[Term, ...]:
        """Return the terms of a combination of the solutions, amplitudes of shape (12,)."""
        terms = combined((block for block, _ in self.groups), amplitudes.tolist())
        return tuple(
            term.mirrored(1.0) if is_image else term
            for term, (_, is_image) in zip(terms, self.groups, strict=True)
        )


@lru_cache(maxsize=BASES_KEPT)
def segment_basis(key: bytes, reference: bytes) -> SegmentBasis:
    """
    Return the solutions of an equation.

    Parameters
    ----------
    key
        The bytes of the coefficients a_0 ... a_6 in normalised time.
    reference
        These coefficients in another unit of time, common to all segments of a path: in it the
        roots are found.

    """
    scale = _scale(np.frombuffer(key), np.frombuffer(reference))
    found = sorted(_spectrum(reference).clusters(scale), key=lambda cluster: abs(cluster.centre))
    groups: list[tuple[Block, bool]] = []
    rates: list[float] = []
    places: list[FloatArray] = []
    for cluster in found:
        even = block_of(cluster, 1.0)
        rates += [even.growth] * len(even.columns)
        if even.origin == 0:
            for block in (even, block_of(cluster, -1.0)):
                groups.append((block, False))
                places.append(_derivatives_at(block, _PLACES))
            continue
        found_at = _derivatives_at(even, _PLACES - 1.0)
        # Each solution by itself, not odd and even ones: a boundary layer stays at its own end.
        groups += [(even, False), (even, True)]
        places += [found_at, _MIRRORED * found_at[::-1]]
    at_start, at_middle, at_end = np.concatenate(places, axis=1).swapaxes(1, 2)
    return SegmentBasis(
        groups=tuple(groups),
        at_start=at_start,
        at_middle=at_middle,
        at_end=at_end,
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


def _derivatives_at(block: Block, places: FloatArray) -> FloatArray:
    """Return derivatives 0 to 11 of solutions at distances from their origin, (m, columns, 12)."""
    series = _ALONE[: len(block.columns)] if block.series is None else block.series
    return np.real(_derivatives(block.rate, series, places, SOLUTIONS - 1))


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
