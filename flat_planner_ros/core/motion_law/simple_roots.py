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

"""Characteristic roots of many equations, each taken for a simple one."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from flat_planner_ros.core.arm import ComplexArray, FloatArray
from flat_planner_ros.core.motion_law.basis import CONDITIONS
from flat_planner_ros.core.motion_law.roots import companion_roots, CONVERGED, MAX_STEPS
from flat_planner_ros.core.motion_law.unit_motions import IntArray
import numpy as np


@dataclass(frozen=True, kw_only=True, eq=False)
class SimpleRoots:
    """
    Roots of equations that have equally many of each kind.

    Attributes
    ----------
    rows
        Where the equations stand among those that were given, shape (p,).
    decays
        One root of each +-beta and conjugates, real part positive, complex ones first, (p, m) [-].
    zeros
        Roots z = beta^2 that are zero.
    pairs
        Complex ones among the decays.

    """

    rows: IntArray
    decays: ComplexArray
    zeros: int
    pairs: int

    def chosen(self, which: IntArray) -> 'SimpleRoots':
        """Return those of some equations."""
        return replace(self, rows=self.rows[which], decays=self.decays[which])


def simple_roots(coefficients: FloatArray) -> Iterator[SimpleRoots]:
    """
    Return the roots of equations; those that are not found are left out.

    Parameters
    ----------
    coefficients
        a_0 ... a_6 of each, a_6 = 1, shape (p, 7) [-].

    """
    zeros = (coefficients != 0.0).argmax(axis=1)
    for count in np.unique(zeros[zeros < CONDITIONS]).tolist():
        rows = np.flatnonzero(zeros == count)
        squares = _squares(coefficients[rows, count:])
        upper = (squares.imag > 0.0).sum(axis=1)
        is_found = np.isfinite(squares).all(axis=1)
        for pairs in np.unique(upper).tolist():
            some = np.flatnonzero((upper == pairs) & is_found)
            # Complex ones first, without their conjugates.
            order = np.argsort(-squares[some].imag, axis=1, kind='stable')
            ordered = np.take_along_axis(squares[some], order, axis=1)
            decays = np.sqrt(ordered[:, : CONDITIONS - count - pairs])
            grows = (decays.real > 0.0).all(axis=1)
            yield SimpleRoots(
                rows=rows[some[grows]], decays=decays[grows], zeros=count, pairs=pairs
            )


def characteristic_roots(coefficients: FloatArray) -> ComplexArray:
    """Return the roots of an equation a_0 ... a_6, one of each +-beta, not refined, shape (6,)."""
    zeros = next(k for k, a in enumerate(coefficients.tolist()) if a != 0.0)
    squares = np.zeros(len(coefficients) - 1, dtype=complex)
    squares[zeros:] = companion_roots(coefficients[zeros:])
    roots: ComplexArray = np.sqrt(squares)
    return roots


def _squares(ascending: FloatArray) -> ComplexArray:
    """Return the roots of polynomials after Newton steps; NaN where these do not converge."""
    degree = ascending.shape[1] - 1
    order = np.arange(degree, 0.0, -1.0)
    # Scaled to size one, so that nothing overflows.
    scale = (np.abs(ascending[:, :-1]) ** (1.0 / order)).max(axis=1, keepdims=True)
    scaled = ascending[:, :-1] / scale**order
    companion = np.zeros((len(ascending), degree, degree))
    companion[:, np.arange(1, degree), np.arange(degree - 1)] = 1.0
    companion[:, 0] = -scaled[:, ::-1]
    z: ComplexArray = np.linalg.eigvals(companion).astype(complex)
    step = np.zeros_like(z)
    with np.errstate(all='ignore'):
        for _ in range(MAX_STEPS):
            value, slope = np.ones_like(z), np.zeros_like(z)
            for column in scaled.T[::-1]:
                slope = slope * z + value
                value = value * z + column[:, None]
            step = value / slope
            z = z - step
            if (np.abs(step) <= CONVERGED * np.abs(z)).all():
                break
        is_found = (np.abs(step) <= CONVERGED * np.abs(z)).all(axis=1, keepdims=True)
    return np.where(is_found, z * scale, np.nan)
