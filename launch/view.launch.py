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

"""The arm and a ghost of its plan: robot descriptions, their transforms and, on demand, RViz."""

from ament_index_python.packages import get_package_prefix, PackageNotFoundError
from flat_planner_ros.ros.programs.robot_description import read_urdf
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterFile, ParameterValue
from launch_ros.substitutions import FindPackageShare

PACKAGE = 'flat_planner_ros'

GHOST = 'ghost/'
"""Prefix of the frames of the arm as planned."""

RELATIVE_TRANSFORMS = [('/tf', 'tf'), ('/tf_static', 'tf_static')]
"""Keeps the transforms of several arms apart, each in its namespace."""


def generate_launch_description() -> LaunchDescription:
    """Describe the arguments and the viewers; what is not installed is left out."""
    arm = PathJoinSubstitution([FindPackageShare(PACKAGE), 'config', 'arm_2dof.yaml'])
    rviz = PathJoinSubstitution([FindPackageShare(PACKAGE), 'config', 'rviz', 'flat_planner.rviz'])
    return LaunchDescription(
        [
            DeclareLaunchArgument('namespace', default_value='', description='of all nodes'),
            DeclareLaunchArgument(
                'use_sim_time',
                default_value='false',
                choices=['true', 'false'],
                description='take the time from /clock',
            ),
            DeclareLaunchArgument(
                'params_file', default_value=arm, description='parameters of the arm'
            ),
            DeclareLaunchArgument(
                'rviz',
                default_value='false',
                choices=['true', 'false'],
                description='show the arm and a ghost of the plan in RViz',
            ),
            DeclareLaunchArgument(
                'rviz_config', default_value=rviz, description='what RViz shows'
            ),
            OpaqueFunction(function=_viewers),
        ]
    )


def _viewers(context: LaunchContext) -> list[LogInfo | Node]:
    """Return the nodes of the packages that are there."""
    namespace = LaunchConfiguration('namespace').perform(context)
    # With substitutions, as for the nodes; what they give is a file that lives as long as this.
    file = ParameterFile(LaunchConfiguration('params_file'), allow_substs=True)
    urdf = ParameterValue(read_urdf(file.evaluate(context), namespace=namespace), value_type=str)
    wanted = {
        'robot_state_publisher': [
            _publisher('robot_state_publisher', {'robot_description': urdf}),
            _publisher(
                'ghost_state_publisher',
                {'robot_description': urdf, 'frame_prefix': GHOST},
                ('joint_states', 'flat_planner/reference'),
                ('robot_description', 'ghost_description'),
            ),
        ],
        'tf2_ros': [
            Node(
                package='tf2_ros',
                executable='static_transform_publisher',
                name='ghost_base',
                namespace=LaunchConfiguration('namespace'),
                arguments=['--frame-id', 'base_link', '--child-frame-id', f'{GHOST}base_link'],
                remappings=RELATIVE_TRANSFORMS,
            )
        ],
    }
    if LaunchConfiguration('rviz').perform(context) == 'true':
        wanted['rviz2'] = [
            Node(
                package='rviz2',
                executable='rviz2',
                name='rviz',
                namespace=LaunchConfiguration('namespace'),
                arguments=['--display-config', LaunchConfiguration('rviz_config')],
                parameters=[{'use_sim_time': _use_sim_time()}],
                remappings=RELATIVE_TRANSFORMS,
            )
        ]
    return [
        action
        for package, nodes in wanted.items()
        for action in (nodes if _is_installed(package) else [_left_out(package)])
    ]


def _publisher(name: str, parameters: dict, *remappings: tuple[str, str]) -> Node:
    """Return a robot_state_publisher."""
    return Node(
        package='robot_state_publisher',
        executable='robot_state_publisher',
        name=name,
        namespace=LaunchConfiguration('namespace'),
        parameters=[{**parameters, 'use_sim_time': _use_sim_time()}],
        remappings=[*RELATIVE_TRANSFORMS, *remappings],
    )


def _use_sim_time() -> ParameterValue:
    """Return the argument as a parameter."""
    return ParameterValue(LaunchConfiguration('use_sim_time'), value_type=bool)


def _is_installed(package: str) -> bool:
    """Return whether a package is on the ament prefix path."""
    try:
        get_package_prefix(package)
    except PackageNotFoundError:
        return False
    return True


def _left_out(package: str) -> LogInfo:
    """Say what would be there."""
    return LogInfo(msg=f'{package} is not installed: what it shows is left out')
