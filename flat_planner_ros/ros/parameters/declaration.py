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
Parameters: declared from tables, validated as a whole, handed on as frozen core types.

A table row says what a parameter means and what it may be; a *builder* turns the values of a node
into its settings and refuses what contradicts itself. Both are asked at the start and before every
change at run time, so that a node never holds settings that it could not have started with.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from math import inf, isfinite, isnan
import sys
from typing import Any, Generic, TypeVar

from flat_planner_ros.core.arm import displaced_com, FlatPlannerError, NotFlat, PlanarArm, remedy
from rcl_interfaces.msg import (
    FloatingPointRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

Settings = TypeVar('Settings')
Values = Mapping[str, Any]
"""Values of declared parameters by name; a parameter without a value is left out."""

TYPO_SIMILARITY = 0.8
"""Likeness of an unknown name to a known one from which it is taken for a typing error [-]."""


class InvalidParameter(FlatPlannerError):
    """A parameter that a node cannot work with; the message says what to write instead."""


ANY_VALUE = {
    Parameter.Type.BOOL: 'true or false',
    Parameter.Type.INTEGER: 'an integer',
    Parameter.Type.DOUBLE: 'a finite number',
    Parameter.Type.DOUBLE_ARRAY: 'finite numbers',
    Parameter.Type.STRING: 'any text',
    Parameter.Type.STRING_ARRAY: 'different names',
}
"""Constraints of parameters that have none of their own."""


@dataclass(frozen=True, kw_only=True)
class Row:
    """
    One parameter.

    Attributes
    ----------
    name, description
        As `ros2 param describe` shows them.
    default
        Value where none is given; a `Parameter.Type` for a parameter that may stay without.
    lower, upper
        Range of every number in it.
    choices
        Allowed texts; empty for any.
    read_only
        Whether it is structural, fixed at the start.
    infinite
        Whether infinity is allowed, meaning no limit.

    """

    name: str
    default: Any
    description: str
    lower: float = -inf
    upper: float = inf
    choices: tuple[str, ...] = ()
    read_only: bool = False
    infinite: bool = False

    @property
    def type(self) -> Parameter.Type:  # noqa: A003
        """Return the type of its value."""
        if isinstance(self.default, Parameter.Type):
            return self.default
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
        if self.infinite and not self.constraints:
            allowed = 'numbers, or .inf'
        if isinstance(self.default, Parameter.Type):
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
        )

    def check(self, value: Any) -> None:
        """
        Refuse a value outside the constraints; ROS looks at scalars only.

        Raises
        ------
        InvalidParameter
            With the name, the value and the constraint.

        """
        if self.choices and value not in self.choices:
            raise InvalidParameter(f'{self.name} must be {self.constraints}, got {value!r}')
        numbers = value if isinstance(value, Sequence) and not isinstance(value, str) else [value]
        for number in numbers:
            if not isinstance(number, float):
                continue
            is_number = isfinite(number) or (self.infinite and not isnan(number))
            if not (is_number and self.lower <= number <= self.upper):
                raise InvalidParameter(
                    f'{self.name} must be {self.constraints or "finite"}, got {number}'
                )


class NodeParameters(Generic[Settings]):
    """
    The parameters of a node and the settings that follow from them.

    Parameters
    ----------
    node
        Whose parameters.
    rows
        What to declare.
    build
        Makes the settings of the values, or raises a FlatPlannerError that says why not.
    apply
        Called with new settings after a change at run time.

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
        """Declare, read and validate; then listen for changes."""
        self._node = node
        self._rows = {row.name: row for row in rows}
        self._build = build
        self._apply = apply
        overrides = {name: p.value for name, p in node._parameter_overrides.items()}
        refuse_unknown(overrides, list(self._rows), node.get_logger().warning)
        defaults = model_defaults(overrides)
        for row in rows:
            _declare(node, row, defaults.get(row.name, row.default))
        self.settings = self._checked({})
        if defaults:
            node.get_logger().info("no model is given: this is the paper's arm")
        node.add_on_set_parameters_callback(self._validate)
        node.add_post_set_parameters_callback(self._changed)

    def _checked(self, changes: Values) -> Settings:
        """Return the settings of the present values with some changes."""
        values = {}
        for name, row in self._rows.items():
            value = changes.get(name, self._node.get_parameter_or(name).value)
            if value is None:
                continue
            if hasattr(value, 'tolist'):
                value = value.tolist()
            row.check(value)
            values[name] = value
        return self._build(values)

    def _validate(self, parameters: list[Parameter]) -> SetParametersResult:
        """Answer a request to change parameters."""
        changes = {p.name: p.value for p in parameters if p.name in self._rows}
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


def model_rows(*, read_only: bool) -> list[Row]:
    """Return the rows of the arm's nominal model, the same for the three nodes."""
    doubles = Parameter.Type.DOUBLE_ARRAY
    arrays = {
        'model.inertia_star': 'reduced inertias I*_{n-1} and I*_n [kg m^2]',
        'model.link_length': 'lengths of the links [m]',
        'model.link_com': 'centres of mass of the links from their joints [m]',
        'model.link_mass': 'masses of the links [kg]',
        'model.link_inertia': 'barycentric moments of inertia of the links [kg m^2]',
        'model.counterbalance_mass': 'counterbalances of the last two links [kg]',
        'model.counterbalance_arm': 'their distances behind the joints [m]',
        'friction.viscous': 'viscous friction of the actuated joints [N m s/rad]',
        'friction.coulomb': 'Coulomb friction of the actuated joints [N m]',
    }
    double = Parameter.Type.DOUBLE
    scalars = {
        'model.stiffness': 'stiffness of the passive joint [N m/rad]',
        'model.damping': 'damping of the passive joint [N m s/rad]',
        'model.tip_mass': 'mass that rides at joint n-1, reduced form with n > 2 [kg]',
        'model.gravity': 'gravity in the plane of motion, 0 = horizontal plane [m/s^2]',
    }
    joints = Row(
        name='joints',
        default=Parameter.Type.STRING_ARRAY,
        description='joint names in kinematic order, the passive one last',
        read_only=True,
    )
    return [
        joints,
        *(
            Row(name=n, default=doubles, description=d, read_only=read_only)
            for n, d in arrays.items()
        ),
        *(
            Row(name=n, default=double, description=d, read_only=read_only)
            for n, d in scalars.items()
        ),
    ]


def model_parameters(*, stiffness: float, damping: float) -> list[Parameter]:
    """Return the parameters of the passive joint with new values [N m/rad], [N m s/rad]."""
    return [
        Parameter('model.stiffness', value=stiffness),
        Parameter('model.damping', value=damping),
    ]


EXAMPLE_ARM: Values = {
    'joints': ['joint1', 'joint2'],
    'model.inertia_star': [6.4e-4, 3.3e-5],
    'model.stiffness': 3.0e-3,
    'model.damping': 2.0e-5,
}
"""The paper's arm, for nodes that are started without any model (config/arm_2dof.yaml)."""


def arm_of(
    values: Values, imbalance: Sequence[float] = (0.0, 0.0)
) -> tuple[tuple[str, ...], PlanarArm]:
    """
    Return the joint names and the arm.

    Parameters
    ----------
    values
        The nominal model.
    imbalance
        What the last two links of the true arm lack of balance, as for `displaced_com` [kg m].

    Raises
    ------
    InvalidParameter
        The model is incomplete, or given in both forms.
    FlatPlannerError
        Its numbers are not those of a flat arm.

    """
    joints = tuple(values.get('joints', ()))
    if len(joints) < 2:
        raise InvalidParameter(
            'joints must name the joints in kinematic order, e.g. joints: [joint1, joint2]'
        )
    common = {name: _required(values, f'model.{name}') for name in ('stiffness', 'damping')}
    common['gravity'] = values.get('model.gravity', 0.0)
    for kind in ('viscous', 'coulomb'):
        common[f'{kind}_friction'] = per_joint(values, f'friction.{kind}', len(joints) - 1)
    reduced = 'model.inertia_star' in values
    links = {name: values[f'model.{name}'] for name in LINK_ARRAYS if f'model.{name}' in values}
    if reduced:
        inertia = values['model.inertia_star']
        if len(inertia) != 2:
            raise InvalidParameter(
                f'model.inertia_star needs two numbers, I*_{{n-1}} and I*_n, got {len(inertia)}'
            )
        if any(name.startswith('counterbalance') for name in links):
            raise InvalidParameter(
                'the model is given twice: model.inertia_star is the reduced form, '
                'model.counterbalance_* belongs to the full one'
            )
        tip_mass = values.get('model.tip_mass', 0.0)
        arm = PlanarArm.reduced(inertia_star=inertia, tip_mass=tip_mass, **links, **common)
    else:
        for name in LINK_ARRAYS:
            _required(values, f'model.{name}')
        arm = PlanarArm.from_links(**links, **common)
    if arm.n != len(joints):
        raise InvalidParameter(f'{len(joints)} joints are named, but the model has {arm.n}')
    try:
        arm.check_flat()
    except NotFlat as error:
        mended = remedy(**{name: links[name] for name in LINK_ARRAYS if name != 'link_inertia'})
        raise NotFlat(error.link, error.static_moment, f'{error}; {mended}') from error
    if any(imbalance):
        if reduced:
            raise InvalidParameter(
                'an imbalance needs the model in its full form: the reduced one does not know '
                'the masses of the last two links'
            )
        com = displaced_com(links['link_com'], links['link_mass'], imbalance)
        arm = PlanarArm.from_links(**{**links, 'link_com': com}, **common)
    return joints, arm


LINK_ARRAYS = (
    'link_length',
    'link_com',
    'link_mass',
    'link_inertia',
    'counterbalance_mass',
    'counterbalance_arm',
)
"""The arrays of the full form of the model."""


def per_joint(
    values: Values, name: str, count: int, kind: str = 'actuated joint'
) -> tuple[float, ...] | None:
    """Return an array with an entry for each of some joints, None where it is not given."""
    numbers = values.get(name)
    if numbers is None:
        return None
    if len(numbers) != count:
        raise InvalidParameter(f'{name} needs one number per {kind}, {count}, got {len(numbers)}')
    return tuple(numbers)


def _required(values: Values, name: str) -> Any:
    """Return a value that the model cannot do without."""
    if name not in values:
        raise InvalidParameter(
            f'{name} is missing: give the whole model, model.inertia_star, model.stiffness and '
            f'model.damping, or links with counterbalances (config/arm_2dof.yaml shows how)'
        )
    return values[name]


def model_defaults(overrides: Values) -> Values:
    """Return the example arm where nothing of a model is given, else nothing."""
    if any(name == 'joints' or name.startswith('model.') for name in overrides):
        return {}
    return EXAMPLE_ARM


def _declare(node: Node, row: Row, default: Any) -> None:
    """Declare one parameter and put the middleware's complaint about its type into words."""
    try:
        node.declare_parameter(row.name, default, row.descriptor())
    except InvalidParameterValueException as error:
        value = node._parameter_overrides[row.name].value
        raise InvalidParameter(f'{row.name} must be {row.constraints}, got {value}') from error
    except InvalidParameterTypeException as error:
        raise wrong_type(row, node._parameter_overrides[row.name].value) from error


def wrong_type(row: Row, value: Any) -> InvalidParameter:
    """Return the complaint about a value of another type than the parameter's."""
    return InvalidParameter(
        f'{row.name} must be of type {row.type.name.lower().replace("_", " ")}'
        f'{TYPE_HINTS.get(row.type, "")}, got {value!r}'
    )


TYPE_HINTS = {
    Parameter.Type.DOUBLE: ' (write 1.0, not 1)',
    Parameter.Type.DOUBLE_ARRAY: ' (write [1.0, 2.0], not [1, 2])',
    Parameter.Type.STRING: ' (write it in quotes)',
    Parameter.Type.STRING_ARRAY: ' (write [joint1, joint2])',
    Parameter.Type.BOOL: ' (write true or false)',
}
"""What to write for a value of the wrong type."""


def refuse_unknown(overrides: Values, known: Sequence[str], warn: Callable[[str], object]) -> None:
    """Refuse a misspelt name, and mention one that means nothing here: ROS drops both silently."""
    for name in overrides:
        if name in known or name == 'use_sim_time' or name.startswith('qos_overrides.'):
            continue
        similar = get_close_matches(name, known, n=1, cutoff=TYPO_SIMILARITY)
        if similar:
            raise InvalidParameter(f'unknown parameter {name}; did you mean {similar[0]}?')
        warn(f'parameter {name} is unknown here and has no effect')
