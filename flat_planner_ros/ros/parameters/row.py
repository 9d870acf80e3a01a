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
One parameter of a node as a row of data, and what every value of it must satisfy.

The tables of the nodes (planner.py, plant.py, monitor.py) are lists of rows. Whoever reads a table
reads these: the node that declares them, a tool that reads a parameter file, the page of the live
view, the tables in docs/interfaces.md.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, KW_ONLY
from enum import Enum
from math import inf, isfinite, isnan
import sys
from typing import Any

from flat_planner_ros.core.arm import FlatPlannerError
from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
from rclpy.parameter import Parameter

Values = Mapping[str, Any]
"""Values of declared parameters by name; a parameter without a value is left out."""

DOUBLE = Parameter.Type.DOUBLE
DOUBLES = Parameter.Type.DOUBLE_ARRAY
NAMES = Parameter.Type.STRING_ARRAY

ANY_VALUE = {
    Parameter.Type.BOOL: 'true or false',
    Parameter.Type.INTEGER: 'an integer',
    Parameter.Type.DOUBLE: 'a finite number',
    Parameter.Type.DOUBLE_ARRAY: 'finite numbers',
    Parameter.Type.STRING: 'any text',
    Parameter.Type.STRING_ARRAY: 'different names',
}
"""Constraints of parameters that have none of their own."""

TYPE_HINTS = {
    Parameter.Type.DOUBLE: ' (write 1.0, not 1)',
    Parameter.Type.DOUBLE_ARRAY: ' (write [1.0, 2.0], not [1, 2])',
    Parameter.Type.STRING: ' (write it in quotes)',
    Parameter.Type.STRING_ARRAY: ' (write [joint1, joint2])',
    Parameter.Type.BOOL: ' (write true or false)',
}
"""What to write for a value of the wrong type."""


class InvalidParameter(FlatPlannerError):
    """A parameter that a node cannot work with; the message says what to write instead."""


@dataclass(frozen=True)
class Row:
    """
    One parameter.

    Attributes
    ----------
    name
        Name with its group, as ``duration.min``.
    given
        Value where none is set, from the core's settings where these have one; a member of an
        `Enum` for a choice among its values; a `Parameter.Type` for what may stay without a value.
    unit
        Unit of its numbers, empty where there is none to state.
    meaning
        Half a sentence on what the parameter is.
    remark
        Meaning of a special value, or where the parameter counts.
    lower, upper
        Range of every number in it.
    may_be_infinite
        Whether infinity is allowed, meaning no limit.
    read_only
        Whether it is structural, fixed at the start; all others may change at run time.
    word
        Text that it may be in place of its value; empty for none.

    """

    name: str
    given: Any
    unit: str
    meaning: str
    remark: str = ''
    _: KW_ONLY
    lower: float = -inf
    upper: float = inf
    may_be_infinite: bool = False
    read_only: bool = False
    word: str = ''

    @property
    def default(self) -> Any:
        """Return the value where none is set, or the type of a parameter that may do without."""
        return self.given.value if self.choices else self.given

    @property
    def choices(self) -> tuple[str, ...]:
        """Return the allowed texts, empty for any."""
        if isinstance(self.given, Parameter.Type) or not isinstance(self.given, Enum):
            return ()
        return tuple(member.value for member in type(self.given))

    @property
    def description(self) -> str:
        """Return what `ros2 param describe` shows: meaning, unit and remark."""
        unit = f' [{self.unit}]' if self.unit else ''
        remark = f'; {self.remark}' if self.remark else ''
        return f'{self.meaning}{unit}{remark}'

    @property
    def type(self) -> Parameter.Type:  # noqa: A003
        """Return the type of its value."""
        if isinstance(self.given, Parameter.Type):
            return self.given
        return Parameter.Type(Parameter.Type.from_parameter_value(self.default))

    @property
    def constraints(self) -> str:
        """Return the allowed values in words."""
        if self.choices:
            return 'one of ' + ', '.join(self.choices)
        if self.lower == -inf and self.upper == inf:
            return ''
        return f'in [{self.lower:g}, {self.upper:g}]'

    @property
    def _allowed(self) -> str:
        """Return the constraints, or what any value of the type is, and whether it may change."""
        allowed = self.constraints or ANY_VALUE[self.type]
        if self.may_be_infinite and not self.constraints:
            allowed = 'numbers, or .inf'
        if self.word:
            allowed += f', or {self.word}'
        if isinstance(self.given, Parameter.Type):
            allowed += '; may be left out'
        return f'{allowed}; fixed at the start' if self.read_only else allowed

    def descriptor(self) -> ParameterDescriptor:
        """Return what ROS tools show and check."""
        ranges = []
        if isinstance(self.default, float) and self.constraints:
            finite = sys.float_info.max
            ranges.append(
                FloatingPointRange(
                    from_value=max(self.lower, -finite), to_value=min(self.upper, finite)
                )
            )
        return ParameterDescriptor(
            description=self.description,
            additional_constraints=self._allowed,
            floating_point_range=ranges,
            read_only=self.read_only,
            dynamic_typing=bool(self.word),
        )

    def check(self, value: Any) -> None:
        """
        Refuse a value outside the constraints; ROS looks at scalars only.

        Raises
        ------
        InvalidParameter
            The message gives the name, the value and the constraint.

        """
        if self.word and not self._has_type(value):
            raise wrong_type(self, value)
        if self.choices and value not in self.choices:
            raise InvalidParameter(f'{self.name} must be {self.constraints}, got {value!r}')
        numbers = value if isinstance(value, Sequence) and not isinstance(value, str) else [value]
        for number in numbers:
            if not isinstance(number, float):
                continue
            is_number = isfinite(number) or (self.may_be_infinite and not isnan(number))
            if not (is_number and self.lower <= number <= self.upper):
                raise InvalidParameter(
                    f'{self.name} must be {self.constraints or "finite"}, got {number}'
                )

    def _has_type(self, value: Any) -> bool:
        """Tell whether a value is of the type, or the word in its place: ROS checks neither."""
        if value == self.word:
            return True
        try:
            return Parameter.Type.from_parameter_value(value) is self.type
        except TypeError:
            return False


def wrong_type(row: Row, value: Any) -> InvalidParameter:
    """Return the complaint about a value of another type than the parameter's."""
    word = f' or {row.word}' if row.word else ''
    return InvalidParameter(
        f'{row.name} must be of type {row.type.name.lower().replace("_", " ")}'
        f'{TYPE_HINTS.get(row.type, "")}{word}, got {value!r}'
    )
