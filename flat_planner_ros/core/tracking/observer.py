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

"""Estimate of what a chain does now, and will do when the next input acts, from its angles."""

from math import factorial, floor, inf
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.tracking.chain import Chain
from flat_planner_ros.core.tracking.gains import observer_gain
import numpy as np

TERMS = 8
"""Terms of the exponential series over less than a period: 1e-9 of what moves 1 rad in it."""

POWERS = np.arange(TERMS)

PERIODS = 4
"""Samples that come after so many periods still have a gain of their own."""

LONGEST = 1000
"""Periods over which one input is followed: an arm unseen for longer, no model knows any more."""

ROUNDING = 1e-9
"""Share of a period that is no time [-]."""


class _Input(NamedTuple):
    """An input (columns,) that acts from a time [s] until the next one."""

    time: float
    value: FloatArray


class Observer:
    """
    Observer of equal chains side by side, with a constant disturbance of each one's input.

    It knows which inputs act when, those of the near future too, so that a delay of the loop is
    compensated: the state is carried forward by the model.

    Parameters
    ----------
    chain
        The model.
    period
        Usual time between two samples [s].
    bandwidth
        Of the estimate [rad/s].
    columns
        Number of chains, until a restart with another number.

    """

    def __init__(self, chain: Chain, period: float, bandwidth: float, columns: int = 1) -> None:
        """Rest at zero."""
        self._chain, self._period = chain, period
        self._gains = [observer_gain(chain, k * period, bandwidth) for k in range(1, PERIODS + 1)]
        self._flow = np.column_stack(chain.over(period))
        self._series = np.array(
            [np.linalg.matrix_power(chain.disturbed, k)[:-1] / factorial(k) for k in range(TERMS)]
        ).reshape(TERMS, -1)
        m = chain.order
        self.restart(-inf, np.zeros((m // 2, columns)), np.zeros((m // 2, columns)))

    def restart(self, time: float, angles: FloatArray, rates: FloatArray) -> None:
        """Take angles and rates, shape (m / 2, columns), for the truth; forget inputs."""
        self.time, self._columns = time, angles.shape[1]
        self.state = np.vstack([angles, rates, np.zeros((1, self._columns))])
        self._acting = np.zeros(self._columns)
        self._pending: list[_Input] = []

    def continue_from(self, other: 'Observer') -> None:
        """Take over the state, the disturbance and the inputs of another one."""
        self.time, self.state = other.time, other.state
        self._acting, self._pending = other._acting, list(other._pending)

    def forget_disturbance(self) -> None:
        """Start the estimate of the disturbance anew."""
        self.state[-1] = 0.0

    def apply(self, time: float, value: FloatArray) -> None:
        """Note that an input (columns,) acts from a time [s] on; it replaces later ones."""
        self._pending = [entry for entry in self._pending if entry.time < time]
        self._pending.append(_Input(time, value))

    def correct(self, time: float, angles: FloatArray) -> FloatArray:
        """
        Take in measured angles; return by how much they differ from what was expected.

        Parameters
        ----------
        time
            Of the measurement [s], not before the last one.
        angles
            Shape (m / 2, columns) [rad].

        """
        elapsed = time - self.time
        self.state = self._carried(self.state, time)
        while self._pending and self._pending[0].time <= time:
            self._acting = self._pending.pop(0).value
        self.time = time
        surprise: FloatArray = angles - self.state[: self._chain.angles]
        periods = min(max(1, round(elapsed / self._period)), PERIODS)
        self.state = self.state + self._gains[periods - 1] @ surprise
        return surprise

    def predicted(self, time: float) -> FloatArray:
        """Return states and disturbance at a time from now on, shape (m + 1, columns)."""
        return self._carried(self.state, time)

    def _carried(self, state: FloatArray, until: float) -> FloatArray:
        """Return what a state of the present becomes of under the inputs noted."""
        now, acting = self.time, self._acting
        for entry in self._pending:
            if entry.time >= until:
                break
            if entry.time > now:
                state, now = self._moved(state, acting, entry.time - now), entry.time
            acting = entry.value
        return self._moved(state, acting, until - now)

    def _moved(self, state: FloatArray, acting: FloatArray, time: float) -> FloatArray:
        """Return what a state becomes of under one input, for a time of `LONGEST` at most."""
        # A clock that was set forward asks for years.
        time = min(time, LONGEST * self._period)
        whole = floor(time / self._period + ROUNDING) if self._columns else 0
        rest = time - whole * self._period
        for _ in range(whole):
            state = self._flow.dot(np.concatenate([state, acting[None]]))
        if not self._columns or rest < ROUNDING * self._period:
            return state
        flow = (rest**POWERS).dot(self._series).reshape(self._flow.shape)
        moved: FloatArray = flow.dot(np.concatenate([state, acting[None]]))
        return moved
