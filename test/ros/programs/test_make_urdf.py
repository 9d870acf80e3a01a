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

"""The program make_urdf: a parameter file, read as the planner reads it, to a URDF."""

from pathlib import Path
import subprocess
import sys
from xml.etree import ElementTree

from flat_planner_ros.ros.programs.robot_description import read_urdf
import pytest

CONFIG = Path(__file__).resolve().parents[3] / 'config'
FILES = sorted(CONFIG.glob('arm_*.yaml'))


def make_urdf(*arguments, expect=0):
    """Run the program."""
    command = [
        sys.executable,
        '-m',
        'flat_planner_ros.ros.programs.make_urdf',
        *map(str, arguments),
    ]
    answer = subprocess.run(command, capture_output=True, text=True)
    assert answer.returncode == expect, answer.stderr
    return answer


@pytest.mark.parametrize('file', FILES, ids=lambda file: file.stem)
def test_every_shipped_arm_has_a_urdf(file):
    root = ElementTree.fromstring(read_urdf(file).encode())
    joints = [joint.get('name') for joint in root.findall('joint')]
    assert joints == [f'joint{i + 1}' for i in range(len(joints))]
    assert len(joints) >= 2


def test_it_prints_what_it_writes(tmp_path):
    file = tmp_path / 'arm.urdf'
    printed = make_urdf('--params-file', CONFIG / 'arm_2dof.yaml').stdout
    make_urdf('--params-file', CONFIG / 'arm_2dof.yaml', '--output', file)
    assert file.read_text('utf-8') == printed == read_urdf(CONFIG / 'arm_2dof.yaml')


def test_its_options_reach_the_urdf():
    urdf = make_urdf(
        *('--drawn-length', '0.3', '--ros2-control', 'mujoco', '--command-interface', 'position'),
        *('--hardware-param', 'mujoco_model=/tmp/scene.xml'),
    ).stdout
    root = ElementTree.fromstring(urdf.encode())
    assert root.find('joint[@name="joint2"]/origin').get('xyz') == '0.3 0.0 0.0'
    block = root.find('ros2_control')
    assert block.find('hardware/plugin').text == 'mujoco_ros2_control/MujocoSystemInterface'
    assert block.find('hardware/param[@name="mujoco_model"]').text == '/tmp/scene.xml'
    assert block.find('joint/command_interface').get('name') == 'position'


def test_the_command_interface_is_the_drive_s(tmp_path):
    file = tmp_path / 'arm.yaml'
    text = (CONFIG / 'arm_2dof.yaml').read_text('utf-8')
    for drive in ('effort', 'position'):
        file.write_text(text.replace('drive: effort', f'drive: {drive}'), 'utf-8')
        urdf = make_urdf('--params-file', file, '--ros2-control', 'mock').stdout
        root = ElementTree.fromstring(urdf.encode())
        assert root.find('ros2_control/joint/command_interface').get('name') == drive


def test_limits_of_the_planner_become_limits_of_the_joints(tmp_path):
    file = tmp_path / 'arm.yaml'
    file.write_text(
        '/**:\n  ros__parameters:\n'
        '    joints: [a, b]\n'
        '    model: {inertia_star: [6.4e-4, 3.3e-5], stiffness: 3.0e-3, damping: 2.0e-5}\n'
        '/left/flat_planner:\n  ros__parameters:\n'
        '    limits:\n      position_min: [-1.0, -.inf]\n      position_max: [2.0, .inf]\n'
        '      effort: [0.5, .inf]\n'
    )
    root = ElementTree.fromstring(read_urdf(file, namespace='left').encode())
    first = root.find('joint[@name="a"]')
    assert first.get('type') == 'revolute'
    assert [float(first.find('limit').get(k)) for k in ('lower', 'upper', 'effort')] == [
        -1,
        2,
        0.5,
    ]
    assert root.find('joint[@name="b"]').get('type') == 'continuous'
    elsewhere = ElementTree.fromstring(read_urdf(file).encode())
    assert elsewhere.find('joint[@name="a"]').get('type') == 'continuous'


@pytest.mark.parametrize(
    ('arguments', 'complaint', 'code'),
    [
        (['--params-file', 'nowhere.yaml'], 'cannot read', 1),
        (['--drawn-length', '0'], 'drawn_length', 1),
        (['--hardware-param', 'novalue', '--ros2-control', 'mock'], 'NAME=VALUE', 2),
        (['--output', '/nowhere/arm.urdf'], 'No such file', 1),
    ],
)
def test_it_says_in_one_line_what_is_wrong(arguments, complaint, code):
    answer = make_urdf(*arguments, expect=code)
    assert complaint in answer.stderr
    assert 'Traceback' not in answer.stderr
