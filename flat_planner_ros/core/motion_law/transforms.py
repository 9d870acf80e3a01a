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
Integrals of a velocity times exp(z (1 - x)) over a motion, -1 < x < 1, in closed form.

They are what a motion leaves of an oscillation with the pole z (docs/derivation.md, (44a)).
"""

from flat_planner_ros.core.arm import ComplexArray, FloatArray
import numpy as np

SMALL = 1e-2
"""Argument below which (1 - exp(-t)) / t is taken from its series [-]."""

SLOW_POLE = 4.0
"""Pole below which integrals of powers are taken from a series [-]."""

SERIES = 24
"""Terms of that series; 4^48 / 48! is below the last digit."""


def exponential_transform(
    decays: ComplexArray, factors: ComplexArray, poles: ComplexArray
) -> ComplexArray:
    """
    Return the integrals of sum_i Re B_i (exp(-d_i (1 - x)) + exp(-d_i (1 + x))).

    Parameters
    ----------
    decays, factors
        d and B, shape (p, m).
    poles
        z, none with a positive real part, shape (p, q).

    Returns
    -------
    ComplexArray
        Shape (p, q).

    """
    total = np.zeros_like(poles)
    with np.errstate(under='ignore'):
        left = np.exp(2.0 * poles)
        falls = np.exp(-2.0 * decays)
    for d, fall, factor in zip(decays.T, falls.T, factors.T, strict=True):
        columns = d[:, None], fall[:, None], 0.5 * factor[:, None]
        for rate, gone, half in (columns, [column.conj() for column in columns]):
            total += half * _quotient(left - gone, rate + poles, left)
            total += half * _quotient(1.0 - gone * left, rate - poles, 1.0)
    return total


def _quotient(
    difference: ComplexArray, rate: ComplexArray, value: ComplexArray | float
) -> ComplexArray:
    """Return value (1 - exp(-2 rate)) / rate, given the numerator as it is formed safely."""
    is_small = np.abs(rate) < SMALL
    if not is_small.any():
        return difference / rate
    t = 2.0 * rate
    series = 2.0 * value * (1.0 - t / 2.0 * (1.0 - t / 3.0 * (1.0 - t / 4.0 * (1.0 - t / 5.0))))
    result: ComplexArray = np.where(is_small, series, difference / np.where(is_small, 1.0, rate))
    return result


def power_transform(powers: FloatArray, poles: ComplexArray) -> ComplexArray:
    """
    Return the integrals of the derivative of sum_j c_j x^(2 j + 1).

    Parameters
    ----------
    powers
        c, shape (p, m).
    poles
        z, none with a positive real part, shape (p, q).

    """
    factors = powers * (2.0 * np.arange(powers.shape[1]) + 1.0)
    is_slow = np.abs(poles) < SLOW_POLE
    safe: ComplexArray = np.where(is_slow, SLOW_POLE, poles)
    with np.errstate(under='ignore'):
        left = np.exp(2.0 * safe)
    # By parts, from one power to the next.
    moment = (left - 1.0) / safe
    total: ComplexArray = factors[:, :1] * moment
    for power in range(1, 2 * powers.shape[1] - 1):
        moment = (power * moment - 1.0 + (-1.0) ** power * left) / safe
        if power % 2 == 0:
            total = total + factors[:, power // 2, None] * moment
    if is_slow.any():
        rows, _ = np.nonzero(is_slow)
        total[is_slow] = _slow_powers(factors[rows], poles[is_slow])
    return total


def _slow_powers(factors: FloatArray, poles: ComplexArray) -> ComplexArray:
    """Return the integrals of sum_j b_j x^(2 j) for slow poles, one for each row, shape (r,)."""
    terms = np.arange(SERIES)
    # sum_n z^(2 n) / (2 n)! * 2 / (2 n + 2 j + 1), times exp(z).
    shares = 2.0 / (2.0 * (terms[:, None] + np.arange(factors.shape[1])) + 1.0)
    coefficients = factors @ shares.T
    square, total = poles**2, np.zeros_like(poles)
    for n in range(SERIES - 1, -1, -1):
        total = coefficients[:, n] + total * square / ((2.0 * n + 1.0) * (2.0 * n + 2.0))
    result: ComplexArray = np.exp(poles) * total
    return result
