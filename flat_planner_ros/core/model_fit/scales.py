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

"""The parameters of an arm as a vector, and how far each may reasonably be off."""

from math import sqrt

from flat_planner_ros.core.arm import FloatArray, PlanarArm
from flat_planner_ros.core.model_fit.last_links import (
    COULOMB,
    DAMPING,
    DELAY,
    LAST,
    OFFSET,
    STIFFNESS,
    VISCOUS,
)
from flat_planner_ros.core.model_fit.simulation import Observed
import numpy as np

LIGHT_DAMPING = 0.01
"""Damping ratio that sets the scale of a damping which is smaller [-]."""

FRICTION_SHARE = 0.1
"""Scale of friction, relative to the effort [-]."""

OFFSET_SCALE, DELAY_SCALE = 0.05, 0.01
"""Scales of an encoder's offset [rad] and of a delay [s]."""


def vector_of(arm: PlanarArm) -> FloatArray:
    """Return the parameters of a flat arm in the order of `last_links.NAMES`, shape (8,)."""
    friction = arm.viscous_friction[-1], arm.coulomb_friction[-1]
    return np.array([*arm.inertia_star, arm.stiffness, arm.damping, *friction, 0.0, 0.0])


def scales_of(observed: Observed, guess: FloatArray) -> FloatArray:
    """Return how far each parameter may reasonably be off, shape (8,)."""
    effort = float(np.std(observed.effort)) + 1e-12
    rate = observed.rate_spread + 1e-9
    scales = np.abs(guess)
    critical = 2 * sqrt(guess[STIFFNESS] * guess[LAST])
    scales[DAMPING] = max(scales[DAMPING], LIGHT_DAMPING * critical)
    scales[VISCOUS] = max(scales[VISCOUS], FRICTION_SHARE * effort / rate)
    scales[COULOMB] = max(scales[COULOMB], FRICTION_SHARE * effort)
    scales[[OFFSET, DELAY]] = OFFSET_SCALE, DELAY_SCALE
    return scales
