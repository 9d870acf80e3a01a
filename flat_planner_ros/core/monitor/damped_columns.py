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

"""Signals of a damped oscillation beside a straight line, as columns of least squares."""

from flat_planner_ros.core.arm import FloatArray
import numpy as np

ROUNDOFF = 4.0 * float(np.finfo(float).eps)
"""Size of rounding errors relative to the largest value [-]."""


def basis_columns(u: FloatArray, rates: FloatArray) -> FloatArray:
    """Return the linear unknowns' columns for rates (w, s) per unit of u: (m, 4)."""
    w, s = rates
    envelope = np.exp(-s * u)
    columns = (np.ones_like(u), u - 0.5, envelope * np.cos(w * u), envelope * np.sin(w * u))
    return np.stack(columns, axis=-1)


def rate_columns(u: FloatArray, basis: FloatArray, linear: FloatArray) -> FloatArray:
    """Return the derivatives of the fitted signal with respect to (w, s): (m, 2)."""
    cosine, sine = basis[:, 2], basis[:, 3]
    a, b = linear[2], linear[3]
    return np.stack((u * (b * cosine - a * sine), -u * (a * cosine + b * sine)), axis=-1)


def solve_linear(basis: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the orthonormal columns (m, 4) and the linear unknowns (4,) of least squares."""
    q, r = np.linalg.qr(basis)
    # A decay within one long gap leaves an empty column: any finite unknown will do for it.
    np.fill_diagonal(r, np.where(np.abs(np.diagonal(r)) < ROUNDOFF, 1.0, np.diagonal(r)))
    return q, np.linalg.solve(r, q.T @ y)
