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

"""What the tests of planning share: the arm of the paper, how it swings, and an oracle."""

from dataclasses import replace
from types import ModuleType

from flat_planner_ros.core.arm.planar_arm import PlanarArm
import numpy as np
import pytest

ARM = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
"""That of the paper's table, with its damping."""


def first_links(count=1, *, com=1.0, mass=1.0, inertia=1.0, tip=1.0):
    """Return what `PlanarArm.reduced` takes of so many links, changed by factors, (count,)."""
    ones = np.ones(count)
    return {
        'link_length': 0.2 * ones,
        'link_com': 0.1 * ones * com,
        'link_mass': 0.3 * ones * mass,
        'link_inertia': 1e-3 * ones * inertia,
        'tip_mass': 0.1 * tip,
    }


ELBOW = PlanarArm.reduced(
    inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5, **first_links()
)
"""The same behind a first link."""


def envelope(arm: PlanarArm, angle: float, rate: float, *, held: bool = False) -> float:
    """Return the envelope of the free elastic joint at an angle [rad] and a rate [rad/s]."""
    mode = arm.natural_mode(held=held)
    return float(np.hypot(angle, (rate + mode.decay_rate * angle) / mode.damped_frequency))


@pytest.fixture(scope='session')
def oracle() -> ModuleType:
    """Return the module of the oracle; only tests that need it are skipped without mpmath."""
    pytest.importorskip('mpmath')
    import oracle

    return oracle


@pytest.fixture
def paper_arm() -> PlanarArm:
    """Return the arm of the paper's table, made anew: plans remember arms."""
    return replace(ARM)
