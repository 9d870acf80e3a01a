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

"""NumPy's floor of a cold plan: what its array operations cost without what joins them."""

from collections.abc import Callable

from flat_planner_ros.core import Plan
from flat_planner_ros.core.motion_law import probes
from flat_planner_ros.core.motion_law.series_basis import PROBE_DEPTH
import numpy as np
import problem

ORDERS = 7
"""Derivatives 0 to 6."""


def array_operations(made: Plan) -> Callable[[], object]:
    """
    Return a function that does what a cold plan asks of NumPy, on arrays of the same shapes.

    The solved series, the law at the times of its certificate, and its samples; Legendre and
    Chebyshev polynomials there are known from before. Nothing is formed, scaled, checked or kept.
    """
    terms = len(made.problem.unit.law.total.amplitudes) - 1
    size = made.problem.unit.law.total.series.shape[1]
    parts = _series_operations(terms), _certificate_operations(terms)
    samples = _sample_operations(terms, size, made.problem.flat_map.effort)

    def run() -> object:
        for part in parts:
            part()
        return samples()

    return run


def _series_operations(terms: int) -> Callable[[], object]:
    """Return what forms and solves the system of a series."""
    energy, coefficients = np.ones((ORDERS, (terms + 1) ** 2)), np.ones(ORDERS)
    matrix, right = np.eye(terms) + 0.1 * np.ones((terms, terms)), np.ones((terms, 1))

    def run() -> object:
        return coefficients @ energy, np.linalg.solve(matrix, right)

    return run


def _certificate_operations(terms: int) -> Callable[[], object]:
    """Return what gives derivatives and parts of the equation for the certificate, and sums."""
    weights, amplitudes = np.ones(ORDERS - 1), np.ones(terms + 1)
    table = np.ones((terms + 1, (2 * ORDERS - 1) * probes(PROBE_DEPTH).shape[1]))

    def run() -> object:
        values = (amplitudes @ table).reshape(2 * ORDERS - 1, -1)
        jet, parts = values[:ORDERS], values[ORDERS:]
        return np.abs(jet).max(axis=1), weights @ parts, weights @ np.abs(parts)

    return run


def _sample_operations(terms: int, size: int, row: np.ndarray) -> Callable[[], object]:
    """Return what gives derivatives 0 to 6 and the torque on half the grid, mirrored."""
    half = problem.SAMPLES // 2 + 1
    amplitudes, basis = np.ones(terms + 1), np.ones((terms + 1, ORDERS * size))
    at_odd, at_even = np.ones((size // 2, half)), np.ones((size // 2, half))

    def run() -> object:
        table = np.empty((ORDERS + 1, problem.SAMPLES))
        series = (amplitudes @ basis).reshape(ORDERS, size)
        odd, even = series[::2, 1::2] @ at_odd, series[1::2, ::2] @ at_even
        mirrored = table[:ORDERS, ::-1]
        table[:ORDERS:2, :half], table[1:ORDERS:2, :half] = odd, even
        np.negative(odd, out=mirrored[::2, :half])
        mirrored[1::2, :half] = even
        np.matmul(row, table[: len(row)], out=table[-1])
        return np.multiply(table, problem.DISTANCE)

    return run
