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

"""Three arms in namespaces of one graph; and processes that are not to be found beyond a host."""

from diagnostic_msgs.msg import DiagnosticArray
from flat_planner_ros.ros.wire import interfaces
import numpy as np
import pytest
from ros.conftest import TIMEOUT
from ros.world import EVERY_VERDICT, goal, move, stamp, values
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

ARMS = ('left', 'middle', 'right')


def test_three_arms_on_one_graph_do_not_hear_each_other(graph):
    states, status, commands, reports = {}, {}, {}, {}
    for arm in ARMS:
        graph.start('demo', '--ros-args', '-r', f'__ns:=/{arm}')
        states[arm] = graph.collect(JointState, f'/{arm}/joint_states', matched=False)
        status[arm] = graph.collect(
            DiagnosticArray, f'/{arm}/flat_planner/status', EVERY_VERDICT, matched=False
        )
        commands[arm] = graph.collect(
            JointTrajectory, f'/{arm}/flat_planner/joint_trajectory', matched=False
        )
        reports[arm] = graph.collect(
            DiagnosticArray, f'/{arm}/flat_monitor/report', interfaces.LATCHED, matched=False
        )
    graph.expect(lambda: all(states.values()), 'joint states of all arms')

    def accepted(arm):
        return [v for v in map(values, status[arm]) if v['state'] == 'ACCEPTED']

    for count, (arm, position) in enumerate(zip(ARMS, (1.0, -0.5, 0.7), strict=True), 1):
        verdict = move(graph, status[arm], goal(position, 0.8), f'/{arm}/flat_planner/goal')
        end = float(verdict['start_time']) + 0.8
        graph.expect(lambda arm=arm: commands[arm], 'the command')
        graph.expect(lambda arm=arm, end=end: stamp(states[arm][-1]) > end + 0.1, 'the end')
        assert len(accepted(arm)) == len(commands[arm]) == 1
        for other in ARMS[count:]:
            assert not status[other]
            assert not commands[other]
            moved = [(*state.position, *state.effort) for state in states[other]]
            assert not np.any(moved)
        if not graph.logged('ms after its start'):
            assert states[arm][-1].position[0] == pytest.approx(position, abs=1e-3)
    graph.expect(lambda: all(reports.values()), 'a report of each arm')
    assert [len(reports[arm]) for arm in ARMS] == [1, 1, 1]
    assert not graph.logged('is published by')


def test_all_topics_and_services_follow_the_namespace(graph):
    graph.start('demo', '--ros-args', '-r', '__ns:=/cell', '-p', 'flat_plant:publish_clock:=true')
    graph.expect(lambda: graph.logged('ready'), 'a node')
    graph.expect(lambda: len(graph.logged('ready')) == 3, 'three nodes')
    allowed = {'/clock', '/diagnostics', '/rosout', '/parameter_events'}
    topics = {name for name, _ in graph.probe.get_topic_names_and_types()}
    assert {name for name in topics if not name.startswith('/cell/')} <= allowed
    services = [name for name, _ in graph.probe.get_service_names_and_types()]
    services = [name for name in services if not name.startswith('/probe/')]
    assert services
    assert all(name.startswith('/cell/') for name in services), services


@pytest.mark.parametrize(('reach', 'is_found'), [('LOCALHOST', True), ('OFF', False)])
def test_the_reach_of_discovery_is_what_is_asked_for(graph, reach, is_found):
    process = graph.start('plant_node', ROS_AUTOMATIC_DISCOVERY_RANGE=reach)
    graph.expect(lambda: 'ready' in process.stderr, 'a plant that is ready')
    patience = TIMEOUT if is_found else 3.0
    found = graph.spin_until(lambda: graph.probe.count_publishers('/joint_states'), patience)
    assert found == is_found
