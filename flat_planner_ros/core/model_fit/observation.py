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

"""A recording of the last two links as the fit sees it, and the size of what it looks for."""

from collections.abc import Iterator
from dataclasses import replace
from math import sqrt

from flat_planner_ros.core.arm import FloatArray, InvalidRequest
from flat_planner_ros.core.model_fit.base_errors import base_errors_of, Smoothing
from flat_planner_ros.core.model_fit.imbalance import turning_of
from flat_planner_ros.core.model_fit.measurements import (
    encoder_step,
    Measurements,
    moves_of,
    noise_of,
)
from flat_planner_ros.core.model_fit.signals import (
    derivative,
    deviation_of,
    FEWEST,
    interpolated,
    pieces,
    segments_of,
    Smoothed,
    span_for,
)
from flat_planner_ros.core.model_fit.simulation import Observed
import numpy as np
import numpy.typing as npt

SEGMENT = 6.0
"""Longest segment, in free periods of the passive joint [-]."""

SMOOTHING = 0.15
"""Span of the polynomials that smooth velocities, in free periods [-]."""


SUDDEN = 0.3
"""Change of a held effort from sample to sample that is sudden, relative to the largest [-]."""

FEW = 0.02
"""Share of samples with such changes beyond which they are the rule [-]."""

STANDS = 10.0
"""Range of an angle that noise alone may have, in standard deviations: of 1e6 samples [-]."""

STILL = 1.05
"""Spread of an angle that rests, in that of its noise [-]: motions of a third are hidden."""

LONGER = 1.6
"""Factor on the span of smoothed velocities, what comes of which shows what they cost [-]."""


def observed_of(
    measurements: Measurements, period: float, *, with_turning: bool = False
) -> Observed:
    """Return the last two links, with what a coupling of both turns on demand."""
    if not np.ptp(measurements.positions, axis=0).any():
        raise InvalidRequest('no joint moves in the measurements: only motions tell a model')
    if not np.ptp(measurements.positions[:, -1]):
        raise InvalidRequest(
            f'joint {measurements.joints} stands still in all {measurements.times.size} '
            'measurements: only its swings tell a model'
        )
    times, shown = measurements.times, _shown(measurements)
    rates = smoothed_rates(times, shown, period)
    base = base_rate(measurements, base_smoothing(measurements, period))
    cuts = sudden_changes(measurements.efforts[:, -1]) if measurements.are_held else []
    segments = segments_of(times, measurements.period, SEGMENT * period, cuts)
    if not segments:
        raise InvalidRequest('the measurements have no stretch without gaps')
    each = np.array([encoder_step(column) for column in measurements.positions.T])
    steps = np.array([np.linalg.norm(each[:-1]), each[-1]])
    return Observed(
        times=times,
        angles=shown,
        rates=np.concatenate([rates(first, first + 1) for first, _ in segments]),
        rate_spread=float(deviation_of(_turning_rates(rates, base))[0]),
        effort=measurements.efforts[:, -1],
        base=base,
        moves=np.column_stack([moves_of(*pair) for pair in zip(shown.T, steps, strict=True)]),
        rounding=steps / sqrt(12.0),
        segments=segments,
        turning=_turning(times, shown, period) if with_turning else None,
    )


def check_moves(measurements: Measurements) -> None:
    """Refuse measurements in which joint n-1 stands still, or link n-1 but for noise."""
    joint, count = measurements.joints - 1, measurements.times.size
    if not np.ptp(measurements.positions[:, -2]):
        raise InvalidRequest(
            f'joint {joint} stands exactly still in all {count} measurements: only its own '
            'motions tell the last two links; let it move, or check that its angle is recorded'
        )
    ends = [
        (link.min(), link.max())
        for link in (measurements.positions[piece, :-1].sum(axis=1) for piece in pieces(0, count))
    ]
    moved = float(np.ptp(ends))
    noise = float(noise_of_links(measurements)[0])
    if moved < STANDS * noise:
        raise InvalidRequest(
            f'link {joint} moves by {moved:.2g} rad in all {count} measurements, no more than its '
            f'noise of {noise:.2g} rad makes it: larger motions of joint {joint} are needed'
        )


def _shown(measurements: Measurements) -> FloatArray:
    """Return the angle of link n-1 and of the passive joint, shape (m, 2) [rad]."""
    if measurements.joints == 2:
        return measurements.positions
    link = measurements.positions[:, :-1].sum(axis=1)
    return np.column_stack((link, measurements.positions[:, -1]))


def smoothed_rates(times: FloatArray, shown: FloatArray, period: float) -> Smoothed:
    """Return the velocities of both angles (m, 2); the period is the passive joint's [s]."""
    return Smoothed(times, shown, _span(times, period), 1)


def _span(times: FloatArray, period: float) -> float:
    """Return the span of the polynomials that smooth velocities [s]."""
    return max(SMOOTHING * period, FEWEST * float(np.median(np.diff(times))))


def _turning_rates(rates: Smoothed, base: FloatArray) -> Iterator[FloatArray]:
    """Yield the velocity of joint n-1, a few samples at a time, shape (k, 1) [rad/s]."""
    for piece in pieces(0, base.size):
        yield rates(piece.start, piece.stop)[:, :1] - base[piece, None]


def _turning(times: FloatArray, shown: FloatArray, period: float) -> npt.NDArray[np.float32]:
    """Return `Observed.turning`, of angles as they are shown (m, 2)."""
    found = np.empty(shown.shape, dtype=np.float32)
    each = [Smoothed(times, shown, _span(times, period), order) for order in (1, 2)]
    for piece in pieces(0, times.size):
        rates, accelerations = (of(piece.start, piece.stop).cumsum(axis=1) for of in each)
        found[piece] = turning_of(shown[piece, 1], rates, accelerations)
    return found


def base_rate(measurements: Measurements, smoothing: Smoothing) -> FloatArray:
    """Return the smoothed velocity of link n-2, shape (m,): none with two joints, or at rest."""
    angle = measurements.positions[:, :-2].sum(axis=1, keepdims=True)
    if float(angle.std()) <= STILL * smoothing.noise:
        return np.broadcast_to(0.0, measurements.times.size)
    return derivative(measurements.times, angle, smoothing.span, 1)[:, 0]


def base_smoothing(measurements: Measurements, period: float) -> Smoothing:
    """Return how the velocity of link n-2 is smoothed; the period is the passive joint's [s]."""
    noise = float(np.linalg.norm(noise_of(measurements)[:-2]))
    return Smoothing(noise, span_for(noise, measurements.period, SMOOTHING * period))


def with_base_errors(observed: Observed, measurements: Measurements, period: float) -> Observed:
    """Return a recording whose velocity of link n-2 may be off, as its noise has it."""
    if not observed.base.any():
        return observed
    own = base_smoothing(measurements, period)
    longer = own._replace(span=LONGER * own.span)
    change = base_rate(measurements, longer) - observed.base
    rates = smoothed_rates(observed.times, observed.angles, period)
    turning = np.concatenate(list(_turning_rates(rates, observed.base)))[:, 0]
    smoothing = own, longer
    errors = base_errors_of(observed.times, turning, change, observed.segments, smoothing)
    return replace(observed, base_errors=errors)


def with_fewer_efforts(observed: Observed, every: int) -> Observed:
    """Return a recording in which all but `every` second, third, ... effort are interpolated."""
    times, effort = observed.times, observed.effort
    known = times[::every], effort[::every]
    fewer = interpolated(*known, times, observed.straightness)
    return replace(observed, effort=fewer)


def with_other_times(observed: Observed, seed: int) -> Observed:
    """
    Return efforts that began to act at other times between the same samples.

    Parameters
    ----------
    observed
        The recording.
    seed
        Of the times, each as likely as any other between its two samples.

    """
    bits = np.random.PCG64(seed).advance(observed.before)
    earlier = np.random.Generator(bits).uniform(-0.5, 0.5, observed.effort.size - 1)
    is_inside = np.zeros(earlier.size, dtype=bool)
    for first, last in observed.segments:
        is_inside[first : last - 1] = True
    earlier[~is_inside] = 0.0
    # Half of the impulse that is gained or lost goes to either end: what interpolates keeps it.
    gained = 0.5 * earlier * np.diff(observed.effort)
    return replace(observed, effort=observed.effort + np.append(gained, 0) + np.append(0, gained))


def sudden_changes(effort: FloatArray) -> list[int]:
    """
    Return the samples around changes of a held effort that are too large not to know their time.

    Parameters
    ----------
    effort
        Shape (m,) [N m].

    Returns
    -------
    list of int
        Where pieces are cut, the samples next to a change left out: none if there are many.

    """
    changes = np.flatnonzero(np.abs(np.diff(effort)) > SUDDEN * np.abs(effort).max())
    if changes.size > FEW * effort.size:
        return []
    return sorted({int(change) + place for change in changes for place in range(3)})


def noise_of_links(measurements: Measurements) -> FloatArray:
    """Return the noise of link n-1 and of the passive joint, shape (2,) [rad]."""
    each = noise_of(measurements)
    return np.array([np.linalg.norm(each[:-1]), each[-1]])
