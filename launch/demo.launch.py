"""The planner, the plant and the monitor, each in its own process, from one parameter file."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterFile, ParameterValue
from launch_ros.substitutions import FindPackageShare

PACKAGE = 'flat_planner_ros'


def generate_launch_description() -> LaunchDescription:
    """Describe the arguments and the three nodes."""
    default_file = PathJoinSubstitution([FindPackageShare(PACKAGE), 'config', 'arm_2dof.yaml'])
    use_sim_time = ParameterValue(LaunchConfiguration('use_sim_time'), value_type=bool)
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'namespace', default_value='', description='namespace of the three nodes'
            ),
            DeclareLaunchArgument(
                'use_sim_time',
                default_value='false',
                choices=['true', 'false'],
                description='take the time from /clock',
            ),
            DeclareLaunchArgument(
                'params_file', default_value=default_file, description='parameters of the arm'
            ),
            DeclareLaunchArgument(
                'log_level', default_value='info', description='debug, info, warn, error or fatal'
            ),
            *(
                Node(
                    package=PACKAGE,
                    executable=executable,
                    name=name,
                    namespace=LaunchConfiguration('namespace'),
                    parameters=[
                        # Substitution makes launch read the file, and so miss a missing one.
                        ParameterFile(LaunchConfiguration('params_file'), allow_substs=True),
                        {'use_sim_time': use_sim_time},
                    ],
                    ros_arguments=['--log-level', LaunchConfiguration('log_level')],
                    output='screen',
                )
                for executable, name in (
                    ('planner_node', 'flat_planner'),
                    ('plant_node', 'flat_plant'),
                    ('monitor_node', 'flat_monitor'),
                )
            ),
        ]
    )
