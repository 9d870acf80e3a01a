"""Planning, dynamics and judgement of flat elastic arms; free of ROS, files and clocks."""

from flat_planner_ros.core.adoption import (
    Adoption,
    AdoptionRefused,
    ModelTuner,
    ReportedEstimate,
)
from flat_planner_ros.core.arm import NaturalMode, PlanarArm
from flat_planner_ros.core.cost import MAX_WEIGHT, QuadraticCost, Strategy, strategy_cost
from flat_planner_ros.core.duration import NoFeasibleDuration, shortest_plan
from flat_planner_ros.core.effort_profile import EffortProfile
from flat_planner_ros.core.errors import (
    FlatPlannerError,
    InvalidCommand,
    InvalidCost,
    InvalidModel,
    InvalidRequest,
    NotFlat,
    UncertifiedPlan,
)
from flat_planner_ros.core.extrema import Extrema, extrema_of, Quantity
from flat_planner_ros.core.flatness import flat_map, FlatMap, FlatModel
from flat_planner_ros.core.goal import (
    check_point_count,
    Goal,
    GoalPoint,
    Reason,
    RequestRejected,
    rest_target,
)
from flat_planner_ros.core.identification import ActuatedJoints, identify, StiffnessEstimate
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
from flat_planner_ros.core.rollout import rollout
from flat_planner_ros.core.sensing import Sensing
from flat_planner_ros.core.session import Motion, PlannerSession, SessionSettings, StartSource
from flat_planner_ros.core.simulation import ArmState, SimulatedArm
from flat_planner_ros.core.simulation_settings import SimulationSettings
from flat_planner_ros.core.vibration import VibrationMonitor
from flat_planner_ros.core.vibration_report import Level, MonitorSettings, VibrationReport

__all__ = [
    'ActuatedJoints',
    'Adoption',
    'AdoptionRefused',
    'ArmState',
    'bodies_of_constants',
    'bodies_of_links',
    'check_point_count',
    'EffortProfile',
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
    'InvalidCommand',
    'InvalidCost',
    'InvalidModel',
    'InvalidRequest',
    'JointLimits',
    'JointSample',
    'Law',
    'Level',
    'LimitUse',
    'LinkBody',
    'MAX_WEIGHT',
    'ModelTuner',
    'MonitorSettings',
    'Motion',
    'MotionLaw',
    'MotionRequest',
    'NaturalMode',
    'NoFeasibleDuration',
    'NotFlat',
    'OscillationFit',
    'PacedArm',
    'Plan',
    'plan',
    'PlanarArm',
    'PlannedMotion',
    'PlannerSession',
    'PlanningOptions',
    'PlanSamples',
    'QuadraticCost',
    'Quantity',
    'Reason',
    'ReportedEstimate',
    'RequestRejected',
    'Residual',
    'rest_target',
    'rollout',
    'select',
    'Sensing',
    'SessionSettings',
    'shortest_plan',
    'SimulatedArm',
    'SimulationSettings',
    'StartSource',
    'StiffnessEstimate',
    'Strategy',
    'strategy_cost',
    'UncertifiedPlan',
    'VibrationMonitor',
    'VibrationReport',
    'ViaPoint',
]
