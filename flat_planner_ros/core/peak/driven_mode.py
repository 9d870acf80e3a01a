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
Driven mode: how sigma and the passive joint's oscillation answer to an effort linear in pieces.

The executor joins the samples of an effort by straight lines. The transition over one such piece
is known in closed form, so conditions on the end of a motion hold for the effort that is played,
not only for a curve behind it ((B2) to (B4) of docs/derivation.md).
"""

from dataclasses import dataclass
from functools import cache
from itertools import accumulate
from math import factorial
from typing import NamedTuple

from flat_planner_ros.core.arm import (
    ComplexArray,
    Drive,
    FloatArray,
    InvalidRequest,
    locked,
    PlanarArm,
)
import numpy as np

SERIES_TERMS = 20
"""Terms of the exponential's series; on one piece its argument is at most 1."""


class ModeState(NamedTuple):
    """
    State of the last two links.

    Attributes
    ----------
    sigma, sigma_rate
        Momentum angle, or angle of link n-1 under a servo [rad], [rad/s].
    swing
        w''' - conj(pole) w'', which only the oscillation has [rad/s^3].

    """

    sigma: FloatArray
    sigma_rate: FloatArray
    swing: ComplexArray


@dataclass(frozen=True, kw_only=True)
class DrivenMode:
    """
    The last two links as sigma'' = gain u and w + relaxation w' + w'' / frequency^2 = sigma.

    Attributes
    ----------
    gain
        Of the drive: 1 / I*_(n-1) for an effort [1/(kg m^2)], 1 for a servo's acceleration [-].
    frequency
        Undamped angular frequency [rad/s].
    relaxation
        Time constant c_n / k_n [s].
    reaction
        Share of w'' that link n-1 has besides sigma [s^2].

    """

    gain: float
    frequency: float
    relaxation: float
    reaction: float

    @classmethod
    def of(cls, arm: PlanarArm, drive: Drive = Drive.EFFORT) -> 'DrivenMode':
        """
        Return that of an arm.

        Raises
        ------
        NotFlat
            The arm is not flat.
        InvalidRequest
            Its passive joint does not oscillate.

        """
        is_held = drive is Drive.POSITION
        mode = arm.natural_mode(held=is_held)
        if not mode.damped_frequency > 0.0:
            raise InvalidRequest(
                f'strategy min_peak_effort needs a passive joint that oscillates; its damping '
                f'ratio is {mode.damping_ratio:.3g}'
            )
        both, last = arm.inertia_star
        return cls(
            gain=1.0 if is_held else 1.0 / both,
            frequency=mode.frequency,
            relaxation=arm.damping / arm.stiffness,
            # Zero but for rounding under a servo, where sigma is the angle of link n-1.
            reaction=0.0 if is_held else last / arm.stiffness - mode.frequency**-2,
        )

    @property
    def pole(self) -> complex:
        """Pole of the oscillation, in the upper half plane [1/s]."""
        decay = 0.5 * self.relaxation * self.frequency**2
        return complex(-decay, np.sqrt(self.frequency**2 - decay**2))

    @property
    def swing_gain(self) -> float:
        """Rate of the swing for each unit of the drive."""
        return self.gain * self.frequency**2

    @property
    def compliance(self) -> float:
        """Return the angle of the passive joint for each unit of -w'', I_n / k [s^2]."""
        return self.reaction + self.frequency**-2

    def state(self, jet: FloatArray) -> ModeState:
        """Return the state from the derivatives 0 to 3 of w."""
        sigma = jet[0] + self.relaxation * jet[1] + jet[2] / self.frequency**2
        rate = jet[1] + self.relaxation * jet[2] + jet[3] / self.frequency**2
        return ModeState(sigma, rate, jet[3] - np.conj(self.pole) * jet[2])

    def drive_of(self, jet: FloatArray) -> float:
        """Return what drives link n-1, from the derivatives 0 to 4 of w."""
        return float(jet[2] + self.relaxation * jet[3] + jet[4] / self.frequency**2) / self.gain

    def planned(self, state: ModeState) -> FloatArray:
        """Return the derivatives 0 to 3 of w, shape (4, m)."""
        acceleration = state.swing.imag / self.pole.imag
        jerk = self.jerk(state.swing)
        velocity = state.sigma_rate - self.relaxation * acceleration - jerk / self.frequency**2
        value = state.sigma - self.relaxation * velocity - acceleration / self.frequency**2
        return np.array([value, velocity, acceleration, jerk])

    def jerk(self, swing: ComplexArray) -> FloatArray:
        """Return the third derivative of w in a swing."""
        jerk: FloatArray = swing.real + self.pole.real / self.pole.imag * swing.imag
        return jerk

    def end_rows(self, duration: float, pieces: int, *, insensitive: bool) -> FloatArray:
        """
        Return what each sample of the drive adds to the state at the end.

        Parameters
        ----------
        duration
            Length of the motion [s].
        pieces
            Between pieces + 1 even samples, joined linearly.
        insensitive
            Whether to add the derivative of the swing with respect to the pole.

        Returns
        -------
        FloatArray
            Rows of sigma', of sigma, of the real and imaginary part of the swing, and of its
            derivative, shape (4 or 6, pieces + 1).

        """
        step = duration / pieces
        left = duration - step * np.arange(pieces + 1.0)
        swing = self.swing_row(self.pole, duration, pieces)
        weights = np.full(pieces + 1, step)
        weights[[0, -1]] *= 0.5
        reach = weights * left
        reach[0] -= step**2 / 6.0
        reach[-1] += step**2 / 6.0
        rows = [self.gain * weights, self.gain * reach, swing.real, swing.imag]
        if insensitive:
            turn = self.pole * step
            slopes = np.full(pieces + 1, half_hat(turn, 1) - half_hat(-turn, 1))
            slopes[0], slopes[-1] = -half_hat(-turn, 1), half_hat(turn, 1)
            slope = self.swing_gain * step**2 * slopes * np.exp(self.pole * left) + swing * left
            rows += [slope.real, slope.imag]
        return np.array(rows)

    def swing_row(self, pole: complex, duration: float, pieces: int) -> ComplexArray:
        """Return what each sample of the drive adds to a swing of a pole, shape (pieces + 1,)."""
        step = duration / pieces
        turn = pole * step
        after, before = half_hat(-turn), half_hat(turn)
        hats = np.full(pieces + 1, after + before)
        hats[0], hats[-1] = after, before
        left = duration - step * np.arange(pieces + 1.0)
        turned: ComplexArray = np.exp(pole * left)
        return self.swing_gain * step * hats * turned

    def states(self, start: ModeState, drive: FloatArray, duration: float) -> ModeState:
        """
        Return the state at every sample.

        Parameters
        ----------
        start
            State at the start, numbers.
        drive
            Even samples, joined linearly, shape (m,).
        duration
            From the first to the last [s].

        """
        step = duration / (len(drive) - 1)
        turn = self.pole * step
        first, second = drive[:-1], drive[1:]
        rates = start.sigma_rate + np.append(
            0.0, np.cumsum(0.5 * step * self.gain * (first + second))
        )
        moves = step * rates[:-1] + step**2 * self.gain * (2.0 * first + second) / 6.0
        factor = np.exp(turn)
        pushes = (
            step * self.swing_gain * (factor * half_hat(-turn) * first + half_hat(turn) * second)
        )
        swings = accumulate(
            pushes.tolist(), lambda swing, push: swing * factor + push, initial=start.swing
        )
        return ModeState(
            start.sigma + np.append(0.0, np.cumsum(moves)),
            rates,
            np.array(list(swings), dtype=complex),
        )


def half_hat(turn: complex, order: int = 0) -> complex:
    """Return (exp(x) - 1 - x) / x^2 or its derivative, for |x| up to about 1."""
    coefficients = _half_hat_series()
    if order:
        coefficients = coefficients[1:] * np.arange(1.0, len(coefficients))
    return complex(np.polynomial.polynomial.polyval(turn, coefficients))


@cache
def _half_hat_series() -> FloatArray:
    """Return 1 / (j + 2)!, whose terms cancel nothing where the closed form does."""
    return locked(np.array([1.0 / factorial(j + 2) for j in range(SERIES_TERMS)]))
