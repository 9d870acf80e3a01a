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

"""Legendre series: integrals, derivatives and values of their coefficients."""

from functools import lru_cache

from flat_planner_ros.core.arm import FloatArray, locked
import numpy as np
from numpy.polynomial import legendre

SIZES_KEPT = 16
"""Matrices of different size that are remembered."""


@lru_cache(maxsize=SIZES_KEPT)
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


@lru_cache(maxsize=SIZES_KEPT)
def differentiation(size: int) -> FloatArray:
    """Return the matrix of the derivative on Legendre coefficients."""
    # P_k' = (2 k - 1) P_(k-1) + (2 k - 5) P_(k-3) + ...
    below, order = np.indices((size, size))
    is_part = (order > below) & ((order - below) % 2 == 1)
    matrix = np.where(is_part, 2.0 * below + 1.0, 0.0)
    return locked(matrix)


def legendre_values(places: FloatArray, size: int) -> FloatArray:
    """Return the first Legendre polynomials at some places in [-1, 1], shape (size, m)."""
    return np.asarray(legendre.legvander(places, size - 1).T, dtype=float)
