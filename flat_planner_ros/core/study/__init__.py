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

"""Studies: many motions over axes of choice and chance, planned, predicted and simulated."""

from flat_planner_ros.core.study.axes import (
    Axes,
    Column,
    column,
    Distribution,
    Draws,
    InvalidStudy,
    shares_of,
    Turns,
)
from flat_planner_ros.core.study.case import Batch, Case, last_links_of, Waypoint
from flat_planner_ros.core.study.engine import Chunk, chunks_of, EngineBroken, here, on_executor
from flat_planner_ros.core.study.planned import ACCEPTED, Answer, answer, figures, refusal
from flat_planner_ros.core.study.playing import PlantDisagrees
from flat_planner_ros.core.study.study import Refused, Study, Table, TIME

__all__ = [
    'ACCEPTED',
    'Answer',
    'answer',
    'Axes',
    'Batch',
    'Case',
    'Chunk',
    'chunks_of',
    'Column',
    'column',
    'Distribution',
    'Draws',
    'EngineBroken',
    'figures',
    'here',
    'InvalidStudy',
    'last_links_of',
    'on_executor',
    'PlantDisagrees',
    'refusal',
    'Refused',
    'shares_of',
    'Study',
    'Table',
    'TIME',
    'Turns',
    'Waypoint',
]
