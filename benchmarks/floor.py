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
import numpy as np
import problem

BLOCK = 64
"""Times whose exponentials are multiples of one table, as in the planner."""

ORDERS = 7
"""Derivatives 0 to 6."""


def array_operations(made: Plan) -> Callable[[], object]:
    """
    Return a function that does what a cold plan asks of NumPy, on arrays of the same shapes.

    Roots of the equation and the solved boundary conditions with one correction, or the solved
    series of a slow one; the law at the times of its certificate, and its samples. Powers at those
    times are known from before. Nothing is formed, scaled, checked or kept.
    """
    unit = made.problem.unit
    total = unit.law.total
    is_series = not len(total.decays)
    found = _series_operations(total) if is_series else _law_operations(unit.coefficients)
    parts = found, _certificate_operations(total)
    samples = _sample_operations(total, made.problem.flat_map.effort)

    def run() -> object:
        for part in parts:
            part()
        return samples()

    return run


def _law_operations(coefficients: np.ndarray) -> Callable[[], object]:
    """Return what finds the roots and solves the boundary conditions."""
    reduced = np.trim_zeros(coefficients, 'f')
    scaled = reduced[-2::-1] / np.abs(reduced[-2::-1]).max() if len(reduced) > 1 else reduced[:0]
    companion = np.eye(len(scaled), k=-1)
    companion[:1] = -scaled
    matrix, target = np.eye(6) + 0.1 * np.tri(6).T, np.ones(6)

    def run() -> object:
        if len(companion):
            np.linalg.eigvals(companion)
        inverse = np.linalg.inv(matrix)
        solved = inverse @ target
        solved += inverse @ (target - matrix @ solved)
        return solved

    return run


def _series_operations(total) -> Callable[[], object]:
    """Return what solves the system of a slow equation and writes its law in powers."""
    orders, powers = total.factors.shape
    terms = (powers - 12) // 2
    system, table = np.ones((7, terms * (terms + 1))), np.ones((terms + 1, orders * powers))
    coefficients, matrix = np.ones(7), np.eye(terms) + 0.1 * np.tri(terms).T

    def run() -> object:
        right = coefficients @ system
        return np.append(np.linalg.solve(matrix, right[:terms]), 1.0) @ table

    return run


def _certificate_operations(total) -> Callable[[], object]:
    """Return what gives derivatives 0 to 12 for the certificate, their peaks and sums."""
    distances, weights = probes(), np.ones(6)
    count = len(total.decays)
    basis = np.ones((total.factors.shape[1], distances.shape[1]))

    def run() -> object:
        if count:
            fall = np.exp(-total.decays[:, None, None] * distances)
            parts = basis[: 4 * count].reshape(count, 2, 2, -1)
            parts[:, :, 0], parts[:, :, 1] = fall.real, fall.imag
        jet = total.factors @ basis
        return np.abs(jet).max(axis=1), weights @ jet[2::2], weights @ np.abs(jet[2::2])

    return run


def _sample_operations(total, row: np.ndarray) -> Callable[[], object]:
    """Return what gives derivatives 0 to 6 and the torque on half the grid, mirrored."""
    half = problem.SAMPLES // 2 + 1
    count, blocks = len(total.decays), -(-half // BLOCK)
    signs = np.ones((ORDERS, 1))
    exponents = -np.abs(total.decays[:, None]) * np.linspace(0.0, 2.0, BLOCK + 2 * blocks)
    amplitudes = total.factors[:ORDERS, None, : 4 * count].repeat(blocks, axis=1)
    powers = np.ones((total.factors.shape[1] - 4 * count, half))

    def run() -> object:
        table = np.empty((ORDERS + 1, problem.SAMPLES))
        part = total.factors[:ORDERS, 4 * count :] @ powers
        if count:
            fall = np.exp(exponents)
            fine = np.empty((count, 2, 2, BLOCK))
            fine[:, 0, 0], fine[:, 0, 1] = fall[:, :BLOCK].real, fall[:, :BLOCK].imag
            fine[:, 1] = fine[:, 0, :, ::-1]
            product = amplitudes.reshape(-1, 4 * count) @ fine.reshape(-1, BLOCK)
            part += product.reshape(ORDERS, -1)[:, :half]
        np.multiply(part, signs, out=table[:ORDERS, ::-1][:, :half])
        table[:ORDERS, :half] = part
        np.matmul(row, table[: len(row)], out=table[-1])
        return np.multiply(table, problem.DISTANCE)

    return run
