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
from flat_planner_ros.core.model_fit.first_links import (
    Chain,
    first_scales,
    KINDS,
    noise_of_rows,
    OFFSET,
    parameters_of,
)
from flat_planner_ros.core.model_fit.first_motion import (
    ChainRows,
    first_motions,
    FirstMotion,
    rows_of,
    windowed,
)
from flat_planner_ros.core.model_fit.measurements import Measurements, noise_of
from flat_planner_ros.core.model_fit.weak_form import OVERLAP
import numpy as np

UNMODELLED = 0.003
"""Error of a row that comes with the noise's, relative to its effort [-]: of sampled efforts."""


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
    sample = float(motion.times[1] - motion.times[0])
    (slopes, _, weights), net, by_noise = _told(arm, [motion], sample, noise)
    spread = np.hypot(by_noise, UNMODELLED * net.std(axis=0) if len(net) else 0.0)
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
    motions = first_motions(measurements, delay)
    (_, left, weights), net, by_noise = _told(arm, motions, measurements.period, noise)
    result = np.ones(arm.n - 2)
    for i in range(arm.n - 2):
        is_used = weights[:, i] > 0.0
        if np.count_nonzero(is_used) > OVERLAP:
            wrong = max(float(np.mean(left[is_used, i] ** 2)) - by_noise[i] ** 2, 0.0)
            size = max(float(np.std(net[is_used, i])), np.finfo(float).tiny)
            result[i] = np.sqrt(wrong) / size
    return result


class _Told(NamedTuple):
    """Rows, the efforts that they explain and leave (w, m), and what noise does to them (m,)."""

    rows: ChainRows
    net: FloatArray
    by_noise: FloatArray


def _told(arm: PlanarArm, motions: list[FirstMotion], sample: float, noise: FloatArray) -> _Told:
    """Return what motions tell around a model; `sample` is the time between samples [s]."""
    count = arm.n - 2
    friction = float(arm.viscous_friction[-1]), float(arm.coulomb_friction[-1])
    values, period = parameters_of(arm), 2 * pi / arm.natural_mode().frequency
    parts = windowed(motions, period, sample, noise)
    whole = rows_of(parts, Chain.of(arm, friction), values)
    gain = parts[-1].windows.gain(2) if parts else 0.0
    by_noise = noise_of_rows(arm.inertia[:count, :count], noise, gain)
    return _Told(whole, whole.left + whole.slopes @ _without_offsets(values), by_noise)


def _without_offsets(values: FloatArray) -> FloatArray:
    """Return the parameters in which rows are linear, the others zero."""
    linear = values.reshape(len(KINDS), -1).copy()
    linear[OFFSET] = 0.0
    return linear.ravel()


def _scales(arm: PlanarArm, motion: FirstMotion) -> FloatArray:
    """Return how far each parameter may reasonably be off, shape (5 k,), as a fit has it."""
    count = arm.n - 2
    rates = np.gradient(motion.positions[:, :count], motion.times, axis=0)
    return first_scales(arm, motion.efforts[:, :count].std(axis=0), rates.std(axis=0))
