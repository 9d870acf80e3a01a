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

"""What the core refuses, and with which numbers."""

import numpy as np


class FlatPlannerError(Exception):
    """Base of every error that this package raises on purpose."""


class InvalidModel(FlatPlannerError):
    """The arm's data are not those of a physical arm."""


class NotFlat(InvalidModel):
    """
    The arm is not differentially flat: a centre of mass is off its joint axis.

    Attributes
    ----------
    link
        Number of the offending link, counted from 1.
    static_moment
        Its remaining first moment of mass about its joint axis [kg m].

    """

    def __init__(self, link: int, static_moment: float, message: str) -> None:
        """Keep the link and its unbalance, so that a caller can mend it."""
        super().__init__(message)
        self.link = link
        self.static_moment = static_moment


class InvalidCost(FlatPlannerError):
    """The cost matrix or a weight defines no convex planning problem."""


class InvalidRequest(FlatPlannerError):
    """The motion asked for has no meaning (not finite, no duration)."""


class OutOfReach(FlatPlannerError):
    """
    No motion meets a bound that was asked for.

    Attributes
    ----------
    quantity
        What is bounded: `effort` [N m] or `residual` [rad].
    value, limit
        The best that was found, and the bound.

    """

    def __init__(self, quantity: str, value: float, limit: float, message: str) -> None:
        """Keep the numbers, so that a caller can report them."""
        super().__init__(message)
        self.quantity = quantity
        self.value = value
        self.limit = limit


class UncertifiedPlan(FlatPlannerError):
    """
    A computed motion law misses the accuracy that a plan promises.

    Attributes
    ----------
    quantity
        What was checked.
    residual, tolerance
        What was found and what is allowed [-].

    """

    def __init__(self, quantity: str, residual: float, tolerance: float) -> None:
        """Keep both numbers, so that a caller can report them."""
        super().__init__(f'{quantity} {residual:.2e} exceeds {tolerance:.0e}')
        self.quantity = quantity
        self.residual = residual
        self.tolerance = tolerance


class UncertifiedLoop(FlatPlannerError):
    """
    A feedback loop is not stable enough for every arm that it may meet.

    Attributes
    ----------
    margin, bound
        Least distance of its frequency response from -1, 0 if it is unstable, and the least one
        allowed [-].
    decay_rate
        At which its slowest deviation dies away, negative if it grows [1/s].
    factors
        On stiffness, damping and inertia of the worst arm [-].
    bandwidth
        Largest one that would do [rad/s], 0 if there is none.

    """

    def __init__(
        self,
        margin: float,
        bound: float,
        decay_rate: float,
        factors: tuple[float, float, float],
        bandwidth: float = 0.0,
    ) -> None:
        """Keep the numbers, so that a caller can report them."""
        k, c, inertia = factors
        found = f'its margin is {margin:.3g}' if decay_rate > 0.0 else 'it is unstable'
        lower = f'lower bandwidth to {bandwidth:.3g} rad/s, lower' if bandwidth else 'lower'
        super().__init__(
            f'loop refused: with stiffness, damping and inertia times {k:g}, {c:g} and '
            f'{inertia:g} {found} (slowest decay {decay_rate:.3g} 1/s); a margin of {bound:g} is '
            f'asked for; {lower} delay or uncertainty, or raise rate'
        )
        self.margin = margin
        self.bound = bound
        self.decay_rate = decay_rate
        self.factors = factors
        self.bandwidth = bandwidth


class InvalidCommand(FlatPlannerError):
    """The commanded trajectory cannot be played."""


def strict_arithmetic() -> np.errstate:
    """Return a context in which numbers that leave double precision raise ArithmeticError."""
    return np.errstate(over='raise', invalid='raise', divide='raise', under='ignore')
