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

"""The fit of the first n-2 links: weighted least squares of their rows, and what they tell."""

from math import sqrt
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray, PlanarArm
from flat_planner_ros.core.model_fit.correlation import correlation_length, lags_for, products
from flat_planner_ros.core.model_fit.first_links import (
    Chain,
    COULOMB,
    first_scales,
    inertia_of,
    KINDS,
    MOMENT,
    noise_of_rows,
    OFFSET,
    OWN,
    parameters_of,
    VISCOUS,
)
from flat_planner_ros.core.model_fit.first_motion import (
    ChainRows,
    first_motions,
    rows_of,
    Windowed,
    windowed,
)
from flat_planner_ros.core.model_fit.measurements import Measurements, noise_of
from flat_planner_ros.core.model_fit.observation import LONGER
from flat_planner_ros.core.model_fit.refinement import neighbours
from flat_planner_ros.core.model_fit.weak_form import OVERLAP
import numpy as np

TOLD = 0.3
"""Largest standard error of a parameter that counts as told, relative to its scale [-]."""

NEGLIGIBLE = 0.01
"""Scale of a friction that makes no difference, relative to the one it is solved with [-]."""

CERTAIN = 3.0
"""Standard errors from its start value from which a parameter counts as told all the same [-]."""

SIMILAR = 0.01
"""Errors relative to the largest that count as of its size [-]."""

STEPS = 12
"""Most steps of Gauss and Newton: all but the offsets is linear."""

CONVERGED = 1e-8
"""Step that is the last, relative to the scales [-]."""

LEAST_ALIKE = 2.0
"""Windows that at least count as one, since their neighbours share most samples [-]."""

FAR = 100.0
"""Error of what nothing tells, relative to the scales [-]."""

LARGE = 4.0
"""Offset that is hardly believed, relative to its scale [-]."""

NULL, TINY = 1e-9, 1e-30
"""Ridge of the normal equations, relative to their diagonal and at least [-]."""

GIVEN_UP_FIRST = (OFFSET, COULOMB, VISCOUS, MOMENT, OWN)
"""Of parameters that only together are told, the kind that is kept at its start value."""

COARSER = 3.0
"""What half the efforts add to an error of second order, relative to it [-]."""

EXCESS, FLOOR = 1.5, 0.01
"""Effort left over relative to what noise explains, and to the effort, that is in doubt [-]."""


class FirstFit(NamedTuple):
    """
    The first links as fitted.

    Attributes
    ----------
    values
        Parameters in the order of `first_links.KINDS`, shape (5 m,).
    free
        Which of them the motion tells.
    errors
        Covariance of all, zero for those that are not told, shape (5 m, 5 m).
    misfit
        What the model does not explain; empty if noise explains what is left.

    """

    values: FloatArray
    free: list[int]
    errors: FloatArray
    misfit: str


def fit_first_links(
    measurements: Measurements,
    start: PlanarArm,
    period: float,
    last_friction: tuple[float, float],
    delay: float,
) -> FirstFit:
    """
    Fit the first links of an arm of three or more joints.

    Parameters
    ----------
    measurements, start
        As for `fit_model`.
    period
        Free period of the passive joint [s].
    last_friction
        Viscous and Coulomb friction of joint n-1 [N m s/rad], [N m].
    delay
        By which efforts act later than they are stamped [s].

    """
    chain = Chain.of(start, last_friction)
    noise = noise_of(measurements)

    def seen(*, longer: float = 1.0, every: int = 1) -> list[Windowed]:
        motions = first_motions(measurements, delay, every=every)
        return windowed(motions, period, measurements.period, noise, longer=longer)

    parts = seen()
    believed = parameters_of(start)
    scales = _scales(parts, start)
    free = list(range(believed.size))
    linear = [i for i in free if i // (start.n - 2) != OFFSET]
    values, _ = _solved(parts, chain, believed, linear, scales)
    scales = np.maximum(scales, np.abs(values))
    while True:
        values, found = _solved(parts, chain, values, free, scales)
        errors = _covariance(found, free, scales)
        ratio = np.sqrt(np.diag(errors))
        away = np.abs(values - believed)[free] / scales[free]
        is_vague = (ratio > TOLD) & (away < CERTAIN * ratio)
        if not is_vague.any():
            break
        # Parameters that only together are told have errors of one size.
        most = ratio[is_vague].max()
        vague = [free[i] for i in np.flatnonzero(is_vague & (ratio > SIMILAR * most))]
        given_up = min(vague, key=lambda i: GIVEN_UP_FIRST.index(i // (start.n - 2)))
        free.remove(given_up)
        values[given_up] = believed[given_up]
    whole = np.zeros((values.size, values.size))
    whole[np.ix_(free, free)] = errors * np.outer(scales[free], scales[free])
    for weight, changed in (
        (1.0, seen(longer=LONGER)),
        (1 / COARSER, seen(every=2)),
    ):
        other, _ = _solved(changed, chain, values, free, scales)
        whole += weight**2 * np.outer(other - values, other - values)
    misfit = _doubt(found, values, chain, noise, parts)
    sizes = _sizes(scales, values, believed)
    stds = np.sqrt(np.diag(whole))
    is_told = (stds <= TOLD * sizes) | (np.abs(values - believed) >= CERTAIN * stds)
    told = [i for i in free if is_told[i]]
    untold = np.setdiff1d(np.arange(values.size), told)
    # The others keep what was found with these: what they lack is in the errors of the others.
    values[untold] = believed[untold]
    whole[untold] = whole[:, untold] = 0.0
    return FirstFit(values, told, whole, misfit)


def _sizes(scales: FloatArray, values: FloatArray, believed: FloatArray) -> FloatArray:
    """Return what an error is compared with, shape (5 m,): inertia and friction themselves."""
    sizes = scales.reshape(len(KINDS), -1).copy()
    least = NEGLIGIBLE * sizes
    known = np.maximum(np.abs(values), np.abs(believed)).reshape(sizes.shape)
    friction = [VISCOUS, COULOMB]
    sizes[friction] = np.maximum(known, least)[friction]
    sizes[OWN] = np.abs(values).reshape(sizes.shape)[OWN]
    return sizes.ravel()


def _scales(parts: list[Windowed], start: PlanarArm) -> FloatArray:
    """Return how far each parameter may reasonably be off, shape (5 m,)."""
    effort, rate = np.zeros(start.n - 2), np.zeros(start.n - 2)
    for signals, _ in parts:
        joints = np.diff(signals.rates, axis=1, prepend=0.0)
        effort = np.maximum(effort, signals.efforts[:, :-1].std(axis=0))
        rate = np.maximum(rate, joints.std(axis=0))
    return first_scales(start, effort, rate)


def _rows_around(parts: list[Windowed], chain: Chain, values: FloatArray) -> ChainRows:
    """Return the rows of all stretches, their weights those of what is left."""
    whole = rows_of(parts, chain, values)
    if not len(whole.left):  # a recording shorter than a window
        return whole
    spread = np.sqrt(np.average(whole.left**2, axis=0, weights=whole.weights + 1e-12))
    return whole._replace(weights=whole.weights / np.maximum(spread, 1e-300) ** 2)


def _solved(
    parts: list[Windowed],
    chain: Chain,
    values: FloatArray,
    free: list[int],
    scales: FloatArray,
) -> tuple[FloatArray, ChainRows]:
    """Return the free parameters with the least weighted sum of squares, and the rows there."""
    around = _rows_around(parts, chain, values)
    for _ in range(STEPS):
        if not free or not len(around.left):
            break
        slopes = around.slopes[:, :, free] * scales[free]
        normal = np.einsum('wmp,wm,wmq->pq', slopes, around.weights, slopes)
        gradient = np.einsum('wmp,wm->p', slopes, around.weights * around.left)
        # Offsets are small by belief: far from zero their rows are no longer linear.
        is_offset = np.array(free) // around.left.shape[1] == OFFSET
        gradient -= is_offset / LARGE**2 * values[free] / scales[free]
        normal += np.diag(NULL * (np.diag(normal) + TINY) + is_offset / LARGE**2)
        step = np.linalg.solve(normal, gradient)
        values = values.copy()
        values[free] += scales[free] * step
        around = _rows_around(parts, chain, values)
        if np.abs(step).max() < CONVERGED:
            break
    return values, around


def _covariance(around: ChainRows, free: list[int], scales: FloatArray) -> FloatArray:
    """
    Return the covariance of the free parameters, in units of their scales.

    A sandwich whose scores are correlated as far as windows overlap (Newey and West 1987), or, if
    that is larger, the normal equations with windows that err alike counting as one.
    """
    slopes = around.slopes[:, :, free] * scales[free]
    normal = np.einsum('wmp,wm,wmq->pq', slopes, around.weights, slopes)
    inverse = np.linalg.inv(normal + np.eye(len(free)) / FAR**2)
    scores = np.einsum('wmp,wm->wp', slopes, around.weights * around.left)
    by_scores = inverse @ neighbours(scores, 2 * OVERLAP) @ inverse if len(scores) else inverse
    alike = _alike(around)
    by_length = inverse * alike
    larger = np.sqrt(np.maximum(np.diag(by_scores) / np.diag(by_length), 1.0))
    independent = max(np.count_nonzero(around.weights) / alike, 1.0)
    few = independent / max(independent - len(free), 1.0)
    result: FloatArray = by_length * np.outer(larger, larger) * few
    return result


def _alike(around: ChainRows) -> float:
    """Return how many windows are worth one, at most those that overlap [-]."""
    used = [
        left[weight > 0.0] for left, weight in zip(around.left.T, around.weights.T, strict=True)
    ]
    sums = [products(each[:, None], lags_for([each.size])) for each in used if each.size > OVERLAP]
    lengths = [correlation_length(each[0]) for each in sums]
    return float(np.clip(max(lengths, default=OVERLAP), LEAST_ALIKE, OVERLAP))


def _doubt(
    around: ChainRows,
    values: FloatArray,
    chain: Chain,
    noise: FloatArray,
    parts: list[Windowed],
) -> str:
    """Return what the rows leave unexplained, empty if noise explains it."""
    if not parts:
        return ''
    count = values.size // len(KINDS)
    own, moment = values.reshape(len(KINDS), count)[[OWN, MOMENT]]
    inertia = inertia_of(own, moment, chain.lengths)
    by_noise = noise_of_rows(inertia, noise, parts[0].windows.gain(2))
    found = []
    for i in range(count):
        is_used = around.weights[:, i] > 0.0
        if not is_used.any():
            continue
        left = sqrt(np.mean(around.left[is_used, i] ** 2))
        effort = max(float(signals.efforts[:, i].std()) for signals, _ in parts)
        allowed = float(np.hypot(by_noise[i], FLOOR * effort))
        if left > EXCESS * allowed:
            found.append(f'{left:.2g} N m at link {i + 1} where {allowed:.2g} N m are allowed')
    return '; '.join(found)
