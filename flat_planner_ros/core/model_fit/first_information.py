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

"""What a motion will tell of the first n-2 links before it is carried out, and what it kept."""

from math import pi
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray, PlanarArm
from flat_planner_ros.core.model_fit.first_fit import (
    MOSTLY,
    POWER,
    SHORTEST,
    SMOOTHING,
    WINDOW,
)
from flat_planner_ros.core.model_fit.first_links import (
    Chain,
    ChainSignals,
    first_scales,
    KINDS,
    OFFSET,
    parameters_of,
    rows,
)
from flat_planner_ros.core.model_fit.measurements import Measurements, noise_of
from flat_planner_ros.core.model_fit.signals import span_for, stretches
from flat_planner_ros.core.model_fit.weak_form import OVERLAP, Windows
import numpy as np

UNMODELLED = 0.003
"""Error of a row that comes with the noise's, relative to its effort [-]: of sampled efforts."""


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


def first_information(
    arm: PlanarArm, motion: FirstMotion, noise: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """
    Return the Fisher information about the first links that a recording will hold, and the scales.

    Parameters
    ----------
    arm
        The model that is taken for true, of three or more joints.
    motion
        As it is foreseen.
    noise
        Standard deviation of each joint angle, shape (n,) [rad].

    Returns
    -------
    tuple[FloatArray, FloatArray]
        Information about the parameters in the order of `first_links.KINDS`, shape (5 k, 5 k) with
        k = n-2, of the rows of the weak form by which a fit tells them, windows that overlap
        counting as one; and how far each may reasonably be off, shape (5 k,).

    """
    slopes, left, net, weights, gain = _rows_of(arm, [motion], noise)
    spread = _noise_of_rows(arm, noise, gain)
    spread = np.hypot(spread, UNMODELLED * net.std(axis=0) if len(net) else 0.0)
    weighted = slopes * (weights / np.maximum(spread, 1e-300) ** 2)[:, :, None]
    told = np.einsum('wmp,wmq->pq', weighted, slopes) / OVERLAP
    return told, _scales(arm, motion)


def first_misprediction(arm: PlanarArm, measurements: Measurements, delay: float) -> FloatArray:
    """
    Return how far the efforts of a model are from those measured, relative to their changes.

    Parameters
    ----------
    arm
        The model, of three or more joints.
    measurements
        With the efforts that acted.
    delay
        By which they act later than they are stamped [s].

    Returns
    -------
    FloatArray
        Root mean square of what the row of each of the first links leaves unexplained, less what
        noise explains, over the spread of its effort, shape (n-2,) [-]; 1 where the joints of the
        row hardly moved.

    """
    noise = noise_of(measurements)
    parts = first_motions(measurements, delay)
    _, left, net, weights, gain = _rows_of(arm, parts, noise)
    result = np.ones(arm.n - 2)
    by_noise = _noise_of_rows(arm, noise, gain)
    for i in range(arm.n - 2):
        is_used = weights[:, i] > 0.0
        if np.count_nonzero(is_used) > OVERLAP:
            wrong = max(float(np.mean(left[is_used, i] ** 2)) - by_noise[i] ** 2, 0.0)
            size = max(float(np.std(net[is_used, i])), np.finfo(float).tiny)
            result[i] = np.sqrt(wrong) / size
    return result


def first_motions(measurements: Measurements, delay: float) -> list[FirstMotion]:
    """
    Return each stretch without gaps on an even grid, with the efforts that act there.

    Parameters
    ----------
    measurements
        Of an arm of three or more joints.
    delay
        By which efforts act later than they are stamped [s].

    """
    found = []
    for first, last in stretches(measurements.times, measurements.period):
        times = measurements.times[first:last]
        count = round(float(times[-1] - times[0]) / measurements.period) + 1
        if count < SHORTEST:
            continue
        grid = np.linspace(times[0], times[-1], count)
        positions, efforts = (
            np.column_stack([np.interp(grid - late, times, column) for column in array.T])
            for array, late in (
                (measurements.positions[first:last], 0.0),
                (measurements.efforts[first:last], delay),
            )
        )
        found.append(FirstMotion(grid, positions, efforts))
    return found


class _ChainRows(NamedTuple):
    """Slopes (w, k, 5 k), what is left (w, k), net efforts (w, k), weights (w, k), and a gain."""

    slopes: FloatArray
    left: FloatArray
    net: FloatArray
    weights: FloatArray
    gain: float


def _rows_of(arm: PlanarArm, parts: list[FirstMotion], noise: FloatArray) -> _ChainRows:
    """Return the rows of all parts; those in which a joint of theirs rests have no weight."""
    count = arm.n - 2
    friction = float(arm.viscous_friction[-1]), float(arm.coulomb_friction[-1])
    chain, values = Chain.of(arm, friction), parameters_of(arm)
    slopes, left = [np.empty((0, count, values.size))], [np.empty((0, count))]
    net, weights = [left[0]], [left[0]]
    gain = 0.0
    period = 2 * pi / arm.natural_mode().frequency
    for part in parts:
        sample = float(part.times[1] - part.times[0])
        length = max(WINDOW * period, SHORTEST * sample)
        if part.times.size <= length / sample + 2:
            continue
        windows = Windows(part.times, length, POWER)
        signals = _signals(part, float(np.linalg.norm(noise[:-1])), period)
        by, rest = rows(signals, windows, chain, values)
        still = np.column_stack([windows(column) for column in signals.resting.T])
        slopes.append(by)
        left.append(rest)
        net.append(rest + by @ _without_offsets(values))
        weights.append((np.maximum(still[:, :-1], still[:, 1:]) < MOSTLY).astype(float))
        gain = windows.gain(2)
    return _ChainRows(
        np.concatenate(slopes),
        np.concatenate(left),
        np.concatenate(net),
        np.concatenate(weights),
        gain,
    )


def _signals(motion: FirstMotion, noise: float, period: float) -> ChainSignals:
    """Return what the rows need."""
    sample = float(motion.times[1] - motion.times[0])
    angles = np.cumsum(motion.positions, axis=1)[:, :-1]
    span = span_for(noise, sample, SMOOTHING * period)
    return ChainSignals.of(motion.times, angles, motion.efforts, span)


def _without_offsets(values: FloatArray) -> FloatArray:
    """Return the parameters in which rows are linear, the others zero."""
    linear = values.reshape(len(KINDS), -1).copy()
    linear[OFFSET] = 0.0
    return linear.ravel()


def _noise_of_rows(arm: PlanarArm, noise: FloatArray, gain: float) -> FloatArray:
    """Return what noise of the angles does to the rows, shape (n-2,) [N m]."""
    count = arm.n - 2
    spread = np.sqrt(np.cumsum(noise[:count] ** 2))
    result: FloatArray = gain * np.linalg.norm(arm.inertia[:count, :count] * spread, axis=1)
    return result


def _scales(arm: PlanarArm, motion: FirstMotion) -> FloatArray:
    """Return how far each parameter may reasonably be off, shape (5 k,), as a fit has it."""
    count = arm.n - 2
    rates = np.gradient(motion.positions[:, :count], motion.times, axis=0)
    return first_scales(arm, motion.efforts[:, :count].std(axis=0), rates.std(axis=0))
