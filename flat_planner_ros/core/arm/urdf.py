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

"""The arm as a URDF: for robot_state_publisher, ros2_control, simulators and visualisation."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf, isfinite, pi
from types import MappingProxyType
from xml.etree.ElementTree import Comment, Element, indent, SubElement, tostring

from flat_planner_ros.core.arm.errors import FlatPlannerError
from flat_planner_ros.core.arm.links import LinkBody
from flat_planner_ros.core.arm.planar_arm import PlanarArm

BASE = 'base_link'
"""Root of the arm, x forward and z upward (REP-103, REP-105)."""

THICKNESS = 0.12
"""Width and height of a drawn link, relative to the mean length of all links [-]."""

ROLL_INERTIA = 0.05
"""Inertia of a link about its long axis relative to that about the joint's [-]; it never turns."""

NO_LIMIT = 1e9
"""What stands for an unknown effort or velocity limit where URDF wants a number [N m], [rad/s]."""

COMMANDED = {'effort', 'position'}
"""Command interfaces for which the planner's command has something."""

COLOURS = {
    'base': '0.25 0.25 0.28 1',
    'actuated': '0.20 0.45 0.75 1',
    'passive': '0.95 0.55 0.1 1',
}
"""Red, green, blue and opacity of the materials."""

GZ = 'gz'
"""Short name of the hardware plugin of Gazebo, which needs more than a hardware block."""

PLUGINS: Mapping[str, str] = MappingProxyType(
    {
        'mock': 'mock_components/GenericSystem',
        GZ: 'gz_ros2_control/GazeboSimSystem',
        'mujoco': 'mujoco_ros2_control/MujocoSystemInterface',
    }
)
"""Hardware plugins of ros2_control by short names."""


@dataclass(frozen=True, kw_only=True)
class UrdfLimits:
    """
    Bounds of one joint, infinite where there are none.

    Attributes
    ----------
    lower, upper
        Of the angle [rad].
    velocity, effort
        Of the magnitude [rad/s], [N m].

    """

    lower: float = -inf
    upper: float = inf
    velocity: float = inf
    effort: float = inf


@dataclass(frozen=True, kw_only=True)
class ControlBlock:
    """
    What ros2_control needs to know.

    Attributes
    ----------
    plugin
        Hardware plugin, or a key of `PLUGINS`.
    command_interfaces
        ``effort``, ``position`` or both, of the actuated joints; the passive one has none.
    initial_position
        Joint angles at the start of a simulated hardware, shape (n,) [rad]; zeros by default.
    hardware_parameters
        Of the plugin, by name.
    controllers
        Parameter file of the controllers, read by Gazebo's plugin.

    """

    plugin: str
    command_interfaces: Sequence[str] = ('effort',)
    initial_position: Sequence[float] = ()
    hardware_parameters: Mapping[str, str] = field(default_factory=dict)
    controllers: str = ''

    def __post_init__(self) -> None:
        """Refuse an interface that the planner's command has nothing for."""
        wanted = set(self.command_interfaces)
        if not wanted or not wanted <= COMMANDED or len(wanted) != len(self.command_interfaces):
            raise FlatPlannerError(
                f'command_interfaces must be effort, position or both, got '
                f'{", ".join(self.command_interfaces) or "none"}'
            )


@dataclass(frozen=True, kw_only=True)
class ArmDescription:
    """
    An arm and its names.

    Attributes
    ----------
    joints
        Names in kinematic order, the passive one last.
    arm
        Its dynamics: spring, damper, friction and gravity.
    bodies
        Its links.
    limits
        Of each joint; none by default.
    name
        Of the robot.

    """

    joints: Sequence[str]
    arm: PlanarArm
    bodies: Sequence[LinkBody]
    limits: Sequence[UrdfLimits] = field(default=())
    name: str = 'flat_arm'

    def __post_init__(self) -> None:
        """Refuse parts that do not fit."""
        n = len(self.joints)
        if not (self.arm.n == len(self.bodies) == n and len(self.limits) in (0, n)):
            raise FlatPlannerError(
                f'{n} joints are named for {len(self.bodies)} links with {len(self.limits)} limits'
            )

    @property
    def links(self) -> list[str]:
        """Return the names of the links, after their joints: link1 turns about joint1."""
        plain = [joint.replace('joint', 'link') for joint in self.joints]
        return [
            link if link != joint else f'{joint}_link'
            for link, joint in zip(plain, self.joints, strict=True)
        ]


def urdf_of(description: ArmDescription, control: ControlBlock | None = None) -> str:
    """
    Return the URDF of an arm.

    URDF has no springs: the passive joint's stiffness stands in a comment, and as an extension
    that Gazebo reads. Its damper and the motors' friction are in `<dynamics>`. With gravity in the
    plane of motion the first joint turns about the horizontal axis -y of `base_link`, so that
    positive angles lift; otherwise all joints turn about its z.

    Parameters
    ----------
    description
        The arm.
    control
        Adds a block for ros2_control.

    """
    arm, joints, links = description.arm, description.joints, description.links
    robot = Element('robot', name=description.name)
    robot.append(
        Comment(
            f' Generated by make_urdf. Spring of {joints[-1]}: {_number(arm.stiffness)} N m/rad, '
            'which URDF cannot express. '
        )
    )
    for name, colour in COLOURS.items():
        SubElement(SubElement(robot, 'material', name=name), 'color', rgba=colour)
    size = THICKNESS * sum(body.length for body in description.bodies) / arm.n
    if control is not None and control.plugin == GZ:
        _fix_to_world(robot)
    base = SubElement(robot, 'link', name=BASE)
    for kind in ('visual', 'collision'):
        shape = _shape(base, kind, 'cylinder', _xyz(0, 0, -size), radius=size, length=size)
        if kind == 'visual':
            SubElement(shape, 'material', name='base')
    parent, x, roll = BASE, 0.0, _roll(arm.gravity)
    for i, (joint, link) in enumerate(zip(joints, links, strict=True)):
        _add_joint(robot, description, i, parent, (x, roll), has_control=control is not None)
        _add_link(robot, link, description.bodies[i], i == arm.n - 1, size)
        parent, x, roll = link, description.bodies[i].length, 0.0
        if joint == joints[-1]:
            extension = SubElement(robot, 'gazebo', reference=joint)
            SubElement(extension, 'springStiffness').text = _number(arm.stiffness)
            SubElement(extension, 'springReference').text = '0'
    if control is not None:
        _add_control(robot, description, control)
    indent(robot)
    text: bytes = tostring(robot, encoding='utf-8', xml_declaration=True)
    return text.decode() + '\n'


def _roll(gravity: float) -> float:
    """Return the turn about x from the plane z = 0 into that of the motion [rad]."""
    return 0.0 if gravity == 0.0 else pi / 2 if gravity > 0.0 else -pi / 2


def _fix_to_world(robot: Element) -> None:
    """Keep a simulated arm from falling."""
    SubElement(robot, 'link', name='world')
    joint = SubElement(robot, 'joint', name='base_joint', type='fixed')
    SubElement(joint, 'parent', link='world')
    SubElement(joint, 'child', link=BASE)


def _add_joint(
    robot: Element,
    description: ArmDescription,
    index: int,
    parent: str,
    origin: tuple[float, float],
    *,
    has_control: bool,
) -> None:
    """Add a joint at x [m], turned by a roll [rad]; controllers want limits of every joint."""
    arm = description.arm
    limits = description.limits[index] if description.limits else UrdfLimits()
    is_bounded = isfinite(limits.lower) and isfinite(limits.upper)
    kind = 'revolute' if is_bounded else 'continuous'
    joint = SubElement(robot, 'joint', name=description.joints[index], type=kind)
    SubElement(joint, 'parent', link=parent)
    SubElement(joint, 'child', link=description.links[index])
    SubElement(joint, 'origin', xyz=_xyz(origin[0], 0, 0), rpy=_xyz(origin[1], 0, 0))
    SubElement(joint, 'axis', xyz='0 0 1')
    is_passive = index == arm.n - 1
    damping = arm.damping if is_passive else arm.viscous_friction[index]
    friction = 0.0 if is_passive else arm.coulomb_friction[index]
    SubElement(joint, 'dynamics', damping=_number(damping), friction=_number(friction))
    if has_control or is_bounded or isfinite(limits.velocity) or isfinite(limits.effort):
        numbers = {'lower': limits.lower, 'upper': limits.upper} if is_bounded else {}
        numbers['effort'] = min(limits.effort, NO_LIMIT)
        numbers['velocity'] = min(limits.velocity, NO_LIMIT)
        SubElement(joint, 'limit', {name: _number(value) for name, value in numbers.items()})


def _add_link(robot: Element, name: str, body: LinkBody, is_passive: bool, size: float) -> None:
    """Add a link: what it weighs, and what is seen of it."""
    link = SubElement(robot, 'link', name=name)
    inertial = SubElement(link, 'inertial')
    SubElement(inertial, 'origin', xyz=_xyz(body.com, 0, 0), rpy='0 0 0')
    SubElement(inertial, 'mass', value=_number(body.mass))
    yaw = body.inertia
    moments = {'ixx': ROLL_INERTIA * yaw, 'ixy': 0, 'ixz': 0, 'iyy': yaw, 'iyz': 0, 'izz': yaw}
    SubElement(inertial, 'inertia', {axis: _number(value) for axis, value in moments.items()})
    reach = body.length + body.tail
    bar = f'{_xyz(reach, size, size / 2)}'
    middle = _xyz((body.length - body.tail) / 2, 0, 0)
    # No collision shapes: the links of a planar arm pass each other in layers that are not drawn.
    _shape(link, 'visual', 'box', middle, size=bar)
    _shape(link, 'visual', 'cylinder', _xyz(0, 0, 0), radius=0.7 * size, length=0.7 * size)
    for visual in link.findall('visual'):
        SubElement(visual, 'material', name='passive' if is_passive else 'actuated')


def _shape(link: Element, kind: str, form: str, xyz: str, **sizes: float | str) -> Element:
    """Add a simple body to be seen or touched; return it."""
    shape = SubElement(link, kind)
    SubElement(shape, 'origin', xyz=xyz, rpy='0 0 0')
    attributes = {k: v if isinstance(v, str) else _number(v) for k, v in sizes.items()}
    SubElement(SubElement(shape, 'geometry'), form, attributes)
    return shape


def _add_control(robot: Element, description: ArmDescription, control: ControlBlock) -> None:
    """Add the hardware block, and Gazebo's own plugin where that is the hardware."""
    block = SubElement(robot, 'ros2_control', name=description.name, type='system')
    plugin = PLUGINS.get(control.plugin, control.plugin)
    hardware = SubElement(block, 'hardware')
    SubElement(hardware, 'plugin').text = plugin
    for name, value in control.hardware_parameters.items():
        SubElement(hardware, 'param', name=name).text = value
    start = control.initial_position or [0.0] * len(description.joints)
    for name, angle in zip(description.joints, start, strict=True):
        joint = SubElement(block, 'joint', name=name)
        if name != description.joints[-1]:
            for interface in control.command_interfaces:
                SubElement(joint, 'command_interface', name=interface)
        for interface in ('position', 'velocity', 'effort'):
            state = SubElement(joint, 'state_interface', name=interface)
            if interface == 'position':
                SubElement(state, 'param', name='initial_value').text = _number(angle)
    if control.plugin == GZ:
        system = SubElement(
            SubElement(robot, 'gazebo'),
            'plugin',
            filename='gz_ros2_control-system',
            name='gz_ros2_control::GazeboSimROS2ControlPlugin',
        )
        SubElement(system, 'parameters').text = control.controllers


def _number(value: float) -> str:
    """Return all digits of a number."""
    return repr(float(value))


def _xyz(*values: float) -> str:
    """Return numbers side by side."""
    return ' '.join(map(_number, values))
