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
from flat_planner_ros.core.motion_law.certificate import probes
from flat_planner_ros.core.motion_law.cost import (
    fixed_cost,
    QuadraticCost,
    Strategy,
    strategy_cost,
)
from flat_planner_ros.core.motion_law.extremal import (
    BoundaryConditions,
    costate,
    extremals,
    Mean,
    stationarity_residual,
    unit_motion,
    UnitMotion,
)
from flat_planner_ros.core.motion_law.law import (
    JET_ORDER,
    Law,
    MAX_DERIVATIVE,
    motion_quadrature,
    ScaledLaw,
    SummedLaw,
)
from flat_planner_ros.core.motion_law.legendre_series import differentiation, integration
from flat_planner_ros.core.motion_law.optimal_path import optimal_path, PathConditions
from flat_planner_ros.core.motion_law.path_cost import PathCost
from flat_planner_ros.core.motion_law.roots import Cluster
from flat_planner_ros.core.motion_law.simple_roots import characteristic_roots
from flat_planner_ros.core.motion_law.spectra import known_spectrum
from flat_planner_ros.core.motion_law.unit_table import unit_table, UnitGroup, UnitMotions

__all__ = [
    'BoundaryConditions',
    'characteristic_roots',
    'Cluster',
    'CONDITIONS',
    'costate',
    'differentiation',
    'extremals',
    'fixed_cost',
    'integration',
    'JET_ORDER',
    'known_spectrum',
    'Law',
    'MAX_DERIVATIVE',
    'Mean',
    'motion_quadrature',
    'optimal_path',
    'PathCost',
    'PathConditions',
    'probes',
    'QuadraticCost',
    'ScaledLaw',
    'stationarity_residual',
    'Strategy',
    'strategy_cost',
    'SummedLaw',
    'unit_motion',
    'UnitMotion',
    'unit_table',
    'UnitGroup',
    'UnitMotions',
]
