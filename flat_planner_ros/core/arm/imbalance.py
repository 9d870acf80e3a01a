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

"""
Imbalance: an arm that is nearly flat, and the flat one that is planned for.

Nobody balances a link by hand to a millionth. What is missing couples the last two links to the
joints before and to gravity ((N7) of docs/derivation.md); the plan does without it.
"""

from dataclasses import replace

from flat_planner_ros.core.arm.counterbalance import BALANCED
from flat_planner_ros.core.arm.planar_arm import PlanarArm
import numpy as np


def balanced(arm: PlanarArm) -> PlanarArm:
    """Return a copy whose last two links have their centres of mass on their joint axes."""
    inertia, moment = arm.inertia.copy(), arm.static_moment.copy()
    for j in range(arm.n - BALANCED, arm.n):
        own = inertia[j, j]
        inertia[j], inertia[:, j] = 0.0, 0.0
        inertia[j, j] = own
        moment[j] = 0.0
    return replace(arm, inertia=inertia, static_moment=moment)


def imbalance(arm: PlanarArm) -> float:
    """
    Return how much the last two links lack of balance, relative to their own inertias [-].

    Parameters
    ----------
    arm
        Balanced or not.

    Returns
    -------
    float
        Largest coupling to a link before, or moment of the weight over that of the spring at
        1 rad; 0 for an arm that moves as a balanced one does.

    References
    ----------
    (N7) of docs/derivation.md.

    """
    shares = []
    squared_frequency = balanced(arm).natural_mode().frequency ** 2
    for j in range(arm.n - BALANCED, arm.n):
        coupling = float(np.abs(arm.inertia[:j, j]).max(initial=0.0))
        weight = abs(arm.gravity * float(arm.static_moment[j])) / squared_frequency
        shares.append(max(coupling, weight) / float(arm.inertia[j, j]))
    return max(shares)
