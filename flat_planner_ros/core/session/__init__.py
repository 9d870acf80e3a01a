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

"""Session: goals and measurements in, motions and verdicts out, in the order of time."""

from flat_planner_ros.core.session.execution import Astray, clock_fault, Ended, Outcome, Shortfall
from flat_planner_ros.core.session.goal import (
    check_point_count,
    Goal,
    GoalPoint,
    MAX_ANGLE,
    MAX_POINTS,
)
from flat_planner_ros.core.session.path_goal import path_goal
from flat_planner_ros.core.session.session import PlannerSession
from flat_planner_ros.core.session.settings import (
    ReplanFrom,
    SessionSettings,
    SettlePose,
    StartSource,
    WhenMoving,
)
from flat_planner_ros.core.session.single_goal import single_goal
from flat_planner_ros.core.session.timeline import Motion, Piece, Timeline, Track

__all__ = [
    'Astray',
    'check_point_count',
    'clock_fault',
    'Ended',
    'Goal',
    'GoalPoint',
    'MAX_ANGLE',
    'MAX_POINTS',
    'Motion',
    'Outcome',
    'path_goal',
    'Piece',
    'PlannerSession',
    'ReplanFrom',
    'SessionSettings',
    'SettlePose',
    'Shortfall',
    'single_goal',
    'StartSource',
    'Timeline',
    'Track',
    'WhenMoving',
]
