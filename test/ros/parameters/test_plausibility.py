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

"""Models in other units are doubted, with the unit; those of the shipped arms are not."""

from pathlib import Path

from flat_planner_ros.ros.nodes.planner_node import PlannerNode
from flat_planner_ros.ros.parameters.arm_model import EXAMPLE_ARM
from flat_planner_ros.ros.parameters.parameter_file import read_settings
from flat_planner_ros.ros.parameters.planner import build, ROWS
from flat_planner_ros.ros.parameters.plausibility import doubts
import pytest

CONFIG = Path(__file__).resolve().parents[3] / 'config'


@pytest.mark.parametrize('name', ['arm_2dof.yaml', 'arm_3dof.yaml', 'arm_4dof.yaml'])
def test_shipped_arms_are_not_doubted(name):
    told = []
    read_settings(CONFIG / name, ROWS, build, node='flat_planner', warn=told.append)
    assert not told


def test_inertias_in_another_unit():
    (doubt,) = doubts({**EXAMPLE_ARM, 'model.inertia_star': [640.0, 33.0]})
    assert '0.00156 Hz' in doubt
    assert 'in kg mm^2, write [0.00064, 3.3e-05]' in doubt


def test_lengths_in_millimetres():
    arm = {
        **EXAMPLE_ARM,
        'joints': ['joint1', 'joint2', 'joint3'],
        'model.link_length': [300.0],
        'model.link_com': [0.1],
        'model.link_mass': [0.5],
        'model.link_inertia': [0.01],
        'model.tip_mass': 0.1,
    }
    (doubt,) = doubts(arm)
    assert 'if that is in mm, write 0.3' in doubt


def test_damping_beyond_the_range():
    (doubt,) = doubts({**EXAMPLE_ARM, 'model.damping': 2e-3})
    assert 'damping ratio' in doubt


def test_a_node_says_it(graph):
    graph.create(PlannerNode, {**EXAMPLE_ARM, 'model.inertia_star': [640.0, 33.0]})
    graph.expect(lambda: graph.logged('natural frequency of this model'), 'a warning')
