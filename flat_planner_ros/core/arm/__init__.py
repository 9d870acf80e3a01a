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

"""Arm: the model. Links, dynamics, counterbalances, flat map; its errors and measured samples."""

from flat_planner_ros.core.arm.arm_stack import ArmStack
from flat_planner_ros.core.arm.arrays import (
    check_number,
    checked_array,
    ComplexArray,
    FloatArray,
    locked,
)
from flat_planner_ros.core.arm.clock_offset import is_noticed, OffsetFilter
from flat_planner_ros.core.arm.counterbalance import (
    Counterbalances,
    counterbalances,
    displaced_com,
    suggest_counterbalances,
)
from flat_planner_ros.core.arm.dynamics import coulomb_share, COULOMB_VELOCITY
from flat_planner_ros.core.arm.errors import (
    FlatPlannerError,
    InvalidCommand,
    InvalidCost,
    InvalidModel,
    InvalidRequest,
    NotFlat,
    OutOfReach,
    strict_arithmetic,
    UncertifiedLoop,
    UncertifiedPlan,
)
from flat_planner_ros.core.arm.flat_map import apply_row, flat_map, FlatMap, FlatModel
from flat_planner_ros.core.arm.imbalance import balanced, imbalance
from flat_planner_ros.core.arm.joint_merger import JointMerger
from flat_planner_ros.core.arm.links import (
    bodies_from_links,
    bodies_from_reduced,
    LinkBody,
    placed_masses,
)
from flat_planner_ros.core.arm.planar_arm import Drive, NaturalMode, PlanarArm
from flat_planner_ros.core.arm.samples import (
    cubic_coefficients,
    JointSample,
    JointStateRules,
    JUMP,
    SampledMotion,
    SampleTable,
    travel,
    UNUSABLE,
)
from flat_planner_ros.core.arm.sparse_points import sparse_rows
from flat_planner_ros.core.arm.turns import TurnCounter
from flat_planner_ros.core.arm.urdf import (
    ArmDescription,
    ControlBlock,
    PLUGINS,
    urdf_of,
    UrdfLimits,
)

__all__ = [
    'apply_row',
    'ArmDescription',
    'ArmStack',
    'balanced',
    'bodies_from_links',
    'bodies_from_reduced',
    'check_number',
    'checked_array',
    'ComplexArray',
    'ControlBlock',
    'coulomb_share',
    'COULOMB_VELOCITY',
    'counterbalances',
    'Counterbalances',
    'cubic_coefficients',
    'displaced_com',
    'Drive',
    'flat_map',
    'FlatMap',
    'FlatModel',
    'FlatPlannerError',
    'FloatArray',
    'imbalance',
    'InvalidCommand',
    'InvalidCost',
    'InvalidModel',
    'InvalidRequest',
    'is_noticed',
    'JointMerger',
    'JointSample',
    'JointStateRules',
    'JUMP',
    'LinkBody',
    'locked',
    'NaturalMode',
    'NotFlat',
    'OffsetFilter',
    'OutOfReach',
    'PlanarArm',
    'placed_masses',
    'PLUGINS',
    'SampledMotion',
    'SampleTable',
    'sparse_rows',
    'strict_arithmetic',
    'suggest_counterbalances',
    'travel',
    'TurnCounter',
    'UncertifiedLoop',
    'UncertifiedPlan',
    'UNUSABLE',
    'urdf_of',
    'UrdfLimits',
]
