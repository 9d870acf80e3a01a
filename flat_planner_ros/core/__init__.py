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

"""
Planning, dynamics and judgement of flat elastic arms; free of ROS, files and clocks.

A wing is loaded when a name of its list is asked for: no program needs all of them.
"""

from importlib import import_module
from typing import Any, TYPE_CHECKING

if TYPE_CHECKING:
    from flat_planner_ros.core.arm import (
        counterbalances,
        Drive,
        FlatModel,
        FlatPlannerError,
        NotFlat,
        PlanarArm,
        suggest_counterbalances,
    )
    from flat_planner_ros.core.insensitive import Insensitivity, predict_residual, UncertaintyBox
    from flat_planner_ros.core.monitor import fit_oscillation, identify
    from flat_planner_ros.core.motion_law import Strategy
    from flat_planner_ros.core.plan_table import plan_many, PlanTable
    from flat_planner_ros.core.planning import (
        JointLimits,
        MotionRequest,
        Plan,
        plan,
        PlanningOptions,
        residual_of_plan,
        shortest_plan,
        ViaPoint,
        with_via_times,
    )
    from flat_planner_ros.core.plant import DriveSettings, EffortProfile, rollout
    from flat_planner_ros.core.session import (
        Goal,
        GoalPoint,
        PlannerSession,
        SessionSettings,
        StartSource,
    )

_HOMES = {
    'arm': (
        'counterbalances',
        'Drive',
        'FlatModel',
        'FlatPlannerError',
        'NotFlat',
        'PlanarArm',
        'suggest_counterbalances',
    ),
    'insensitive': ('Insensitivity', 'predict_residual', 'UncertaintyBox'),
    'monitor': ('fit_oscillation', 'identify'),
    'motion_law': ('Strategy',),
    'plan_table': ('plan_many', 'PlanTable'),
    'planning': (
        'JointLimits',
        'MotionRequest',
        'Plan',
        'plan',
        'PlanningOptions',
        'residual_of_plan',
        'shortest_plan',
        'ViaPoint',
        'with_via_times',
    ),
    'plant': ('DriveSettings', 'EffortProfile', 'rollout'),
    'session': ('Goal', 'GoalPoint', 'PlannerSession', 'SessionSettings', 'StartSource'),
}
"""Names by the wing that has them."""

if not TYPE_CHECKING:  # or a type checker would take any name

    def __getattr__(name: str) -> Any:
        """Load the wing that has a name."""
        for wing, names in _HOMES.items():
            if name in names:
                value = getattr(import_module(f'{__name__}.{wing}'), name)
                globals()[name] = value
                return value
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')

    def __dir__() -> list[str]:
        """Return what may be asked for."""
        return [*globals(), *__all__]


__all__ = [
    'counterbalances',
    'Drive',
    'DriveSettings',
    'EffortProfile',
    'fit_oscillation',
    'FlatModel',
    'FlatPlannerError',
    'Goal',
    'GoalPoint',
    'identify',
    'Insensitivity',
    'JointLimits',
    'MotionRequest',
    'NotFlat',
    'plan',
    'Plan',
    'plan_many',
    'PlanarArm',
    'PlannerSession',
    'PlanningOptions',
    'PlanTable',
    'predict_residual',
    'residual_of_plan',
    'suggest_counterbalances',
    'rollout',
    'SessionSettings',
    'StartSource',
    'shortest_plan',
    'Strategy',
    'UncertaintyBox',
    'ViaPoint',
    'with_via_times',
]
