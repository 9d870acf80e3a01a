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

"""Imbalance of the last link from the same recording: a coupling that a balanced arm has not."""

from dataclasses import dataclass, replace

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.model_fit.doubts import MIDDLE
from flat_planner_ros.core.model_fit.judgement import covariance
from flat_planner_ros.core.model_fit.last_links import BOTH, IMBALANCE, LAST, STIFFNESS
from flat_planner_ros.core.model_fit.refinement import refine, Refined
from flat_planner_ros.core.model_fit.simulation import Observed
import numpy as np

SCALE = 0.1
"""Size of an imbalance, relative to the inertia of the last link [-]."""

SURE = 3.0
"""Imbalance over its standard error from which there is one [-]."""

EXPLAINED = 0.7
"""Sum of squares that an imbalance leaves at most, of that without; other faults do more [-]."""

NEGLECTED = 1e-3
"""Smallest imbalance that is said, relative to the inertia [-]."""


@dataclass(frozen=True, kw_only=True)
class ImbalanceEstimate:
    """
    What the last link lacks of balance.

    Attributes
    ----------
    coupling, std
        l_(n-1) s_n and its standard error [kg m^2].
    inertia
        I*_n, to which it is relative [kg m^2].
    left
        Sum of squares that is left with it, relative to that without [-].

    """

    coupling: float
    std: float
    inertia: float
    left: float

    @property
    def is_seen(self) -> bool:
        """Tell whether there is an imbalance for certain."""
        is_large = abs(self.coupling) > max(SURE * self.std, NEGLECTED * self.inertia)
        return is_large and self.left < EXPLAINED

    @property
    def text(self) -> str:
        """Return the finding as a line for people."""
        if not self.is_seen:
            most = max(SURE * self.std, NEGLECTED * self.inertia)
            share = 100.0 * most / self.inertia
            return f'imbalance of link n: none above {most:.2g} kg m^2 ({share:.2g} % of I*_n)'
        share = 100.0 * self.coupling / self.inertia
        change = 'larger' if self.coupling > 0.0 else 'smaller'
        return (
            f'imbalance of link n: {self.coupling:.4g} ± {self.std:.2g} kg m^2 ({share:.2g} % of '
            f'I*_n): make mass * arm of its counterbalance {change} by '
            f'{abs(self.coupling):.4g} kg m^2 over the length of link n-1'
        )


def turning_of(deflection: FloatArray, rates: FloatArray, accelerations: FloatArray) -> FloatArray:
    """
    Return what a unit of coupling takes from links n-1 and n besides the mass matrix's part.

    Parameters
    ----------
    deflection
        Of the passive joint, shape (m,) [rad].
    rates, accelerations
        Of both links in absolute angles, shape (m, 2) [rad/s], [rad/s^2].

    Returns
    -------
    FloatArray
        Shape (m, 2) [rad/s^2], of (4) of docs/derivation.md.

    """
    less, sine = np.cos(deflection) - 1.0, np.sin(deflection)
    on_inner = less * accelerations[:, 1] - sine * rates[:, 1] ** 2
    on_last = less * accelerations[:, 0] + sine * rates[:, 0] ** 2
    return np.column_stack((on_inner, on_last))


def find_imbalance(
    observed: Observed, found: Refined, free: list[int], scales: FloatArray
) -> tuple[ImbalanceEstimate | None, Refined, Observed]:
    """
    Return the imbalance that a recording shows, and the fit with it where there is one.

    Parameters
    ----------
    observed
        The recording.
    found, free, scales
        The fit of a balanced arm, what it tells, and the parameters' scales.

    Returns
    -------
    tuple[ImbalanceEstimate | None, Refined, Observed]
        None where inertias or stiffness are not told; the fit, and the interpolation that goes
        with it, as they were unless there is an imbalance.

    Notes
    -----
    To first order in the deflection the mass matrix of both links is not diagonal, and constant;
    what there is besides follows from the measured motion (`turning_of`).

    """
    if not {BOTH, LAST, STIFFNESS} <= set(free):
        return None, found, observed
    widened = np.append(scales, SCALE * float(found.parameters[LAST]))
    with_it = [*free, IMBALANCE]
    start = np.append(found.parameters, 0.0)

    def tried_with(each: Observed) -> Refined:
        return refine(each, start, with_it, widened, found.spread, found.starts)

    best, tried = observed, tried_with(observed)
    if tried.around.cost < EXPLAINED * found.around.cost:
        # A balanced arm may have been explained by the wrong interpolation.
        other = replace(observed, straightness=float(observed.straightness < MIDDLE))
        again = tried_with(other)
        if again.around.cost < tried.around.cost:
            best, tried = other, again
    error = np.sqrt(covariance(tried.around, widened[with_it])[-1, -1]) * widened[-1]
    estimate = ImbalanceEstimate(
        coupling=float(tried.parameters[IMBALANCE]),
        std=float(error),
        inertia=float(tried.parameters[LAST]),
        left=tried.around.cost / found.around.cost,
    )
    if not estimate.is_seen:
        return estimate, found, observed
    fixed = refine(best, tried.parameters, free, widened, tried.spread, tried.starts)
    return estimate, fixed, best
