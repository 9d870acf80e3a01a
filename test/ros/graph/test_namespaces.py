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

from collections import Counter

import numpy as np
import pytest
from ros.conftest import TIMEOUT
from ros.rig import World

ARMS = ('left', 'middle', 'right')


def test_three_arms_on_one_graph_do_not_hear_each_other(graph):
    worlds = [World(graph, namespace=f'/{arm}') for arm in ARMS]
    graph.expect(lambda: all(world.states for world in worlds), 'joint states of all arms')
    asked = Counter()

    def accepted(world):
        return [v for v in world.answers() if v['state'] == 'ACCEPTED']

    for count, (world, position) in enumerate(zip(worlds, (1.0, -0.5, 0.7), strict=True), 1):

        def arrive(world=world, position=position, others=worlds[count:]):
            """Move one arm; return where it comes to rest."""
            asked[world] += 1
            world.move(position, 0.8)
            world.wait_until(world.end + 0.1)
            assert len(accepted(world)) == len(world.commands) == asked[world]
            for other in others:
                assert not other.status
                assert not other.commands
                moved = [(*state.position, *state.effort) for state in other.states]
                assert not np.any(moved)
            world.amplitude()  # the report
            return world.states[-1].position[0]

        assert world.in_time(arrive) == pytest.approx(position, abs=1e-3)
    assert [len(world.reports) for world in worlds] == [asked[world] for world in worlds]
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
