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

"""Print the URDF of the arm in a parameter file."""

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Sequence
import sys

from flat_planner_ros.core.arm import ControlBlock, FlatPlannerError, PLUGINS
from flat_planner_ros.ros.programs.command_line import explain_os, parsed
from flat_planner_ros.ros.programs.outputs import open_text, STANDARD_OUTPUT
from flat_planner_ros.ros.programs.robot_description import read_drive, read_urdf


def main(args: Sequence[str] | None = None) -> int:
    """Write the URDF; 0 if it could be made, 1 if the parameters are no arm."""
    options = _options(args)
    try:
        urdf = read_urdf(
            options.params_file,
            namespace=options.namespace,
            drawn_length=options.drawn_length,
            control=_control(options),
            warn=lambda text: print(f'make_urdf: {text}', file=sys.stderr),
        )
        with open_text(options.output) as file:
            file.write(urdf)
    except FlatPlannerError as error:
        print(f'make_urdf: {error}', file=sys.stderr)
        return 1
    except OSError as error:
        print(f'make_urdf: {explain_os(error)}', file=sys.stderr)
        return 1
    return 0


def _options(args: Sequence[str] | None) -> Namespace:
    """Return the command line's options; one that would have no effect is an error."""
    parser = _parser()
    options = parsed(parser, args, ['output'])
    plugin = options.ros2_control
    for name in ('command_interface', 'hardware_param', 'controllers'):
        if plugin is None and getattr(options, name):
            parser.error(f'--{name.replace("_", "-")} needs --ros2-control')
    if plugin is not None and plugin not in PLUGINS and not {'/', ':'} & set(plugin):
        parser.error(
            f'--ros2-control {plugin!r} is none of {", ".join(PLUGINS)}, nor a full name such as '
            f'my_robot/Driver'
        )
    if plugin == 'gz' and not options.controllers:
        parser.error('--ros2-control gz needs --controllers FILE: Gazebo starts them')
    return options


def _parser() -> ArgumentParser:
    """Return the command line."""
    parser = ArgumentParser(
        prog='make_urdf',
        description='Print the URDF of the arm in a parameter file: its links with their '
        'inertias, and on demand its ros2_control block.',
        epilog='example: make_urdf --params-file arm.yaml --ros2-control mock --output arm.urdf',
    )
    parser.add_argument(
        '--params-file',
        metavar='FILE',
        help="ROS parameter file with the arm's model; without it, the paper's arm",
    )
    parser.add_argument(
        '-o',
        '--output',
        metavar='FILE',
        default=STANDARD_OUTPUT,
        help='file to write; -, the default, is standard output',
    )
    parser.add_argument(
        '--namespace', default='', help="of the planner, for files with a namespace's blocks"
    )
    parser.add_argument(
        '--drawn-length',
        type=float,
        metavar='METRES',
        help='length of link n-1 of an arm in reduced form, which leaves it open',
    )
    control = parser.add_argument_group('ros2_control')
    control.add_argument(
        '--ros2-control',
        metavar='PLUGIN',
        help=f'add a block for a hardware plugin: {", ".join(PLUGINS)} or its full name',
    )
    control.add_argument(
        '--command-interface',
        choices=('effort', 'position', 'position,effort'),
        help='of the actuated joints (default: the drive in the parameter file); a '
        'joint_trajectory_controller with both applies the positions of the next period and the '
        'effort of this one',
    )
    control.add_argument(
        '--hardware-param',
        action='append',
        default=[],
        type=_assignment,
        metavar='NAME=VALUE',
        help='parameter of the hardware plugin; may be repeated',
    )
    control.add_argument(
        '--controllers', default='', metavar='FILE', help="controllers' parameter file, for gz"
    )
    return parser


def _assignment(text: str) -> tuple[str, str]:
    """Return name and value."""
    name, separator, value = text.partition('=')
    if not (name and separator):
        raise ArgumentTypeError(f'{text!r} is not NAME=VALUE')
    return name, value


def _control(options: Namespace) -> ControlBlock | None:
    """Return what is asked for ros2_control."""
    if options.ros2_control is None:
        return None
    drive = options.command_interface or read_drive(
        options.params_file, namespace=options.namespace
    )
    return ControlBlock(
        plugin=options.ros2_control,
        command_interfaces=drive.split(','),
        hardware_parameters=dict(options.hardware_param),
        controllers=options.controllers,
    )


if __name__ == '__main__':
    sys.exit(main())
