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

"""Plant: a simulated arm that plays commands by time; it knows nothing of planning."""

from flat_planner_ros.core.plant.drives import DriveSettings
from flat_planner_ros.core.plant.effort_profile import EffortProfile
from flat_planner_ros.core.plant.exact_steps import (
    CommandTable,
    exact_ends,
    held_steps,
    States,
)
from flat_planner_ros.core.plant.many_arms import integrated_ends
from flat_planner_ros.core.plant.paced_arm import PacedArm
from flat_planner_ros.core.plant.rollout import rollout
from flat_planner_ros.core.plant.settings import Sensing, SimulationSettings
from flat_planner_ros.core.plant.simulation import SimulatedArm
from flat_planner_ros.core.plant.states import ArmState

__all__ = [
    'ArmState',
    'CommandTable',
    'DriveSettings',
    'EffortProfile',
    'exact_ends',
    'held_steps',
    'integrated_ends',
    'PacedArm',
    'rollout',
    'Sensing',
    'SimulatedArm',
    'SimulationSettings',
    'States',
]
