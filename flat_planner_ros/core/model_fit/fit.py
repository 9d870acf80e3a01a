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

from enum import Enum
from math import inf, pi
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray, InvalidModel, InvalidRequest, PlanarArm
from flat_planner_ros.core.model_fit.estimate import ModelFit, ParameterEstimate
from flat_planner_ros.core.model_fit.first_fit import FirstFit, fit_first_links
from flat_planner_ros.core.model_fit.first_links import parameters_of, with_first_links
from flat_planner_ros.core.model_fit.judgement import doubt
from flat_planner_ros.core.model_fit.last_fit import fit_last_links, LastFit
from flat_planner_ros.core.model_fit.last_links import (
    BOTH,
    COULOMB,
    DAMPING,
    DELAY,
    LAST,
    NAMES,
    STIFFNESS,
    VISCOUS,
)
from flat_planner_ros.core.model_fit.measurements import Measurements
from flat_planner_ros.core.model_fit.observation import noise_of_links
from flat_planner_ros.core.model_fit.parts import part_of
from flat_planner_ros.core.model_fit.refinement import left_in, Refined
from flat_planner_ros.core.model_fit.scales import vector_of
from flat_planner_ros.core.model_fit.signals import deviation_of, pieces
from flat_planner_ros.core.model_fit.simulation import blocks, Observed
from flat_planner_ros.core.model_fit.table import entries, Entry
import numpy as np
import numpy.typing as npt

UNCERTAIN = 0.5
"""Standard error of an estimate from which it is hardly told, relative to it [-]."""


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
        The measurements are of another arm, too few, of one that does not move, or of one that is
        nothing like the start.
    NotFlat
        The arm of the start is not flat.

    """
    if measurements.joints != start.n:
        raise InvalidRequest(f'{measurements.joints} joints measured, the arm has {start.n}')
    last = fit_last_links(measurements, start, with_imbalance=with_imbalance)
    first = None if start.n == 2 else _first_links(measurements, start, last.found.parameters)
    return _result(measurements, start, _whole(start, last, first, trust), last, first)


def _first_links(measurements: Measurements, start: PlanarArm, found: FloatArray) -> FirstFit:
    """Return the fit of the first links, given the last ones; nothing told if it is no arm."""
    period = 2 * pi / start.natural_mode().frequency
    friction = float(found[VISCOUS]), float(found[COULOMB])
    first = fit_first_links(measurements, start, period, friction, float(found[DELAY]))
    try:
        with_first_links(_with_last_links(start, found), first.values)
    except InvalidModel as error:
        believed = parameters_of(start)
        misfit = f'what was found of the first links is no arm, they stay as they were: {error}'
        return FirstFit(believed, [], np.zeros_like(first.errors), misfit)
    return first


class _Whole(NamedTuple):
    """All parameters in the order of `table.entries`: believed, found, told, and their errors."""

    believed: FloatArray
    values: FloatArray
    is_told: npt.NDArray[np.bool_]
    errors: FloatArray
    effort_scale: float


def _whole(start: PlanarArm, last: LastFit, first: FirstFit | None, trust: Trust) -> _Whole:
    """Return last and first links together, with the scale that is trusted."""
    firsts = 0 if first is None else first.values.size
    count = len(NAMES) + firsts + 1
    believed = np.concatenate((vector_of(start), parameters_of(start), [0.0]))
    values, errors = believed.copy(), np.zeros((count, count))
    told = np.zeros(count, dtype=bool)
    values[: len(NAMES)] = last.found.parameters[: len(NAMES)]
    errors[: len(NAMES), : len(NAMES)] = last.errors
    told[last.free] = True
    if first is not None:
        place = slice(len(NAMES), len(NAMES) + firsts)
        values[place], errors[place, place] = first.values, first.errors
        told[len(NAMES) + np.array(first.free, dtype=int)] = True
    scale = 1.0
    if trust is Trust.INERTIA and told[BOTH]:
        scale = float(believed[BOTH] / values[BOTH])
        table = entries(start.n, has_gravity=start.has_weight)
        of_effort = told & np.array([entry.is_of_effort for entry in table])
        values, errors = _scaled_to_inertia(values, errors, float(believed[BOTH]), of_effort)
    return _Whole(believed, values, told, errors, scale)


def _scaled_to_inertia(
    values: FloatArray, errors: FloatArray, trusted: float, of_effort: npt.NDArray[np.bool_]
) -> tuple[FloatArray, FloatArray]:
    """Return parameters and covariance in proportion to an inertia I*_{n-1} that is trusted."""
    # Errors of the ratio to that inertia, which has none itself.
    ratio = np.eye(values.size)
    ratio[:, BOTH] -= of_effort * values / values[BOTH]
    factor = np.where(of_effort, trusted / values[BOTH], 1.0)
    return values * factor, ratio @ errors @ ratio.T * np.outer(factor, factor)


def _result(
    measurements: Measurements,
    start: PlanarArm,
    whole: _Whole,
    last: LastFit,
    first: FirstFit | None,
) -> ModelFit:
    """Put numbers into words."""
    observed, around = last.observed, last.found.around
    noise = noise_of_links(measurements)
    explained = np.hypot(noise, last.by_inputs)
    motion = deviation_of(observed.angles[piece] for piece in pieces(0, measurements.times.size))
    doubts = [doubt(around, last.found.spread, explained, motion)]
    if first is not None:
        doubts.append(first.misfit)
    return ModelFit(
        arm=_arm(start, whole.values),
        estimates=_estimates(start, whole),
        effort_scale=whole.effort_scale,
        times=measurements.times,
        residuals=_residuals(observed, last.found),
        residual_rms=last.found.spread,
        noise=noise,
        misfit='; '.join(filter(None, doubts)),
        covariance=whole.errors,
        imbalance=last.imbalance,
    )


def _residuals(observed: Observed, found: Refined) -> FloatArray:
    """Return what a fit leaves of either angle, NaN where nothing was simulated, (m, 2) [rad]."""
    residuals = np.full(observed.angles.shape, np.nan)
    for block in blocks(observed):
        part = part_of(observed, block, float(found.parameters[DELAY]))
        each = left_in(part, block, found)
        for segment, left in zip(observed.segments[block], each, strict=True):
            residuals[segment.first : segment.last] = left
    return residuals


def _estimates(start: PlanarArm, whole: _Whole) -> tuple[ParameterEstimate, ...]:
    """Return all parameters with what would tell those that are not told."""
    stds = np.where(whole.is_told, np.sqrt(np.diag(whole.errors)), inf).tolist()
    table = entries(start.n, has_gravity=start.gravity != 0.0)
    rows = zip(table, whole.believed.tolist(), whole.values.tolist(), stds, strict=True)
    return tuple(
        ParameterEstimate(
            name=entry.name,
            unit=entry.unit,
            start=believed,
            value=value,
            std=std,
            is_told=std < inf,
            remark=_remark(entry, value, std),
        )
        for entry, believed, value, std in rows
    )


def _remark(entry: Entry, value: float, std: float) -> str:
    """Return what would tell a parameter, or tell one better that has a standard error."""
    if std == inf:
        return f'{entry.telling} would tell it'
    # Offsets and delays may well be zero.
    if entry.unit in ('rad', 's') or std < UNCERTAIN * abs(value):
        return ''
    return f'hardly told; {entry.telling} would tell it better'


def _arm(start: PlanarArm, values: FloatArray) -> PlanarArm:
    """Return the arm with the values found."""
    arm = _with_last_links(start, values)
    return arm if start.n == 2 else with_first_links(arm, values[len(NAMES) : -1])


def _with_last_links(start: PlanarArm, values: FloatArray) -> PlanarArm:
    """Return the arm with other last links; none of friction and damping is negative."""
    damping, viscous, coulomb = np.maximum(values[[DAMPING, VISCOUS, COULOMB]], 0.0).tolist()
    return start.with_last_links(
        inertia_star=(float(values[BOTH]), float(values[LAST])),
        stiffness=float(values[STIFFNESS]),
        damping=damping,
        viscous=viscous,
        coulomb=coulomb,
    )
