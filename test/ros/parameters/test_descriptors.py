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

"""What `ros2 param describe` says of every parameter."""

import re

from flat_planner_ros.ros.nodes.monitor_node import MonitorNode
from flat_planner_ros.ros.nodes.planner_node import PlannerNode
from flat_planner_ros.ros.nodes.plant_node import PlantNode
from flat_planner_ros.ros.nodes.tracker_node import TrackerNode
from flat_planner_ros.ros.parameters import monitor, planner, plant, tracker
import pytest
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import DescribeParameters

NODES = {
    'flat_planner': (PlannerNode, planner),
    'flat_plant': (PlantNode, plant),
    'flat_monitor': (MonitorNode, monitor),
    'flat_tracker': (TrackerNode, tracker),
}
WITHOUT_UNIT = {
    'weights.r': 'its unit is what makes r^8 tau^2 one of the jerk-like term',
    'model.max_imbalance': 'relative to inertias',
    'weights.effort': 'a ratio of rates',
    'weights.energy': 'a ratio of rates',
    'weights.Q': 'each entry has another one',
    'drift.false_alarms': 'a share',
    'insensitivity.stiffness': 'a share',
    'insensitivity.damping': 'a share',
    'insensitivity.inertia': 'a share',
    'insensitivity.payload': 'a share',
    'insensitivity.weight': 'a ratio of distances',
}
"""Numbers that have no unit to state, with the reason."""

NUMBERS = (ParameterType.PARAMETER_DOUBLE, ParameterType.PARAMETER_DOUBLE_ARRAY)


@pytest.mark.parametrize('node', NODES)
def test_every_parameter_says_what_it_is_and_what_it_may_be(graph, node):
    node_class, module = NODES[node]
    graph.create(node_class)
    names = [row.name for row in module.ROWS]
    request = DescribeParameters.Request(names=names)
    answer = graph.call(DescribeParameters, f'{node}/describe_parameters', request)
    assert len(answer.descriptors) == len(names)
    for descriptor, row in zip(answer.descriptors, module.ROWS, strict=True):
        said = descriptor.description
        assert len(said) > 10, row.name
        assert '\n' not in said
        assert descriptor.additional_constraints, row.name
        if row.default is not None and row.type.value in NUMBERS:
            has_unit = re.search(r'\[[^\]]+\]', said) is not None
            assert has_unit == (row.name not in WITHOUT_UNIT), row.name
        if row.read_only:
            assert descriptor.read_only
            assert 'fixed at the start' in descriptor.additional_constraints
        for limits in descriptor.floating_point_range:
            assert limits.from_value < limits.to_value
