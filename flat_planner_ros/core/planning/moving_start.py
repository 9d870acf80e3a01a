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

"""Motions that start while the arm moves: extremals from given derivatives to rest."""

from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.motion_law import (
    BoundaryConditions,
    CONDITIONS,
    ExponentialLaw,
    extremals,
    MAX_DERIVATIVE,
    probes,
    stationarity_residual,
)
from flat_planner_ros.core.planning.problem import MotionProblem
import numpy as np


class CertifiedLaws(NamedTuple):
    """
    Laws and the proof of their quality.

    Attributes
    ----------
    laws
        One for each planned variable.
    boundary_residual
        Largest miss at the ends, relative to each derivative's peak [-].
    optimality_residual
        Largest Euler-Lagrange residual relative to its terms [-].

    """

    laws: tuple[ExponentialLaw, ...]
    boundary_residual: float
    optimality_residual: float


def laws_to_rest(problem: MotionProblem, start: FloatArray, final: FloatArray) -> CertifiedLaws:
    """
    Return the optimal laws from given derivatives to rest.

    Parameters
    ----------
    problem
        Equation and duration.
    start
        Derivatives 0 to 5 of every planned variable, shape (n - 1, 6) [rad/s^k].
    final
        Planned variables at the end, shape (n - 1,) [rad].

    Raises
    ------
    UncertifiedPlan
        The boundary conditions are singular in double precision.
    ArithmeticError
        The numbers leave double precision.

    """
    # Counted from the end, so that a distant place costs no digits of a short way.
    ways = start.copy()
    ways[:, 0] -= final
    rest = np.zeros(CONDITIONS)
    coefficients = problem.cost.characteristic()
    laws = extremals(
        coefficients, problem.duration, [BoundaryConditions(start=way, end=rest) for way in ways]
    )
    powers = (0.5 * problem.duration) ** np.arange(CONDITIONS + 1.0)
    normalised = coefficients * powers[::-1] ** 2
    boundary = optimality = 0.0
    for law, way in zip(laws, ways, strict=True):
        if not way.any():
            continue
        jet = _jet(law)
        peaks = np.abs(jet[: CONDITIONS + 1]).max(axis=1)
        if not (peaks / powers).max() < MAX_DERIVATIVE:
            raise OverflowError(f'derivatives exceed {MAX_DERIVATIVE:g}')
        ends = way * powers[:CONDITIONS]
        miss = np.maximum(np.abs(jet[:CONDITIONS, 0] - ends), np.abs(jet[:CONDITIONS, -1]))
        boundary = max(boundary, float((miss / peaks[:CONDITIONS]).max()))
        optimality = max(optimality, stationarity_residual(normalised, jet))
    shifted = tuple(
        law.transformed(1.0, place) for law, place in zip(laws, final.tolist(), strict=True)
    )
    return CertifiedLaws(shifted, boundary, optimality)


def _jet(law: ExponentialLaw) -> FloatArray:
    """Return the derivatives 0 to 12 in normalised time where laws are certified, (13, m)."""
    near = probes()[0, :-1]
    after_start = np.concatenate([[0.0], near, 2.0 - near[::-1], [2.0]])
    return law.normalised_jet(np.array([after_start, after_start[::-1]]), 2 * CONDITIONS)
