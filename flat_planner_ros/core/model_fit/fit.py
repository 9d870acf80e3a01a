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

"""The front door: the whole model from one recording."""

from dataclasses import replace
from enum import Enum
from math import inf, pi, sqrt

from flat_planner_ros.core.arm import FloatArray, InvalidRequest, PlanarArm
from flat_planner_ros.core.model_fit.estimate import ModelFit, ParameterEstimate
from flat_planner_ros.core.model_fit.imbalance import find_imbalance, turning_of
from flat_planner_ros.core.model_fit.judgement import covariance, doubt
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
from flat_planner_ros.core.model_fit.measurements import (
    encoder_step,
    Measurements,
    moves_of,
    noise_of,
)
from flat_planner_ros.core.model_fit.refinement import (
    first_starts,
    linearised,
    Observed,
    refine,
    Refined,
)
from flat_planner_ros.core.model_fit.scales import scales_of, vector_of
from flat_planner_ros.core.model_fit.signals import derivatives, segments_of
from flat_planner_ros.core.model_fit.weak_form import LinkSignals, weak_guess
import numpy as np

SEGMENT = 6.0
"""Longest segment, in free periods of the passive joint [-]."""

SMOOTHING = 0.15
"""Span of the polynomials that smooth velocities, in free periods [-]."""

TOLD = 0.3
"""Largest standard error of a parameter that counts as told, relative to its scale [-]."""

LITTLE = 2.0
"""Residual relative to the noise with which no other guess is tried [-]."""

COARSE = 0.3
"""Refinement of the steps for a first fit [-]."""

CLEAR = 9.0
"""Difference of two sums of squares, in variances, that decides between interpolations [-]."""

UNDECIDED, DECIDED = 0.5, 0.1
"""Share of the interpolations' difference that stays as a systematic error [-]."""

UNITS = ('kg m^2', 'kg m^2', 'N m/rad', 'N m s/rad', 'N m s/rad', 'N m', 'rad', 's')
"""Units of `last_links.NAMES`."""

TELLING = (
    'a motion with effort at joint n-1',
    'a motion in which effort at joint n-1 swings the passive joint',
    'a motion that swings the passive joint',
    'a motion after which the passive joint swings on for several periods',
    'motions of joint n-1 at different speeds',
    'slow motions of joint n-1 that turn back',
    'a rest, or a swing of many periods',
    'a motion with quick changes of effort',
)
"""What would tell a parameter, in the order of `last_links.NAMES`."""

GIVEN_UP_FIRST = (DELAY, COULOMB, VISCOUS, OFFSET, LAST, BOTH, DAMPING, STIFFNESS)
"""Of parameters that only together are told, the one that is kept at its start value."""


class Trust(Enum):
    """What sets the scale of a model: efforts and inertias cannot both be found."""

    EFFORT = 'effort'
    """The measured efforts are true."""

    INERTIA = 'inertia'
    """The inertia I*_{n-1} of the start is true."""


def fit_model(
    measurements: Measurements,
    start: PlanarArm,
    *,
    trust: Trust = Trust.EFFORT,
    with_imbalance: bool = False,
) -> ModelFit:
    """
    Fit the model of a flat arm to measured angles and efforts.

    A weak form gives the first guess, an output-error refinement the estimates (Ljung, System
    Identification, 1999, chapter 7).

    Parameters
    ----------
    measurements
        Ordinary motions are enough; those without effort tell only ratios.
    start
        The arm as believed; what the motion does not tell stays as it is there.
    trust
        What sets the scale.
    with_imbalance
        Whether to look for an imbalance of the last link, too.

    Returns
    -------
    ModelFit
        Estimates with standard errors, what is not told, and whether the model explains the
        motion.

    Raises
    ------
    InvalidRequest
        The measurements are of another arm, or too few.
    NotFlat
        The arm of the start is not flat.

    """
    if measurements.joints != start.n:
        raise InvalidRequest(f'{measurements.joints} joints measured, the arm has {start.n}')
    period = 2 * pi / start.natural_mode().frequency
    observed = observed_of(measurements, period)
    believed = vector_of(start)
    noise = np.maximum(_noise(measurements), 1e-9)
    found, scales = _first(observed, _guesses(measurements, observed, period, believed), noise)
    found, observed, other = _interpolated(observed, found, scales)
    found, free = _told(observed, found, scales, believed)
    imbalance = None
    if with_imbalance:
        former = observed
        imbalance, found, observed = find_imbalance(former, other[0], found, free, scales)
        other = (other[0] if observed is former else former, other[1])
    errors = _errors(observed, other, found, free, scales)
    result = _result(measurements, start, observed, found, free, errors, trust)
    return replace(result, imbalance=imbalance)


def observed_of(measurements: Measurements, period: float) -> Observed:
    """Return the last two links in absolute angles."""
    times, angles = measurements.times, np.cumsum(measurements.positions, axis=1)
    span = max(SMOOTHING * period, 6 * measurements.period)
    _, rates, accelerations = derivatives(times, angles, span)
    base = rates[:, -3] if measurements.joints > 2 else np.zeros(times.size)
    segments = segments_of(times, measurements.period, SEGMENT * period)
    if not segments:
        raise InvalidRequest('the measurements have no stretch without gaps')
    shown = np.column_stack((angles[:, -2], measurements.positions[:, -1]))
    each = np.array([encoder_step(column) for column in measurements.positions.T])
    steps = np.array([np.linalg.norm(each[:-1]), each[-1]])
    return Observed(
        times=times,
        angles=shown,
        rates=np.column_stack((rates[:, -2], rates[:, -1] - rates[:, -2])),
        effort=measurements.efforts[:, -1],
        base=base,
        moves=np.column_stack([moves_of(*pair) for pair in zip(shown.T, steps, strict=True)]),
        rounding=steps / sqrt(12.0),
        segments=segments,
        turning=turning_of(measurements.positions[:, -1], rates[:, -2:], accelerations[:, -2:]),
    )


def _noise(measurements: Measurements) -> FloatArray:
    """Return the noise of link n-1 and of the passive joint, shape (2,) [rad]."""
    each = noise_of(measurements)
    return np.array([np.linalg.norm(each[:-1]), each[-1]])


def _guesses(
    measurements: Measurements, observed: Observed, period: float, believed: FloatArray
) -> list[FloatArray]:
    """Return weak form and belief, the better one first."""
    count = round(float(np.ptp(observed.times)) / measurements.period) + 1
    grid = np.linspace(observed.times[0], observed.times[-1], count)
    link, passive, rate, effort = (
        np.interp(grid, observed.times, signal)
        for signal in (*observed.angles.T, observed.rates[:, 0] - observed.base, observed.effort)
    )
    weak = weak_guess(LinkSignals(grid, link, passive, rate, effort), period)
    guesses = [point for point in (weak, believed) if np.isfinite(point).all()]
    scales, starts, ones = np.abs(believed) + 1e-9, first_starts(observed), np.ones(2)
    costs = [linearised(observed, p, starts, (), scales, ones).cost for p in guesses]
    return [guesses[i] for i in np.argsort(costs)]


def _first(
    observed: Observed, guesses: list[FloatArray], noise: FloatArray
) -> tuple[Refined, FloatArray]:
    """Return the fit from the first guess that leaves little, else the best; and the scales."""
    best, best_scales = None, np.empty(0)
    coarse = replace(observed, refinement=COARSE)
    for guess in guesses:
        scales = scales_of(observed, guess)
        found = refine(coarse, guess, range(len(NAMES)), scales, noise)
        if best is None or found.around.cost < best.around.cost:
            best, best_scales = found, scales
        if (best.spread < LITTLE * noise).all():
            break
    if best is None:
        raise InvalidRequest('no guess at the model has a meaning')
    return best, best_scales


def _interpolated(
    observed: Observed, first: Refined, scales: FloatArray
) -> tuple[Refined, Observed, tuple[Observed, float]]:
    """Return the fit with the better interpolation of the effort, that, and the other's share."""
    every = range(len(NAMES))
    for _ in range(2):  # the second time with the spread that is left, for both alike
        first = refine(observed, first.parameters, every, scales, first.spread, first.starts)
    straight = replace(observed, is_linear=True)
    second = refine(straight, first.parameters, every, scales, first.spread, first.starts)
    worse = second.around.cost - first.around.cost
    share = DECIDED if abs(worse) > CLEAR else UNDECIDED
    if worse > 0.0:
        return first, observed, (straight, share)
    return second, straight, (observed, share)


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
        vague = [free[i] for i in np.flatnonzero(ratio > max(TOLD, 0.01 * ratio.max()))]
        given_up = next(index for index in GIVEN_UP_FIRST if index in vague)
        free.remove(given_up)
        parameters = found.parameters.copy()
        parameters[given_up] = believed[given_up]
        if not parameters[BOTH] > parameters[LAST]:
            parameters[[BOTH, LAST]] = believed[[BOTH, LAST]]
        found = refine(observed, parameters, free, scales, found.spread, found.starts)


def _errors(
    observed: Observed,
    other: tuple[Observed, float],
    found: Refined,
    free: list[int],
    scales: FloatArray,
) -> FloatArray:
    """Return the covariance (8, 8) of the parameters: noise, interpolation and integration."""
    size = np.outer(scales[free], scales[free])
    inside = covariance(found.around, scales[free]) * size
    alternative, share = other
    # The integration is of second order: twice the step adds three times the error.
    halved = replace(observed, refinement=observed.refinement / 2)
    for weight, changed in ((share, alternative), (1 / 3, halved)):
        there = linearised(changed, found.parameters, found.starts, free, scales, found.spread)
        normal = there.normal.sum(axis=0) * size + np.eye(len(free)) * 1e-12
        change = there.gradient - found.around.gradient
        moved = weight * scales[free] * np.linalg.solve(normal, scales[free] * change)
        inside += np.outer(moved, moved)
    whole = np.zeros((len(NAMES), len(NAMES)))
    whole[np.ix_(free, free)] = inside
    return whole


def _scaled_to_inertia(
    values: FloatArray, errors: FloatArray, trusted: float
) -> tuple[FloatArray, FloatArray]:
    """Return parameters and covariance in proportion to an inertia I*_{n-1} that is trusted."""
    with_effort = np.arange(len(NAMES)) <= COULOMB
    # Errors of the ratio to that inertia, which has none itself.
    ratio = np.eye(len(NAMES))
    ratio[:, BOTH] -= with_effort * values / values[BOTH]
    factor = np.where(with_effort, trusted / values[BOTH], 1.0)
    return values * factor, ratio @ errors @ ratio.T * np.outer(factor, factor)


def _result(
    measurements: Measurements,
    start: PlanarArm,
    observed: Observed,
    found: Refined,
    free: list[int],
    errors: FloatArray,
    trust: Trust,
) -> ModelFit:
    """Put numbers into words."""
    believed, values = vector_of(start), found.parameters[: len(NAMES)]
    scale = 1.0
    if trust is Trust.INERTIA and BOTH in free:
        scale = float(believed[BOTH] / values[BOTH])
        values, errors = _scaled_to_inertia(values, errors, float(believed[BOTH]))
    residuals = np.full(observed.angles.shape, np.nan)
    for segment, part in zip(observed.segments, found.around.residuals, strict=True):
        residuals[segment.first : segment.last] = part
    noise = _noise(measurements)
    return ModelFit(
        arm=_arm(start, values),
        estimates=_estimates(start, values, errors, free),
        effort_scale=scale,
        times=measurements.times,
        residuals=residuals,
        residual_rms=found.spread,
        noise=noise,
        misfit=doubt(found.around, found.spread, noise, observed.angles.std(axis=0)),
    )


def _estimates(
    start: PlanarArm, values: FloatArray, errors: FloatArray, free: list[int]
) -> tuple[ParameterEstimate, ...]:
    """Return the estimates of the last two links."""
    believed, stds = vector_of(start), np.sqrt(np.diag(errors))
    names = list(NAMES)
    for index in (VISCOUS, COULOMB):
        names[index] += f'[{start.n - 1}]'
    return tuple(
        ParameterEstimate(
            name=name,
            unit=UNITS[index],
            start=float(believed[index]),
            value=float(values[index]),
            std=float(stds[index]) if index in free else inf,
            is_told=index in free,
            remark='' if index in free else f'{TELLING[index]} would tell it',
        )
        for index, name in enumerate(names)
    )


def _arm(start: PlanarArm, values: FloatArray) -> PlanarArm:
    """Return the arm with the values of the last two links; none of them is negative."""
    damping, viscous, coulomb = np.maximum(values[[DAMPING, VISCOUS, COULOMB]], 0.0).tolist()
    return start.with_last_links(
        inertia_star=(float(values[BOTH]), float(values[LAST])),
        stiffness=float(values[STIFFNESS]),
        damping=damping,
        viscous=viscous,
        coulomb=coulomb,
    )
