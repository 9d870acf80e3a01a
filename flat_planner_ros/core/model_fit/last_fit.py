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

"""The fit of the last two links: a guess, its refinement, what is told, and how well."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from math import pi, sqrt
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray, InvalidRequest, PlanarArm
from flat_planner_ros.core.model_fit.doubts import (
    as_it_is,
    changes_by,
    Doubt,
    errors_of,
    straighter,
    straightness,
    View,
    Way,
)
from flat_planner_ros.core.model_fit.imbalance import find_imbalance, ImbalanceEstimate
from flat_planner_ros.core.model_fit.judgement import covariance
from flat_planner_ros.core.model_fit.last_links import (
    BOTH,
    COULOMB,
    DAMPING,
    DELAY,
    LAST,
    NAMES,
    OFFSET,
    STIFFNESS,
    VISCOUS,
)
from flat_planner_ros.core.model_fit.measurements import Measurements
from flat_planner_ros.core.model_fit.observation import (
    check_moves,
    noise_of_links,
    observed_of,
    smoothed_rates,
    with_base_errors,
    with_fewer_efforts,
    with_other_times,
)
from flat_planner_ros.core.model_fit.refinement import linearised, refine, Refined, spread_of
from flat_planner_ros.core.model_fit.scales import scales_of, vector_of
from flat_planner_ros.core.model_fit.signals import Even, samples_around, Smoothed
from flat_planner_ros.core.model_fit.simulation import first_starts, Observed, with_unknowns
from flat_planner_ros.core.model_fit.starts import settled
from flat_planner_ros.core.model_fit.weak_form import LinkSignals, weak_guess
import numpy as np

TOLD = 0.3
"""Largest standard error of a parameter that counts as told, relative to its scale [-]."""

LITTLE = 2.0
"""Residual relative to the noise with which no other guess is tried [-]."""

COARSE = 0.3
"""Refinement of the steps for a first fit [-]."""

ROUGH = 0.1
"""Last step of a first fit, relative to the standard errors of white noise [-]."""

FINE = 2.0
"""Refinement of the steps for the last fit, whose errors are left [-]."""

HELD_TIMES = 4
"""Draws of the unknown times at which held efforts began to act [-]."""

COVER = 2.0
"""Factor on what these times do to residuals: a slow drift of which one draw is seen [-]."""

STICKING = (BOTH, COULOMB)
"""What a small motion shows first: friction holds the arm where a model without would move it."""

HOLDING = 0.5
"""Friction that is tried for an arm that sticks, relative to the largest effort [-]."""

GIVEN_UP_FIRST = (DELAY, COULOMB, VISCOUS, OFFSET, LAST, BOTH, DAMPING, STIFFNESS)
"""Of parameters that only together are told, the one that is kept at its start value."""


class LastFit(NamedTuple):
    """
    The last two links as fitted.

    Attributes
    ----------
    observed
        The recording, with the interpolation of the effort that explains it best.
    found
        Parameters in the order of `last_links.NAMES`, and what is left.
    free
        Which of them the motion tells.
    errors
        Covariance of all, zero for those that are not told, shape (8, 8).
    imbalance
        Of the last link; None where it was not looked for, or nothing tells it.
    by_inputs
        What the effort between samples and its time, and the integration may do to either angle
        that no parameter takes away, shape (2,) [rad].

    """

    observed: Observed
    found: Refined
    free: list[int]
    errors: FloatArray
    imbalance: ImbalanceEstimate | None
    by_inputs: FloatArray


def fit_last_links(
    measurements: Measurements, start: PlanarArm, *, with_imbalance: bool
) -> LastFit:
    """Fit the last two links; parameters and errors as for `fit_model`."""
    period = 2 * pi / start.natural_mode().frequency
    observed = observed_of(measurements, period, with_turning=with_imbalance)
    check_moves(measurements)
    believed = vector_of(start)
    noise = np.maximum(noise_of_links(measurements), 1e-9)
    sharper = with_base_errors(observed, measurements, period)
    attempts = _attempts(measurements, observed, period, believed)
    found, scales = _first(observed, sharper, attempts, noise)
    observed = sharper
    if observed.base_errors is not None:
        # Sharper than by what is left without these errors.
        found = found._replace(starts=with_unknowns(observed, found.starts), spread=noise)
    every = list(range(len(NAMES)))
    found = refine(observed, found.parameters, every, scales, found.spread, found.starts)
    found, observed, vague = _interpolated(observed, found, every, scales)
    observed = replace(observed, refinement=FINE)
    found, free = _told(observed, found, scales, believed)
    imbalance = None
    if with_imbalance:
        imbalance, found, observed = find_imbalance(observed, found, free, scales)
        if imbalance is not None and imbalance.is_seen:
            found, observed, vague = _interpolated(observed, found, free, scales)
    doubts = _doubts(observed, found, free, scales, vague, measurements.are_held)
    errors, by_inputs = errors_of(doubts, found, free, scales)
    return LastFit(observed, found, free, errors, imbalance, by_inputs)


def _doubts(
    observed: Observed,
    found: Refined,
    free: list[int],
    scales: FloatArray,
    vague: float,
    are_held: bool,
) -> list[Doubt]:
    """Return what may be wrong with inputs and integration, `vague` being the straightness."""
    # Fewer steps of a feedback tell nothing of what happens between them.
    inputs: list[View] = [partial(with_other_times, seed=seed) for seed in range(HELD_TIMES)]
    if not are_held:
        inputs = [partial(with_fewer_efforts, every=every) for every in (2, 4)]

    # Longer steps do for differences.
    def longer(part: Observed) -> Observed:
        return replace(part, refinement=part.refinement / 2)

    ways = [Way(as_it_is, found.around), Way(longer)]
    ways += [Way(partial(_both, longer, see)) for see in [straighter, *inputs]]
    plain, *others = changes_by(ways, observed, found, free, scales)
    straight, *others = (other.since(plain) for other in others)
    # Of second order where efforts have corners: twice the step adds three times the error.
    doubts = [Doubt(1 / 3, plain), Doubt(vague, straight)]
    if are_held:
        return doubts + [Doubt(1.0 / sqrt(HELD_TIMES), draw, COVER) for draw in others]
    half, quarter = (other.besides(straight) for other in others)
    weight = 1.0 / (quarter.growth_from(half) - 1.0)
    return [*doubts, Doubt(weight, half, 1 / 3 / weight)]


def _both(first: View, then: View, part: Observed) -> Observed:
    """Return a recording that is seen in two other ways at once."""
    return then(first(part))


class _Attempt(NamedTuple):
    """A guess at the parameters, and those of them that are fitted before all are."""

    guess: FloatArray
    first: Sequence[int]


def _attempts(
    measurements: Measurements, observed: Observed, period: float, believed: FloatArray
) -> list[_Attempt]:
    """
    Return weak form and belief, the better one first, and between them an arm that sticks.

    Small motions of an arm with friction mislead the weak form, and friction that begins at zero
    is taken for inertia.
    """
    count = round(float(np.ptp(observed.times)) / measurements.period) + 1
    grid = Even(float(observed.times[0]), float(observed.times[-1]), count)
    rates = smoothed_rates(observed.times, observed.angles, period)
    weak = weak_guess(partial(even_signals, observed, grid, rates), count, period)
    guesses = [point for point in (weak, believed) if np.isfinite(point).all()]
    scales, starts, ones = np.abs(believed) + 1e-9, first_starts(observed), np.ones(2)
    costs = [linearised(observed, p, starts, (), scales, ones).cost for p in guesses]
    best, *others = [_Attempt(guesses[i], range(len(NAMES))) for i in np.argsort(costs)]
    sticking = believed.copy()
    sticking[COULOMB] = HOLDING * max(observed.effort.max(), -observed.effort.min())
    return [best, _Attempt(sticking, STICKING), *others]


def even_signals(
    observed: Observed, grid: Even, rates: Smoothed, first: int, last: int
) -> LinkSignals:
    """Return what was measured, at times first ... last-1 of a grid."""
    times = grid.times(first, last)
    near = samples_around(observed.times, times)
    rate = rates(*near.indices(observed.times.size)[:2])[:, 0] - observed.base[near]
    seen = *observed.angles[near].T, rate, observed.effort[near]
    return LinkSignals(times, *(np.interp(times, observed.times[near], each) for each in seen))


def _first(
    observed: Observed, sharper: Observed, attempts: list[_Attempt], noise: FloatArray
) -> tuple[Refined, FloatArray]:
    """
    Return the fit of the first attempt that leaves little, else the best; and the scales.

    What errors of the base explain, in a sharper view of the recording, is not left.
    """
    best, best_scales = None, np.empty(0)
    coarse = replace(observed, refinement=COARSE)
    for attempt in attempts:
        scales = scales_of(observed, attempt.guess)
        try:
            found = _tried(coarse, attempt, scales, noise)
        except (InvalidRequest, np.linalg.LinAlgError):  # it has run away
            continue
        if best is None or found.around.cost < best.around.cost:
            best, best_scales = found, scales
        if (best.spread < LITTLE * noise).all() or _is_explained(sharper, best, noise):
            break
    if best is None:
        raise InvalidRequest('no guess at the model has a meaning')
    return best, best_scales


def _tried(
    observed: Observed, attempt: _Attempt, scales: FloatArray, noise: FloatArray
) -> Refined:
    """Return the rough fit that begins with a guess."""
    starts = settled(observed, attempt.guess, noise)
    found = refine(observed, attempt.guess, attempt.first, scales, noise, starts, ROUGH)
    starts = settled(observed, found.parameters, found.spread, found.starts)
    every = range(len(NAMES))
    return refine(observed, found.parameters, every, scales, noise, starts, ROUGH)


def _is_explained(sharper: Observed, found: Refined, noise: FloatArray) -> bool:
    """Return whether noise and errors of the base are about all that is left of a fit without."""
    if sharper.base_errors is None:
        return False
    starts = with_unknowns(sharper, found.starts)
    around = linearised(sharper, found.parameters, starts, (), found.parameters, noise)
    return bool((spread_of(around, len(NAMES)) < LITTLE * noise).all())


def _interpolated(
    observed: Observed, found: Refined, free: list[int], scales: FloatArray
) -> tuple[Refined, Observed, float]:
    """Return the fit with the interpolation that explains most, that, and its standard error."""
    error = 0.0
    for _ in range(2):  # the second time with the spread that is left
        share, error = straightness(observed, found, free, scales)
        observed = replace(observed, straightness=share)
        found = refine(observed, found.parameters, free, scales, found.spread, found.starts)
    return found, observed, error


def _told(
    observed: Observed, found: Refined, scales: FloatArray, believed: FloatArray
) -> tuple[Refined, list[int]]:
    """Return the fit of what the motion tells, the rest put back to where it was."""
    free = list(range(len(NAMES)))
    while True:
        found = refine(observed, found.parameters, free, scales, found.spread, found.starts)
        ratio = np.sqrt(np.diag(covariance(found.around, scales[free])))
        if not free or ratio.max() <= TOLD:
            return found, free
        # Parameters that only together are told have errors of one size.
        vague = [free[i] for i in np.flatnonzero(ratio >= max(TOLD, 0.01 * ratio.max()))]
        given_up = next(index for index in GIVEN_UP_FIRST if index in vague)
        free.remove(given_up)
        parameters = found.parameters.copy()
        parameters[given_up] = believed[given_up]
        if given_up == LAST:  # what shows are stiffness and damping relative to that inertia
            parameters[[STIFFNESS, DAMPING]] *= believed[LAST] / found.parameters[LAST]
        if not parameters[BOTH] > parameters[LAST]:
            parameters[[BOTH, LAST]] = believed[[BOTH, LAST]]
        found = refine(observed, parameters, free, scales, found.spread, found.starts)
