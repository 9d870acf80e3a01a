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

"""The parameters of the arm's nominal model, the same for the three nodes, and the arm of them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from flat_planner_ros.core.arm import (
    balanced,
    counterbalances,
    displaced_com,
    Drive,
    imbalance,
    NotFlat,
    PlanarArm,
    suggest_counterbalances,
)
from flat_planner_ros.ros.parameters.row import (
    DOUBLE,
    DOUBLES,
    InvalidParameter,
    NAMES,
    Row,
    Values,
)
import numpy as np
from rclpy.node import Node
from rclpy.parameter import Parameter

AUTO = 'auto'
"""Masses or arms of the counterbalances that follow from the rest."""

MAX_IMBALANCE = 0.2
"""Largest imbalance that may be accepted [-]: beyond, it does more than first order says."""

MODEL_ROWS = [
    Row(
        'joints', NAMES, '', 'joint names in kinematic order, the passive one last', read_only=True
    ),
    Row(
        'drive',
        Drive.EFFORT,
        '',
        'what joint n-1 is given: an effort, or positions that a stiff servo follows',
        read_only=True,
    ),
    Row('model.inertia_star', DOUBLES, 'kg m^2', 'reduced inertias I*_{n-1} and I*_n'),
    Row('model.link_length', DOUBLES, 'm', 'lengths of the links'),
    Row('model.link_com', DOUBLES, 'm', 'centres of mass of the links from their joints'),
    Row('model.link_mass', DOUBLES, 'kg', 'masses of the links'),
    Row('model.link_inertia', DOUBLES, 'kg m^2', 'barycentric moments of inertia of the links'),
    Row(
        'model.counterbalance_mass',
        DOUBLES,
        'kg',
        'counterbalances of the last two links',
        'auto = what balances them with the arms',
        word=AUTO,
    ),
    Row(
        'model.counterbalance_arm',
        DOUBLES,
        'm',
        'their distances behind the joints',
        'auto = what balances them with the masses',
        word=AUTO,
    ),
    Row(
        'model.max_imbalance',
        0.02,
        '',
        'imbalance of the last two links that is accepted, relative to their own inertias',
        'what it leaves is said at the start and in every verdict; 0 = none',
        lower=0.0,
        upper=MAX_IMBALANCE,
    ),
    Row('friction.viscous', DOUBLES, 'N m s/rad', 'viscous friction of the actuated joints'),
    Row('friction.coulomb', DOUBLES, 'N m', 'Coulomb friction of the actuated joints'),
    Row('model.stiffness', DOUBLE, 'N m/rad', 'stiffness of the passive joint'),
    Row('model.damping', DOUBLE, 'N m s/rad', 'damping of the passive joint'),
    Row('model.tip_mass', DOUBLE, 'kg', 'mass that rides at joint n-1, reduced form with n > 2'),
    Row('model.gravity', DOUBLE, 'm/s^2', 'gravity in the plane of motion, 0 = horizontal plane'),
]
"""The nominal model; it may change at run time, but for the joints."""

FIXED_MODEL_ROWS = [replace(row, read_only=True) for row in MODEL_ROWS]
"""The nominal model of a node whose arm cannot change."""

LINK_ARRAYS = (
    'link_length',
    'link_com',
    'link_mass',
    'link_inertia',
    'counterbalance_mass',
    'counterbalance_arm',
)
"""The arrays of the full form of the model."""

LINK_SHAPE = ('link_length', 'link_com', 'link_mass')
"""Those that tell which counterbalances are needed."""

EXAMPLE_ARM: Values = {
    'joints': ['joint1', 'joint2'],
    'model.inertia_star': [6.4e-4, 3.3e-5],
    'model.stiffness': 3.0e-3,
    'model.damping': 2.0e-5,
}
"""The paper's arm, for nodes that are started without any model (config/arm_2dof.yaml)."""


def arm_of(values: Values) -> tuple[tuple[str, ...], PlanarArm]:
    """
    Return the joint names and the flat arm that is planned for.

    Parameters
    ----------
    values
        The nominal model.

    Raises
    ------
    InvalidParameter
        The model is incomplete, or given in both forms.
    FlatPlannerError
        The numbers are not those of an arm that is flat, or nearly so.

    """
    joints, built = built_arm(values)
    return joints, built if _is_flat(built) else balanced(built)


def imbalanced_arm(values: Values) -> PlanarArm | None:
    """Return the arm as it is built, None if that is the flat one; errors as of `arm_of`."""
    _, built = built_arm(values)
    return None if _is_flat(built) else built


def _is_flat(arm: PlanarArm) -> bool:
    """Tell whether an arm is as good as balanced."""
    try:
        arm.check_flat()
    except NotFlat:
        return False
    return True


def built_arm(
    values: Values, excess: Sequence[float] = (0.0, 0.0)
) -> tuple[tuple[str, ...], PlanarArm]:
    """
    Return the joint names and the arm with what it lacks of balance.

    Parameters
    ----------
    values
        The nominal model.
    excess
        Static moments that the last two links have too much besides [kg m].

    Raises
    ------
    FlatPlannerError
        As for `arm_of`; or an excess without links that could have it.

    """
    joints = tuple(values.get('joints', ()))
    if len(joints) < 2:
        raise InvalidParameter(
            'joints must name the joints in kinematic order, e.g. joints: [joint1, joint2]'
        )
    common = _common(values, len(joints))
    links = links_of(values)
    is_reduced = 'model.inertia_star' in values
    if is_reduced:
        arm = _reduced_arm(values, links, common)
    else:
        for name in LINK_ARRAYS:
            _required(values, f'model.{name}')
        arm = PlanarArm.from_links(**links, **common)
    if arm.n != len(joints):
        raise InvalidParameter(f'{len(joints)} joints are named, but the model has {arm.n}')
    _check_balance(arm, links, values.get('model.max_imbalance', 0.0))
    if any(excess):
        if is_reduced:
            raise InvalidParameter(
                'an imbalance needs the model in its full form: the reduced one does not know '
                'the masses of the last two links'
            )
        com = displaced_com(links['link_com'], links['link_mass'], excess)
        arm = PlanarArm.from_links(**{**links, 'link_com': com}, **common)
    return joints, arm


def links_of(values: Values) -> dict[str, Any]:
    """
    Return the arrays of the links that are given, the counterbalances as numbers.

    Raises
    ------
    FlatPlannerError
        The counterbalances are to follow, and none or nothing tells them.

    """
    links = {name: values[f'model.{name}'] for name in LINK_ARRAYS if f'model.{name}' in values}
    masses, arms = (links.get(f'counterbalance_{kind}') for kind in ('mass', 'arm'))
    if AUTO not in (masses, arms):
        return links
    if masses == arms:
        raise InvalidParameter(
            'model.counterbalance_mass and model.counterbalance_arm are both auto: give one'
        )
    given, wanted = ('arm', 'mass') if masses == AUTO else ('mass', 'arm')
    shape = {name: _required(values, f'model.{name}') for name in LINK_SHAPE}
    value = _required(values, f'model.counterbalance_{given}')
    found = counterbalances(**shape, **{given: value})
    links[f'counterbalance_{wanted}'] = getattr(found, wanted).tolist()
    return links


def _common(values: Values, joints: int) -> dict[str, Any]:
    """Return what both forms of the model have."""
    common = {name: _required(values, f'model.{name}') for name in ('stiffness', 'damping')}
    common['gravity'] = values.get('model.gravity', 0.0)
    for kind in ('viscous', 'coulomb'):
        common[f'{kind}_friction'] = per_joint(values, f'friction.{kind}', joints - 1)
    return common


def _reduced_arm(values: Values, links: Mapping[str, Any], common: Mapping[str, Any]) -> PlanarArm:
    """Return the arm of the reduced form, which is not given together with the full one."""
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
    return PlanarArm.reduced(inertia_star=inertia, tip_mass=tip_mass, **links, **common)


def _check_balance(arm: PlanarArm, links: Mapping[str, Any], accepted: float) -> None:
    """Refuse an arm whose last two links lack more balance; say what would balance them."""
    if imbalance(arm) <= accepted:
        return
    try:
        arm.check_flat()
    except NotFlat as error:
        mended = suggest_counterbalances(
            **{name: links[name] for name in LINK_ARRAYS if name != 'link_inertia'}
        )
        raise NotFlat(
            error.link,
            error.static_moment,
            f"{error}; imbalance {imbalance(arm):.3g} of the links' inertias, accepted up to "
            f'model.max_imbalance = {accepted:g}; {mended}; or counterbalance_arm: auto',
        ) from error


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


def model_parameters(node: Node, arm: PlanarArm, before: PlanarArm) -> list[Parameter]:
    """
    Return the parameters that make an arm of the one that a node has; its last two links differ.

    Parameters
    ----------
    node
        Its parameters say in which form the model is given.
    arm, before
        The arm wanted and the present one.

    """
    changed: dict[str, Any] = {'model.stiffness': arm.stiffness, 'model.damping': arm.damping}
    if (arm.inertia != before.inertia).any():
        if node.get_parameter_or('model.inertia_star').value is not None:
            changed['model.inertia_star'] = list(arm.inertia_star)
        else:
            given = node.get_parameter('model.link_inertia').value
            changed['model.link_inertia'] = changed_link_inertia(given, arm, before)
    for kind in ('viscous', 'coulomb'):
        friction = getattr(arm, f'{kind}_friction')
        if (friction != getattr(before, f'{kind}_friction')).any():
            changed[f'friction.{kind}'] = friction.tolist()
    return [Parameter(name, value=value) for name, value in changed.items()]


def changed_link_inertia(
    link_inertia: Sequence[float], arm: PlanarArm, before: PlanarArm
) -> list[float]:
    """Return the full form's inertias [kg m^2]; what is more or less sits at the centres."""
    inertia = np.array(link_inertia, dtype=float)
    inertia[-2:] += np.diag(arm.inertia - before.inertia)[-2:]
    changed: list[float] = inertia.tolist()
    return changed
