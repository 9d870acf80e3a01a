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
Residuals of many motions at once, each on arms of its own.

Where the planned variable w is known as a function of time, nothing needs to be sampled: what
drives link n-1 is a combination of derivatives of w, which vanish at both ends, so its integral
against an oscillation is a polynomial in the pole times that of w' ((44a) of docs/derivation.md).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from flat_planner_ros.core.arm import ComplexArray, Drive, FloatArray
from flat_planner_ros.core.insensitive.insensitivity import UncertaintyBox
from flat_planner_ros.core.insensitive.oscillator import (
    corners_of,
    edges_between,
    Oscillator,
    pole_parts,
    stiffening,
)
import numpy as np
from numpy.typing import NDArray

Transform = Callable[[ComplexArray], ComplexArray]
"""From poles in units of 2 / duration, (p, q), to the integrals of w' exp(z (1 - x)), (p, q)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class OscillatorTable:
    """
    Oscillators of several arms, as `Oscillator` has one.

    Attributes
    ----------
    frequency, decay, inertia_ratio, gain
        As those of an `Oscillator`, shape (p, 1).
    drive
        What moves joint n-1.

    """

    frequency: FloatArray
    decay: FloatArray
    inertia_ratio: FloatArray
    gain: FloatArray
    drive: Drive

    @classmethod
    def of(cls, oscillators: Sequence[Oscillator | None], drive: Drive) -> 'OscillatorTable':
        """Return the table of some oscillators with the same drive; NaN where there is none."""
        values = [
            (np.nan,) * 4 if o is None else (o.frequency, o.decay, o.inertia_ratio, o.gain)
            for o in oscillators
        ]
        frequency, decay, ratio, gain = np.array(values).reshape(-1, 4).T[..., None]
        return cls(frequency=frequency, decay=decay, inertia_ratio=ratio, gain=gain, drive=drive)

    def chosen(self, rows: NDArray[np.int64]) -> 'OscillatorTable':
        """Return those of some arms."""
        return OscillatorTable(
            frequency=self.frequency[rows],
            decay=self.decay[rows],
            inertia_ratio=self.inertia_ratio[rows],
            gain=self.gain[rows],
            drive=self.drive,
        )

    def poles(self, factors: FloatArray) -> ComplexArray:
        """
        Return the poles of other arms; NaN where one does not oscillate.

        Parameters
        ----------
        factors
            On stiffness, damping, inertia of link n and, if there is a fourth, that of link n-1,
            shape (p, q, 3), (p, q, 4), or either without p [-].

        """
        inner = factors[..., 3] if factors.shape[-1] > 3 else 1.0
        common = stiffening(self.drive, self.inertia_ratio, factors[..., 2], inner)
        decay, square = pole_parts(
            self.frequency, self.decay, factors[..., 0] * common, factors[..., 1] * common
        )
        poles: ComplexArray = np.empty(square.shape, dtype=complex)
        poles.real = -decay
        poles.imag = np.sqrt(np.where(square > 0.0, square, np.nan))
        return poles

    def amplitudes(
        self, factors: FloatArray, rows: FloatArray, durations: FloatArray, transform: Transform
    ) -> FloatArray:
        """
        Return what motions over 1 rad leave on other arms, NaN where one does not oscillate.

        Parameters
        ----------
        factors
            Of the arms, as for `poles`.
        rows
            Factors of the derivatives of w in what drives link n-1, an effort [N m] or the link's
            velocity [rad/s], shape (p, 7) [s^k].
        durations
            Of the motions, shape (p,) [s].
        transform
            Of the motions.

        Returns
        -------
        FloatArray
            Shape (p, q) [rad].

        References
        ----------
        (44a) of docs/derivation.md.

        """
        poles = self.poles(factors)
        half = 0.5 * durations[:, None]
        harmless: ComplexArray = np.where(np.isfinite(poles.imag), poles, 1j)
        integral = transform(half * harmless)
        gain = self.gain / factors[..., 3] if factors.shape[-1] > 3 else self.gain
        if self.drive is Drive.POSITION:
            # Of the acceleration, a derivative more than the velocity.
            integral, gain = poles * integral, np.ones_like(self.gain)
        driven = np.zeros_like(poles)
        for order in range(rows.shape[1] - 1, 0, -1):
            driven = driven * poles + rows[:, order : order + 1]
        result: FloatArray = np.abs(gain * driven * integral) / poles.imag
        return result

    def edges(self, box: UncertaintyBox, durations: FloatArray) -> list[FloatArray]:
        """
        Return factors along the edges of a box, as many as the slowest drift of all arms takes.

        Parameters
        ----------
        box
            What may differ.
        durations
            Of the motions, shape (p,) [s].

        Returns
        -------
        list[FloatArray]
            Each of shape (m, 3) [-].

        """
        corners = corners_of(box)
        poles = self.poles(corners)
        turns = durations[:, None] * np.abs(np.roll(poles, -1, axis=1) - poles)
        most = np.max(turns, axis=0, where=np.isfinite(turns), initial=0.0)
        return edges_between(corners, most)


@dataclass(frozen=True, kw_only=True, eq=False)
class ResidualTable:
    """
    Residuals of motions, as `PredictedResidual` has those of one.

    Attributes
    ----------
    nominal, worst
        On the planner's own model, and the largest over the box; NaN where an arm does not
        oscillate, shape (p,) [rad].
    factors
        Where that is: on stiffness, damping and inertia of the last link, shape (p, 3) [-].
    miss
        How far from the goal the last two links may stop, shape (p,) [rad].
    box
        What may differ.

    """

    nominal: FloatArray
    worst: FloatArray
    factors: FloatArray
    miss: FloatArray
    box: UncertaintyBox


def residual_table(
    oscillators: OscillatorTable,
    rows: FloatArray,
    durations: FloatArray,
    transform: Transform,
    box: UncertaintyBox,
) -> ResidualTable:
    """
    Return the residuals of motions over 1 rad on their nominal arms, and the largest over a box.

    Parameters
    ----------
    oscillators, rows, durations, transform
        As for `OscillatorTable.amplitudes`.
    box
        What may differ.

    """
    edges = oscillators.edges(box, durations)
    factors = np.concatenate([np.ones((1, 3)), *edges])
    amplitudes = oscillators.amplitudes(factors, rows, durations, transform)
    worst, places = largest_along(edges, amplitudes[:, 1:])
    corners = np.array([[1.0, 1.0, factor] for factor in box.ranges[2]])
    return ResidualTable(
        nominal=amplitudes[:, 0],
        worst=worst,
        factors=places,
        miss=misses(oscillators, corners).max(axis=1),
        box=box,
    )


def misses(oscillators: OscillatorTable, factors: FloatArray) -> FloatArray:
    """
    Return how far from the goal motions over 1 rad leave other arms.

    Parameters
    ----------
    oscillators
        Of the nominal arms.
    factors
        Of the others, as for `OscillatorTable.poles`.

    Returns
    -------
    FloatArray
        Shape (p, q) [rad].

    References
    ----------
    (I18) of docs/derivation.md: the momentum that an effort gives is that of the nominal arm.

    """
    ratio = oscillators.inertia_ratio
    if oscillators.drive is Drive.POSITION:
        return np.zeros(np.broadcast_shapes(ratio.shape, factors.shape[:-1]))
    inner = factors[..., 3] if factors.shape[-1] > 3 else 1.0
    missed: FloatArray = np.abs(1.0 - ratio / (factors[..., 2] + inner * (ratio - 1.0)))
    return missed


def largest_along(
    edges: Sequence[FloatArray], values: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """
    Return the largest values along all edges, from parabolas, and where, as `largest` does.

    Parameters
    ----------
    edges
        Factors, each of shape (m, 3) [-].
    values
        At all of them, shape (p, sum of m).

    Returns
    -------
    tuple[FloatArray, FloatArray]
        Shapes (p,) and (p, 3).

    """
    tops, places, first = [], [], 0
    for edge in edges:
        top, place = _tops(edge, values[:, first : first + len(edge)])
        tops.append(top)
        places.append(place)
        first += len(edge)
    which = np.argmax(tops, axis=0)
    every = np.arange(len(which))
    return np.array(tops)[which, every], np.array(places)[which, every]


def _tops(edge: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the largest values along an edge, from parabolas through their neighbours."""
    every, best = np.arange(len(values)), np.argmax(values, axis=1)
    if len(edge) < 3:
        return values[every, best], edge[best]
    i = np.clip(best, 1, len(edge) - 2)
    a, b, c = (values[every, i + shift] for shift in (-1, 0, 1))
    span = edge[i + 1] - edge[i - 1]
    share = np.abs(edge[i] - edge[i - 1]).sum(axis=1) / np.abs(span).sum(axis=1)
    # Newton's form a + s u + q u (u - share) over u in [0, 1].
    slope = (b - a) / share
    bend = (c - a - slope) / (1.0 - share)
    is_inside = (best == i) & (bend < 0.0)
    at = np.clip(0.5 * (share - slope / np.where(is_inside, bend, -1.0)), 0.0, 1.0)
    top = a + slope * at + bend * at * (at - share)
    value = values[every, best]
    place = np.where(is_inside[:, None], edge[i - 1] + at[:, None] * span, edge[best])
    return np.where(is_inside, np.maximum(value, top), value), place
