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
Trade: effort against residual, in the coefficients of one basis of laws.

Effort is a plain sum of squares and every residual amplitude the magnitude of one complex number,
affine in the coefficients. A quadratic compromise is therefore a small linear system, and the
largest residual over a box takes a few dozen points of its edges that are weighed anew
(docs/derivation.md, section I).
"""

from dataclasses import dataclass, replace
from functools import cached_property
from math import sqrt
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.insensitive.insensitivity import Criterion, Insensitivity, Nominal
from flat_planner_ros.core.insensitive.minimax import Multipliers
from flat_planner_ros.core.insensitive.momentum_angle import (
    basis_for,
    Course,
    LEAST_OF_ALL,
    MomentumBasis,
    UNIT_COURSE,
)
from flat_planner_ros.core.insensitive.oscillator import largest, Oscillator
from flat_planner_ros.core.insensitive.residual import legendre_residuals, swing_of_start
from flat_planner_ros.core.insensitive.response import flat_outputs, Normalised, responses
import numpy as np

GAP = 1e-3
"""Distance from the optimum of the minimax problem at which weighing anew ends [-]."""

MAX_ROUNDS = 40
"""New weights after which the law is taken with the gap that it has; 23 were the most seen."""

MODES_PER_POINT = 8
"""Coefficients more for each via point: a half-wave is as well resolved as a whole motion is."""

MAX_POINTS = 65
"""Most points of an edge that are weighed; those of the prediction may be more."""


class Compromise(NamedTuple):
    """Coefficients c, shape (m,); the points' shares of the weight, and figures of merit."""

    c: FloatArray
    shares: FloatArray
    effort: float
    cost: float
    stationarity: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Trade:
    """
    Effort and residuals as functions of the coefficients c of a basis.

    Attributes
    ----------
    oscillator, equation
        The nominal arm, and what it makes of a momentum angle.
    duration, wanted, course
        What is asked for.
    basis
        Laws that leave on the nominal arm what is wanted.

    """

    oscillator: Oscillator
    equation: Normalised
    duration: float
    wanted: Insensitivity
    course: Course
    basis: MomentumBasis

    @classmethod
    def of(
        cls,
        oscillator: Oscillator,
        duration: float,
        wanted: Insensitivity,
        course: Course = UNIT_COURSE,
    ) -> 'Trade':
        """Return the problem, what is left on the nominal arm and via points settled."""
        equation = Normalised.of(oscillator, duration)
        modes = wanted.modes + MODES_PER_POINT * len(course.places)
        problem = cls(
            oscillator=oscillator,
            equation=equation,
            duration=duration,
            wanted=wanted,
            course=course,
            basis=basis_for(oscillator, equation, modes, course),
        )
        conditions = []
        if wanted.nominal is Nominal.EXACT:
            conditions.append(problem.residuals(np.ones((1, 3))))
        if len(course.places):
            conditions.append(problem.misses())
        if not conditions:
            return problem
        matrix, start = (np.concatenate(parts) for parts in zip(*conditions, strict=True))
        left, sizes, right = np.linalg.svd(matrix)
        count = len(sizes)
        origin = right[:count].T @ (-(left.T @ start) / sizes)
        return replace(problem, basis=problem.basis.changed(origin, right[count:].T))

    @cached_property
    def points(self) -> tuple[FloatArray, FloatArray]:
        """Return the arms that are weighed, (p, 3), and shares of weight to begin with, (p,)."""
        if not self.is_minimax:
            return self.oscillator.nodes(self.wanted.box, self.duration)
        edges = self.oscillator.edges(self.wanted.box, self.duration, MAX_POINTS)
        points = np.concatenate(edges)
        return points, np.full(len(points), 1.0 / len(points))

    def effort(self, c: FloatArray) -> float:
        """Return the RMS effort over the least one of any motion."""
        return sqrt((self.basis.least + float(c @ c)) / LEAST_OF_ALL)

    def worst(self, c: FloatArray) -> float:
        """Return the largest residual on the edges of the box [rad]."""
        edges, (matrix, start) = self._edges
        amplitudes = np.hypot(*np.split(matrix @ c + start, 2))
        return largest(edges, amplitudes)[0]

    @cached_property
    def _edges(self) -> tuple[list[FloatArray], tuple[FloatArray, FloatArray]]:
        """Return the edges of the box and the residuals on them."""
        edges = self.oscillator.edges(self.wanted.box, self.duration)
        return edges, self.residuals(np.concatenate(edges))

    @cached_property
    def _weighed(self) -> tuple[FloatArray, FloatArray]:
        """Return the residuals of the arms that are weighed."""
        return self.residuals(self.points[0])

    def residuals(self, factors: FloatArray) -> tuple[FloatArray, FloatArray]:
        """
        Return residuals as matrix @ c + start, real parts above imaginary ones.

        Parameters
        ----------
        factors
            Arms, as for `Oscillator.poles`, shape (p, 3) [-].

        Returns
        -------
        tuple[FloatArray, FloatArray]
            Shapes (2 p, modes) and (2 p,) [rad].

        """
        basis = self.basis
        rows = legendre_residuals(self.oscillator, factors, self.duration, len(basis.second_start))
        stacked = np.concatenate([rows.real, rows.imag])
        swing = swing_of_start(self.oscillator, factors, self.duration, self.course.start)
        start = stacked @ basis.second_start - np.concatenate([swing.real, swing.imag])
        return stacked @ basis.second_directions, start

    def misses(self) -> tuple[FloatArray, FloatArray]:
        """Return how far via points are missed as matrix @ c + start, shapes (v, modes), (v,)."""
        basis, course, equation = self.basis, self.course, self.equation
        still = np.zeros_like(course.start)
        parts = [
            (basis.start[:, None], basis.second_start[:, None], course.start),
            (basis.directions, basis.second_directions, still),
        ]
        columns = [
            flat_outputs(law, equation, course.places)
            for fourths, seconds, begin in parts
            for law in responses(fourths, seconds, equation, self.duration, begin)
        ]
        return np.array(columns[1:]).T, columns[0] - course.values

    def solve(self, weight: float, shares: FloatArray | None = None) -> Compromise:
        """Return the best coefficients for a weight; the shares are a first guess."""
        total = LEAST_OF_ALL * weight**2
        weights = total * (self.points[1] if shares is None else shares)
        (matrix, start), points = self._weighed, len(weights)
        is_minimax, identity = self.is_minimax, np.eye(matrix.shape[1])
        multipliers: Multipliers | None = None
        for _ in range(MAX_ROUNDS):
            weighted = matrix.T * np.concatenate([weights, weights])
            hessian, gradient = identity + weighted @ matrix, weighted @ start
            c = np.asarray(-np.linalg.solve(hessian, gradient), dtype=float)
            residuals = matrix @ c + start
            squares = residuals[:points] ** 2 + residuals[points:] ** 2
            mean = float(weights @ squares)
            weighed = total * float(squares.max()) if is_minimax else mean
            cost = self.basis.least + float(c @ c) + weighed
            # For any weights, the weighted sum is a lower bound on the minimax cost.
            if weighed - mean <= GAP * cost:
                break
            slopes = residuals[:, None] * matrix
            multipliers = multipliers or Multipliers.of(weights, squares)
            multipliers = multipliers.improved(squares, slopes[:points] + slopes[points:], hessian)
            weights = multipliers.weights
        terms = np.abs(hessian) @ np.abs(c) + np.abs(gradient)
        miss = np.abs(hessian @ c + gradient).max() / (terms.max() or 1.0)
        return Compromise(c, weights / total, self.effort(c), cost / LEAST_OF_ALL, float(miss))

    @property
    def is_minimax(self) -> bool:
        """Tell whether the largest residual is weighed."""
        return self.wanted.criterion is Criterion.WORST
