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

"""Parameters on the page of the live view: which, what they may be, and values from a browser."""

from typing import Any

from flat_planner_ros.core.arm import InvalidRequest
from flat_planner_ros.ros.parameters import planner, plant
from flat_planner_ros.ros.parameters.row import InvalidParameter
from flat_planner_ros.ros.wire import interfaces

SETTINGS = {
    interfaces.PLANNER: ('strategy', 'flat_model', 'weights.r', 'weights.p', 'auto_tune'),
    interfaces.PLANT: (
        'mismatch.stiffness_scale',
        'mismatch.damping_scale',
        'mismatch.inertia_scale',
    ),
}
"""Parameters that the page shows and sets."""

SHOWN = 'drive'
"""Parameter of these nodes that it shows only: it is chosen with the arm."""

ROWS = {
    interfaces.PLANNER: {row.name: row for row in planner.ROWS},
    interfaces.PLANT: {row.name: row for row in plant.ROWS},
}
"""Rows of these parameters and of all others, by node and name."""


def choices() -> dict[str, dict[str, Any]]:
    """Return what the page needs to know of the parameters that it sets."""
    shown = {}
    for node, names in SETTINGS.items():
        shown[node] = {
            name: {
                'description': ROWS[node][name].description,
                'allowed': ROWS[node][name].constraints,
                'choices': list(ROWS[node][name].choices),
                'kind': type(ROWS[node][name].default).__name__,
            }
            for name in names
        }
    return shown


def checked_value(node: str, name: str, value: Any) -> Any:
    """
    Return a value from a browser as a parameter takes it.

    Raises
    ------
    FlatPlannerError
        The value is of another type, or outside what the parameter may be.

    """
    row = ROWS[node][name]
    if isinstance(row.default, float):
        value = number_within(value, name)
    elif type(value) is not type(row.default):
        raise InvalidParameter(f'{name} must be a {type(row.default).__name__}')
    row.check(value)
    return value


def number_within(
    value: Any, name: str, *, lower: float = -float('inf'), upper: float = float('inf')
) -> float:
    """Return a finite number within bounds."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InvalidRequest(f'{name} must be a number')
    if not (lower <= value <= upper and abs(value) < float('inf')):
        raise InvalidRequest(f'{name} must be a number in [{lower:g}, {upper:g}]')
    return float(value)
