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

"""Excitation: goals that make the least certain parameter of an arm certain, safely."""

from flat_planner_ros.core.excitation.excitation import Excitation
from flat_planner_ros.core.excitation.motions import Heard, Proposal
from flat_planner_ros.core.excitation.settings import ExcitationSettings, JointRoom, Room

__all__ = [
    'Excitation',
    'ExcitationSettings',
    'Heard',
    'JointRoom',
    'Proposal',
    'Room',
]
