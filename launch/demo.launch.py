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

"""The planner, the plant and the monitor, each in its own process, from one parameter file."""

from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    IncludeLaunchDescription,
    OpaqueFunction,
    SetLaunchConfiguration,
)
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterFile, ParameterValue
from launch_ros.substitutions import FindPackageShare

PACKAGE = 'flat_planner_ros'

TRACKED = {'input': 'tracker', 'publish_rate': 500.0}
"""Parameters of a plant that a tracker moves."""

SERVOS = {'drive': 'position'}
"""Parameters of a plant that takes the positions of a planner that sends nothing else."""


def generate_launch_description() -> LaunchDescription:
    """Describe the arguments that planner.launch.py has not, and start both."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'scenario',
                default_value='',
                choices=['', '1', '2', '3'],
                description="the paper's: 1 no damping, 2 damping, 3 plant 10 % stiffer and more "
                'damped; empty = as in params_file',
            ),
            DeclareLaunchArgument(
                'command_topic',
                default_value='flat_planner/joint_trajectory',
                description='from the planner to the plant',
            ),
            DeclareLaunchArgument(
                'view',
                default_value='true',
                choices=['true', 'false'],
                description='publish robot descriptions and transforms, where ROS has what it '
                'takes',
            ),
            OpaqueFunction(function=_scenario),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(str(Path(__file__).with_name('planner.launch.py')))
            ),
            OpaqueFunction(function=_plant),
        ]
    )


def _scenario(context: LaunchContext) -> list[SetLaunchConfiguration]:
    """Lay the scenario's parameters over those of the arm."""
    scenario = LaunchConfiguration('scenario').perform(context)
    if not scenario:
        return []
    name = f'scenario_{scenario}.yaml'
    file = PathJoinSubstitution([FindPackageShare(PACKAGE), 'config', 'scenarios', name])
    return [SetLaunchConfiguration('overlay_file', file)]


def _plant(context: LaunchContext) -> list[Node]:
    """Return the plant; with use_sim_time it makes the time that all others take."""
    overlay = LaunchConfiguration('overlay_file').perform(context)
    files = [LaunchConfiguration('params_file'), *([overlay] if overlay else [])]
    is_tracked = LaunchConfiguration('tracker').perform(context) == 'true'
    has_servos = LaunchConfiguration('command_interface').perform(context) == 'position'
    chosen = {**(TRACKED if is_tracked else {}), **(SERVOS if has_servos else {})}
    use_sim_time = ParameterValue(LaunchConfiguration('use_sim_time'), value_type=bool)
    return [
        Node(
            package=PACKAGE,
            executable='plant_node',
            name='flat_plant',
            namespace=LaunchConfiguration('namespace'),
            parameters=[
                *(ParameterFile(file, allow_substs=True) for file in files),
                {'publish_clock': use_sim_time, **chosen},
            ],
            ros_arguments=['--log-level', LaunchConfiguration('log_level')],
            output='screen',
        )
    ]
