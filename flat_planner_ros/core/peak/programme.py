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
The linear programme of least peak, and what its dual values prove.

With the drive over its peak as unknown, v = u / M, and y = 1 / M, all conditions are homogeneous:
the least peak is the largest y with A v = b y and |v| <= 1 ((B6) of docs/derivation.md).
"""

from dataclasses import dataclass
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.peak.least_sum import least_sum
import numpy as np

FEASIBILITY = 1e-10
"""What the solver forgives, the least it can be told [-]."""

FREE = 1e-6
"""Distance of a coefficient from its bound from which it may correct the rest [-]."""

RANK = 1e-12
"""Ratio of singular values below which a condition is not corrected [-]."""


class PeakSolution(NamedTuple):
    """
    Solution of the programme.

    Attributes
    ----------
    coefficients
        Of the drive, shape (size,).
    multipliers
        Dual values p of the conditions, up to a common factor, shape (r,).
    cap_multipliers
        Those of the bounded quantities, up to the same factor, none negative, shape (s,).
    proven_peak
        Peak below which no coefficients meet the conditions, by the dual values.

    """

    coefficients: FloatArray
    multipliers: FloatArray
    cap_multipliers: FloatArray
    proven_peak: float


@dataclass(frozen=True, kw_only=True, eq=False)
class PeakProgramme:
    """
    Conditions of a motion in the coefficients v of its drive over the peak.

    Attributes
    ----------
    rows
        A, what the free coefficients add to the state at the end, shape (r, size).
    target
        b, what they have to add for a peak of 1, shape (r,).
    caps
        C, quantities that are bounded from above, shape (s, size).
    cap_target
        What each has already for a peak of 1, shape (s,).
    cap_limits
        Their bounds, shape (s,).

    """

    rows: FloatArray
    target: FloatArray
    caps: FloatArray
    cap_target: FloatArray
    cap_limits: FloatArray

    def solve(self) -> PeakSolution | None:
        """Return the coefficients of least peak; None where no motion meets the bounds."""
        # Orthonormal: in a fast motion the rows of the swing are nearly those of a rigid link.
        orthonormal, triangle = np.linalg.qr((self.rows / self._sizes[:, None]).T)
        rows = orthonormal.T
        target = np.linalg.solve(triangle.T, self.target / self._sizes)
        found = None if len(self.caps) else self._by_duals(rows, target)
        if found is None:
            found = self._by_general_solver(rows, target)
        if found is None:
            return None
        multipliers = np.linalg.solve(triangle, found.multipliers) / self._sizes
        return found._replace(multipliers=multipliers)

    def _by_duals(self, rows: FloatArray, target: FloatArray) -> PeakSolution | None:
        """Return the solution for orthonormal rows; None where the search does not end."""
        found = least_sum(rows, target)
        if found is None:
            return None
        # The inverse of a vertex leaves its condition number of roundings.
        share = found.values + rows.T @ (target * found.gain - rows @ found.values)
        proven = self._proven_peak(rows, target, found.multipliers, np.zeros(0))
        return PeakSolution(share / found.gain, found.multipliers, np.zeros(0), proven)

    def _by_general_solver(self, rows: FloatArray, target: FloatArray) -> PeakSolution | None:
        """Return the same with bounded quantities, by HiGHS."""
        from scipy.optimize import linprog

        # No drive of peak 1 reaches further: y in these units is at most about 1.
        unit = float(np.max(np.abs(target) / np.abs(rows).sum(axis=1)))
        equations = np.column_stack([rows, -target / unit])
        inequalities = np.column_stack([self.caps, (self.cap_target - self.cap_limits) / unit])
        cap_sizes = np.abs(inequalities).max(axis=1, initial=0.0)
        bounds = [(-1.0, 1.0)] * rows.shape[1] + [(0.0, None)]
        found = linprog(
            -np.eye(rows.shape[1] + 1)[-1],
            A_ub=inequalities / cap_sizes[:, None],
            b_ub=np.zeros(len(inequalities)),
            A_eq=equations,
            b_eq=np.zeros(len(rows)),
            bounds=bounds,
            method='highs-ds',
            options={
                'primal_feasibility_tolerance': FEASIBILITY,
                'dual_feasibility_tolerance': FEASIBILITY,
            },
        )
        if found.x is None or not found.x[-1] > 0.0:
            return None
        share, least = found.x[:-1], found.x[-1] / unit
        # What the solver forgives is corrected: first where there is room, then everywhere.
        free = 1.0 - np.abs(share) > FREE
        worth = np.column_stack([rows[:, free], -target])
        change = np.linalg.lstsq(worth, target * least - rows @ share, rcond=RANK)[0]
        share[free] += change[:-1]
        least += float(change[-1])
        share += rows.T @ (target * least - rows @ share)
        duals, of_caps = found.eqlin.marginals, -found.ineqlin.marginals / cap_sizes
        # The same for the dual values: a coefficient within its bounds is worth nothing.
        active = of_caps > 0.0
        worth = np.concatenate([rows[:, free], -self.caps[active][:, free]])
        values = np.append(duals, of_caps[active])
        values -= np.linalg.lstsq(worth.T, values @ worth, rcond=RANK)[0]
        duals = values[: len(duals)]
        of_caps[active] = np.maximum(values[len(duals) :], 0.0)
        proven = self._proven_peak(rows, target, duals, of_caps)
        return PeakSolution(share / least, duals, of_caps, proven)

    @property
    def _sizes(self) -> FloatArray:
        """Return the size of each row, shape (r,)."""
        sizes: FloatArray = np.linalg.norm(self.rows, axis=1)
        return sizes

    def _proven_peak(
        self, rows: FloatArray, target: FloatArray, p: FloatArray, of_caps: FloatArray
    ) -> float:
        """Return what multipliers prove, in orthonormal rows: there they cancel least."""
        gain = p @ target + of_caps @ (self.cap_target - self.cap_limits)
        return float(gain / np.abs(p @ rows - of_caps @ self.caps).sum())
