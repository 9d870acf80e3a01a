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

"""Parameters of commands: what they contain, and how they are sent."""

from enum import Enum

from flat_planner_ros.core.arm import InvalidCommand
from flat_planner_ros.ros.parameters.row import Row, Values
from flat_planner_ros.ros.wire.command_form import CommandForm


class CommandStamp(Enum):
    """Meaning of a command's stamp."""

    ABSOLUTE = 'absolute'
    ZERO = 'zero'


class CommandInterface(Enum):
    """How a command reaches its executor."""

    TOPIC = 'topic'
    ACTION = 'action'


COMMAND_ROWS = [
    Row('command.include_passive_joint', True, '', 'name the passive joint in the command'),
    Row('command.include_effort', True, '', 'put the feed-forward effort into the command'),
    Row('command.include_acceleration', True, '', 'put accelerations into the command'),
    Row(
        'command.tolerance',
        0.0,
        'rad',
        'leave out the points that cubic interpolation of positions and velocities does not need '
        'for this; 0 = none',
        'without efforts only, which are joined by straight lines',
        lower=0.0,
        upper=0.001,
    ),
    Row(
        'command.stamp',
        CommandStamp.ABSOLUTE,
        '',
        'stamp of the command: its absolute start, or zero = on arrival',
    ),
    Row(
        'command.interface',
        CommandInterface.TOPIC,
        '',
        'how a command is sent: on ~/joint_trajectory, or as a goal of command.action',
        'action needs control_msgs',
        read_only=True,
    ),
    Row(
        'command.action',
        'flat_arm_controller/follow_joint_trajectory',
        '',
        "the controller's action, with command.interface action",
        read_only=True,
    ),
]
"""Parameters of the command."""


def is_stamped(values: Values) -> bool:
    """Tell whether a command's stamp is its start."""
    return CommandStamp(values['command.stamp']) is CommandStamp.ABSOLUTE


def controller_of(values: Values) -> str:
    """Return the action whose goals commands are, empty where they go by their topic."""
    is_action = CommandInterface(values['command.interface']) is CommandInterface.ACTION
    return str(values['command.action']) if is_action else ''


def command_form(values: Values) -> CommandForm:
    """
    Return what commands contain.

    Raises
    ------
    InvalidCommand
        Points are to be left out of a command with efforts.

    """
    form = CommandForm(
        include_passive_joint=values['command.include_passive_joint'],
        include_acceleration=values['command.include_acceleration'],
        include_effort=values['command.include_effort'],
        absolute_stamp=is_stamped(values),
        tolerance=values['command.tolerance'],
    )
    if form.tolerance and form.include_effort:
        raise InvalidCommand(
            f'command.tolerance = {form.tolerance:g} rad needs command.include_effort: false; '
            'efforts are joined by straight lines and would not be those planned'
        )
    return form
