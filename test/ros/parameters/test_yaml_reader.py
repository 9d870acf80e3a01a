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

"""A plain word in a parameter file means to programs what it means to nodes."""

from math import isnan

from flat_planner_ros.ros.parameters.row import InvalidParameter
from flat_planner_ros.ros.parameters.yaml_reader import parsed
import pytest
from rclpy.node import Node

WORDS = [
    'inf',
    '-inf',
    '+inf',
    'Infinity',
    '.inf',
    '-.INF',
    '+.Inf',
    'nan',
    '.NaN',
    '-.nan',
    '.iNF',
    '2.31e6',
    '1e-4',
    '1.',
    '.5',
    '-.5',
    '1.5E+3',
    '1e',
    'e5',
    '+5',
    '-0',
    '010',
    '-017',
    '08',
    '09.5',
    '0x1F',
    '0x1.8p1',
    '0x',
    '0o17',
    '1_000',
    '1:30',
    '9223372036854775807',
    '9223372036854775808',
    '-9223372036854775809',
    '1e400',
    '-1e400',
    '1e-5',
    'y',
    'N',
    'yes',
    'No',
    'on',
    'Off',
    'TRUE',
    'tRUE',
    'null',
    '2001-01-01',
    '"1.0"',
    "'yes'",
    '"inf"',
    'joint1',
    '1.5f',
    '5m',
    '=',
    '<<',
]


class Bare(Node):
    """A node that takes any parameter."""

    def __init__(self, **options):
        options = {'automatically_declare_parameters_from_overrides': True, **options}
        super().__init__('bare', allow_undeclared_parameters=True, **options)


def test_every_word_means_what_it_means_to_a_node(graph, tmp_path):
    path = tmp_path / 'words.yaml'
    lines = [f'    word{index}: {word}' for index, word in enumerate(WORDS)]
    path.write_text('\n'.join(['/**:', '  ros__parameters:', *lines]) + '\n')
    node = graph.create(Bare, None, '--params-file', str(path))
    ours = parsed(path.read_text(), 'words')['/**']['ros__parameters']
    for index, word in enumerate(WORDS):
        expected, found = node.get_parameter(f'word{index}').value, ours[f'word{index}']
        if isinstance(expected, float) and isnan(expected):
            assert isnan(found), word
        else:
            assert (type(found), found) == (type(expected), expected), word


def test_what_is_no_yaml_is_refused_with_its_place():
    with pytest.raises(InvalidParameter, match='arm.yaml is not valid YAML'):
        parsed('a: [1, 2', 'arm.yaml')
