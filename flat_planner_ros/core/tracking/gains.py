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
Constant gains of the state feedback and of the observer, from a few physical numbers.

The feedback is the discrete linear-quadratic regulator whose weights put all poles at one
frequency and one damping ratio: with D the chain's own polynomial and P the wanted one, the
weighted output N of the flat output's derivatives is the spectral factor of P P* - D D* (Kalman's
equation of the return difference; Anderson and Moore, Optimal Control, 1990, section 5.6).
"""

from math import sqrt

from flat_planner_ros.core.arm import FloatArray, InvalidRequest
from flat_planner_ros.core.tracking.chain import Chain
import numpy as np

ROUNDING = 1e-9
"""Negative part of P P* - D D* that is forgiven, relative to P P* [-]."""

SPEEDS = np.geomspace(1e-3, 1e3, 601)
"""Frequencies at which it is looked at, relative to the bandwidth [-]."""


def feedback_gain(chain: Chain, period: float, bandwidth: float, damping: float) -> FloatArray:
    """
    Return the gain K of u = -K x, shape (m,).

    Parameters
    ----------
    chain
        What is fed back.
    period
        Between two inputs, each constant until the next [s].
    bandwidth, damping
        Frequency [rad/s] and damping ratio [-] of the wanted poles.

    Raises
    ------
    InvalidRequest
        No quadratic cost leads to these poles: the bandwidth or the damping is too low.

    """
    output = np.linalg.solve(
        chain.coordinates.T, weighted_output(chain.input_row, bandwidth, damping)
    )
    transition, effect = chain.over(period)
    m = chain.order
    weight = chain.input_row[-1] ** -2  # P and D are monic, the input is not
    return regulator(transition[:m, :m], effect[:m], np.outer(output, output), weight)


def weighted_output(input_row: FloatArray, bandwidth: float, damping: float) -> FloatArray:
    """
    Return the derivatives' combination N whose square is to be weighed, shape (m,).

    Raises
    ------
    InvalidRequest
        There is none.

    """
    own = input_row[::-1] / input_row[-1]
    pair = [1.0, 2 * damping * bandwidth, bandwidth**2]
    wanted: FloatArray = np.ones(1)
    for _ in range(own.size // 2):
        wanted = np.asarray(np.polymul(wanted, pair), dtype=float)
    difference = np.polysub(_even(wanted), _even(own))
    speeds = 1j * bandwidth * SPEEDS
    share = (np.polyval(difference, speeds) / np.polyval(_even(wanted), speeds)).real
    if share.min() < -ROUNDING:
        raise InvalidRequest(
            f'no quadratic cost gives a bandwidth of {bandwidth:g} rad/s with a damping ratio of '
            f'{damping:g}: at {SPEEDS[share.argmin()] * bandwidth:.3g} rad/s the loop would have '
            'to be slower than the arm; raise bandwidth or damping'
        )
    squares = difference[2::2]  # over powers of s^2, of which the highest cancels
    left = -np.sqrt(np.roots(squares) + 0j)
    return np.asarray(sqrt(abs(squares[0])) * np.poly(left).real[::-1], dtype=float)


def regulator(
    transition: FloatArray, effect: FloatArray, state_weight: FloatArray, input_weight: float
) -> FloatArray:
    """
    Return the gain of the discrete linear-quadratic regulator of one input, shape (m,).

    Parameters
    ----------
    transition, effect
        x+ = F x + g u, shape (m, m) and (m,).
    state_weight, input_weight
        Of the cost sum x^T Q x + R u^2, shape (m, m) and a number.

    """
    from scipy.linalg import solve_discrete_are  # here: slow to import

    g = effect[:, None]
    cost = solve_discrete_are(transition, g, state_weight, np.array([[input_weight]]))
    gain = np.linalg.solve(input_weight + g.T @ cost @ g, g.T @ cost @ transition)
    return np.asarray(gain[0], dtype=float)


def observer_gain(chain: Chain, period: float, bandwidth: float) -> FloatArray:
    """
    Return the gain of the correction of (x, d) by measured angles, shape (m + 1, m / 2).

    It is a stationary Kalman filter. Its noise is chosen so that an angle by itself would have
    Butterworth's poles at the bandwidth [rad/s], with the disturbance three poles next to it.
    """
    from scipy.linalg import solve_discrete_are  # here: slow to import

    m, angles = chain.order, chain.angles
    inertia = 1.0 / abs(chain.input_effect[angles])
    noise = np.zeros((m + 1, m + 1))
    noise[angles:m, angles:m] = np.eye(angles) * bandwidth**4 * period
    noise[m, m] = (inertia * bandwidth**3) ** 2 * period
    transition, _ = chain.over(period)
    shown = np.eye(m + 1)[:angles]
    measured = np.eye(angles) / period
    spread = solve_discrete_are(transition.T, shown.T, noise, measured)
    return np.asarray(
        np.linalg.solve(shown @ spread @ shown.T + measured, shown @ spread).T, dtype=float
    )


def _even(polynomial: FloatArray) -> FloatArray:
    """Return P(s) P(-s), coefficients from the highest power on."""
    signs = (-1.0) ** np.arange(polynomial.size)[::-1]
    return np.asarray(np.polymul(polynomial, signs * polynomial), dtype=float)
