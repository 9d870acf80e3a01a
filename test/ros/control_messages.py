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
"""
The package control_msgs, as far as the planner's action needs it, made where it is not installed.

The generators that come with rclpy turn its definitions into Python and C, and a compiler makes
the C a module: what the tests speak then is what every controller speaks.
"""

from importlib.util import find_spec
from pathlib import Path
import shutil
import subprocess
import sys
import sysconfig

import numpy as np
import pytest

PACKAGE = 'control_msgs'
MODULE = f'{PACKAGE}_s__rosidl_typesupport_c'
FAST = f'{PACKAGE}__rosidl_typesupport_fastrtps_c'
INTROSPECTION = f'{PACKAGE}__rosidl_typesupport_introspection_c'

NEEDED = (
    'action_msgs',
    'builtin_interfaces',
    'geometry_msgs',
    'service_msgs',
    'std_msgs',
    'trajectory_msgs',
    'unique_identifier_msgs',
)
"""Packages whose types its definitions are made of."""

TOLERANCE = 'float64 position\nfloat64 velocity\nfloat64 acceleration\n'

DEFINITIONS = {
    'msg/JointTolerance.msg': f'string name\n{TOLERANCE}',
    'msg/JointComponentTolerance.msg': f'string joint_name\nuint16 component\n{TOLERANCE}',
    'action/FollowJointTrajectory.action': """
trajectory_msgs/JointTrajectory trajectory
trajectory_msgs/MultiDOFJointTrajectory multi_dof_trajectory
JointTolerance[] path_tolerance
JointComponentTolerance[] component_path_tolerance
JointTolerance[] goal_tolerance
JointComponentTolerance[] component_goal_tolerance
builtin_interfaces/Duration goal_time_tolerance
---
int32 error_code
string error_string
---
std_msgs/Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint desired
trajectory_msgs/JointTrajectoryPoint actual
trajectory_msgs/JointTrajectoryPoint error
string[] multi_dof_joint_names
trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_desired
trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_actual
trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_error
""",
}


def make_control_messages(place):
    """Return a folder for Python's path with control_msgs in it; skip where it cannot be made."""
    if find_spec('rosidl_generator_py') is None or shutil.which('g++') is None:
        pytest.skip('control_msgs is not installed, nor are generators and a compiler to make it')
    if not Path(sysconfig.get_path('include'), 'Python.h').is_file():
        pytest.skip('control_msgs is not installed, nor is Python.h to make it')
    code, other = place / 'code', place / 'introspection'
    _generate(place, code / PACKAGE, other / PACKAGE)
    _compile(code, other)
    return code


def _generate(place, code, introspection):
    """Write Python, C and C++ from the definitions."""
    from ament_index_python import get_package_share_directory
    from rosidl_adapter.action import convert_action_to_idl
    from rosidl_adapter.msg import convert_msg_to_idl
    from rosidl_cli.command.hash.api import generate_type_hashes
    from rosidl_generator_c.cli import GenerateC
    from rosidl_generator_py.cli import GeneratePython
    from rosidl_typesupport_c.cli import GenerateCTypesupport
    from rosidl_typesupport_fastrtps_c.cli import GenerateFastRTPSCTypesupport
    from rosidl_typesupport_introspection_c.cli import GenerateIntrospectionCTypesupport

    idl, files = place / 'idl' / PACKAGE, []
    for name, text in DEFINITIONS.items():
        source = place / name
        source.parent.mkdir(parents=True, exist_ok=True)
        source.write_text(text)
        convert = convert_action_to_idl if source.suffix == '.action' else convert_msg_to_idl
        convert(place, PACKAGE, Path(name), idl / Path(name).parent)
        files.append(f'{idl}:{Path(name).with_suffix(".idl")}')
    shares = [get_package_share_directory(package) for package in NEEDED]
    hashes = generate_type_hashes(
        package_name=PACKAGE, interface_files=files, include_paths=shares, output_path=idl
    )
    supports = ['rosidl_typesupport_fastrtps_c', 'rosidl_typesupport_introspection_c']
    joined = GenerateCTypesupport('c', typesupport_implementations=supports)
    python = GeneratePython('py', typesupport_implementations=['rosidl_typesupport_c'])
    given = PACKAGE, files, shares
    GenerateC('c').generate(*given, code, hashes)
    GenerateFastRTPSCTypesupport('fastrtps_c').generate(*given, code)
    GenerateIntrospectionCTypesupport('introspection_c').generate(*given, introspection)
    joined.generate(*given, code)
    python.generate(*given, code)
    (code / '__init__.py').write_text('')


def _compile(code, introspection):
    """Make the sources the module that Python imports, and the libraries that it loads."""
    ros, target = Path(sys.prefix), code / PACKAGE
    headers = [code, introspection, sysconfig.get_path('include'), np.get_include()]
    headers += [ros / 'include', *(ros / 'include').iterdir()]
    flags = ['-O0', '-w', '-fPIC', '-shared', f'-L{ros / "lib"}', f'-L{target}']
    flags += [f'-I{path}' for path in headers]

    def build(name, sources, *libraries):
        linked = [f'-l{library}' for library in (*libraries, 'stdc++')]
        own = f'-Wl,-soname,{name}.so,-rpath,$ORIGIN,--no-as-needed'
        command = ['gcc', *flags, own, *sources, '-o', target / f'{name}.so', *linked]
        subprocess.run(command, check=True)

    def needed(kind):
        return [f'{package}__rosidl_{kind}' for package in NEEDED]

    fast = _joined(code / 'fast.cpp', code.rglob('*__type_support_c.cpp'))
    introspected = introspection.rglob('*__type_support.c')
    known = _joined(code / 'known.c', introspected)
    types = [*code.rglob('*__functions.c'), *code.rglob('*__type_support.c')]
    messages = _joined(code / 'messages.c', [*types, *code.rglob('*_s.c')])
    dispatch = _joined(code / 'dispatch.cpp', code.rglob('*__type_support.cpp'))
    # Each by itself: they have names in common.
    descriptions = code.rglob('*__description.c')
    entry = code.rglob('*.ep.rosidl_typesupport_c.c')
    build(
        f'lib{FAST}',
        [fast],
        *needed('typesupport_fastrtps_c'),
        'rosidl_typesupport_fastrtps_c',
        'rosidl_typesupport_fastrtps_cpp',
        'fastcdr',
    )
    build(
        f'lib{INTROSPECTION}',
        [known],
        *needed('typesupport_introspection_c'),
        'rosidl_typesupport_introspection_c',
    )
    build(
        MODULE,
        [messages, dispatch, *descriptions, *entry],
        FAST,
        INTROSPECTION,
        *needed('generator_c'),
        *needed('generator_py'),
        *needed('typesupport_c'),
        'rosidl_runtime_c',
        'rosidl_typesupport_c',
        'rcutils',
        'rmw',
    )


def _joined(path, sources):
    """Return a file that includes sources: their headers are then read once."""
    path.write_text(''.join(f'#include "{source}"\n' for source in sorted(sources)))
    return path
