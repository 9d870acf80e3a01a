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

"""The whole model of the last two links from one motion and what it leaves behind."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, TYPE_CHECKING

from flat_planner_ros.core.arm import FlatPlannerError, FloatArray, PlanarArm
import numpy as np

if TYPE_CHECKING:
    from flat_planner_ros.core.model_fit import ModelFit

RELATIVE_ERROR = 0.02
"""Largest standard error of an inertia or the stiffness, relative to it [-]."""

MODEL_FACTOR = 4.0
"""Largest factor between an estimate and the value believed, either way [-]."""


class LastLinks(NamedTuple):
    """
    What moves the last two links, or the standard errors of it.

    Attributes
    ----------
    both, last
        Inertias I*_{n-1} and I*_n [kg m^2].
    stiffness, damping
        Passive joint [N m/rad], [N m s/rad].
    viscous, coulomb
        Friction of joint n-1 [N m s/rad], [N m].

    """

    both: float
    last: float
    stiffness: float
    damping: float
    viscous: float
    coulomb: float

    @classmethod
    def of(cls, arm: PlanarArm) -> LastLinks:
        """Return the values of a flat arm."""
        friction = float(arm.viscous_friction[-1]), float(arm.coulomb_friction[-1])
        return cls(*arm.inertia_star, arm.stiffness, arm.damping, *friction)

    def applied_to(self, arm: PlanarArm) -> PlanarArm:
        """Return an arm with these values."""
        return arm.with_last_links(
            inertia_star=(self.both, self.last),
            stiffness=self.stiffness,
            damping=self.damping,
            viscous=self.viscous,
            coulomb=self.coulomb,
        )


@dataclass(frozen=True, kw_only=True)
class ModelEstimate:
    """
    The model of the last two links as one motion tells it.

    Attributes
    ----------
    values, stds
        Estimates and standard errors, infinite for friction that is not told; ``None`` if nothing
        could be fitted.
    reason
        Why they are not good enough to plan with; empty if they are.

    """

    values: LastLinks | None = None
    stds: LastLinks | None = None
    reason: str = ''

    @property
    def is_trustworthy(self) -> bool:
        """Return whether the values are good enough to plan with."""
        return self.values is not None and not self.reason

    @property
    def text(self) -> str:
        """Return the estimate in half a sentence."""
        if self.values is None or self.stds is None or self.reason:
            return f'whole model not estimated ({self.reason})'
        names = 'I*_{n-1}', 'I*_n', 'stiffness', 'damping'
        told = zip(names, self.values[: len(names)], self.stds[: len(names)], strict=True)
        listed = (f'{name} {value:.6g} ± {std:.2g}' for name, value, std in told)
        return f'whole model from the measured efforts: {", ".join(listed)}'


def estimate_model(
    times: FloatArray,
    positions: FloatArray,
    efforts: FloatArray,
    arm: PlanarArm,
    *,
    are_held: bool = False,
) -> ModelEstimate:
    """
    Fit the model to the samples of one motion and of the time after it.

    Parameters
    ----------
    times
        Shape (m,) [s], from a near origin.
    positions, efforts
        Of all joints, shape (m, n) [rad], [N m]; samples with an unknown effort are left out.
    arm
        The model as believed.
    are_held
        Whether efforts are those of a feedback, as of `Measurements`.

    """
    # Loaded when a motion is over: a node that has just started need not wait for it.
    from flat_planner_ros.core.model_fit import fit_model, Measurements

    known = np.isfinite(efforts[:, :-1]).all(axis=1)
    if not known.any():
        return ModelEstimate(reason='the efforts of the motors are not measured')
    try:
        measurements = Measurements(
            times=times[known],
            positions=positions[known],
            efforts=efforts[known, :-1],
            are_held=are_held,
        )
        fit = fit_model(measurements, arm)
    except (FlatPlannerError, np.linalg.LinAlgError) as error:
        return ModelEstimate(reason=str(error))
    stds = LastLinks(*(estimate.std for estimate in fit.estimates[: len(LastLinks._fields)]))
    return ModelEstimate(values=LastLinks.of(fit.arm), stds=stds, reason=_doubt(fit, stds, arm))


def _doubt(fit: ModelFit, stds: LastLinks, believed: PlanarArm) -> str:
    """Return what speaks against a fit, if anything."""
    found, before = LastLinks.of(fit.arm), LastLinks.of(believed)
    for index in range(LastLinks._fields.index('viscous')):
        estimate = fit.estimates[index]
        if not estimate.is_told:
            return f'{estimate.name} is not told: {estimate.remark}'
    if fit.misfit:
        return f'the model does not explain the motion: {fit.misfit}'
    for name in ('both', 'last', 'stiffness'):
        value, old = getattr(found, name), getattr(before, name)
        error = getattr(stds, name) / value
        if error > RELATIVE_ERROR:
            return f'standard error of {name} {error:.2g}, above {RELATIVE_ERROR:g}'
        if not 1.0 / MODEL_FACTOR <= value / old <= MODEL_FACTOR:
            return f'{name} would be {value / old:.3g} times the value believed'
    return ''
