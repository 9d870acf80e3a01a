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

"""What a fit has found, in numbers and in words."""

from dataclasses import dataclass
from math import isfinite

from flat_planner_ros.core.arm import FloatArray, PlanarArm
from flat_planner_ros.core.model_fit.imbalance import ImbalanceEstimate


@dataclass(frozen=True, kw_only=True)
class ParameterEstimate:
    """
    One parameter of the model.

    Attributes
    ----------
    name, unit
        As in a parameter file, with the joint in brackets where there are several.
    start
        What was believed before.
    value, std
        Estimate and its standard error; the start and infinity if the motion does not tell it.
    is_told
        Whether the motion tells it.
    remark
        What would tell it, or tell it better where it is not known to half of itself, or what the
        value rests on; may be empty.

    """

    name: str
    unit: str
    start: float
    value: float
    std: float
    is_told: bool
    remark: str = ''

    @property
    def text(self) -> str:
        """Return the estimate as a line of a table."""
        unit = f' {self.unit}' if self.unit else ''
        note = f'  ({self.remark})' if self.remark else ''
        if not self.is_told:
            return f'{self.name:<22} {self.value:>12.6g}{unit}, not told{note}'
        share = abs(self.std / self.value) if self.value else float('inf')
        relative = f' ({100 * share:.2g} %)' if isfinite(share) and share < 1.0 else ''
        return (
            f'{self.name:<22} {self.value:>12.6g} ± {self.std:.2g}{relative}{unit}, '
            f'before {self.start:.6g}{note}'
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelFit:
    """
    A model that was fitted to measurements.

    Attributes
    ----------
    arm
        The arm with all that the motion tells; the rest as it was believed.
    estimates
        Every parameter, also those that are not told.
    effort_scale
        True over measured effort [-]; 1 where the efforts were trusted.
    times
        Of the samples, shape (m,) [s].
    residuals
        Simulated less measured angles of link n-1 and of the passive joint, shape (m, 2) [rad];
        NaN where nothing was simulated.
    residual_rms
        Their root mean squares, shape (2,) [rad].
    noise
        Standard deviation of the sensors' noise in both, shape (2,) [rad].
    misfit
        What the model does not explain; empty if noise explains the residuals.
    covariance
        Of the estimates in their order, zero for those that are not told, shape (P, P).
    imbalance
        Of the last link; None where it was not looked for, or nothing tells it.

    """

    arm: PlanarArm
    estimates: tuple[ParameterEstimate, ...]
    effort_scale: float
    times: FloatArray
    residuals: FloatArray
    residual_rms: FloatArray
    noise: FloatArray
    misfit: str
    covariance: FloatArray
    imbalance: ImbalanceEstimate | None = None

    def estimate(self, name: str) -> ParameterEstimate:
        """Return the estimate with a name; raise KeyError if there is none."""
        found = {estimate.name: estimate for estimate in self.estimates}
        return found[name]

    @property
    def text(self) -> str:
        """Return all estimates and the verdict on the fit, a line each."""
        left = (
            f'left over: {self.residual_rms[0]:.2g} rad of link n-1 and '
            f'{self.residual_rms[1]:.2g} rad of the passive joint, noise {self.noise[0]:.2g} and '
            f'{self.noise[1]:.2g} rad'
        )
        verdict = f'the model does not explain the motion: {self.misfit}' if self.misfit else ''
        scale = f'true efforts are {self.effort_scale:.6g} times those measured'
        unbalanced = '' if self.imbalance is None else self.imbalance.text
        lines = [estimate.text for estimate in self.estimates] + [unbalanced, left, verdict]
        if self.effort_scale != 1.0:
            lines.insert(0, scale)
        return '\n'.join(filter(None, lines))
