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

"""Motions as the rows of the first n-2 links take them: on even times, with their windows."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.model_fit.first_links import Chain, ChainSignals, KINDS, rows
from flat_planner_ros.core.model_fit.measurements import Measurements
from flat_planner_ros.core.model_fit.signals import span_for, stretches
from flat_planner_ros.core.model_fit.weak_form import Windows
import numpy as np

WINDOW, SHORTEST = 0.5, 26
"""Length of a window, in free periods of the passive joint [-] and at least in samples."""

POWER = 6
"""A window is (1 - x^2)^POWER, so smooth at its ends that sums are as good as integrals."""

SMOOTHING = 0.15
"""Longest span of the polynomials that smooth velocities, in free periods [-]."""

MOSTLY = 0.3
"""Share of a window at rest from which it tells nothing of that joint [-]."""


class FirstMotion(NamedTuple):
    """
    Motion of all joints, sampled evenly.

    Attributes
    ----------
    times
        Shape (m,) [s].
    positions
        Joint angles, shape (m, n) [rad].
    efforts
        Of the actuated joints when they act, shape (m, n-1) [N m].

    """

    times: FloatArray
    positions: FloatArray
    efforts: FloatArray


class Windowed(NamedTuple):
    """What is measured in one stretch, and the windows over it."""

    signals: ChainSignals
    windows: Windows


class ChainRows(NamedTuple):
    """Rows of all windows: slopes (w, m, P), what is left (w, m) and weights (w, m)."""

    slopes: FloatArray
    left: FloatArray
    weights: FloatArray


def first_motions(
    measurements: Measurements, delay: float, *, every: int = 1
) -> list[FirstMotion]:
    """
    Return each stretch without gaps on an even grid, with the efforts that act there.

    Parameters
    ----------
    measurements
        Of an arm of three or more joints.
    delay
        By which efforts act later than they are stamped [s].
    every
        Of the efforts only every so many are looked at [-].

    """
    found = []
    for first, last in stretches(measurements.times, measurements.period):
        times = measurements.times[first:last]
        count = round(float(times[-1] - times[0]) / measurements.period) + 1
        if count < SHORTEST:
            continue
        grid = np.linspace(times[0], times[-1], count)
        positions, efforts = measurements.positions[first:last], measurements.efforts[first:last]
        seen = [np.interp(grid, times, column) for column in positions.T]
        acting = [np.interp(grid - delay, times[::every], each) for each in efforts[::every].T]
        found.append(FirstMotion(grid, np.column_stack(seen), np.column_stack(acting)))
    return found


def windowed(
    motions: Iterable[FirstMotion],
    period: float,
    sample: float,
    noise: FloatArray,
    *,
    longer: float = 1.0,
) -> list[Windowed]:
    """
    Return what the rows need of motions that are longer than a window.

    Parameters
    ----------
    motions
        Of an arm of three or more joints.
    period
        Free period of the passive joint [s].
    sample
        Usual time from one sample to the next [s].
    noise
        Standard deviation of each joint angle, shape (n,) [rad].
    longer
        By which velocities are smoothed over a longer span [-].

    """
    length = max(WINDOW * period, SHORTEST * sample)
    span = longer * span_for(float(np.linalg.norm(noise[:-1])), sample, SMOOTHING * period)
    found = []
    for times, positions, efforts in motions:
        if times.size > length / sample + 2:
            angles = np.cumsum(positions, axis=1)[:, :-1]
            signals = ChainSignals.of(times, angles, efforts, span)
            found.append(Windowed(signals, Windows(times, length, POWER)))
    return found


def rows_of(parts: Sequence[Windowed], chain: Chain, values: FloatArray) -> ChainRows:
    """Return the rows of all parts; those in which a joint of theirs rests have no weight."""
    count = values.size // len(KINDS)
    slopes, left = [np.empty((0, count, values.size))], [np.empty((0, count))]
    weights = [left[0]]
    for signals, windows in parts:
        by, rest = rows(signals, windows, chain, values)
        still = np.column_stack([windows(column) for column in signals.resting.T])
        slopes.append(by)
        left.append(rest)
        weights.append((np.maximum(still[:, :-1], still[:, 1:]) < MOSTLY).astype(float))
    return ChainRows(np.concatenate(slopes), np.concatenate(left), np.concatenate(weights))
