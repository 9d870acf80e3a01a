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

"""Law of an effort that is linear in pieces: a Taylor series of the planned variable on each."""

from dataclasses import dataclass, replace
from math import factorial, perm
from typing import TYPE_CHECKING

from flat_planner_ros.core.arm import FloatArray, locked
from flat_planner_ros.core.motion_law import JET_ORDER
from flat_planner_ros.core.peak.driven_mode import DrivenMode, ModeState
import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from typing import Self  # Python 3.10 has none

REMAINDER = 1e-17
"""Share of the seventh derivative that the last term of its series may have [-]."""

KNOT_TOLERANCE = 1e-9
"""Distance in pieces below which a time is that of the next knot [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LinearEffortLaw:
    """
    A `Law` whose effort, or acceleration of link n-1, is linear between even knots.

    Five derivatives are continuous, the fifth one from the right at a knot.

    Attributes
    ----------
    duration
        Length of the motion [s].
    series
        Row k holds the k-th derivative of each piece at its start, times the k-th power of the
        piece's length over k!, shape (m, pieces).
    factor
        Multiplies the series [-].
    offset
        Is added to the value [rad].

    """

    duration: float
    series: FloatArray
    factor: float = 1.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        """Lock the series."""
        locked(self.series)

    @classmethod
    def of(cls, mode: DrivenMode, start: ModeState, drive: FloatArray, duration: float) -> 'Self':
        """
        Return the law of even samples of a drive.

        Parameters
        ----------
        mode
            What is driven.
        start
            Its state at the start, numbers.
        drive
            Even samples, joined linearly, shape (m,).
        duration
            From the first to the last [s].

        References
        ----------
        (B5) of docs/derivation.md.

        """
        step = duration / (len(drive) - 1)
        states = mode.states(start, drive, duration)
        turn = mode.frequency * step
        degree = JET_ORDER + 1
        while turn ** (degree - JET_ORDER) > REMAINDER * factorial(degree - JET_ORDER):
            degree += 1
        derivatives = np.zeros((degree + 1, len(drive) - 1))
        derivatives[:4] = mode.planned(states)[:, :-1]
        # Derivatives of sigma from the second on; those of a line vanish from the fourth on.
        sigma = np.zeros((degree + 1, len(drive) - 1))
        sigma[2], sigma[3] = mode.gain * drive[:-1], mode.gain * np.diff(drive) / step
        for k in range(2, degree - 1):
            swing = sigma[k] - derivatives[k] - mode.relaxation * derivatives[k + 1]
            derivatives[k + 2] = mode.frequency**2 * swing
        scales = [step**k / factorial(k) for k in range(degree + 1)]
        return cls(duration=duration, series=derivatives * np.array(scales)[:, None])

    def transformed(self, factor: float, offset: float) -> 'Self':
        """Return offset + factor times this law."""
        return replace(self, factor=factor * self.factor, offset=offset + factor * self.offset)

    @property
    def knots(self) -> FloatArray:
        """Return the times between which the law is smooth, with both ends, shape (m,) [s]."""
        pieces = self.series.shape[1]
        times: FloatArray = np.arange(pieces + 1.0) / pieces * self.duration
        return times

    def jet(self, t: ArrayLike, order: int, /) -> FloatArray:
        """Return the value and its derivatives up to an order, as `Law.jet`."""
        terms, pieces = self.series.shape
        places = np.atleast_1d(np.asarray(t, dtype=float)) * (pieces / self.duration)
        chosen = np.clip(np.floor(places + KNOT_TOLERANCE), 0, pieces - 1).astype(int)
        powers = np.vander(places - chosen, terms, increasing=True).T
        series = self.factor * self.series[:, chosen]
        table = np.zeros((order + 1, len(places)))
        for k in range(min(order + 1, terms)):
            falling = [float(perm(j, k)) for j in range(k, terms)]
            table[k] = np.einsum('j,jm,jm->m', falling, series[k:], powers[: terms - k])
            table[k] *= (pieces / self.duration) ** k
        table[0] += self.offset
        return table
