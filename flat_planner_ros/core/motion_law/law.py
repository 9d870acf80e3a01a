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
Motion law: the planned function of time, and every derivative of it, as a sum of modes.

The modes are fixed in normalised time; a law stretches them to its duration, scales and shifts
them, so that one set serves any distance and any place.
"""

from dataclasses import dataclass, replace
from functools import cached_property

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.motion_law.modes import Mode, mode_sum, ModeSum, TOP_ORDER
import numpy as np
from numpy.typing import ArrayLike

MAX_DERIVATIVE = 1e150
"""Largest derivative of a planned variable; its square, as in a cost, has room [rad/s^k]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ExponentialLaw:
    """
    A function of time on [0, duration], infinitely smooth.

    Attributes
    ----------
    duration
        Length of the motion [s].
    modes
        Their sum, scaled and shifted, is the value [rad].
    factor
        Multiplies the sum [-].
    offset
        Is added to the value [rad].

    """

    duration: float
    modes: tuple[Mode, ...]
    factor: float = 1.0
    offset: float = 0.0

    def __call__(self, t: ArrayLike, order: int = 0) -> FloatArray:
        """
        Return a derivative with respect to time.

        Parameters
        ----------
        t
            Times from the start of the motion [s], shape (m,).
        order
            Which derivative; 0 is the value itself.

        Returns
        -------
        FloatArray
            The derivative, shape (m,) [rad/s^order].

        """
        derivative: FloatArray = self.jet(t, order)[order]
        return derivative

    def jet(self, t: ArrayLike, order: int) -> FloatArray:
        """
        Return the value and its derivatives up to an order.

        Parameters
        ----------
        t
            Times from the start of the motion, shape (m,) [s].
        order
            Highest derivative wanted.

        Returns
        -------
        FloatArray
            Row k holds the k-th derivative, shape (order + 1, m) [rad/s^k].

        """
        times = np.atleast_1d(np.asarray(t, dtype=float))
        rate = 2.0 / self.duration
        terms = self.terms if order <= TOP_ORDER else mode_sum(self.modes, order)
        # Both distances are formed from t: a boundary layer may be far thinner than the spacing
        # of floating-point numbers near x = 1.
        table = terms.at(rate * np.array([times, self.duration - times]), order)
        table *= (self.factor * rate ** np.arange(order + 1.0))[:, None]
        table[0] += self.offset
        return table

    @cached_property
    def terms(self) -> ModeSum:
        """Return the modes, ready for evaluation in normalised time."""
        return mode_sum(self.modes)

    def transformed(self, factor: float, offset: float) -> 'ExponentialLaw':
        """Return offset + factor times this law."""
        return replace(self, factor=factor * self.factor, offset=offset + factor * self.offset)
