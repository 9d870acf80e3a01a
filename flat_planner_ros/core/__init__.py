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

"""Planning, dynamics and judgement of flat elastic arms; free of ROS, files and clocks."""

from flat_planner_ros.core.arm import (
    counterbalances,
    Drive,
    FlatModel,
    FlatPlannerError,
    NotFlat,
    PlanarArm,
    suggest_counterbalances,
)
from flat_planner_ros.core.insensitive import Insensitivity, predict_residual, UncertaintyBox
from flat_planner_ros.core.monitor import fit_oscillation, identify
from flat_planner_ros.core.motion_law import Strategy
from flat_planner_ros.core.plan_table import plan_many, PlanTable
from flat_planner_ros.core.planning import (
    JointLimits,
    MotionRequest,
    Plan,
    plan,
    PlanningOptions,
    residual_of_plan,
    shortest_plan,
    ViaPoint,
    with_via_times,
)
from flat_planner_ros.core.plant import DriveSettings, EffortProfile, rollout
from flat_planner_ros.core.session import (
    Goal,
    GoalPoint,
    PlannerSession,
    SessionSettings,
    StartSource,
)

__all__ = [
    'counterbalances',
    'Drive',
    'DriveSettings',
    'EffortProfile',
    'fit_oscillation',
    'FlatModel',
    'FlatPlannerError',
    'Goal',
    'GoalPoint',
    'identify',
    'Insensitivity',
    'JointLimits',
    'MotionRequest',
    'NotFlat',
    'plan',
    'Plan',
    'plan_many',
    'PlanarArm',
    'PlannerSession',
    'PlanningOptions',
    'PlanTable',
    'predict_residual',
    'residual_of_plan',
    'suggest_counterbalances',
    'rollout',
    'SessionSettings',
    'StartSource',
    'shortest_plan',
    'Strategy',
    'UncertaintyBox',
    'ViaPoint',
    'with_via_times',
]
