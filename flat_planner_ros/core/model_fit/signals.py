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

"""Signals between their samples, smoothed derivatives, and pieces of a recording."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from math import sqrt
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray
import numpy as np

GAP = 5.0
"""Time between two samples that ends a segment, relative to the usual one [-]."""

RATE_GAIN = 8.7
"""Noise of a velocity by polynomials of degree 4, for unit noise, sample and span [-]."""

RATE_NOISE = 3e-3
"""Noise of velocities that is aimed at, well below that of Coulomb friction [rad/s]."""

FEWEST = 6
"""Fewest samples that polynomials span."""

AT_A_TIME = 8192
"""Samples that are looked at together: memory does not grow with a recording [-]."""

SHORTEST = 12
"""Fewest samples of a segment: its start alone takes four unknowns [-]."""


class Segment(NamedTuple):
    """Samples first ... last-1 of a recording, simulated from a start of their own."""

    first: int
    last: int


def segments_of(
    times: FloatArray, period: float, longest: float, cuts: Sequence[int] = ()
) -> list[Segment]:
    """
    Return even pieces of a recording, none longer than asked, none across a gap or cut.

    Parameters
    ----------
    times
        Of the samples, shape (m,) [s].
    period
        Usual time between two of them [s].
    longest
        Bound on the time that a piece spans [s].
    cuts
        Samples at which a piece begins in any case, ascending.

    """
    pieces = []
    for first, last in _cut(stretches(times, period), cuts):
        count = max(1, round(float(times[last - 1] - times[first]) / longest))
        ends = np.linspace(first, last, count + 1).astype(int).tolist()
        pieces += [Segment(*each) for each in pairwise(ends)]
    return [piece for piece in pieces if piece.last - piece.first >= SHORTEST]


def _cut(pieces: Sequence[Segment], cuts: Sequence[int]) -> Iterator[Segment]:
    """Yield what cuts leave of pieces."""
    for first, last in pieces:
        inside = [cut for cut in cuts if first < cut < last]
        yield from (Segment(*ends) for ends in pairwise([first, *inside, last]))


def stretches(times: FloatArray, period: float) -> list[Segment]:
    """Return the pieces of a recording between gaps, its usual period being known [s]."""
    gaps = (np.flatnonzero(np.diff(times) > GAP * period) + 1).tolist()
    return [Segment(*ends) for ends in pairwise([0, *gaps, times.size])]


class Cubics(NamedTuple):
    """
    Samples interpolated by cubic Hermite polynomials with central slopes.

    Local and without the ringing of a spline where an effort jumps; the ends are held.

    Attributes
    ----------
    times, values, slopes
        Shape (m,).

    """

    times: FloatArray
    values: FloatArray
    slopes: FloatArray

    @classmethod
    def of(cls, times: FloatArray, values: FloatArray, begin: float, end: float) -> 'Cubics':
        """Return what is needed between two times [s]: a recording may be long."""
        first = max(int(np.searchsorted(times, min(begin, times[-1]))) - 2, 0)
        near = slice(first, int(np.searchsorted(times, max(end, times[0]))) + 3)
        return cls(times[near], values[near], np.gradient(values[near], times[near]))

    def __call__(self, at: FloatArray) -> FloatArray:
        """Return values at times of any shape [s]."""
        times, values, slopes = self
        inside = np.clip(at, times[0], times[-1])
        index = np.clip(np.searchsorted(times, inside, side='right') - 1, 0, times.size - 2)
        here = times[index]
        step = times[index + 1] - here
        ends = values[index], values[index + 1], slopes[index], slopes[index + 1]
        return hermite((inside - here) / step, step, *ends)


def interpolated(
    times: FloatArray, values: FloatArray, at: FloatArray, straightness: float
) -> FloatArray:
    """
    Return samples interpolated by cubics, straight lines, or what is between the two.

    Parameters
    ----------
    times, values
        Samples, shape (m,).
    at
        Times, any shape [s].
    straightness
        0 for the cubics, 1 for the lines [-].

    """
    return between(Cubics.of(times, values, float(at.min()), float(at.max())), at, straightness)


def between(cubics: Cubics, at: FloatArray, straightness: float) -> FloatArray:
    """Return the same of samples whose slopes are known."""
    if straightness == 0.0:
        return cubics(at)
    straight = np.interp(at, cubics.times, cubics.values)
    if straightness == 1.0:
        return straight
    return straightness * straight + (1.0 - straightness) * cubics(at)


def hermite(
    share: FloatArray,
    step: FloatArray,
    first: FloatArray,
    last: FloatArray,
    first_slope: FloatArray,
    last_slope: FloatArray,
) -> FloatArray:
    """Return the cubic with given ends at a share, 0 to 1, of a step; shapes that broadcast."""
    rise = last - first
    bend = step * first_slope - rise
    back = rise - step * last_slope
    result: FloatArray = first + share * (rise + (1 - share) * ((1 - share) * bend + share * back))
    return result


def span_for(noise: float, period: float, longest: float) -> float:
    """
    Return the time that smoothing polynomials span: as short as the noise admits.

    Where friction turns, a velocity has a kink, which polynomials round off.

    Parameters
    ----------
    noise
        Of the angles [rad].
    period
        Time between two samples [s].
    longest
        Bound on the span, unless that is less than a polynomial needs [s].

    """
    wanted: float = (RATE_GAIN * noise * sqrt(period) / RATE_NOISE) ** (2 / 3)
    return max(min(wanted, longest), FEWEST * period)


def derivative(
    times: FloatArray, angles: FloatArray, width: float, order: int, degree: int = 4
) -> FloatArray:
    """
    Return a derivative of smoothed angles, shape (m, n).

    A polynomial is fitted around every sample (Savitzky and Golay 1964), on an even grid of the
    usual period to which uneven samples are brought first.

    Parameters
    ----------
    times, angles
        Samples, shapes (m,) [s] and (m, n) [rad].
    width
        Time that the polynomials span [s].
    order
        Of the derivative, 0 to 2.
    degree
        Of the polynomials.

    """
    return Smoothed(times, angles, width, order, degree)(0, times.size)


class Even(NamedTuple):
    """So many even times from one to another [s]."""

    begin: float
    end: float
    samples: int

    @property
    def spacing(self) -> float:
        """Return the time between two of them [s]."""
        return (self.end - self.begin) / (self.samples - 1)

    def times(self, first: int, last: int) -> FloatArray:
        """Return those with numbers first ... last-1 [s]."""
        found = np.arange(first, last, dtype=float) * self.spacing + self.begin
        if last == self.samples:
            found[-1] = self.end
        return found

    def around(self, begin: float, end: float) -> Segment:
        """Return the numbers of times that span some [s], with one to spare on either side."""
        first, last = (int((time - self.begin) / self.spacing) for time in (begin, end))
        return Segment(max(first - 1, 0), min(last + 3, self.samples))


class Smoothed:
    """
    A derivative of smoothed angles, for some of the samples at a time.

    Parameters are as for `derivative`.
    """

    def __init__(
        self, times: FloatArray, angles: FloatArray, width: float, order: int, degree: int = 4
    ) -> None:
        self._times, self._angles = times, angles
        period = float(np.median(np.diff(times)))
        count = max(round(float(times[-1] - times[0]) / period), 2 * degree) + 1
        self._grid = Even(float(times[0]), float(times[-1]), count)
        window = min(max(2 * round(width / period / 2) + 1, degree + 3 - degree % 2), count)
        window -= 1 - window % 2
        spacing = float(np.diff(self._grid.times(0, 2))[0])
        self._weights = _smoothing(window, degree, spacing, order)

    def __call__(self, first: int, last: int) -> FloatArray:
        """Return the derivative at samples first ... last-1, shape (last - first, n)."""
        times = self._times[first:last]
        begin, end = self._needed(float(times[0]), float(times[-1]))
        grid = self._grid.times(begin, end)
        near = samples_around(self._times, grid)
        has_ends = begin == 0, end == self._grid.samples
        half = self._weights[1].size // 2
        seen = grid[0 if has_ends[0] else half : None if has_ends[1] else grid.size - half]
        found = np.empty((times.size, self._angles.shape[1]))
        # One by one: a recording may be long.
        for place, column in enumerate(self._angles[near].T):
            even = np.interp(grid, self._times[near], column)
            found[:, place] = np.interp(times, seen, _smoothed(even, *self._weights, *has_ends))
        return found

    def _needed(self, begin: float, end: float) -> Segment:
        """Return the numbers of even samples that times between two are told by."""
        window = self._weights[1].size
        first, last = self._grid.around(begin, end)
        first = max(min(first - window // 2, self._grid.samples - window), 0)
        last = min(max(last + window // 2, first + window), self._grid.samples)
        return Segment(first, last)


def samples_around(times: FloatArray, grid: FloatArray) -> slice:
    """Return the samples at times (m,) between which a grid lies, shape (g,) [s]."""
    first = max(int(np.searchsorted(times, grid[0], side='right')) - 1, 0)
    return slice(first, int(np.searchsorted(times, grid[-1])) + 1)


def pieces(first: int, last: int, overlap: int = 0) -> Iterator[slice]:
    """Yield the samples first ... last-1 a few at a time, some of the next ones with them."""
    for begin in range(first, last - overlap, AT_A_TIME):
        yield slice(begin, min(begin + AT_A_TIME + overlap, last))


def deviation_of(parts: Iterable[FloatArray]) -> FloatArray:
    """Return the standard deviation over all rows of parts, shape of a row."""
    count, total, power = 0, np.zeros(()), np.zeros(())
    for part in parts:
        count += len(part)
        total = total + part.sum(axis=0)
        power = power + (part**2).sum(axis=0)
    mean = total / count
    found: FloatArray = np.sqrt(np.maximum(power / count - mean**2, 0.0))
    return found


def _smoothing(
    window: int, degree: int, spacing: float, order: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return weights of a window's samples in a derivative: before its middle, in it, behind."""
    # Not scipy's: its signal processing alone takes 40 MB and a second to load.
    half = window // 2
    places = np.arange(-half, half + 1) * spacing
    scale = half * spacing
    fit = np.linalg.pinv(np.vander(places / scale, degree + 1, increasing=True))
    rows = np.polynomial.polynomial.polyder(fit, order) / scale**order
    powers = np.vander(places / scale, degree + 1 - order, increasing=True)
    return powers[:half] @ rows, rows[0], powers[half + 1 :] @ rows


def _smoothed(
    even: FloatArray,
    before: FloatArray,
    inside: FloatArray,
    behind: FloatArray,
    has_begin: bool,
    has_end: bool,
) -> FloatArray:
    """Return a derivative of even samples by the weights of a window, half of one off no end."""
    window = inside.size
    parts = [np.correlate(even, inside, mode='valid')]
    # At both ends the polynomial of the last whole window goes on.
    if has_begin:
        parts.insert(0, before @ even[:window])
    if has_end:
        parts.append(behind @ even[-window:])
    return np.concatenate(parts)
