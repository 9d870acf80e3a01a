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

"""Planning: from what is asked to a certified plan within the limits."""

from flat_planner_ros.core.motion_law import CONDITIONS, Strategy
from flat_planner_ros.core.planning.certified_plan import (
    BOUNDARY_TOLERANCE,
    OPTIMALITY_TOLERANCE,
    Plan,
    PlanSamples,
)
from flat_planner_ros.core.planning.cost_weights import (
    DEFAULT_EFFORT_WEIGHT,
    DEFAULT_ENERGY_WEIGHT,
    MAX_RELATIVE_WEIGHT,
    MAX_WEIGHT,
)
from flat_planner_ros.core.planning.duration_rules import DurationRules, OnViolation
from flat_planner_ros.core.planning.extrema import Extrema, extrema_of, Quantity
from flat_planner_ros.core.planning.limits import JointLimits, LimitUse
from flat_planner_ros.core.planning.motion_problem import joint_rows, MAX_NUMBER
from flat_planner_ros.core.planning.planner import NO_DISTANCE, plan
from flat_planner_ros.core.planning.request import (
    MotionRequest,
    planned_at_rest,
    PlanningOptions,
    Reason,
    RequestRejected,
    ViaPoint,
)
from flat_planner_ros.core.planning.shortest_duration import (
    IsOver,
    NoFeasibleDuration,
    shortest_plan,
)
from flat_planner_ros.core.planning.stop import stop_plan
from flat_planner_ros.core.planning.strategies import check_options, OWN_LAWS, shortest_known
from flat_planner_ros.core.planning.tradeoff import (
    baselines,
    duration_advice,
    FASTEST,
    FASTEST_INSENSITIVE,
    fastest_points,
    FASTEST_WITHIN,
    residual_of_plan,
    residual_on,
    time_advice,
    tradeoff_points,
    TradeoffPoint,
)
from flat_planner_ros.core.planning.via_times import with_via_times

__all__ = [
    'CONDITIONS',
    'Strategy',
    'baselines',
    'BOUNDARY_TOLERANCE',
    'check_options',
    'DEFAULT_EFFORT_WEIGHT',
    'DEFAULT_ENERGY_WEIGHT',
    'duration_advice',
    'Extrema',
    'extrema_of',
    'FASTEST',
    'FASTEST_INSENSITIVE',
    'fastest_points',
    'FASTEST_WITHIN',
    'joint_rows',
    'JointLimits',
    'LimitUse',
    'MAX_NUMBER',
    'MAX_RELATIVE_WEIGHT',
    'MAX_WEIGHT',
    'MotionRequest',
    'NO_DISTANCE',
    'IsOver',
    'NoFeasibleDuration',
    'OnViolation',
    'OPTIMALITY_TOLERANCE',
    'OWN_LAWS',
    'Plan',
    'plan',
    'planned_at_rest',
    'PlanningOptions',
    'PlanSamples',
    'residual_of_plan',
    'residual_on',
    'Quantity',
    'Reason',
    'RequestRejected',
    'shortest_known',
    'shortest_plan',
    'stop_plan',
    'DurationRules',
    'time_advice',
    'tradeoff_points',
    'TradeoffPoint',
    'ViaPoint',
    'with_via_times',
]
