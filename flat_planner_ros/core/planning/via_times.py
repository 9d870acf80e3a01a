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
Times of via points, chosen where the cost is least.

The path itself is solved exactly for any times, and its cost has derivatives with respect to them
((V8) and (V10) of docs/derivation.md): Newton's method finds the times at which the cost that the
strategy minimises is least, the duration kept. A weighted cost has several minima; it is searched
from the times of the polynomial law, which has one as far as is known and takes less to compute.
"""

from dataclasses import replace
from math import inf, log

from flat_planner_ros.core.arm import FloatArray, PlanarArm, UncertifiedPlan
from flat_planner_ros.core.motion_law import PathConditions, PathCost, QuadraticCost
from flat_planner_ros.core.planning.motion_problem import problem_of
from flat_planner_ros.core.planning.planner import path_of
from flat_planner_ros.core.planning.request import MotionRequest, PlanningOptions, ViaPoint
from flat_planner_ros.core.planning.shortest_duration import IsOver
import numpy as np

LEAST_SHARE = 0.05
"""
Shortest segment, relative to an even share of the duration [-].

Between equal values the optimum would let a segment vanish, and its two points with it.
"""

GUESS_POWER = 0.25
"""Power of a segment's distance to which its length is taken to be proportional at first [-]."""

GUESS_AT_ENDS = 1.5
"""How many times as long segments are at first that begin or end at rest [-]."""

GRADIENT_TOLERANCE = 1e-3
"""Derivative of the cost's logarithm by that of a segment's length at which times are kept [-]."""

GAIN_TOLERANCE = 1e-5
"""What a step would still take off the cost, relative to it, at which times are kept [-]."""

GUESS_TOLERANCE = 1e-3
"""The same for the polynomial law's times, from which those of a weighted cost start [-]."""

MAX_STEPS = 40
"""Bound on the steps; the cost has long settled then."""

FIRST_REACH = 0.25
"""Most that the logarithms of lengths first change at once, along each direction [-]."""

LEAST_REACH = 1e-9
"""Below that there is nothing to gain but rounding [-]."""

FLATTEST = 1e-6
"""Curvature that is taken for none, relative to the largest [-]."""


def with_via_times(
    request: MotionRequest,
    arm: PlanarArm,
    options: PlanningOptions,
    *,
    is_near: bool = False,
    is_over: IsOver | None = None,
) -> MotionRequest:
    """
    Return a request whose via points have the times at which the motion is cheapest.

    Parameters
    ----------
    request
        Points in their order, and the duration, which is kept; the times of the via points do not
        matter, unless they are said to be near.
    arm, options
        As for `plan`.
    is_near
        Whether the times are those of another duration in proportion: the search goes on there.
    is_over
        Tells when to be content with the best so far, asked before each step; None for never.

    Raises
    ------
    FlatPlannerError
        The arm, the weights or the numbers allow no plan.

    """
    try:
        problem = problem_of(arm, options, request.duration)
        path = path_of(request, problem)
        edges = cheapest_edges(problem.cost, path, is_near=is_near, is_over=is_over)
    except ArithmeticError as error:
        raise UncertifiedPlan('boundary residual', inf, 0.0) from error
    via = tuple(
        ViaPoint(time=time, values=point.values)
        for point, time in zip(request.via, edges[1:-1].tolist(), strict=True)
    )
    return replace(request, via=via)


def cheapest_edges(
    cost: QuadraticCost,
    path: PathConditions,
    *,
    is_near: bool = False,
    is_over: IsOver | None = None,
) -> FloatArray:
    """
    Return edges of a path's segments that make it cheap: no small change of them is cheaper.

    Parameters
    ----------
    cost
        What is minimised.
    path
        What is passed; of its edges, the last one alone matters, unless they are near.
    is_near
        Whether the search starts from these edges.
    is_over
        As for `with_via_times`.

    Returns
    -------
    FloatArray
        From 0 to the same last one, shape (p + 1,) [s].

    """
    count = path.values.shape[1]
    if count == 1:
        return path.edges
    distances = np.linalg.norm(np.diff(path.values, prepend=path.start[:, :1], axis=1), axis=0)
    if not distances.any():
        return np.linspace(0.0, path.edges[-1], count + 1)
    if is_near:
        parts = np.diff(path.edges) / path.edges[-1] - LEAST_SHARE / count
        guess = np.log(np.maximum(parts, np.finfo(float).eps))
        return _minimum(cost, path, guess, GAIN_TOLERANCE, is_over).edges
    guess = GUESS_POWER * np.log(np.maximum(distances / distances.max(), LEAST_SHARE**2))
    guess[[0, -1]] += log(GUESS_AT_ENDS)
    plain = QuadraticCost(matrix=np.diag([0.0] * (len(cost.matrix) - 1) + [1.0]))
    if (cost.matrix != plain.matrix).any():
        guess = _minimum(plain, path, guess, GUESS_TOLERANCE, is_over).logarithms
    return _minimum(cost, path, guess, GAIN_TOLERANCE, is_over).edges


def _minimum(
    cost: QuadraticCost,
    path: PathConditions,
    guess: FloatArray,
    tolerance: float,
    is_over: IsOver | None,
) -> '_Division':
    """
    Return the cheapest division of a path near a guess, by Newton's method.

    Along each principal direction of the curvature a step goes to the minimum of the parabola,
    or as far beyond a maximum, but no farther than a reach that follows from how well the last
    steps were foretold. Directions that are nearly flat, as where a segment would vanish, do not
    hold the others up.
    """
    here = _Division(cost, path, guess)
    reach = FIRST_REACH
    for _ in range(MAX_STEPS):
        if np.abs(here.gradient).max() <= GRADIENT_TOLERANCE:
            break
        if is_over is not None and is_over():
            break
        bends, directions = np.linalg.eigh(here.curvatures())
        sizes = np.maximum(np.abs(bends), FLATTEST * np.abs(bends).max())
        slopes = here.gradient @ directions
        if 0.5 * np.sum(slopes**2 / sizes) <= tolerance:
            break
        while True:
            step = np.clip(-slopes / sizes, -reach, reach)
            there = _Division(cost, path, here.logarithms + directions @ step)
            gain = here.logarithm - there.logarithm
            if gain > 0.0:
                break
            reach = 0.25 * float(np.abs(step).max())
            if reach < LEAST_REACH:
                return here
        foretold = -float(slopes @ step + 0.5 * bends @ step**2)
        if gain > 0.75 * foretold and np.abs(step).max() == reach:
            reach *= 2.0
        here = there
    return here


class _Division:
    """
    A path whose segments take parts of the free time, (V9) of docs/derivation.md.

    Parameters
    ----------
    cost, path
        What is minimised, and what is passed.
    logarithms
        Those of the parts, up to a common constant, shape (p,).

    """

    def __init__(self, cost: QuadraticCost, path: PathConditions, logarithms: FloatArray) -> None:
        """Find the cost and its gradient."""
        self.logarithms = logarithms
        parts = np.exp(logarithms - logarithms.max())
        self._shares = parts / parts.sum()
        duration, least = float(path.edges[-1]), LEAST_SHARE / len(parts)
        self._free_time = duration * (1.0 - LEAST_SHARE)
        inner = np.cumsum(least + (1.0 - LEAST_SHARE) * self._shares)[:-1]
        self.edges = np.concatenate([[0.0], duration * inner, [duration]])
        self._cost = PathCost(cost, replace(path, edges=self.edges))
        if not self._cost.value > 0.0:
            raise ArithmeticError(f'the cost, {self._cost.value:g}, is lost in double precision')
        self.logarithm = log(self._cost.value)
        # A longer segment moves all later edges but the last.
        by_share = np.append(np.cumsum(self._cost.slopes[::-1])[::-1], 0.0)
        by_share *= self._free_time / self._cost.value
        self.gradient: FloatArray = self._shares * (by_share - self._shares @ by_share)
        """Derivatives of the cost's logarithm by those of the parts, shape (p,)."""

    def curvatures(self) -> FloatArray:
        """Return the second derivatives of the same, shape (p, p)."""
        shares, gradient = self._shares, self.gradient
        moves = -np.outer(np.cumsum(shares)[:-1], shares)  # of the edges, by the logarithms
        moves += np.tril(np.broadcast_to(shares, moves.shape))
        moves *= self._free_time
        turned = np.outer(shares, gradient)
        curvatures: FloatArray = moves.T @ self._cost.curvatures() @ moves / self._cost.value
        curvatures += np.diag(gradient) - turned - turned.T - np.outer(gradient, gradient)
        return curvatures
