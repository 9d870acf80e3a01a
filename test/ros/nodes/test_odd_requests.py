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

"""Odd requests to every service of every node, and errors in our own callbacks: no node ends."""

from flat_planner_ros.ros.live_view.live_node import LiveNode
from flat_planner_ros.ros.nodes.guarded_callbacks import GuardedNode
from flat_planner_ros.ros.nodes.monitor_node import MonitorNode
from flat_planner_ros.ros.nodes.planner_node import PlannerNode
from flat_planner_ros.ros.nodes.plant_node import PlantNode
from flat_planner_ros.ros.nodes.tracker_node import TrackerNode
from flat_planner_ros.ros.wire import interfaces
import pytest
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    GetParameterTypes,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from ros.rig import goal, Planner, stamps
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from type_description_interfaces.srv import GetTypeDescription

NODES = (PlannerNode, PlantNode, MonitorNode, TrackerNode, LiveNode)

UNKNOWN_TYPES = (10, 77, 255)
"""Values of ParameterValue.type that mean nothing."""

ODD_NAMES = ['', 'a..b', '関節', 'use_sim_time', 'start_type_description_service', 300 * 'x']


def odd(name, kind):
    """Return a parameter of a type by its number, without a value of that type."""
    return Parameter(name=name, value=ParameterValue(type=kind))


@pytest.mark.parametrize('node_class', NODES)
def test_a_value_of_unknown_type_is_a_failure_and_one_line(graph, node_class):
    name = graph.create(node_class).get_name()
    for kind in UNKNOWN_TYPES:
        wrong, right = odd('use_sim_time', kind), odd('use_sim_time', ParameterType.PARAMETER_BOOL)
        graph.log.clear()
        request = SetParameters.Request(parameters=[right, wrong, right])
        results = graph.call(SetParameters, f'/{name}/set_parameters', request).results
        assert [result.successful for result in results] == [True, False, True]
        assert str(kind) in results[1].reason
        request = SetParametersAtomically.Request(parameters=[right, wrong])
        result = graph.call(
            SetParametersAtomically, f'/{name}/set_parameters_atomically', request
        ).result
        assert not result.successful
        assert str(kind) in result.reason
        graph.expect(lambda: len(graph.logged('is lost')) >= 2, 'a line for each')
        assert len(graph.logged('is lost')) == 2
        assert all('\n' not in entry.msg for entry in graph.log)


@pytest.mark.parametrize('node_class', NODES)
def test_odd_requests_to_the_services_of_rclpy_are_answered(graph, node_class):
    name = graph.create(node_class).get_name()
    for kind, service in (
        (DescribeParameters, 'describe_parameters'),
        (GetParameters, 'get_parameters'),
        (GetParameterTypes, 'get_parameter_types'),
    ):
        for names in (ODD_NAMES, [], 1000 * ['use_sim_time']):
            graph.call(kind, f'/{name}/{service}', kind.Request(names=names))
    for depth in (0, 1, 2**64 - 1):
        request = ListParameters.Request(prefixes=ODD_NAMES, depth=depth)
        graph.call(ListParameters, f'/{name}/list_parameters', request)
    for text in ODD_NAMES:
        request = GetTypeDescription.Request(type_name=text, type_hash=text)
        answer = graph.call(GetTypeDescription, f'/{name}/get_type_description', request)
        assert not answer.successful
    for kind in range(256):
        parameters = [odd(text, kind) for text in ODD_NAMES]
        request = SetParameters.Request(parameters=parameters)
        results = graph.call(SetParameters, f'/{name}/set_parameters', request).results
        assert len(results) == len(ODD_NAMES)
        assert not any(result.successful for result in results[1:3])  # names unknown here


@pytest.mark.parametrize('node_class', NODES)
def test_values_without_a_value_change_nothing_that_is_not_checked(graph, node_class):
    """Type 0 would take a parameter away, the others would set it to 0, '' or []."""
    name = graph.create(node_class).get_name()
    names = graph.call(ListParameters, f'/{name}/list_parameters').result.names
    for kind in range(11):
        parameters = [odd(text, kind) for text in names]
        request = SetParameters.Request(parameters=parameters)
        results = graph.call(SetParameters, f'/{name}/set_parameters', request).results
        assert len(results) == len(names)
        assert all(result.reason for result in results if not result.successful)
    after = graph.call(ListParameters, f'/{name}/list_parameters').result.names
    assert sorted(after) == sorted(names)


def test_a_time_that_rclpy_cannot_read_is_lost(graph):
    node = graph.create(PlannerNode, {'use_sim_time': True})

    def publish(second):
        clock = Clock()
        clock.clock.sec = second
        graph.publish('/clock', clock)

    publish(-5)
    graph.expect(lambda: graph.logged('a message on /clock is lost'), 'a line')
    publish(6)
    graph.expect(lambda: stamps.now(node.get_clock()) == 6.0, 'the time after the odd one')


class Faulty(GuardedNode):
    """Fails in everything that it is asked for."""

    def __init__(self, **options):
        super().__init__('faulty', **options)
        self.rests = 0
        self.create_subscription(JointState, 'in', self._fail, 10)
        self.create_service(Trigger, 'ask', self._fail)
        self.timer = self.create_timer(0.01, self._fail)

    def rest(self):
        self.rests += 1

    def _fail(self, *_):
        raise ZeroDivisionError('seeded')


def test_an_error_of_ours_costs_what_it_was_at_work_on_and_the_effort(graph):
    node = graph.create(Faulty)
    graph.expect(lambda: node.rests > 3, 'ticks that go on')
    node.timer.cancel()
    before = node.rests
    graph.publish('/in', JointState())
    graph.expect(lambda: node.rests == before + 1, 'a message that is lost')
    answer = graph.call(Trigger, '/ask')
    assert not answer.success
    assert 'seeded' in answer.message
    assert node.rests == before + 2
    graph.expect(lambda: graph.logged('a tick is lost'), 'a line')
    assert len(graph.logged('internal error')) < before
    assert 'test_odd_requests.py' in graph.logged('a tick is lost')[0]


def test_a_planner_at_rest_after_an_error_streams_zeros_until_the_next_motion(graph):
    rig = Planner(graph, {'stream_effort': True})
    efforts = graph.collect(Float64MultiArray, '/flat_planner/effort_commands')
    rig.measure()
    assert rig.send(1.0, 3.0)['state'] == 'ACCEPTED'
    graph.expect(lambda: efforts and any(efforts[-1].data), 'efforts')
    rig.node.rest()
    graph.expect(lambda: not any(efforts[-1].data), 'the first zero')
    efforts.clear()
    graph.expect(lambda: len(efforts) > 3, 'more of them')
    assert not any(any(msg.data) for msg in efforts)
    rig.measure()
    rig.ask(goal(0.5, 3.0))
    graph.expect(lambda: any(efforts[-1].data), 'efforts of the next motion')


def test_a_plant_at_rest_after_an_error_applies_nothing(graph):
    node = graph.create(PlantNode, {'input': 'effort', 'input_timeout': 10.0})
    states = graph.collect(JointState, '/joint_states', interfaces.RELIABLE)
    graph.publish('/flat_planner/effort_commands', Float64MultiArray(data=[0.01]))
    graph.expect(lambda: states and states[-1].effort[0], 'an effort')
    node.rest()
    graph.expect(lambda: states[-1].effort[0] == 0.0, 'none')
