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

"""Monitor: what a motion leaves behind, judged from measurements alone."""

from flat_planner_ros.core.monitor.adoption import (
    Adoption,
    AdoptionRefused,
    Estimate,
    ModelTuner,
    ReportedEstimate,
    ReportedModel,
)
from flat_planner_ros.core.monitor.drift import DriftWatch, ParameterDrift
from flat_planner_ros.core.monitor.drift_settings import DriftSettings
from flat_planner_ros.core.monitor.feedback_times import FeedbackTimes
from flat_planner_ros.core.monitor.identification import (
    ActuatedJoints,
    identify,
    StiffnessEstimate,
)
from flat_planner_ros.core.monitor.model_estimate import LastLinks, ModelEstimate
from flat_planner_ros.core.monitor.motion_record import joint_indices, PlannedMotion, Residual
from flat_planner_ros.core.monitor.oscillation import fit_oscillation, OscillationFit
from flat_planner_ros.core.monitor.report import VibrationReport
from flat_planner_ros.core.monitor.settings import Level, MonitorSettings
from flat_planner_ros.core.monitor.vibration_monitor import Phase, VibrationMonitor

__all__ = [
    'ActuatedJoints',
    'Adoption',
    'AdoptionRefused',
    'DriftSettings',
    'DriftWatch',
    'Estimate',
    'FeedbackTimes',
    'fit_oscillation',
    'identify',
    'joint_indices',
    'LastLinks',
    'Level',
    'ModelEstimate',
    'ModelTuner',
    'MonitorSettings',
    'OscillationFit',
    'ParameterDrift',
    'Phase',
    'PlannedMotion',
    'ReportedEstimate',
    'ReportedModel',
    'Residual',
    'StiffnessEstimate',
    'VibrationMonitor',
    'VibrationReport',
]
