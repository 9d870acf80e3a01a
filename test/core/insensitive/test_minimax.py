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

"""The minimax problem: its optimum against a bound from below, and against plain reweighting."""

from flat_planner_ros.core.arm import Drive
from flat_planner_ros.core.insensitive.insensitivity import Insensitivity, Nominal
from flat_planner_ros.core.insensitive.momentum_angle import LEAST_OF_ALL
from flat_planner_ros.core.insensitive.oscillator import Oscillator
from flat_planner_ros.core.insensitive.trade import GAP, Trade
import numpy as np
import pytest
from truth import random_arm, random_box


def random_problem(seed: int) -> tuple[Trade, float]:
    """Return a problem and the weight of its residual."""
    rng = np.random.default_rng([seed, 7])
    arm, period = random_arm(rng)
    wanted = Insensitivity(
        box=random_box(rng),
        nominal=list(Nominal)[rng.integers(2)],
        modes=int(rng.integers(6, 40)),
    )
    oscillator = Oscillator.of(arm, list(Drive)[rng.integers(2)])
    problem = Trade.of(oscillator, period * 10.0 ** rng.uniform(-0.3, 1.0), wanted)
    return problem, 10.0 ** rng.uniform(1.0, 4.5)


def squares_of(problem: Trade, c: np.ndarray) -> np.ndarray:
    """Return the squared residuals of the arms that are weighed."""
    matrix, start = problem.residuals(problem.points[0])
    return np.square(np.split(matrix @ c + start, 2)).sum(axis=0)


@pytest.mark.parametrize('seed', range(30))
def test_no_coefficients_are_better_by_more_than_the_gap(seed):
    problem, weight = random_problem(seed)
    found = problem.solve(weight)
    total, least = LEAST_OF_ALL * weight**2, problem.basis.least
    cost = least + found.c @ found.c + total * squares_of(problem, found.c).max()
    assert found.cost * LEAST_OF_ALL == pytest.approx(cost, rel=1e-9)
    # The least of any weighted mean is a bound from below, here by orthogonal factors.
    assert found.shares.min() >= 0.0
    assert found.shares.sum() == pytest.approx(1.0, abs=1e-9)
    matrix, start = problem.residuals(problem.points[0])
    roots = np.sqrt(total * np.tile(found.shares, 2))
    rows = np.vstack([np.eye(len(found.c)), roots[:, None] * matrix])
    wanted = np.concatenate([np.zeros(len(found.c)), -roots * start])
    best = np.linalg.lstsq(rows, wanted)[0]
    bound = least + np.sum((rows @ best - wanted) ** 2)
    assert bound * (1.0 - 1e-9) <= cost <= bound * (1.0 + 1.01 * GAP)


@pytest.mark.parametrize('seed', range(3))
def test_plain_reweighting_comes_to_the_same_cost(seed):
    problem, weight = random_problem(seed)
    matrix, start = problem.residuals(problem.points[0])
    total, shares = LEAST_OF_ALL * weight**2, problem.points[1]
    costs = []
    for _ in range(2000):
        weighted = matrix.T * np.tile(total * shares, 2)
        c = np.linalg.solve(np.eye(len(matrix.T)) + weighted @ matrix, -weighted @ start)
        squares = np.square(np.split(matrix @ c + start, 2)).sum(axis=0)
        costs.append(problem.basis.least + c @ c + total * squares.max())
        shares = shares * np.sqrt(squares)
        shares /= shares.sum()
    cost = problem.solve(weight).cost * LEAST_OF_ALL
    assert cost == pytest.approx(min(costs), rel=1.5 * GAP)
