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

"""Motion laws: the planned function of time that a quadratic cost makes optimal."""

from flat_planner_ros.core.motion_law.basis import CONDITIONS
from flat_planner_ros.core.motion_law.cost import (
    MAX_WEIGHT,
    QuadraticCost,
    Strategy,
    strategy_cost,
)
from flat_planner_ros.core.motion_law.extremal import (
    BoundaryConditions,
    costate,
    extremals,
    stationarity_residual,
)
from flat_planner_ros.core.motion_law.law import ExponentialLaw, MAX_DERIVATIVE
from flat_planner_ros.core.motion_law.optimal_path import optimal_path, PathConditions
from flat_planner_ros.core.motion_law.quadrature import motion_quadrature
from flat_planner_ros.core.motion_law.unit_motion import (
    GRIDS_KEPT,
    JET_ORDER,
    MAX_KEPT_INTERVALS,
    probes,
    unit_motion,
    UnitMotion,
)

__all__ = [
    'CONDITIONS',
    'extremals',
    'GRIDS_KEPT',
    'JET_ORDER',
    'BoundaryConditions',
    'MAX_DERIVATIVE',
    'MAX_KEPT_INTERVALS',
    'MAX_WEIGHT',
    'costate',
    'motion_quadrature',
    'ExponentialLaw',
    'optimal_path',
    'PathConditions',
    'probes',
    'QuadraticCost',
    'stationarity_residual',
    'Strategy',
    'strategy_cost',
    'unit_motion',
    'UnitMotion',
]
