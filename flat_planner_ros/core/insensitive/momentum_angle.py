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
Momentum angle: laws of the planned variable that are shaped by what drives joint n-1.

The momentum angle sigma is the angle that the last two links would have if they were one rigid
body: I*_(n-1) sigma'' = tau, whatever the spring does ((I4) of docs/derivation.md). Where a servo
drives the joint, sigma stands for the angle of link n-1 (I16). Either is expanded here in Legendre
polynomials, and the planned variable w answers to it like the passive joint's oscillator:
w + delta w' + w'' / omega^2 = sigma.
"""

from dataclasses import dataclass
from functools import lru_cache
from math import ceil, sqrt

from flat_planner_ros.core.arm import apply_row, Drive, FloatArray, locked, PlanarArm
from flat_planner_ros.core.insensitive.oscillator import Oscillator
from flat_planner_ros.core.motion_law import JET_ORDER, ScaledLaw
import numpy as np
from numpy.polynomial import legendre

CONTACT = 3
"""
Derivatives of sigma that vanish at both ends.

Then the effort and its rate are zero there, and five derivatives of w at the start: with no
oscillation left, these are the twelve conditions of the other strategies.
"""

TOP = CONTACT + 1
"""Derivative of sigma in which laws are expanded."""

SPLIT_TURN = 1.5
"""
Half the turn of the natural oscillation per term of sigma^(4) from which it is a mode of its own.

Below, a polynomial resolves it to double precision; above, the series of the particular solution
in derivatives of sigma converges fast [rad].
"""

TERMS_PER_TURN = 1.4
"""Legendre terms that resolve one radian of half the turn, a little above e / 2 [1/rad]."""

PROBES = 65
"""Times at which a law is certified."""

SPARE_TERMS = 20
"""Terms beyond those, after which the coefficients have decayed below roundoff."""

MAX_NODES = 2048
"""Most nodes at which the effort of a servo is weighed; then a period has three or more."""

BASES_KEPT = 8
"""Bases of different size that are remembered."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MomentumBasis:
    """
    All sigmas from -1/2 to 1/2 within a space of polynomials, x in [-1, 1].

    The law with coefficients c has sigma^(4) = `start` + `directions` @ c, and the integral of
    (effort / I*_(n-1))^2 is `least` + c @ c.

    Attributes
    ----------
    start
        Legendre coefficients of sigma^(4) of the law of least effort in the space, shape (m,).
    directions
        Those of changes, whose efforts are orthonormal, shape (m, modes).
    second_start, second_directions
        Legendre coefficients of sigma'' of both, shapes (m + 2,) and (m + 2, modes).
    least
        Integral of (effort / I*_(n-1))^2 of `start`.

    """

    start: FloatArray
    directions: FloatArray
    second_start: FloatArray
    second_directions: FloatArray
    least: float

    def changed(self, origin: FloatArray, directions: FloatArray) -> 'MomentumBasis':
        """
        Return the basis of a plane in this one.

        Parameters
        ----------
        origin
            Coefficients of its law of least effort, shape (modes,).
        directions
            Those of its changes, orthonormal and at right angles to the origin, (modes, fewer).

        """
        return MomentumBasis(
            start=self.start + self.directions @ origin,
            directions=self.directions @ directions,
            second_start=self.second_start + self.second_directions @ origin,
            second_directions=self.second_directions @ directions,
            least=self.least + float(origin @ origin),
        )


LEAST_OF_ALL = 1.5
"""Integral of (effort / I*_(n-1))^2, linear in time, the least of any motion over 1."""


def least_effort(arm: PlanarArm, distance: float, duration: float) -> float:
    """Return the least RMS effort of joint n-1 of any motion from rest to rest [N m], (I5)."""
    return sqrt(12.0) * arm.inertia_star.both * abs(distance) / duration**2


@lru_cache(maxsize=BASES_KEPT)
def momentum_basis(modes: int) -> MomentumBasis:
    """Return the basis with a number of free coefficients."""
    size = modes + TOP
    # By Rodrigues' formula the integrals of P_j from -1 vanish at both ends, j times.
    changes = np.eye(size)[:, TOP:]
    power = np.polynomial.polynomial.polypow([1.0, 0.0, -1.0], CONTACT)
    speed = legendre.poly2leg(power)
    start = np.zeros(size)
    fourth = legendre.legder(speed / (2.0 * speed[0]), CONTACT)
    start[: len(fourth)] = fourth
    # Integrals of `start` lack their constants: sigma'' of the polynomial of least degree.
    second = np.zeros(size + 2)
    exact = legendre.legder(speed / (2.0 * speed[0]), 1)
    second[: len(exact)] = exact
    once = integration(size + 2)
    twice = (once @ once)[:, :size]
    seconds = np.column_stack([second, twice @ changes])
    return _orthonormal(np.column_stack([start, changes]), seconds, _norms(size + 2) * seconds)


def _norms(size: int) -> FloatArray:
    """Return the norms of Legendre polynomials, shape (size, 1)."""
    return np.sqrt(2.0 / (2.0 * np.arange(float(size)) + 1.0))[:, None]


def _orthonormal(fourths: FloatArray, seconds: FloatArray, efforts: FloatArray) -> MomentumBasis:
    """
    Return the basis of laws whose efforts are orthonormal, and whose start has the least.

    Parameters
    ----------
    fourths, seconds
        Legendre coefficients of sigma^(4) and sigma'' of a law, then of changes of it, in columns.
    efforts
        Their efforts over I*_(n-1), in coordinates whose sum of squares is the integral.

    """
    orthonormal, triangle = np.linalg.qr(efforts[:, 1:])
    share = orthonormal.T @ efforts[:, 0]
    directions, second_directions = (
        np.linalg.solve(triangle.T, columns[:, 1:].T).T for columns in (fourths, seconds)
    )
    return MomentumBasis(
        start=fourths[:, 0] - directions @ share,
        directions=directions,
        second_start=seconds[:, 0] - second_directions @ share,
        second_directions=second_directions,
        least=float(np.sum((efforts[:, 0] - orthonormal @ share) ** 2)),
    )


def basis_for(oscillator: Oscillator, duration: float, modes: int) -> MomentumBasis:
    """
    Return the basis whose efforts are orthonormal on an arm.

    Parameters
    ----------
    oscillator
        The nominal arm.
    duration
        Length of the motion [s].
    modes
        Number of free coefficients.

    References
    ----------
    (I17) of docs/derivation.md: a servo takes I*_(n-1) sigma'' + I*_n q_n''.

    """
    basis = momentum_basis(modes)
    if oscillator.drive is Drive.EFFORT:
        return basis
    fourths = np.column_stack([basis.start, basis.directions])
    seconds = np.column_stack([basis.second_start, basis.second_directions])
    delta, epsilon = _normalised(oscillator, duration)
    reaction = epsilon / oscillator.inertia_ratio
    if _is_split(fourths, epsilon):
        laws = [_split(second, delta, epsilon, duration) for second in seconds.T]
        nodes, weights = legendre.leggauss(min(len(seconds) + ceil(epsilon**-0.5), MAX_NODES))
        distances = np.array([1.0 + nodes, 1.0 - nodes])
        quiet = legendre.legval(nodes, seconds).T
        swing = np.array([law.normalised_jet(distances, TOP)[TOP] for law in laws]).T
        efforts = np.sqrt(weights)[:, None] * (quiet - reaction * swing)
    else:
        top = _top_derivative(fourths, delta, epsilon)
        once = integration(len(top))
        efforts = -reaction * once @ (once @ top)
        efforts[: len(seconds)] += seconds
        efforts *= _norms(len(top))
    return _orthonormal(fourths, seconds, efforts)


@lru_cache(maxsize=BASES_KEPT)
def integration(size: int) -> FloatArray:
    """Return the matrix of the integral from -1 on Legendre coefficients, the last one cut."""
    matrix = np.zeros((size, size))
    matrix[0, 0] = 1.0
    for k in range(size):
        if k + 1 < size:
            matrix[k + 1, k] = 1.0 / (2 * k + 1)
        if k > 0:
            matrix[k - 1, k] = -1.0 / (2 * k + 1)
    return locked(matrix)


@lru_cache(maxsize=BASES_KEPT)
def differentiation(size: int) -> FloatArray:
    """Return the matrix of the derivative on Legendre coefficients."""
    # P_k' = (2 k - 1) P_(k-1) + (2 k - 5) P_(k-3) + ...
    below, order = np.indices((size, size))
    is_part = (order > below) & ((order - below) % 2 == 1)
    matrix = np.where(is_part, 2.0 * below + 1.0, 0.0)
    return locked(matrix)


@dataclass(frozen=True, kw_only=True, eq=False)
class SeriesLaw(ScaledLaw):
    """
    A planned variable as Legendre series of its derivatives, plus one decaying oscillation.

    Attributes
    ----------
    table
        Row k holds the coefficients of the k-th derivative in x, shape (7, m).
    rate, amplitude
        Of the oscillation Re(amplitude exp(rate (x + 1))).

    """

    table: FloatArray
    rate: complex = 0j
    amplitude: complex = 0j

    def normalised_jet(self, distances: FloatArray, order: int) -> FloatArray:
        """Return the series and its derivatives, as `ScaledLaw.normalised_jet`."""
        x = np.clip(distances[0] - 1.0, -1.0, 1.0)
        table = self.table[: order + 1]
        if order > JET_ORDER:
            higher = np.zeros((order - JET_ORDER, table.shape[1]))
            for row in range(len(higher)):
                derivative = legendre.legder(self.table[-1], row + 1)
                higher[row, : len(derivative)] = derivative
            table = np.concatenate([table, higher])
        result: FloatArray = table @ legendre.legvander(x, table.shape[1] - 1).T
        if self.amplitude:
            powers = self.amplitude * self.rate ** np.arange(order + 1)
            result += np.multiply.outer(powers, np.exp(self.rate * (x + 1.0))).real
        return result


def response(
    fourth: FloatArray, second: FloatArray, oscillator: Oscillator, duration: float
) -> SeriesLaw:
    """
    Return the planned variable from rest at -1/2 that follows a sigma.

    Parameters
    ----------
    fourth
        Legendre coefficients of sigma^(4) in x, shape (m,).
    second
        Those of sigma'', shape (m + 2,).
    oscillator
        The nominal arm.
    duration
        Length of the motion [s].

    References
    ----------
    (I6) and (I10) of docs/derivation.md.

    """
    delta, epsilon = _normalised(oscillator, duration)
    if _is_split(fourth, epsilon):
        return _split(second, delta, epsilon, duration)
    top = _top_derivative(fourth, delta, epsilon)
    size = len(top)
    once = integration(size + JET_ORDER)
    table = np.zeros((JET_ORDER + 1, size + JET_ORDER))
    table[JET_ORDER, :size] = top
    for k in range(JET_ORDER, 0, -1):
        table[k - 1] = once @ table[k]
    table[0, 0] -= 0.5
    locked(table)
    return SeriesLaw(duration=duration, table=table)


def _is_split(fourth: FloatArray, epsilon: float) -> bool:
    """Whether the natural oscillation is too fast for the polynomials of sigma."""
    return bool(epsilon**-0.5 > SPLIT_TURN * len(fourth))


def _top_derivative(fourth: FloatArray, delta: float, epsilon: float) -> FloatArray:
    """Return Legendre coefficients of w^(6) of laws at rest at the start, one or in columns."""
    size = len(fourth) + ceil(TERMS_PER_TURN * epsilon**-0.5) + SPARE_TERMS
    once = integration(size)
    padded = np.zeros((size, *fourth.shape[1:]))
    padded[: len(fourth)] = fourth
    operator = epsilon * np.eye(size) + delta * once + once @ once
    return np.asarray(np.linalg.solve(operator, padded), dtype=float)


def _split(second: FloatArray, delta: float, epsilon: float, duration: float) -> SeriesLaw:
    """Return the same as a particular solution, a polynomial, and the natural oscillation."""
    size = len(second) + 2
    once = integration(size)
    sigma = np.zeros((JET_ORDER + 1, size))
    sigma[2, : len(second)] = second
    sigma[1] = once @ sigma[2]
    sigma[0] = once @ sigma[1]
    sigma[0, 0] -= 0.5
    slope = differentiation(size)
    for k in range(3, JET_ORDER + 1):
        sigma[k] = slope @ sigma[k - 1]
    operator = np.eye(size) + delta * slope + epsilon * slope @ slope
    table = np.asarray(np.linalg.solve(operator, sigma.T).T, dtype=float)
    locked(table)
    rate = (-delta + 1j * np.sqrt(4.0 * epsilon - delta**2)) / (2.0 * epsilon)
    # The fourth derivative of w starts at rest: there the particular solution is smallest.
    signs = (-1.0) ** np.arange(size)
    value, growth = -(table[TOP] @ signs), -(table[TOP + 1] @ signs)
    amplitude = complex(value, (rate.real * value - growth) / rate.imag) / rate**TOP
    return SeriesLaw(duration=duration, table=table, rate=complex(rate), amplitude=amplitude)


def _normalised(oscillator: Oscillator, duration: float) -> tuple[float, float]:
    """Return delta and 1 / omega^2 of w + delta w' + w'' / omega^2 = sigma in x."""
    half = 0.5 * duration
    square = oscillator.frequency**2
    return 2.0 * oscillator.decay / square / half, 1.0 / (square * half**2)


def largest_miss(
    law: SeriesLaw, second: FloatArray, oscillator: Oscillator, *, rests_at_end: bool
) -> float:
    """Return the largest miss at the ends, and of sigma'' in between, relative to peaks."""
    half = 0.5 * law.duration
    times = np.linspace(0.0, law.duration, PROBES)
    jet = law.jet(times, JET_ORDER)
    delta, epsilon = _normalised(oscillator, law.duration)
    row = np.array([1.0, delta * half, epsilon * half**2])
    sigma = np.array([apply_row(row, jet, k) for k in range(CONTACT + 1)])
    expected = legendre.legval(times / half - 1.0, second) / half**2
    misses = [np.abs(sigma[2] - expected).max() / np.abs(expected).max()]
    misses += [_end_miss(jet[:JET_ORDER], 0), _end_miss(sigma, -1)]
    if rests_at_end:
        misses.append(_end_miss(jet[:JET_ORDER], -1))
    return float(max(misses))


def _end_miss(table: FloatArray, end: int) -> float:
    """Return how far derivatives at an end are from rest at -1/2 or 1/2, relative to peaks."""
    rest = np.zeros(len(table))
    rest[0] = 0.5 if end else -0.5
    size = np.abs(table).max(axis=1)
    size[0] += 0.5
    return float((np.abs(table[:, end] - rest) / size).max())
