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

from flat_planner_ros.core.arm import Drive, FloatArray, locked, PlanarArm
from flat_planner_ros.core.insensitive.oscillator import gauss_legendre, Oscillator
from flat_planner_ros.core.insensitive.response import (
    BASES_KEPT,
    CONTACT,
    joining,
    Normalised,
    responses,
    TOP,
    top_derivatives,
)
from flat_planner_ros.core.motion_law import CONDITIONS, integration
import numpy as np
from numpy.polynomial import legendre

MAX_NODES = 2048
"""Most nodes at which the effort of a servo is weighed; then a period has three or more."""


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


NO_POINTS = locked(np.zeros(0))
"""Of a course without via points."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Course:
    """
    Where a motion begins, passes and ends, derivatives by x from -1 to 1.

    Attributes
    ----------
    start
        Derivatives 0 to 5 of the planned variable at the start, shape (6,) [rad].
    end
        Where it comes to rest [rad].
    places, values
        Of via points on the way, x and the flat output y1, shape (v,) [-], [rad].

    """

    start: FloatArray
    end: float
    places: FloatArray
    values: FloatArray


UNIT_COURSE = Course(
    start=locked(np.array([-0.5, 0.0, 0.0, 0.0, 0.0, 0.0])),
    end=0.5,
    places=NO_POINTS,
    values=NO_POINTS,
)
"""From rest to rest over 1 rad."""


def basis_for(
    oscillator: Oscillator, equation: Normalised, modes: int, course: Course
) -> MomentumBasis:
    """
    Return the basis of a course, whose efforts are orthonormal on an arm.

    Parameters
    ----------
    oscillator, equation
        The nominal arm, and what it makes of sigma.
    modes
        Number of free coefficients.
    course
        Where the laws begin and end.

    References
    ----------
    (I17) of docs/derivation.md: a servo takes I*_(n-1) sigma'' + I*_n q_n''; (I19) for a start in
    motion.

    """
    basis = momentum_basis(modes)
    if course is UNIT_COURSE:
        if oscillator.drive is Drive.EFFORT:
            return basis
        fourth, second = basis.start, basis.second_start
    else:
        sigma = joining(equation.momentum_angle(course.start), course.end)
        fourth, second = np.zeros(len(basis.start)), np.zeros(len(basis.second_start))
        fourth[: len(sigma) - 4] = legendre.legder(sigma, 4)
        second[: len(sigma) - 2] = legendre.legder(sigma, 2)
    fourths = np.column_stack([fourth, basis.directions])
    seconds = np.column_stack([second, basis.second_directions])
    if oscillator.drive is Drive.EFFORT:
        return _orthonormal(fourths, seconds, _norms(len(seconds)) * seconds)
    reaction = equation.epsilon / oscillator.inertia_ratio
    efforts = _efforts_of_servo(fourths, seconds, equation, reaction, course.start)
    return _orthonormal(fourths, seconds, efforts)


def _efforts_of_servo(
    fourths: FloatArray,
    seconds: FloatArray,
    equation: Normalised,
    reaction: float,
    start: FloatArray,
) -> FloatArray:
    """Return sigma'' - reaction w^(4) of a law, then of changes of it, as `_orthonormal` does."""
    still = np.zeros(CONDITIONS)
    columns = (slice(0, 1), start), (slice(1, None), still)
    if equation.is_split(len(fourths)):
        count = min(len(seconds) + ceil(equation.epsilon**-0.5), MAX_NODES)
        nodes, weights = gauss_legendre(count)
        distances = np.array([1.0 + nodes, 1.0 - nodes])
        quiet = legendre.legval(nodes, seconds).T
        laws = [
            law
            for part, begin in columns
            for law in responses(fourths[:, part], seconds[:, part], equation, 2.0, begin)
        ]
        swing = np.array([law.normalised_jet(distances, TOP)[TOP] for law in laws]).T
        efforts: FloatArray = np.sqrt(weights)[:, None] * (quiet - reaction * swing)
        return efforts
    tops = [top_derivatives(fourths[:, part], equation, begin) for part, begin in columns]
    top = np.concatenate(tops, axis=1)
    once = integration(len(top))
    efforts = -reaction * once @ (once @ top)
    # What w^(4) and w^(5) are at the start; x + 1 has the coefficients 1 and 1.
    efforts[:2, 0] -= reaction * start[TOP + 1]
    efforts[0, 0] -= reaction * start[TOP]
    efforts[: len(seconds)] += seconds
    return efforts * _norms(len(top))
