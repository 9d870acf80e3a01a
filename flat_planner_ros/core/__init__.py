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

from flat_planner_ros.core.adoption import (
    Adoption,
    AdoptionRefused,
    ModelTuner,
    ReportedEstimate,
)
from flat_planner_ros.core.arm import NaturalMode, PlanarArm
from flat_planner_ros.core.assessment import load_libraries
from flat_planner_ros.core.cost import MAX_WEIGHT, QuadraticCost, Strategy, strategy_cost
from flat_planner_ros.core.counterbalance import (
    Counterbalances,
    counterbalances,
    displaced_com,
    remedy,
)
from flat_planner_ros.core.duration import NoFeasibleDuration, shortest_plan
from flat_planner_ros.core.effort_profile import EffortProfile
from flat_planner_ros.core.errors import (
    FlatPlannerError,
    InvalidCommand,
    InvalidCost,
    InvalidModel,
    InvalidRequest,
    NotFlat,
    OutOfReach,
    UncertifiedPlan,
)
from flat_planner_ros.core.extrema import Extrema, extrema_of, Quantity
from flat_planner_ros.core.flatness import flat_map, FlatMap, FlatModel
from flat_planner_ros.core.goal import check_point_count, Goal, GoalPoint, rest_target
from flat_planner_ros.core.identification import ActuatedJoints, identify, StiffnessEstimate
from flat_planner_ros.core.insensitive import least_effort, rehearse
from flat_planner_ros.core.insensitivity import (
    Criterion,
    DEFAULT_WEIGHT,
    Insensitivity,
    MAX_INSENSITIVITY,
    Nominal,
)
from flat_planner_ros.core.limits import JointLimits, LimitUse
from flat_planner_ros.core.link_bodies import bodies_of_constants, bodies_of_links, LinkBody
from flat_planner_ros.core.motion_law import MotionLaw
from flat_planner_ros.core.motion_record import JointSample, PlannedMotion, Residual, select
from flat_planner_ros.core.oscillation import fit_oscillation, OscillationFit
from flat_planner_ros.core.pacing import PacedArm
from flat_planner_ros.core.planning import (
    Law,
    MotionRequest,
    Plan,
    plan,
    PlanningOptions,
    PlanSamples,
    ViaPoint,
)
from flat_planner_ros.core.rejection import Reason, RequestRejected
from flat_planner_ros.core.robustness import (
    MAX_HALF_WIDTH,
    predict_residual,
    PredictedResidual,
    UncertaintyBox,
)
from flat_planner_ros.core.rollout import rollout
from flat_planner_ros.core.sensing import Sensing
from flat_planner_ros.core.session import Ended, Outcome, PlannerSession
from flat_planner_ros.core.session_settings import SessionSettings, StartSource
from flat_planner_ros.core.shaping import shaped_quintic, Shaper
from flat_planner_ros.core.simulation import ArmState, SimulatedArm
from flat_planner_ros.core.simulation_settings import SimulationSettings
from flat_planner_ros.core.timeline import Motion, Track
from flat_planner_ros.core.timing import OnViolation
from flat_planner_ros.core.tradeoff import (
    advice,
    baselines,
    predicted_residual,
    tradeoff_points,
    TradeoffPoint,
)
from flat_planner_ros.core.via_times import with_via_times
from flat_planner_ros.core.vibration import VibrationMonitor
from flat_planner_ros.core.vibration_report import Level, MonitorSettings, VibrationReport

__all__ = [
    'ActuatedJoints',
    'Adoption',
    'AdoptionRefused',
    'advice',
    'ArmState',
    'baselines',
    'bodies_of_constants',
    'bodies_of_links',
    'check_point_count',
    'counterbalances',
    'Counterbalances',
    'Criterion',
    'DEFAULT_WEIGHT',
    'displaced_com',
    'EffortProfile',
    'Ended',
    'Extrema',
    'extrema_of',
    'fit_oscillation',
    'flat_map',
    'FlatMap',
    'FlatModel',
    'FlatPlannerError',
    'Goal',
    'GoalPoint',
    'identify',
    'Insensitivity',
    'InvalidCommand',
    'InvalidCost',
    'InvalidModel',
    'InvalidRequest',
    'JointLimits',
    'JointSample',
    'Law',
    'least_effort',
    'Level',
    'LimitUse',
    'LinkBody',
    'load_libraries',
    'MAX_HALF_WIDTH',
    'MAX_INSENSITIVITY',
    'MAX_WEIGHT',
    'ModelTuner',
    'MonitorSettings',
    'Motion',
    'MotionLaw',
    'MotionRequest',
    'NaturalMode',
    'NoFeasibleDuration',
    'Nominal',
    'NotFlat',
    'OnViolation',
    'OscillationFit',
    'Outcome',
    'OutOfReach',
    'PacedArm',
    'Plan',
    'plan',
    'PlanarArm',
    'PlannedMotion',
    'PlannerSession',
    'PlanningOptions',
    'PlanSamples',
    'predict_residual',
    'predicted_residual',
    'PredictedResidual',
    'QuadraticCost',
    'Quantity',
    'Reason',
    'rehearse',
    'remedy',
    'ReportedEstimate',
    'RequestRejected',
    'Residual',
    'rest_target',
    'rollout',
    'select',
    'Sensing',
    'SessionSettings',
    'shaped_quintic',
    'Shaper',
    'shortest_plan',
    'SimulatedArm',
    'SimulationSettings',
    'StartSource',
    'StiffnessEstimate',
    'Strategy',
    'strategy_cost',
    'Track',
    'tradeoff_points',
    'TradeoffPoint',
    'UncertaintyBox',
    'UncertifiedPlan',
    'ViaPoint',
    'VibrationMonitor',
    'VibrationReport',
    'with_via_times',
]
