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

"""Chebyshev series: values at any places, many degrees at a time."""

from functools import lru_cache

from flat_planner_ros.core.arm import FloatArray, locked
import numpy as np

SIZES_KEPT = 16
"""Matrices of different size that are remembered."""


@lru_cache(maxsize=SIZES_KEPT)
def from_legendre(size: int) -> FloatArray:
    """
    Return the Chebyshev coefficients of the Legendre polynomials, shape (size, size).

    P_n(cos t) = sum_k g_k g_(n - k) cos((n - 2 k) t) with g_k = (1/2)(3/2)...(k - 1/2) / k!.
    """
    k = np.arange(1.0, size)
    factors = np.cumprod(np.append(1.0, 1.0 - 0.5 / k))
    matrix = np.zeros((size, size))
    for n in range(size):
        # From cos(-n t) to cos(n t): those of the same degree come together.
        terms = factors[: n + 1] * factors[n::-1]
        degrees = np.abs(np.arange(-n, n + 1, 2))
        np.add.at(matrix[:, n], degrees, terms)
    return locked(matrix)


def chebyshev_values(places: FloatArray, size: int) -> FloatArray:
    """Return the first Chebyshev polynomials, two or more, at places in [-1, 1], (size, m)."""
    table = np.empty((size, len(places)))
    table[0], table[1] = 1.0, places
    known = 2
    while known < size:
        # T_(k + j) = 2 T_k T_j - T_(k - j).
        last = known - 1
        more = min(last, size - known)
        new = table[known : known + more]
        np.multiply(table[1 : more + 1], 2.0 * table[last], out=new)
        new -= table[last - more : last][::-1]
        known += more
    return table
