"""
Characteristic roots of an even equation, grouped into clusters of nearly equal ones.

With z = beta^2 the characteristic polynomial has degree six. Its roots may differ by twenty orders
of magnitude and may be multiple, so each is refined on its own scale: a root by itself by Newton's
method, a cluster as one factor of the polynomial, which stays well conditioned where its members
do not (docs/derivation.md, section 5).
"""

from cmath import sqrt
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

LINK = 2.5
"""Roots beta closer than this, in units of 2 / duration, share a cluster [-]."""

RELATIVE_LINK = 0.3
"""Roots beta closer than this share of their decay rate also share a cluster [-]."""

PAIR_LINK = 0.1
"""Two roots alone may come as close as this and still be told apart at a loss of one digit [-]."""

PAIR_RELATIVE_LINK = 0.02
"""The same as a share of their modulus, which bounds the loss in the roots themselves [-]."""

REFINEMENTS = 3
"""Newton steps on every factor; each about squares the error of the companion eigenvalues."""

MAX_STEPS = 8
"""Newton steps on a root by itself, which stop earlier once they have converged."""

CONVERGED = 1e-9
"""Relative step whose square is far below the last digit: the step after it changes nothing."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Cluster:
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


def clusters(coefficients: FloatArray) -> list[Cluster]:
    """
    Return the characteristic roots of sum_k a_k D^(2k) in clusters.

    Parameters
    ----------
    coefficients
        a_0 ... a_6 in normalised time, a_0 = 0 and a_6 = 1, shape (7,) [-].

    """
    zeros = int(np.flatnonzero(coefficients)[0])
    reduced = coefficients[zeros:]
    squares = _companion_roots(reduced)
    separate = _separate(reduced.tolist(), squares.tolist(), zeros)
    if separate is not None:
        return separate
    groups = _groups(np.concatenate([np.zeros(zeros, dtype=complex), squares]))
    members = [np.array([i - zeros for i in group if i >= zeros], dtype=int) for group in groups]
    for _ in range(REFINEMENTS):
        factors = [_refined(reduced, squares, group) for group in members]
        for group, factor in zip(members, factors, strict=True):
            squares[group] = np.roots(factor)
    central_factor = factors[0]
    around_zero = np.zeros(2 * (len(central_factor) + zeros) - 1, dtype=complex)
    around_zero[: 2 * len(central_factor) : 2] = central_factor
    central = Cluster(centre=0j, factor=around_zero)
    others = (_cluster(squares[group]) for group in members[1:])
    return [central, *(cluster for cluster in others if cluster is not None)]


def _companion_roots(ascending: FloatArray) -> ComplexArray:
    """Return the roots, conjugates exact; scaled to size one, so that nothing overflows."""
    first = ascending[-2::-1].tolist()
    degree = len(first)
    if degree == 0:
        return np.zeros(0, dtype=complex)
    scale = max(abs(a) ** (1.0 / n) for n, a in enumerate(first, start=1))
    companion = np.eye(degree, k=-1)
    companion[0] = [-a / scale**n for n, a in enumerate(first, start=1)]
    roots: ComplexArray = np.linalg.eigvals(companion).astype(complex)
    roots *= scale
    return roots


def _separate(ascending: list[float], squares: list[complex], zeros: int) -> list[Cluster] | None:
    """Return one cluster for each root and one for those at zero, None unless all are apart."""
    roots: list[complex] = []
    for z in squares:
        if z.imag >= 0.0:
            polished = _polished(ascending, z)
            if polished is None:
                return None
            roots.append(sqrt(polished))
    for i, beta in enumerate(roots):
        modulus = abs(beta)
        # Half the distance to its mirror image or its conjugate.
        near = 0.5 * max(PAIR_LINK, PAIR_RELATIVE_LINK * modulus)
        if modulus <= LINK or beta.real <= near or 0.0 != beta.imag <= near:
            return None
        for other in roots[:i]:
            # The images of two roots are at least as far apart as they are in the quadrant.
            reach = max(LINK, RELATIVE_LINK * min(beta.real, other.real))
            if abs(beta - other) <= reach:
                return None
    central = Cluster(centre=0j, factor=_monomial(2 * zeros))
    return [central, *(Cluster(centre=beta, factor=_monomial(1)) for beta in roots)]


def _polished(ascending: list[float], z: complex) -> complex | None:
    """Return a root after Newton steps, None if they do not converge."""
    for _ in range(MAX_STEPS):
        value, slope = 0j, 0j
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
def _monomial(degree: int) -> ComplexArray:
    """Return D^degree, descending."""
    factor = np.zeros(degree + 1, dtype=complex)
    factor[0] = 1.0
    factor.setflags(write=False)
    return factor


def _groups(squares: ComplexArray) -> list[list[int]]:
    """Return the indices of linked roots, single linkage over all twelve +-beta."""
    beta = np.sqrt(squares)
    both = np.concatenate([beta, -beta])
    decay = np.abs(both.real)
    same_side = np.outer(both.real, both.real) > 0.0
    reach = np.maximum(LINK, RELATIVE_LINK * np.minimum.outer(decay, decay) * same_side)
    linked = np.abs(both[:, None] - both[None, :]) <= reach
    for _ in range(4):  # Paths of up to 2**4 links: more than twelve roots can form.
        linked = linked @ linked
    count = len(beta)
    # A component that contains beta and -beta surrounds zero, where two of the roots always lie.
    central = [i for i in range(count) if linked[i, i + count] or linked[i, 0]]
    groups, seen = [central], set(central)
    for i in range(count):
        if i not in seen:
            group = [j for j in range(count) if linked[i, j] or linked[i, j + count]]
            groups.append(group)
            seen.update(group)
    return groups


def _refined(
    ascending: FloatArray, squares: ComplexArray, group: NDArray[np.int_]
) -> FloatArray | ComplexArray:
    """
    Return a group's factor F of the polynomial P after one Newton step, monic and descending.

    With P = F G and the remainder R of P by F, the step dF solves G dF = R modulo F.
    """
    if len(group) == 0:
        return np.ones(1)
    if len(group) == len(squares):
        # Exact: rebuilt from its roots, the factor would lose its smallest coefficients.
        return ascending[::-1].copy()
    scale = np.abs(squares[group]).max()
    inside, outside = squares[group] / scale, np.delete(squares, group) / scale
    factor = np.poly(inside).astype(complex)
    # Divided by the far roots, cofactor and lower coefficients stay of size one.
    size = np.prod(np.maximum(np.abs(outside), 1.0))
    cofactor = np.atleast_1d(np.poly(outside)) / size
    degree = len(ascending) - 1
    scaled = (ascending * scale ** np.arange(-degree, 1.0) / size)[::-1]
    columns = [_remainder(np.polymul(power, cofactor), factor) for power in np.eye(len(inside))]
    step = np.linalg.solve(np.array(columns).T, _remainder(scaled, factor))
    factor[1:] += step
    factor *= scale ** np.arange(len(factor), dtype=float)
    # The roots of a real factor come in exact conjugate pairs, which the solver relies on.
    return factor.real if _is_conjugate_closed(inside) else factor


def _remainder(dividend: ComplexArray, factor: ComplexArray) -> ComplexArray:
    """Return dividend modulo a monic factor, descending, one entry less than the factor."""
    # Not np.polydiv, which drops leading entries of the remainder below 1e-8.
    size = len(factor) - 1
    rest = np.concatenate([np.zeros(max(size - len(dividend), 0)), dividend]).astype(complex)
    for i in range(len(rest) - size):
        rest[i + 1 : i + 1 + size] -= rest[i] * factor[1:]
    return rest[len(rest) - size :]


def _is_conjugate_closed(squares: ComplexArray) -> bool:
    """Tell whether every complex root comes with its conjugate."""
    return bool(np.array_equal(np.sort_complex(squares), np.sort_complex(squares.conj())))


def _cluster(squares: ComplexArray) -> Cluster | None:
    """Return the representative of a group away from zero, None for the mirror image of one."""
    if not _is_conjugate_closed(squares):
        if squares.imag.sum() < 0.0:
            return None
        roots = np.sqrt(squares)
        centre = complex(roots.mean())
    elif squares.real.sum() > 0.0:
        roots = np.sqrt(squares)
        centre = complex(roots.real.mean())
    else:
        roots = 1j * np.sqrt(-squares)
        centre = 1j * float(roots.imag.mean())
    return Cluster(centre=centre, factor=np.poly(roots - centre).astype(complex))
