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
Parameters of a node: declared from a table, checked as a whole, handed on as frozen settings.

A row of the table says what a parameter means and what it may be; a *builder* turns the values of
all into the node's settings and refuses what contradicts itself. Both are asked at the start and
before every change at run time, so that a node never holds settings that it could not have started
with.
"""

from collections.abc import Callable, Sequence
from difflib import get_close_matches
from typing import Any, Generic, TypeVar

from flat_planner_ros.core.arm import FlatPlannerError
from flat_planner_ros.ros.parameters.arm_model import model_defaults
from flat_planner_ros.ros.parameters.plausibility import doubts
from flat_planner_ros.ros.parameters.row import InvalidParameter, Row, Values, wrong_type
from flat_planner_ros.ros.wire.log_lines import write_line
from rcl_interfaces.msg import SetParametersResult
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.logging import LoggingSeverity
from rclpy.node import Node
from rclpy.parameter import Parameter

Settings = TypeVar('Settings')

TYPO_SIMILARITY = 0.8
"""Likeness of an unknown name to a known one from which it is taken for a typing error [-]."""


class NodeParameters(Generic[Settings]):
    """
    The parameters of a node and the settings that follow from them.

    Parameters
    ----------
    node
        Node that declares them.
    rows
        Table of all parameters.
    build
        Makes the settings of the values, or raises a FlatPlannerError that says why not.
    apply
        Called with new settings after a change at run time.

    Attributes
    ----------
    settings
        What follows from the present values.
    is_example
        Whether no model was given, so that the arm is an example.

    Raises
    ------
    FlatPlannerError
        The values given at the start are no valid settings.

    """

    def __init__(
        self,
        node: Node,
        rows: Sequence[Row],
        build: Callable[[Values], Settings],
        apply: Callable[[Settings], None],
    ) -> None:
        self._node = node
        self._rows = {row.name: row for row in rows}
        self._build = build
        self._apply = apply
        overrides = {name: p.value for name, p in node._parameter_overrides.items()}
        refuse_unknown(overrides, list(self._rows), self._warn)
        defaults = model_defaults(overrides)
        for row in rows:
            _declare(node, row, defaults.get(row.name, row.default))
        self.settings = self._checked({})
        for doubt in doubts(self.values):
            self._warn(doubt)
        self.is_example = bool(defaults)
        if defaults:
            text = "no model is given: this is the paper's arm"
            write_line(node.get_logger(), LoggingSeverity.INFO, text)
        node.add_on_set_parameters_callback(self._validate)
        node.add_post_set_parameters_callback(self._changed)

    @property
    def values(self) -> Values:
        """Return the present values of all parameters that have one."""
        return self._values({})

    def _warn(self, text: str) -> None:
        """Say what is doubtful."""
        write_line(self._node.get_logger(), LoggingSeverity.WARN, text)

    def _checked(self, changes: Values) -> Settings:
        """Return the settings of the present values with some changes."""
        return self._build(self._values(changes))

    def _values(self, changes: Values) -> Values:
        """Return the present values with some changes, each within its range."""
        values = {}
        for name, row in self._rows.items():
            value = changes.get(name, self._node.get_parameter_or(name).value)
            if value is None:
                continue
            if hasattr(value, 'tolist'):
                value = value.tolist()
            row.check(value)
            values[name] = value
        return values

    def _validate(self, parameters: list[Parameter]) -> SetParametersResult:
        """Answer a request to change parameters."""
        changes = {p.name: p.value for p in parameters if p.name in self._rows}
        for name, value in changes.items():
            if value is None:  # else rclpy would take one away that has no type of its own
                return SetParametersResult(successful=False, reason=f'{name} needs a value')
        try:
            self._checked(changes)
        except FlatPlannerError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _changed(self, parameters: list[Parameter]) -> None:
        """Take over what has been validated."""
        if any(p.name in self._rows for p in parameters):
            self.settings = self._checked({})
            self._apply(self.settings)


def _declare(node: Node, row: Row, default: Any) -> None:
    """Declare one parameter and put the middleware's complaint about its type into words."""
    if row.word and isinstance(default, Parameter.Type):
        default = None  # without a type: it may be the word
    try:
        node.declare_parameter(row.name, default, row.descriptor())
    except InvalidParameterValueException as error:
        value = node._parameter_overrides[row.name].value
        raise InvalidParameter(f'{row.name} must be {row.constraints}, got {value}') from error
    except InvalidParameterTypeException as error:
        raise wrong_type(row, node._parameter_overrides[row.name].value) from error


def refuse_unknown(overrides: Values, known: Sequence[str], warn: Callable[[str], object]) -> None:
    """Refuse a misspelt name, and mention one that means nothing here: ROS drops both silently."""
    for name in overrides:
        if name in known or name == 'use_sim_time' or name.startswith('qos_overrides.'):
            continue
        similar = get_close_matches(name, known, n=1, cutoff=TYPO_SIMILARITY)
        if similar:
            raise InvalidParameter(f'unknown parameter {name}; did you mean {similar[0]}?')
        warn(f'parameter {name} is unknown here and has no effect')
