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

"""The arm of a parameter file as a URDF, the same for robots, simulators and visualisation."""

from collections.abc import Callable, Sequence
from math import inf
from pathlib import Path

from flat_planner_ros.core.arm import (
    ArmDescription,
    bodies_from_links,
    bodies_from_reduced,
    ControlBlock,
    LinkBody,
    urdf_of,
    UrdfLimits,
)
from flat_planner_ros.ros.parameters.arm_model import arm_of, links_of
from flat_planner_ros.ros.parameters.parameter_file import read_settings
from flat_planner_ros.ros.parameters.planner import ROWS
from flat_planner_ros.ros.parameters.row import Values
from flat_planner_ros.ros.wire import interfaces

LIMITS = {
    'lower': ('limits.position_min', -inf),
    'upper': ('limits.position_max', inf),
    'velocity': ('limits.velocity', inf),
    'effort': ('limits.effort', inf),
}
"""Limits of the URDF with the planner's parameters and what holds without them."""


def read_urdf(
    params_file: Path | str | None,
    *,
    namespace: str = '',
    drawn_length: float | None = None,
    control: ControlBlock | None = None,
    warn: Callable[[str], object] = lambda text: None,
) -> str:
    """
    Return the URDF of the arm that a planner started with a file plans for.

    Parameters
    ----------
    params_file
        Parameter file; None for the paper's arm.
    namespace
        Namespace of the planner, for files with blocks by namespace.
    drawn_length
        Length of link n-1 of an arm in reduced form, which does not tell it [m].
    control
        Adds a block for ros2_control.
    warn
        Is told of what the file has in vain.

    Raises
    ------
    FlatPlannerError
        The planner would not start with this file.

    """

    def build(values: Values) -> ArmDescription:
        return description_of(values, drawn_length=drawn_length)

    node = f'{namespace}/{interfaces.PLANNER}'
    return urdf_of(read_settings(params_file, ROWS, build, node=node, warn=warn), control)


def read_drive(params_file: Path | str | None, *, namespace: str = '') -> str:
    """Return the drive of the arm, the name of its command interface; as `read_urdf`."""

    def build(values: Values) -> str:
        return str(values['drive'])

    return read_settings(params_file, ROWS, build, node=f'{namespace}/{interfaces.PLANNER}')


def description_of(values: Values, *, drawn_length: float | None = None) -> ArmDescription:
    """
    Return the arm that the planner's parameters state.

    Raises
    ------
    FlatPlannerError
        The parameters state no arm.

    """
    joints, arm = arm_of(values)
    columns = {
        name: _per_joint(values.get(parameter), default, arm.n)
        for name, (parameter, default) in LIMITS.items()
    }
    return ArmDescription(
        joints=joints,
        arm=arm,
        bodies=_bodies_of(values, drawn_length),
        limits=[
            UrdfLimits(**{name: column[i] for name, column in columns.items()})
            for i in range(arm.n)
        ],
    )


def _bodies_of(values: Values, drawn_length: float | None) -> tuple[LinkBody, ...]:
    """Return the links of either form of the model."""
    links = links_of(values)
    if 'model.inertia_star' not in values:
        return bodies_from_links(**links)
    return bodies_from_reduced(
        inertia_star=values['model.inertia_star'],
        tip_mass=values.get('model.tip_mass', 0.0),
        drawn_length=drawn_length,
        **links,
    )


def _per_joint(numbers: Sequence[float] | None, default: float, count: int) -> list[float]:
    """Return one number per joint; those that a list leaves out at its end have no limit."""
    given = list(numbers or ())
    return (given + [default] * count)[:count]
