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
Dual certificate: what no effort whatsoever can do.

Multipliers p of the conditions at the end make a switching function s(left) of the time that is
left. Any drive u that meets the conditions has p b = integral of s u <= peak * integral of |s|:
a bound on the peak of every motion of this duration, and on the duration of every motion of this
peak, whoever found p ((B7) of docs/derivation.md).
"""

from dataclasses import dataclass

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.peak.driven_mode import DrivenMode
import numpy as np

GRID_PER_TURN = 40
"""Points per turn of the oscillation at which the switching function is looked at."""

MIN_GRID = 400
"""Fewest of these points."""

ROOT_STEPS = 60
"""Steps towards a duration; five are usual, and halvings alone would do with so many."""

ROUNDING = 1e-13
"""Distance from a root, relative to what is sought, at which it is found [-]."""

NEWTON_STEPS = 3
"""Steps that square the distance of a switch to its place, from the chord's."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SwitchingFunction:
    """
    Line and oscillation over the time that is left: the state at the end per unit of the drive.

    Attributes
    ----------
    mode
        What is driven.
    multipliers
        p, shape (4,) or (6,), in the order of `DrivenMode.end_rows`.

    """

    mode: DrivenMode
    multipliers: FloatArray

    def at(self, left: FloatArray | float) -> FloatArray:
        """Return the values, shape (m,)."""
        swing, slope = self._amplitudes
        growth = np.exp(self.mode.pole * left)
        line = self.multipliers[0] + self.multipliers[1] * left
        values: FloatArray = self.mode.gain * line + ((swing + slope * left) * growth).real
        return values

    def area(self, left: FloatArray | float) -> FloatArray:
        """Return an antiderivative, shape (m,), or () of a number."""
        swing, slope = self._amplitudes
        pole = self.mode.pole
        growth = np.exp(pole * left)
        line = left * (self.multipliers[0] + 0.5 * self.multipliers[1] * left)
        oscillating = ((swing + slope * left) / pole - slope / pole**2) * growth
        area: FloatArray = self.mode.gain * line + oscillating.real
        return area

    def _slope(self, left: FloatArray) -> FloatArray:
        """Return the derivative."""
        swing, slope = self._amplitudes
        pole = self.mode.pole
        growth = (pole * swing + slope * (1.0 + pole * left)) * np.exp(pole * left)
        values: FloatArray = self.mode.gain * self.multipliers[1] + growth.real
        return values

    @property
    def _amplitudes(self) -> tuple[complex, complex]:
        """Return the complex amplitudes of exp(pole left) and left exp(pole left)."""
        pairs = self.mode.swing_gain * np.append(self.multipliers[2:], [0.0, 0.0])
        return complex(pairs[0], -pairs[1]), complex(pairs[2], -pairs[3])

    def magnitude(self, duration: float) -> float:
        """Return the integral of ``|s|`` over the times that are left of a duration."""
        edges = np.concatenate([[0.0], self.switches(duration), [duration]])
        return float(np.abs(np.diff(self.area(edges))).sum())

    def magnitudes(self, durations: FloatArray) -> FloatArray:
        """Return the integrals of ``|s|`` over the times left of durations, shape (m,)."""
        edges = np.append(0.0, self.switches(float(durations.max())))
        areas = self.area(edges)
        before = np.append(0.0, np.cumsum(np.abs(np.diff(areas))))
        last = np.searchsorted(edges, durations, side='right') - 1
        magnitudes: FloatArray = before[last] + np.abs(self.area(durations) - areas[last])
        return magnitudes

    def switches(self, duration: float) -> FloatArray:
        """Return the times left at which s changes its sign, ascending, shape (m,) [s]."""
        turns = self.mode.frequency * duration / (2.0 * np.pi)
        grid = np.linspace(0.0, duration, MIN_GRID + int(GRID_PER_TURN * turns))
        values = self.at(grid)
        before = np.flatnonzero(np.signbit(values[:-1]) != np.signbit(values[1:]))
        low, high = grid[before], grid[before + 1]
        left = low - values[before] * (high - low) / (values[before + 1] - values[before])
        for _ in range(NEWTON_STEPS):
            left = np.clip(left - self.at(left) / self._slope(left), low, high)
        return left

    def shortest_duration(self, target: float, peak: float, longest: float) -> float:
        """
        Return a duration below which no drive within a peak meets the conditions.

        Parameters
        ----------
        target
            p b, above zero; does not depend on the duration.
        peak
            Largest magnitude of the drive.
        longest
            A duration in which it is met [s].

        """
        edges = np.concatenate([[0.0], self.switches(longest), [longest]])
        reached = peak * np.append(0.0, np.cumsum(np.abs(np.diff(self.area(edges)))))
        last = int(np.searchsorted(reached, target))
        if last >= len(edges):
            return longest
        low, high = float(edges[last - 1]), float(edges[last])
        # Between two switches s has one sign, and the area runs one way.
        sought = (target - float(reached[last - 1])) / peak
        begin = float(self.area(low))
        left = high
        for _ in range(ROOT_STEPS):
            excess = abs(float(self.area(left)) - begin) - sought
            if abs(excess) <= ROUNDING * abs(sought):
                break
            low, high = (low, left) if excess > 0.0 else (left, high)
            slope = abs(float(self.at(left)))
            # Newton's method, halving where it would leave the bracket.
            left = left - excess / slope if slope > 0.0 else low
            if not low < left < high:
                left = 0.5 * (low + high)
        return left
