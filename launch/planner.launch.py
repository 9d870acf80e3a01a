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

"""Planner and monitor for a real arm, whose controller plays the command, or a tracker."""

import os
from pathlib import Path

from flat_planner_ros.core import Strategy
from flat_planner_ros.ros.dds_profile import profile_environment, variable
from launch import LaunchContext, LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    IncludeLaunchDescription,
    OpaqueFunction,
    SetEnvironmentVariable,
)
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterFile, ParameterValue
from launch_ros.substitutions import FindPackageShare

PACKAGE = 'flat_planner_ros'

BOOLEAN = ['true', 'false']

FORMS = {'position': 'planner_position.yaml'}
"""Parameter files for the drive and the form of the command, by interface of the controller."""


def generate_launch_description() -> LaunchDescription:
    """Describe the arguments, the nodes and what goes with them on demand."""
    arm = PathJoinSubstitution([FindPackageShare(PACKAGE), 'config', 'arm_2dof.yaml'])
    view = str(Path(__file__).with_name('view.launch.py'))
    return LaunchDescription(
        [
            DeclareLaunchArgument('namespace', default_value='', description='of all nodes'),
            DeclareLaunchArgument(
                'use_sim_time',
                default_value='false',
                choices=BOOLEAN,
                description='take the time from /clock',
            ),
            DeclareLaunchArgument(
                'params_file', default_value=arm, description='parameters of the arm'
            ),
            DeclareLaunchArgument(
                'overlay_file', default_value='', description='parameters over those of the arm'
            ),
            DeclareLaunchArgument(
                'log_level', default_value='info', description='debug, info, warn, error or fatal'
            ),
            DeclareLaunchArgument(
                'strategy',
                default_value='',
                choices=['', *(strategy.value for strategy in Strategy)],
                description='what motions minimise; empty = as in params_file',
            ),
            DeclareLaunchArgument(
                'command_interface',
                default_value='effort',
                choices=['effort', 'position'],
                description="of the arm's controller: position sets drive, and leaves efforts out",
            ),
            DeclareLaunchArgument(
                'command_topic',
                default_value='flat_arm_controller/joint_trajectory',
                description="input of the arm's controller",
            ),
            DeclareLaunchArgument(
                'command_action',
                default_value='',
                description="action of the arm's controller, which then has commands as goals "
                'instead; needs control_msgs',
            ),
            DeclareLaunchArgument(
                'tracker',
                default_value='false',
                choices=BOOLEAN,
                description='close the loop: a tracker hears the command and sends efforts',
            ),
            DeclareLaunchArgument(
                'effort_topic',
                default_value='flat_tracker/effort_commands',
                description='with tracker: input of the controller that takes efforts',
            ),
            DeclareLaunchArgument(
                'view',
                default_value='false',
                choices=BOOLEAN,
                description='publish robot descriptions and transforms; a real arm has its own',
            ),
            DeclareLaunchArgument(
                'rviz',
                default_value='false',
                choices=BOOLEAN,
                description='with view: show the arm and a ghost of the plan in RViz',
            ),
            DeclareLaunchArgument(
                'record',
                default_value='false',
                choices=BOOLEAN,
                description='record all topics into an MCAP file in the present directory',
            ),
            DeclareLaunchArgument(
                'dds_profile',
                default_value='auto',
                description='profiles of Fast DDS; auto = config/dds/fastdds.xml of this package, '
                'unless the environment names a file; none = leave Fast DDS as it is',
            ),
            OpaqueFunction(function=_profile),
            OpaqueFunction(function=_nodes),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(view),
                condition=IfCondition(LaunchConfiguration('view')),
            ),
        ]
    )


def _profile(context: LaunchContext) -> list[SetEnvironmentVariable]:
    """Return the environment by which nodes started from here on find the profiles."""
    chosen = LaunchConfiguration('dds_profile').perform(context)
    if chosen == 'none':
        return []
    found = profile_environment(os.environ) if chosen == 'auto' else {variable(): chosen}
    return [SetEnvironmentVariable(name, value) for name, value in found.items()]


def _nodes(context: LaunchContext) -> list[Node]:
    """Return the nodes, with what the arguments change in the planner."""
    common = _common(LaunchConfiguration('overlay_file').perform(context))
    parameters = list(common.pop('parameters'))
    form = FORMS.get(LaunchConfiguration('command_interface').perform(context))
    if form is not None:
        parameters.append(
            PathJoinSubstitution([FindPackageShare(PACKAGE), 'config', 'ros2_control', form])
        )
    planner = [*parameters]
    strategy = LaunchConfiguration('strategy').perform(context)
    if strategy:
        planner.append({'strategy': strategy})
    action = LaunchConfiguration('command_action').perform(context)
    if action and LaunchConfiguration('tracker').perform(context) == 'true':
        raise RuntimeError(
            'command_action and tracker exclude each other: with an action nothing is on the '
            'topic that the tracker hears'
        )
    if action:
        planner.append({'command.interface': 'action', 'command.action': action})
    return [
        Node(
            executable='planner_node',
            name='flat_planner',
            parameters=planner,
            remappings=[('~/joint_trajectory', LaunchConfiguration('command_topic'))],
            **common,
        ),
        Node(executable='monitor_node', name='flat_monitor', parameters=parameters, **common),
        Node(
            executable='tracker_node',
            name='flat_tracker',
            parameters=parameters,
            remappings=[
                ('flat_planner/joint_trajectory', LaunchConfiguration('command_topic')),
                ('~/effort_commands', LaunchConfiguration('effort_topic')),
            ],
            condition=IfCondition(LaunchConfiguration('tracker')),
            **common,
        ),
        Node(
            executable='record',
            parameters=[{'use_sim_time': _use_sim_time()}],
            condition=IfCondition(LaunchConfiguration('record')),
            **common,
        ),
    ]


def _common(overlay: str) -> dict:
    """Return what all nodes of the package are started with."""
    files = [LaunchConfiguration('params_file'), *([overlay] if overlay else [])]
    return {
        'package': PACKAGE,
        'namespace': LaunchConfiguration('namespace'),
        'parameters': [
            # Substitution makes launch read the file, and so miss a missing one.
            *(ParameterFile(file, allow_substs=True) for file in files),
            {'use_sim_time': _use_sim_time()},
        ],
        'ros_arguments': ['--log-level', LaunchConfiguration('log_level')],
        'output': 'screen',
    }


def _use_sim_time() -> ParameterValue:
    """Return the argument as a parameter."""
    return ParameterValue(LaunchConfiguration('use_sim_time'), value_type=bool)
