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

"""Model fit: the whole model of an arm from recorded angles and efforts."""

from flat_planner_ros.core.model_fit.estimate import ModelFit, ParameterEstimate
from flat_planner_ros.core.model_fit.first_fit import FirstFit, fit_first_links
from flat_planner_ros.core.model_fit.first_information import (
    first_information,
    first_misprediction,
)
from flat_planner_ros.core.model_fit.first_links import KINDS, parameters_of, with_first_links
from flat_planner_ros.core.model_fit.first_motion import first_motions, FirstMotion
from flat_planner_ros.core.model_fit.fit import fit_model, Trust
from flat_planner_ros.core.model_fit.information import (
    foresee,
    ForeseenMotion,
    information,
    misprediction,
)
from flat_planner_ros.core.model_fit.last_links import NAMES
from flat_planner_ros.core.model_fit.measurements import Measurements
from flat_planner_ros.core.model_fit.weak_form import seen_stiffness

__all__ = [
    'FirstFit',
    'first_information',
    'first_misprediction',
    'first_motions',
    'FirstMotion',
    'fit_first_links',
    'fit_model',
    'foresee',
    'ForeseenMotion',
    'information',
    'KINDS',
    'Measurements',
    'misprediction',
    'ModelFit',
    'NAMES',
    'ParameterEstimate',
    'parameters_of',
    'seen_stiffness',
    'Trust',
    'with_first_links',
]
