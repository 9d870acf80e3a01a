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
Characteristic roots of an even equation, grouped into clusters of nearly equal ones.

With z = beta^2 the characteristic polynomial has degree six. Its roots may differ by twenty orders
of magnitude and may be multiple, so each is refined on its own scale: a root by itself by Newton's
method, a cluster as one factor of the polynomial, which stays well conditioned where its members
do not (docs/derivation.md, section 5).
"""

from cmath import sqrt
from collections.abc import Iterable, Sequence
from functools import cache, cached_property
from math import inf
from typing import NamedTuple

from flat_planner_ros.core.arm import ComplexArray, FloatArray, locked
from flat_planner_ros.core.motion_law.terms import Number
import numpy as np
from numpy.typing import NDArray

BoolArray = NDArray[np.bool_]

APART = b''
"""Grouping in which each root is a cluster of its own."""

LINK = 2.5
"""Roots beta closer than this, in units of 2 / duration, share a cluster [-]."""

RELATIVE_LINK = 0.3
"""Roots beta closer than this share of their decay rate also share a cluster [-]."""

PAIR_LINK = 0.1
"""Two roots alone may come as close as this and still be told apart at a loss of one digit [-]."""

PAIR_RELATIVE_LINK = 0.02
"""Such a distance as a share of their modulus, which bounds the loss in the roots [-]."""

REFINEMENTS = 3
"""Most Newton steps on a factor; each about squares the error of the companion eigenvalues."""

MAX_STEPS = 8
"""Newton steps on a root by itself, which stop earlier once they have converged."""

CONVERGED = 1e-9
"""Relative step whose square is far below the last digit: the step after it changes nothing."""


class Cluster(NamedTuple):
    """
    Roots that the solver treats together, one representative of +-beta and conjugates.

    Attributes
    ----------
    centre
        0 for the cluster around zero, else a point with Re >= 0 and Im >= 0, exactly on an axis
        where the cluster is its own mirror image in that axis [-].
    factor
        Monic polynomial in D - centre whose roots are the members, descending; for the cluster
        around zero it is even and has both +-beta, shape (m + 1,) [-].

    """

    centre: complex
    factor: ComplexArray

    def scaled(self, scale: float) -> 'Cluster':
        """Return the cluster with all roots multiplied by a factor."""
        return Cluster(scale * self.centre, self.factor * scale ** np.arange(len(self.factor)))


class Spectrum:
    """
    Characteristic roots of an equation in one unit of time, clustered in any other.

    Other units multiply all roots; only which are close together depends on it. They are found
    once, and the clusters once for each grouping.

    Parameters
    ----------
    coefficients
        a_0 ... a_6, a_0 = 0 and a_6 = 1, shape (7,).

    """

    def __init__(self, coefficients: FloatArray) -> None:
        """Find the roots."""
        self._zeros = next(k for k, a in enumerate(coefficients.tolist()) if a != 0.0)
        self._reduced = coefficients[self._zeros :]
        self._squares = companion_roots(self._reduced)
        self._alone = _polished_roots(self._reduced.tolist(), self._squares.tolist())
        self._apart_beyond = inf if self._alone is None else _apart_beyond(self._alone)
        self._grouped: dict[bytes, list[Cluster]] = {}

    def groupings(self, scales: FloatArray) -> list[bytes]:
        """Return what is the same for all factors, (s,), that make the same clusters of roots."""
        near = scales <= self._apart_beyond
        linked = iter(self._linked(scales[near, None, None]) if near.any() else ())
        return [next(linked).tobytes() if is_near else APART for is_near in near.tolist()]

    def clusters(self, scale: float = 1.0) -> list[Cluster]:
        """Return the clusters of all roots multiplied by a positive factor."""
        key = APART if scale > self._apart_beyond else self._linked(scale).tobytes()
        return self.grouped(key, scale)

    def grouped(self, key: bytes, scale: float) -> list[Cluster]:
        """Return clusters of a grouping, of all roots multiplied by a positive factor."""
        if key == APART:
            alone = [Cluster(scale * beta, _monomial(1)) for beta in self._alone or ()]
            return [Cluster(0j, _monomial(2 * self._zeros)), *alone]
        if key not in self._grouped:
            linked = np.frombuffer(key, dtype=np.bool_).reshape(self._distances[0].shape)
            self._grouped[key] = self._of_groups(linked)
        found = self._grouped[key]
        return list(found) if scale == 1.0 else [cluster.scaled(scale) for cluster in found]

    def _linked(self, scale: float | FloatArray) -> BoolArray:
        """Tell which roots share a cluster, the mirror images included, shape (..., 12, 12)."""
        distances, bridged = self._distances
        return np.asarray(distances <= np.maximum(LINK / scale, bridged))

    @cached_property
    def _beta(self) -> ComplexArray:
        """All roots but their mirror images."""
        beta: ComplexArray = np.sqrt(
            np.concatenate([np.zeros(self._zeros, dtype=complex), self._squares])
        )
        return beta

    @cached_property
    def _distances(self) -> tuple[FloatArray, FloatArray]:
        """Distances of all twelve +-beta, and those that their decay rates bridge."""
        both = np.concatenate([self._beta, -self._beta])
        decay = np.abs(both.real)
        is_same_side = np.outer(both.real, both.real) > 0.0
        bridged = np.where(is_same_side, RELATIVE_LINK * np.minimum.outer(decay, decay), 0.0)
        return np.abs(both[:, None] - both[None, :]), bridged

    def _of_groups(self, linked: BoolArray) -> list[Cluster]:
        """Return the clusters of linked roots, in the spectrum's own unit."""
        groups = _groups(self._beta, linked)
        zeros = self._zeros
        squares = self._squares.tolist()
        members = [[squares[i - zeros] for i in group.members if i >= zeros] for group in groups]
        central, *others = _factors(self._reduced[::-1].tolist(), members)
        around_zero = np.zeros(2 * (len(central) + zeros) - 1, dtype=complex)
        around_zero[: 2 * len(central) : 2] = central
        found = [
            _cluster(_roots(factor), group.is_imaginary)
            for factor, group in zip(others, groups[1:], strict=True)
        ]
        return [
            Cluster(centre=0j, factor=around_zero),
            *(cluster for cluster in found if cluster is not None),
        ]


def companion_roots(ascending: NDArray[Number]) -> ComplexArray:
    """Return the roots, conjugates exact; scaled to size one, so that nothing overflows."""
    first = ascending[-2::-1].tolist()
    degree = len(first)
    if degree == 0:
        return np.zeros(0, dtype=complex)
    scale = max(abs(a) ** (1.0 / n) for n, a in enumerate(first, start=1)) or 1.0
    companion = _shift(degree).astype(ascending.dtype)
    companion[0] = [-a / scale**n for n, a in enumerate(first, start=1)]
    roots: ComplexArray = np.linalg.eigvals(companion).astype(complex)
    roots *= scale
    return roots


def _polished_roots(ascending: list[float], squares: list[complex]) -> list[complex] | None:
    """Return the roots beta by themselves, None unless Newton's method converges for all."""
    roots: list[complex] = []
    for z in squares:
        if z.imag >= 0.0:
            polished = _polished(ascending, z)
            if polished is None:
                return None
            roots.append(sqrt(polished))
    return roots


def _apart_beyond(roots: list[complex]) -> float:
    """Return the factor of roots beyond which each is a cluster of its own, infinite if none."""
    least = 0.0
    for i, beta in enumerate(roots):
        # Half the distance to its mirror image or its conjugate.
        near = min(beta.real, beta.imag or inf)
        if near <= 0.5 * PAIR_RELATIVE_LINK * abs(beta):
            return inf
        least = max(least, LINK / abs(beta), 0.5 * PAIR_LINK / near)
        for other in roots[:i]:
            # The images of two roots are at least as far apart as they are in the quadrant.
            distance = abs(beta - other)
            if distance <= RELATIVE_LINK * min(beta.real, other.real):
                return inf
            least = max(least, LINK / distance)
    return least


def _polished(ascending: list[float], z: complex) -> complex | None:
    """Return a root after Newton steps, None if they do not converge."""
    for _ in range(MAX_STEPS):
        value = 0j
        slope = 0j
        for a in reversed(ascending):
            slope = slope * z + value
            value = value * z + a
        if slope == 0.0:
            return None
        step = value / slope
        z -= step
        if abs(step) <= CONVERGED * abs(z):
            return z
    return None


@cache
def _shift(degree: int) -> FloatArray:
    """Return the companion matrix of D^degree."""
    return np.eye(degree, k=-1)


@cache
def _monomial(degree: int) -> ComplexArray:
    """Return D^degree, descending."""
    factor = np.zeros(degree + 1, dtype=complex)
    factor[0] = 1.0
    return locked(factor)


class _Group(NamedTuple):
    """Indices of linked roots, and whether they surround a point of the imaginary axis."""

    members: list[int]
    is_imaginary: bool


def _groups(beta: ComplexArray, linked: BoolArray) -> list[_Group]:
    """Return linked roots, single linkage over all twelve +-beta, those around zero first."""
    for _ in range(4):  # Paths of up to 2**4 links: more than twelve roots can form.
        linked = linked @ linked
    count = len(beta)
    # A component that contains beta and -beta surrounds zero, where two of the roots always lie.
    central = [i for i in range(count) if linked[i, i + count] or linked[i, 0]]
    groups = [_Group(central, False)]
    seen = set(central)
    for i in range(count):
        if i not in seen:
            group = [j for j in range(count) if linked[i, j] or linked[i, j + count]]
            heights = [beta[j].imag if linked[i, j] else -beta[j].imag for j in group]
            # Linked to its conjugate beta lies on both sides of the real axis, to -conj(beta) not.
            groups.append(_Group(group, min(heights) > 0.0 or max(heights) < 0.0))
            seen.update(group)
    return groups


def _factors(
    polynomial: Sequence[complex], groups: Sequence[Sequence[complex]]
) -> list[list[complex]]:
    """
    Return the factor of a monic polynomial for each group of its roots, all descending.

    They start from the given roots and are refined by Newton's method, (27) of
    docs/derivation.md; those of groups that are closed under conjugation are real.
    """
    if len(groups) == 1:
        # Exact: rebuilt from its roots, the factor would lose its smallest coefficients.
        return [list(polynomial)]
    factors: list[list[complex]] = [_monic(group) for group in groups]
    sizes = [max(map(abs, group), default=1.0) for group in groups]
    is_closed = [_is_conjugate_closed(group) for group in groups]
    for factor, is_real in zip(factors, is_closed, strict=True):
        if is_real:
            factor[:] = [complex(c.real) for c in factor]
    for _ in range(REFINEMENTS):
        steps = [_newton_step(polynomial, factors, i, size) for i, size in enumerate(sizes)]
        largest = 0.0
        for factor, step, size, is_real in zip(factors, steps, sizes, is_closed, strict=True):
            for n, change in enumerate(step, start=1):
                largest = max(largest, abs(change))
                factor[n] += (change.real if is_real else change) * size**n
        if largest <= CONVERGED:
            break
    return factors


def _newton_step(
    polynomial: Sequence[complex], factors: Sequence[Sequence[complex]], which: int, size: float
) -> list[complex]:
    """
    Return the change of a factor's coefficients below the first, in units of its roots' size.

    With P = F G and the remainder R of P by F, the step dF solves G dF = R modulo F.
    """
    degree = len(factors[which]) - 1
    if degree == 0:
        return []
    factor = [c / size**n for n, c in enumerate(factors[which])]
    cofactor = [1.0 + 0j]
    far = 1.0
    for i, other in enumerate(factors):
        if i != which:
            scaled = [c / size**n for n, c in enumerate(other)]
            # Divided by the far roots, cofactor and lower coefficients stay of size one.
            largest = max(map(abs, scaled))
            cofactor = _product(cofactor, [c / largest for c in scaled])
            far *= largest
    rest = _remainder([c / size**n / far for n, c in enumerate(polynomial)], factor)
    columns = []
    for _ in range(degree):
        columns.append(_remainder(cofactor, factor))
        cofactor = [*cofactor, 0j]
    step: list[complex] = np.linalg.solve(np.array(columns[::-1]).T, rest).tolist()
    return step


def _product(a: Sequence[complex], b: Sequence[complex]) -> list[complex]:
    """Return the product of two polynomials."""
    product = [0j] * (len(a) + len(b) - 1)
    for i, left in enumerate(a):
        for j, right in enumerate(b):
            product[i + j] += left * right
    return product


def _monic(roots: Iterable[complex]) -> list[complex]:
    """Return the polynomial with given roots, descending."""
    product = [1.0 + 0j]
    for root in roots:
        product = _product(product, [1.0, -root])
    return product


def _remainder(dividend: Sequence[complex], factor: Sequence[complex]) -> list[complex]:
    """Return dividend modulo a monic factor, descending, one entry less than the factor."""
    # Not np.polydiv, which drops leading entries of the remainder below 1e-8.
    size = len(factor) - 1
    rest = [0j] * (size - len(dividend)) + list(dividend)
    for i in range(len(rest) - size):
        for n in range(1, size + 1):
            rest[i + n] -= rest[i] * factor[n]
    return rest[len(rest) - size :]


def _roots(factor: list[complex]) -> list[complex]:
    """Return the roots of a factor; those of a real one come in exact conjugate pairs."""
    if len(factor) == 2:
        return [-factor[1]]
    full = np.array(factor[::-1])
    roots: list[complex] = companion_roots(full if full.imag.any() else full.real).tolist()
    return roots


def _is_conjugate_closed(squares: Sequence[complex]) -> bool:
    """Tell whether every complex root comes with its conjugate."""
    upper = sorted((z.real, z.imag) for z in squares if z.imag > 0.0)
    lower = sorted((z.real, -z.imag) for z in squares if z.imag < 0.0)
    return upper == lower


def _cluster(squares: Sequence[complex], is_imaginary: bool) -> Cluster | None:
    """
    Return the representative of a group away from zero, None for the mirror image of one.

    Raises
    ------
    ArithmeticError
        The group has come to lie at zero: its roots are lost in double precision.

    """
    if not _is_conjugate_closed(squares):
        if sum(z.imag for z in squares) < 0.0:
            return None
        roots = [sqrt(z) for z in squares]
        centre = sum(roots) / len(roots)
    elif is_imaginary:
        roots = [1j * sqrt(-z) for z in squares]
        centre = 1j * (sum(root.imag for root in roots) / len(roots))
    else:
        roots = [sqrt(z) for z in squares]
        centre = complex(sum(root.real for root in roots) / len(roots))
    if centre == 0.0:
        raise ArithmeticError('the smallest characteristic roots are lost in double precision')
    factor = np.array(_monic(root - centre for root in roots))
    return Cluster(centre=centre, factor=factor)
