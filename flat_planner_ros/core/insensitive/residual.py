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
Residual: the oscillation that an effort leaves on an arm other than the planner's model.

The residual amplitude is one integral of the effort against the arm's free oscillation ((44) of
docs/derivation.md), so it is known before anything moves, for any stiffness and damping. Over a
box of stiffness and damping its largest value lies on the boundary (docs/derivation.md, I.1).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

from flat_planner_ros.core.arm import ComplexArray, FloatArray, InvalidRequest, PlanarArm
from flat_planner_ros.core.insensitive.insensitivity import UncertaintyBox
import numpy as np
from numpy.polynomial import legendre

TURN_PER_POINT = 0.1
"""
Largest turn of the residual's phase between neighbouring points of an edge [rad].

A maximum between two points exceeds both by less than 0.1^2 / 8 of itself, and a parabola through
three points removes nearly all of that.
"""

MIN_POINTS = 5
"""Fewest points of an edge, ends included."""

MAX_POINTS = 257
"""Most points of an edge."""

MEAN_NODES = 4
"""Gauss-Legendre nodes over either side of the box, plus one per radian of turn."""

MAX_MEAN_NODES = 24
"""Most of them."""

BLOCK = 32
"""Effort samples per row of the table of exponentials."""


@dataclass(frozen=True, kw_only=True)
class Oscillator:
    """
    Free oscillation of the passive joint under a motor effort, joint n-1 free.

    Attributes
    ----------
    frequency
        Undamped angular frequency of the nominal arm [rad/s].
    decay
        Rate of decay of the nominal arm [1/s].
    inertia, free_inertia
        I*_(n-1), and I*_(n-1) - I*_n, that of link n-1 alone [kg m^2].

    """

    frequency: float
    decay: float
    inertia: float
    free_inertia: float

    @classmethod
    def of(cls, arm: PlanarArm) -> 'Oscillator':
        """Return that of a flat arm; raise NotFlat for another."""
        mode = arm.natural_mode()
        both, last = arm.inertia_star
        return cls(
            frequency=mode.frequency,
            decay=mode.decay_rate,
            inertia=both,
            free_inertia=both - last,
        )

    def poles(self, factors: FloatArray) -> ComplexArray:
        """
        Return the poles -zeta omega + i omega_d of arms with other stiffness and damping.

        Parameters
        ----------
        factors
            On stiffness and damping, shape (m, 2) [-].

        Raises
        ------
        InvalidRequest
            One of the arms does not oscillate.

        """
        decay = factors[:, 1] * self.decay
        square = factors[:, 0] * self.frequency**2 - decay**2
        if (square <= 0.0).any():
            k, c = factors[int(np.argmin(square))]
            raise InvalidRequest(
                f'with {k:.3g} times the stiffness and {c:.3g} times the damping the passive '
                f'joint does not oscillate: there is no residual to plan against'
            )
        poles: ComplexArray = -decay + 1j * np.sqrt(square)
        return poles

    def edges(
        self, box: UncertaintyBox, duration: float, most: int = MAX_POINTS
    ) -> list[FloatArray]:
        """
        Return factors on stiffness and damping along the four edges of a box.

        Parameters
        ----------
        box
            What may differ.
        duration
            Time over which different arms drift apart [s].
        most
            Largest number of points of an edge.

        Returns
        -------
        list[FloatArray]
            Points from corner to corner, each of shape (m, 2) [-]; edges of no length are left
            out.

        """
        k, c = box.stiffness, box.damping
        low, high = np.array([1.0 - k, 1.0 - c]), np.array([1.0 + k, 1.0 + c])
        corners = [low, np.array([high[0], low[1]]), high, np.array([low[0], high[1]])]
        edges = []
        for begin, end in zip(corners, [*corners[1:], corners[0]], strict=True):
            if (begin == end).all():
                continue
            turn = self._turn(begin, end, duration)
            count = min(max(ceil(turn / TURN_PER_POINT) + 1, MIN_POINTS), most)
            # Chebyshev points: extremes near corners are seen as well as those inside.
            share = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, count))
            edges.append(begin + share[:, None] * (end - begin))
        return edges or [low[None]]

    def nodes(self, box: UncertaintyBox, duration: float) -> tuple[FloatArray, FloatArray]:
        """Return points inside a box, shape (p, 2), and weights of a mean over it, shape (p,)."""
        axes = []
        for i, width in enumerate((box.stiffness, box.damping)):
            begin, end = np.ones((2, 2))
            begin[i] -= width
            end[i] += width
            count = MEAN_NODES + ceil(self._turn(begin, end, duration))
            places, weights = legendre.leggauss(min(count, MAX_MEAN_NODES))
            axes.append((1.0 + width * places, 0.5 * weights))
        (k, k_weights), (c, c_weights) = axes
        points = np.stack(np.meshgrid(k, c, indexing='ij'), axis=-1).reshape(-1, 2)
        return points, np.multiply.outer(k_weights, c_weights).ravel()

    def _turn(self, begin: FloatArray, end: FloatArray, duration: float) -> float:
        """Return how far two arms' oscillations drift apart [rad]."""
        first, second = self.poles(np.array([begin, end]))
        return float(duration * abs(second - first))


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
    stiffness_factor, damping_factor
        Where that is: factors on the nominal values [-].
    box
        What may differ, and by how much.

    """

    nominal: float
    worst: float
    stiffness_factor: float
    damping_factor: float
    box: UncertaintyBox


def residual_amplitude(
    oscillator: Oscillator,
    effort: FloatArray,
    duration: float,
    poles: ComplexArray,
    start: tuple[float, float] = (0.0, 0.0),
) -> FloatArray:
    """
    Return what an effort leaves behind that is played with linear interpolation.

    Parameters
    ----------
    oscillator
        The arm; only its inertia enters, as the poles bring the rest.
    effort
        Effort of joint n-1 at even times, both ends included, zero at the last, friction left
        out, shape (m,) [N m].
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
    (I3) of docs/derivation.md: exact for efforts that are linear between the samples.

    """
    step = duration / (len(effort) - 1)
    rows = -(-len(effort) // BLOCK)
    padded = np.zeros(rows * BLOCK)
    padded[: len(effort)] = effort[::-1]
    turn = step * poles
    fine = np.exp(np.multiply.outer(np.arange(BLOCK), turn))
    coarse = np.exp(np.multiply.outer(BLOCK * np.arange(rows), turn))
    total = np.einsum('rp,rp->p', padded.reshape(rows, BLOCK) @ fine, coarse)
    hat = (np.sinh(0.5 * turn) / (0.5 * turn)) ** 2
    driven = -step / oscillator.free_inertia * hat * total
    angle, velocity = start
    if angle or velocity or effort[0]:
        # In motion: the first sample has half a hat, and the joint brings its own oscillation.
        half_hat = (np.expm1(-turn) + turn) / turn**2
        missing = (hat - half_hat) * effort[0] * step / oscillator.free_inertia
        free = velocity - poles.conj() * angle
        driven += np.exp(duration * poles) * (free + missing)
    amplitudes: FloatArray = np.abs(driven) / poles.imag
    return amplitudes


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
    both = oscillator.inertia
    gain = both / (half * oscillator.free_inertia * poles.imag)
    rows: ComplexArray = gain[:, None] * integrals
    return rows


def predict_residual(
    arm: PlanarArm,
    effort: FloatArray,
    duration: float,
    box: UncertaintyBox,
    start: tuple[float, float] = (0.0, 0.0),
) -> PredictedResidual:
    """
    Return the residual of a motion on the nominal arm, and the largest over a box.

    Parameters
    ----------
    arm
        Nominal model.
    effort
        Effort of joint n-1 at even times, friction left out, shape (m,) [N m].
    duration
        Length of the motion [s].
    box
        What may differ.
    start
        Angle and velocity of the passive joint at the start [rad], [rad/s], taken to be the same
        on every arm.

    Raises
    ------
    InvalidRequest
        An arm in the box does not oscillate.

    """
    oscillator = Oscillator.of(arm)
    edges = oscillator.edges(box, duration)
    factors = np.concatenate([np.ones((1, 2)), *edges])
    poles = oscillator.poles(factors)
    amplitudes = residual_amplitude(oscillator, effort, duration, poles, start)
    worst, place = largest(edges, amplitudes[1:])
    nominal = float(amplitudes[0])
    return PredictedResidual(
        nominal=nominal,
        worst=worst,
        stiffness_factor=float(place[0]),
        damping_factor=float(place[1]),
        box=box,
    )


def largest(edges: Sequence[FloatArray], values: FloatArray) -> tuple[float, FloatArray]:
    """Return the largest of the values along all edges, and its factors, shape (2,)."""
    worst, place, first = -1.0, edges[0][0], 0
    for edge in edges:
        value, at = _peak(edge, values[first : first + len(edge)])
        first += len(edge)
        if value > worst:
            worst, place = value, at
    return worst, place


def _peak(edge: FloatArray, values: FloatArray) -> tuple[float, FloatArray]:
    """Return the largest value along an edge, from a parabola through its neighbours."""
    i = int(np.argmax(values))
    if not 0 < i < len(values) - 1:
        return float(values[i]), edge[i]
    span = edge[i + 1] - edge[i - 1]
    share = float(np.abs(edge[i] - edge[i - 1]).sum() / np.abs(span).sum())
    a, b, c = values[i - 1 : i + 2].tolist()
    # Newton's form a + s u + q u (u - share) over u in [0, 1].
    slope = (b - a) / share
    bend = (c - a - slope) / (1.0 - share)
    if bend >= 0.0:
        return float(b), edge[i]
    at = min(max(0.5 * (share - slope / bend), 0.0), 1.0)
    top = a + slope * at + bend * at * (at - share)
    return max(float(b), float(top)), edge[i - 1] + at * span
