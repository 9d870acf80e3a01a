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

"""Residual that imbalance leaves: the arm is planned for as balanced, and nearly is."""

from math import pi

from flat_planner_ros.core.arm import Drive, FloatArray, PlanarArm
from flat_planner_ros.core.insensitive.oscillator import Oscillator
import numpy as np

USUAL_TURN = 0.5 * pi
"""Turn of every actuated joint in the motion by which imbalance is judged [rad]."""

USUAL_PERIODS = 2.0
"""Its duration in periods of the passive joint [-]."""

USUAL_SAMPLES = 400
"""Samples of it, far more than its shape needs."""


def imbalance_residual(
    built: PlanarArm,
    arm: PlanarArm,
    motion: tuple[FloatArray, FloatArray, FloatArray],
    duration: float,
    drive: Drive = Drive.EFFORT,
) -> float:
    """
    Return the oscillation that a motion leaves because the last two links are not balanced.

    Parameters
    ----------
    built
        The arm as it is.
    arm
        The flat one that the motion was planned for.
    motion
        Angles [rad], velocities [rad/s] and accelerations [rad/s^2] of all joints at even times,
        both ends included, each of shape (m, n).
    duration
        From the first to the last [s].
    drive
        What moves joint n-1.

    Returns
    -------
    float
        Amplitude about where the passive joint hangs then, to first order in the imbalance [rad].

    References
    ----------
    (N7) of docs/derivation.md.

    """
    oscillator = Oscillator.of(arm, drive)
    (pole,) = oscillator.poles(np.ones((1, 3))).tolist()
    push = _push(built, arm, motion, drive)
    times = np.linspace(0.0, duration, len(push))
    left = push * np.exp(pole * (duration - times))
    swung = duration / (len(push) - 1) * (left.sum() - 0.5 * (left[0] + left[-1]))
    # Where it hangs under its weight at rest, before and after, is no oscillation.
    positions = motion[0][[0, -1]]
    still = np.zeros_like(positions)
    first, last = _push(built, arm, (positions, still, still), drive) / oscillator.frequency**2
    swung += np.conj(pole) * (last - first * np.exp(pole * duration))
    return float(abs(swung) / pole.imag)


def usual_imbalance_residual(
    built: PlanarArm, arm: PlanarArm, drive: Drive = Drive.EFFORT
) -> tuple[float, float]:
    """
    Return what imbalance leaves after a quarter turn of every actuated joint, and its duration.

    Returns
    -------
    tuple[float, float]
        Amplitude [rad] after a turn of least jerk in two periods of the passive joint [s].

    """
    duration = USUAL_PERIODS * 2.0 * pi / Oscillator.of(arm, drive).frequency
    x = np.linspace(0.0, 1.0, USUAL_SAMPLES)
    law = np.polynomial.Polynomial([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])
    turn = np.append(np.full(arm.n - 1, USUAL_TURN), 0.0)
    position, velocity, acceleration = (
        np.multiply.outer(law.deriv(k)(x) if k else law(x), turn / duration**k) for k in range(3)
    )
    motion = position, velocity, acceleration
    return imbalance_residual(built, arm, motion, duration, drive), duration


def _push(
    built: PlanarArm,
    arm: PlanarArm,
    motion: tuple[FloatArray, FloatArray, FloatArray],
    drive: Drive,
) -> FloatArray:
    """Return the acceleration of the passive joint that the plan does not know, (m,) [rad/s^2]."""
    efforts = built.rigid_effort(*motion) - arm.rigid_effort(*motion)
    on_last = efforts[:, -1]
    both, last = arm.inertia_star
    push: FloatArray = -on_last / last
    if drive is Drive.EFFORT:
        push += (efforts[:, -2] - on_last) / (both - last)
    return push
