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

from collections.abc import Sequence
from typing import Any

from flat_planner_ros.core.arm import InvalidRequest
from flat_planner_ros.ros.parameters import planner, plant
from flat_planner_ros.ros.parameters.idle import READERS
from flat_planner_ros.ros.parameters.row import InvalidParameter, Row
from flat_planner_ros.ros.wire import interfaces
from rclpy.parameter import Parameter

SETTINGS = {
    interfaces.PLANNER: (
        'strategy',
        'flat_model',
        'weights.effort',
        'weights.energy',
        'weights.r',
        'weights.p',
        'insensitivity.stiffness',
        'insensitivity.damping',
        'insensitivity.inertia',
        'insensitivity.nominal',
        'insensitivity.criterion',
        'insensitivity.weight',
        'insensitivity.max_effort_rms',
        'insensitivity.max_residual',
        'peak.insensitive',
        'duration.factor',
        'replan.from',
        'auto_tune',
    ),
    interfaces.PLANT: (
        'mismatch.stiffness_scale',
        'mismatch.damping_scale',
        'mismatch.inertia_scale',
        'mismatch.imbalance',
        'noise.position_std',
        'encoder.resolution',
    ),
}
"""Parameters that the page shows and sets."""

SHOWN = {
    interfaces.PLANNER: ('drive',),
    interfaces.PLANT: ('drive', 'model.inertia_star'),
}
"""Parameters of these nodes that it reads only: they are chosen with the arm."""

WHEN: dict[str, dict[str, list[Any]]] = {
    **{
        name: {'strategy': [strategy.value for strategy in READERS[name]]}
        for name in SETTINGS[interfaces.PLANNER]
        if name in READERS
    },
    # The reduced form of the model does not know the masses that could be out of balance.
    'mismatch.imbalance': {'model.inertia_star': [None]},
}
"""Values of another parameter of the node with which a parameter matters; the others always do."""

ROWS = {
    interfaces.PLANNER: {row.name: row for row in planner.ROWS},
    interfaces.PLANT: {row.name: row for row in plant.ROWS},
}
"""Rows of these parameters and of all others, by node and name."""

KINDS = {
    Parameter.Type.BOOL: 'truth',
    Parameter.Type.DOUBLE: 'number',
    Parameter.Type.DOUBLE_ARRAY: 'numbers',
    Parameter.Type.STRING: 'text',
}
"""What the page calls the types of parameters."""

MAX_NUMBERS = 64
"""Longest array from a browser [-]."""


def choices() -> dict[str, dict[str, Any]]:
    """Return what the page needs to know of the parameters that it sets."""
    return {
        node: {name: _choice(ROWS[node][name]) for name in names}
        for node, names in SETTINGS.items()
    }


def _choice(row: Row) -> dict[str, Any]:
    """Return what the page needs to know of a parameter."""
    return {
        'description': row.description,
        'allowed': row.constraints,
        'choices': list(row.choices),
        'kind': KINDS[row.type],
        'unit': row.unit.replace('-', ''),
        'when': WHEN.get(row.name, {}),
    }


def checked_value(node: str, name: str, value: Any) -> Any:
    """
    Return a value from a browser as a parameter takes it.

    Raises
    ------
    FlatPlannerError
        The value is of another type, or outside what the parameter may be.

    """
    row = ROWS[node][name]
    kind = KINDS[row.type]
    if kind == 'number':
        value = number_within(value, name)
    elif kind == 'numbers':
        value = [number_within(entry, name) for entry in list_within(value, name, MAX_NUMBERS)]
    elif type(value) is not type(row.default):
        raise InvalidParameter(f'{name} must be a {type(row.default).__name__}')
    row.check(value)
    return value


def list_within(value: Any, name: str, most: int) -> Sequence[Any]:
    """Return a list from a browser that is not too long."""
    if not isinstance(value, list) or len(value) > most:
        raise InvalidRequest(f'{name} must be a list of at most {most}')
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
