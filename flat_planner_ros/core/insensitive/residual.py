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
Residual: the oscillation that a motion leaves on an arm other than the planner's model.

The residual amplitude is one integral of what drives link n-1 against the arm's oscillation ((44)
of docs/derivation.md), so it is known before anything moves, for any stiffness, damping and
inertia of the last link. Its largest value over a box lies on the boundary of the poles (I.1).
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

from flat_planner_ros.core.arm import ComplexArray, Drive, FloatArray, locked, PlanarArm
from flat_planner_ros.core.insensitive.insensitivity import UncertaintyBox
from flat_planner_ros.core.insensitive.oscillator import largest, Oscillator
import numpy as np

BLOCK = 32
"""Effort samples per row of the table of exponentials."""

MAPS_KEPT = 8
"""
Residuals as maps of signals that are remembered, for motions of one duration or a few in turn.

One takes 40 kilobytes for each hundred arms and up to 1024 samples.
"""

GREGORY = (3.0 / 8.0, 7.0 / 6.0, 23.0 / 24.0)
"""
First weights of a trapezoidal sum over what does not begin smoothly.

Gregory's rule, good to the third power of the spacing (Hildebrand, Introduction to numerical
analysis, 5.9).
"""


@dataclass(frozen=True, kw_only=True)
class PredictedResidual:
    """
    Amplitude of the oscillation at the end of a motion, as the monitor measures it.

    Attributes
    ----------
    nominal
        On the planner's own model [rad].
    worst
        Largest over the box [rad].
    stiffness_factor, damping_factor, inertia_factor
        Where that is: factors on the nominal values [-].
    miss
        How far from the goal the last two links may stop because their inertia differs: nothing
        where a servo sets the angles; None for a motion that does not start at rest, as nobody
        knows its momentum [rad].
    box
        What may differ, and by how much.

    """

    nominal: float
    worst: float
    stiffness_factor: float
    damping_factor: float
    inertia_factor: float
    miss: float | None
    box: UncertaintyBox


def residual_amplitude(
    oscillator: Oscillator,
    signal: FloatArray,
    duration: float,
    poles: ComplexArray,
    start: tuple[float, float] = (0.0, 0.0),
) -> FloatArray:
    """
    Return what a motion leaves behind, efforts joined linearly or followed by a servo.

    Parameters
    ----------
    oscillator
        The arm; only its gain enters, as the poles bring the rest.
    signal
        What drives link n-1 at even times, both ends included, zero at the last: the effort of
        joint n-1, friction left out [N m], or the link's velocity in absolute angle [rad/s];
        shape (m,).
    duration
        From the first to the last [s].
    poles
        Those of the arms that play it, shape (p,) [1/s].
    start
        Angle and velocity of the passive joint at the start [rad], [rad/s].

    Returns
    -------
    FloatArray
        Amplitudes at the end, shape (p,) [rad].

    References
    ----------
    (I3) of docs/derivation.md: exact for efforts that are linear between the samples; velocities
    by the trapezoidal rule, which converges fast for motions that begin and end smoothly.

    """
    return _ResidualMap.of(oscillator, poles, duration, len(signal)).amplitudes(signal, start)


class _ResidualMap(NamedTuple):
    """
    What signals of one length leave on some arms, as a linear map.

    Attributes
    ----------
    poles
        Of the arms, shape (p,) [1/s].
    fine, coarse
        Exponentials over the samples of a block, shape (BLOCK, p), and over the blocks, (rows, p).
    whole
        Exponential over the duration, shape (p,).
    inner
        Weight of a sample between others, shape (p,).
    first
        Of the first ones of a start in motion, by how much their weight is less, and the
        exponential over what follows them, shape (p,) each.

    """

    poles: ComplexArray
    fine: ComplexArray
    coarse: ComplexArray
    whole: ComplexArray
    inner: ComplexArray
    first: tuple[tuple[ComplexArray, ComplexArray], ...]

    @classmethod
    def of(
        cls, oscillator: Oscillator, poles: ComplexArray, duration: float, samples: int
    ) -> '_ResidualMap':
        """Return the map of signals of some samples over a duration [s]."""
        step = duration / (samples - 1)
        turn = step * poles
        rows = -(-samples // BLOCK)
        fine = np.exp(np.multiply.outer(np.arange(BLOCK), turn))
        coarse = np.exp(np.multiply.outer(BLOCK * np.arange(rows), turn))
        inner, weights = _weights(oscillator, turn, step)
        first = [
            (inner - weight, np.exp((duration - index * step) * poles))
            for index, weight in enumerate(weights)
        ]
        return cls(poles, fine, coarse, np.exp(duration * poles), inner, tuple(first))

    def amplitudes(self, signal: FloatArray, start: tuple[float, float]) -> FloatArray:
        """Return amplitudes, shape (p,) [rad]; arguments as of `residual_amplitude`."""
        blocks = np.zeros((len(self.coarse), BLOCK))
        blocks.ravel()[: len(signal)] = signal[::-1]
        driven = np.einsum('rp,rp->p', blocks @ self.fine, self.coarse) * -self.inner
        angle, velocity = start
        if angle or velocity or signal[0]:
            # In motion: the first samples weigh less, and the joint brings its own oscillation.
            driven += self.whole * (velocity - self.poles.conj() * angle)
            for (less, left), value in zip(self.first, signal, strict=False):
                driven += less * value * left
        amplitudes: FloatArray = np.abs(driven) / self.poles.imag
        return amplitudes


class _Surroundings(NamedTuple):
    """The arms on the edges of a box, factors (m, 3) each, and the map to what they are left."""

    edges: tuple[FloatArray, ...]
    residuals: _ResidualMap


@lru_cache(maxsize=MAPS_KEPT)
def _surroundings(
    oscillator: Oscillator, box: UncertaintyBox, duration: float, samples: int
) -> _Surroundings:
    """Return the edges of a box, and what the nominal arm and those on them are left."""
    edges = oscillator.edges(box, duration)
    poles = oscillator.poles(np.concatenate([np.ones((1, 3)), *edges]))
    return _Surroundings(
        tuple(locked(edge) for edge in edges),
        _ResidualMap.of(oscillator, poles, duration, samples),
    )


def _weights(
    oscillator: Oscillator, turn: ComplexArray, step: float
) -> tuple[ComplexArray, tuple[ComplexArray, ...]]:
    """Return weights of a sample between others, and of the first ones of a start in motion."""
    if oscillator.drive is Drive.POSITION:
        # By parts: the velocity is smoother than the acceleration, whose rise may be abrupt.
        first, *others = [weight * turn for weight in GREGORY]
        return turn, (first - 1.0, *others)
    hat, half_hat = (np.sinh(0.5 * turn) / (0.5 * turn)) ** 2, (np.expm1(-turn) + turn) / turn**2
    scale = step * oscillator.gain
    return scale * hat, (scale * half_hat,)


def servo_effort(arm: PlanarArm, velocity: FloatArray, duration: float) -> FloatArray:
    """
    Return the effort that a servo needs, the passive joint's reaction in it.

    Parameters
    ----------
    arm
        Nominal model; must be flat.
    velocity
        Of link n-1 in absolute angle at even times, both ends included, shape (m,) [rad/s].
    duration
        From the first to the last [s].

    Returns
    -------
    FloatArray
        Effort of joint n-1 at these times, without friction, shape (m,) [N m].

    """
    (pole,) = Oscillator.of(arm, Drive.POSITION).poles(np.ones((1, 2)))
    step = duration / (len(velocity) - 1)
    # Exact for velocities that are linear between the samples.
    decay = complex(np.exp(step * pole))
    pushes = np.diff(velocity) * (decay - 1.0) / (step * pole)
    state, states = 0j, [0j]
    for push in pushes.tolist():
        state = decay * state - push
        states.append(state)
    swing = np.array(states)
    angle = swing.imag / pole.imag
    rate = swing.real + pole.real * angle
    both, last = arm.inertia_star
    effort: FloatArray = (both - last) * np.gradient(velocity, step)
    effort -= arm.stiffness * angle + arm.damping * rate
    return effort


def legendre_residuals(
    oscillator: Oscillator, factors: FloatArray, duration: float, terms: int
) -> ComplexArray:
    """
    Return the residual that each Legendre term of sigma'' leaves per rad, shape (p, terms).

    The integral of P_j(x) exp(z (1 - x)) is a modified spherical Bessel function of z ((I9) of
    docs/derivation.md), here with its growth taken out.
    """
    # Imported here: it takes longer than planning with any other strategy.
    from scipy.special import ive

    half = 0.5 * duration
    poles = oscillator.poles(factors)
    z, order = half * poles[:, None], np.arange(terms)
    bessel = np.sqrt(np.pi / (2.0 * z)) * ive(order + 0.5, z)
    integrals = 2.0 * (-1.0) ** order * bessel * np.exp(1j * z.imag)
    gain = oscillator.gain_of_sigma / (half * poles.imag)
    rows: ComplexArray = gain[:, None] * integrals
    return rows


def swing_of_start(
    oscillator: Oscillator, factors: FloatArray, duration: float, start: FloatArray
) -> ComplexArray:
    """
    Return what is left of the start's own swing at the end of a motion, shape (p,) [rad].

    Parameters
    ----------
    oscillator, factors, duration
        As for `legendre_residuals`; every arm starts with the same angle and velocity.
    start
        Derivatives of the planned variable at the start by x from -1 to 1, shape (6,) [rad].

    """
    half = 0.5 * duration
    poles = oscillator.poles(factors)
    # I*_n / k is the same for both drives.
    compliance = oscillator.gain_of_sigma / (oscillator.frequency * half) ** 2
    angle, velocity = -compliance * start[2], -compliance * start[3] / half
    swing: ComplexArray = np.exp(duration * poles) * (velocity - poles.conj() * angle)
    swing /= poles.imag
    return swing


def predict_residual(
    arm: PlanarArm,
    signal: FloatArray,
    duration: float,
    box: UncertaintyBox,
    start: tuple[float, float] | None = None,
    *,
    drive: Drive = Drive.EFFORT,
) -> PredictedResidual:
    """
    Return the residual of a motion on the nominal arm, and the largest over a box.

    Parameters
    ----------
    arm
        Nominal model.
    signal
        What drives link n-1 at even times, as for `residual_amplitude`, shape (m,) [N m] or
        [rad/s].
    duration
        Length of the motion [s].
    box
        What may differ.
    start
        Angle and velocity of the passive joint at a start in motion [rad], [rad/s], taken to be
        the same on every arm; None for a start at rest.
    drive
        What the signal is.

    Raises
    ------
    InvalidRequest
        An arm in the box does not oscillate.

    """
    oscillator = Oscillator.of(arm, drive)
    edges, residuals = _surroundings(oscillator, box, float(duration), len(signal))
    amplitudes = residuals.amplitudes(signal, start or (0.0, 0.0))
    worst, place = largest(edges, amplitudes[1:])
    miss = 0.0
    if drive is Drive.EFFORT:
        miss = _largest_miss(arm, signal, duration, box)
    return PredictedResidual(
        nominal=float(amplitudes[0]),
        worst=worst,
        stiffness_factor=float(place[0]),
        damping_factor=float(place[1]),
        inertia_factor=float(place[2]),
        miss=miss if start is None else None,
        box=box,
    )


def _largest_miss(
    arm: PlanarArm, effort: FloatArray, duration: float, box: UncertaintyBox
) -> float:
    """Return how far from the goal an effort leaves a heavier or lighter arm of a box [rad]."""
    if box.ranges[2] == (1.0, 1.0):
        return 0.0
    both, last = arm.inertia_star
    planned = driven_angle(both, effort, duration)
    others = [both + last * (factor - 1.0) for factor in box.ranges[2]]
    return max(abs(planned - driven_angle(other, effort, duration)) for other in others)


def driven_angle(both: float, effort: FloatArray, duration: float) -> float:
    """
    Return the angle by which an effort moves the last two links, their swing left out [rad].

    Parameters
    ----------
    both
        I*_{n-1} of the arm [kg m^2].
    effort
        Of joint n-1 at even times, both ends included, joined linearly, shape (m,) [N m].
    duration
        From the first to the last [s].

    References
    ----------
    (I18) of docs/derivation.md is the difference of two arms' angles.

    """
    step = duration / (len(effort) - 1)
    # The momentum of the last two links, integrated: exact for an effort of hats.
    moved = step * float(effort[::-1] @ (step * np.arange(len(effort))))
    return moved / both
