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

"""How far a fit can be believed: residuals that err alike, and what is not modelled."""

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.model_fit.base_errors import root_of
from flat_planner_ros.core.model_fit.correlation import correlation_length
from flat_planner_ros.core.model_fit.refinement import Linearisation
import numpy as np

FAR_PRIOR = 1e4
"""Size of a step that no data need to exclude, relative to the parameters' scales [-]."""

EXCESS = 1.3
"""Residual relative to the noise from which the model's structure is in doubt [-]."""

REGULAR = 6.0
"""Samples that err alike from which a residual is regular, not noise [-]."""

REGULAR_EXCESS = 1.08
"""Regular residual relative to the noise from which the structure is in doubt [-]."""

MODEL_FLOOR = 1e-4
"""Residual that a simulation always leaves, relative to the motion's spread [-]."""


def correlation_lengths(around: Linearisation) -> list[float]:
    """Return the correlation length of either channel's residuals [-]."""
    return [correlation_length(sums) for sums in around.products]


def covariance(around: Linearisation, scales: FloatArray) -> FloatArray:
    """
    Return the covariance of the free parameters, in units of their scales.

    Parameters
    ----------
    around
        The last linearisation, its residuals divided by their own spread.
    scales
        Of the free parameters, shape (free,).

    Notes
    -----
    A sandwich of the normal equations, of three kinds, the largest error of each parameter
    counting: samples that err alike are one, by the mean autocorrelation; the scores as they are,
    with those of their neighbours (Newey and West 1987); and the rounding of encoders, one error
    as long as they stand still, of which a few rests show less than there is. All variances are
    above zero, as sums of squares, also of parameters that are told only together.

    """
    size = np.outer(scales, scales)
    lengths = correlation_lengths(around)
    inverse = _inverse(around.normal.sum(axis=0) * size + np.eye(scales.size) / FAR_PRIOR**2)
    half = inverse @ root_of(np.tensordot(lengths, around.normal, axes=1) * size)
    by_length = half @ half.T + inverse @ inverse / FAR_PRIOR**2
    by_scores = inverse @ (around.scatter * size) @ inverse
    by_rounding = inverse @ (around.rounding * size) @ inverse
    own = np.maximum(np.diag(by_scores), np.diag(by_rounding))
    larger = np.sqrt(np.maximum(own / np.diag(by_length), 1.0))
    result: FloatArray = by_length * np.outer(larger, larger)
    return result


def _inverse(normal: FloatArray) -> FloatArray:
    """Return the inverse of normal equations; a direction lost in rounding is not told at all."""
    sizes = np.sqrt(np.diag(normal))
    told, directions = np.linalg.eigh(normal / np.outer(sizes, sizes))
    is_lost = told <= sizes.size * np.finfo(float).eps
    # With nothing but the prior, seen from the parameter that is told best.
    told = np.where(is_lost, (FAR_PRIOR * sizes.max(initial=1.0)) ** -2, told)
    half = directions / np.sqrt(told) / sizes[:, None]
    inverse: FloatArray = half @ half.T
    return inverse


def doubt(around: Linearisation, spread: FloatArray, noise: FloatArray, motion: FloatArray) -> str:
    """
    Return what the model leaves unexplained, empty if noise explains it.

    Parameters
    ----------
    around
        The last linearisation.
    spread, noise
        Root mean square of the residual of either channel, and of what noise and inputs explain of
        it, shape (2,) [rad].
    motion
        Root mean square of the motion of either channel, shape (2,) [rad].

    """
    names = 'link n-1', 'the passive joint'
    found = []
    for channel, length in enumerate(correlation_lengths(around)):
        allowed = float(np.hypot(noise[channel], MODEL_FLOOR * motion[channel]))
        ratio = float(spread[channel]) / allowed
        if ratio > EXCESS or (ratio > REGULAR_EXCESS and length > REGULAR):
            found.append(
                f'{names[channel]} is {spread[channel]:.2g} rad off where noise and what happens '
                f'between samples explain {allowed:.2g} rad, {length:.0f} samples in a row alike'
            )
    return '; '.join(found)
