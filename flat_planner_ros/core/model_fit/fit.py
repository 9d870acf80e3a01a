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
from math import inf

from flat_planner_ros.core.arm import FloatArray, InvalidRequest, PlanarArm
from flat_planner_ros.core.model_fit.estimate import ModelFit, ParameterEstimate
from flat_planner_ros.core.model_fit.judgement import doubt
from flat_planner_ros.core.model_fit.last_fit import fit_last_links, LastFit
from flat_planner_ros.core.model_fit.last_links import (
    BOTH,
    COULOMB,
    DAMPING,
    LAST,
    NAMES,
    STIFFNESS,
    VISCOUS,
)
from flat_planner_ros.core.model_fit.measurements import Measurements
from flat_planner_ros.core.model_fit.observation import names_for, noise_of_links
from flat_planner_ros.core.model_fit.scales import vector_of
import numpy as np

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
    last = fit_last_links(measurements, start, with_imbalance=with_imbalance)
    return _result(measurements, start, last, trust)


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
    last: LastFit,
    trust: Trust,
) -> ModelFit:
    """Put numbers into words."""
    observed, found, free, errors, imbalance = last
    believed, values = vector_of(start), found.parameters[: len(NAMES)]
    scale = 1.0
    if trust is Trust.INERTIA and BOTH in free:
        scale = float(believed[BOTH] / values[BOTH])
        values, errors = _scaled_to_inertia(values, errors, float(believed[BOTH]))
    residuals = np.full(observed.angles.shape, np.nan)
    for segment, part in zip(observed.segments, found.around.residuals, strict=True):
        residuals[segment.first : segment.last] = part
    noise = noise_of_links(measurements)
    return ModelFit(
        arm=_arm(start, values),
        estimates=_estimates(start, values, errors, free),
        effort_scale=scale,
        times=measurements.times,
        residuals=residuals,
        residual_rms=found.spread,
        noise=noise,
        misfit=doubt(found.around, found.spread, noise, observed.angles.std(axis=0)),
        imbalance=imbalance,
        covariance=errors,
    )


def _estimates(
    start: PlanarArm, values: FloatArray, errors: FloatArray, free: list[int]
) -> tuple[ParameterEstimate, ...]:
    """Return the estimates of the last two links."""
    believed, stds = vector_of(start), np.sqrt(np.diag(errors))
    names = names_for(start.n)
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
