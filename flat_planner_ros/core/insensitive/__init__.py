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

"""Insensitivity: the residual on arms other than the model, and laws that keep it small."""

from flat_planner_ros.core.insensitive.imbalance import (
    imbalance_residual,
    usual_imbalance_residual,
)
from flat_planner_ros.core.insensitive.insensitivity import (
    Criterion,
    DEFAULT_WEIGHT,
    Insensitivity,
    MAX_HALF_WIDTH,
    MAX_INSENSITIVITY,
    MAX_PAYLOAD,
    Nominal,
    UncertaintyBox,
)
from flat_planner_ros.core.insensitive.law import (
    check_insensitivity,
    insensitive_motion,
    insensitive_motion_from,
    InsensitiveMotion,
)
from flat_planner_ros.core.insensitive.oscillator import largest, Oscillator
from flat_planner_ros.core.insensitive.residual import (
    driven_angle,
    predict_residual,
    PredictedResidual,
    residual_amplitude,
    servo_effort,
)
from flat_planner_ros.core.insensitive.residual_table import (
    misses,
    OscillatorTable,
    residual_table,
    ResidualTable,
)
from flat_planner_ros.core.insensitive.shapers import shaped_quintic, Shaper

__all__ = [
    'check_insensitivity',
    'Criterion',
    'DEFAULT_WEIGHT',
    'driven_angle',
    'imbalance_residual',
    'insensitive_motion',
    'insensitive_motion_from',
    'InsensitiveMotion',
    'Insensitivity',
    'largest',
    'MAX_HALF_WIDTH',
    'MAX_INSENSITIVITY',
    'MAX_PAYLOAD',
    'misses',
    'Nominal',
    'Oscillator',
    'OscillatorTable',
    'predict_residual',
    'PredictedResidual',
    'residual_amplitude',
    'residual_table',
    'ResidualTable',
    'servo_effort',
    'shaped_quintic',
    'Shaper',
    'UncertaintyBox',
    'usual_imbalance_residual',
]
