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
Minimax: weights under which the largest of some squares is least.

The largest of the squares |r_i(c)|^2 weighs as much as any weighted mean of them, whose best
coefficients are a linear system; the best weights are the multipliers of |r_i|^2 <= bound, found
by a primal-dual interior-point method (Boyd and Vandenberghe, Convex optimization, 11.7).
"""

from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray
import numpy as np

CENTRING = 0.1
"""Share of the mean product of weight and slack that a step aims at [-]."""

BOUNDARY = 0.95
"""Share of the way to where a weight or a slack would vanish that a step goes at most [-]."""

ROOM = 1.1
"""Bound to begin with, over the largest square [-]."""


class Multipliers(NamedTuple):
    """Weights of the points, and by how much their squares are below a bound, shape (p,)."""

    weights: FloatArray
    slacks: FloatArray

    @classmethod
    def of(cls, weights: FloatArray, squares: FloatArray) -> 'Multipliers':
        """Return those to begin with."""
        return cls(weights, ROOM * squares.max() - squares)

    def improved(
        self, squares: FloatArray, slopes: FloatArray, hessian: FloatArray
    ) -> 'Multipliers':
        """
        Return those after a Newton step, the sum of the weights kept.

        Parameters
        ----------
        squares
            At the best coefficients for these weights, shape (p,).
        slopes
            Half their derivatives by the coefficients, shape (p, m).
        hessian
            Half that of the weighted sum by the coefficients, shape (m, m).

        References
        ----------
        (I12a) of docs/derivation.md.

        """
        weights, slacks = self
        ratio = weights / slacks
        product = CENTRING * float(weights @ slacks) / len(weights)
        # (K + diag(1 / ratio)) change = squares + product / weights - bound, by the lemma on the
        # inverse of a diagonal matrix plus one of low rank, K = 2 slopes hessian^-1 slopes^T.
        scaled = slopes * ratio[:, None]
        wanted = np.array([squares + product / weights, np.ones(len(weights))])
        inner = np.linalg.solve(0.5 * hessian + slopes.T @ scaled, (wanted @ scaled).T)
        first, second = ratio * wanted - (scaled @ inner).T
        change = first - first.sum() / second.sum() * second
        slack_change = product / weights - slacks - change / ratio
        fall = max(-(change / weights).min(), -(slack_change / slacks).min(), BOUNDARY)
        step = BOUNDARY / fall
        return Multipliers(weights + step * change, slacks + step * slack_change)
