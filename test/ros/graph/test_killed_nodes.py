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

"""Nodes killed and started again in the midst of a motion: nothing moves by itself."""

import numpy as np
import pytest
from ros.rig import Late, NODES, stamp, World


def test_a_monitor_killed_in_a_motion_reports_it_after_its_restart(graph):
    world = World(graph, *NODES)

    def move_and_restart():
        """Return what the new monitor says of the motion [rad]."""
        world.move(1.0, 8.0)
        world.wait_until(world.begin + 1.0)
        world.kill('monitor_node')
        world.start('monitor_node')
        return world.amplitude()

    assert world.in_time(move_and_restart) < 1e-5


def test_all_nodes_killed_in_a_motion_start_at_rest_and_stay_there(graph):
    world = World(graph, *NODES)
    world.move(1.0, 6.0)
    world.wait_until(world.begin + 2.0)
    assert world.efforts().any()
    killed = world.kill(*NODES)
    world.start(*NODES)
    world.wait_until(world.end + 0.1)
    assert stamp(world.states[-1]) > killed
    assert not world.efforts(killed).any()
    assert not np.any([state.position for state in world.states if stamp(state) > killed])
    world.assert_next_goal_works(0.5)


def test_a_planner_restarted_in_a_motion_waits_for_its_end(graph):
    refuse = ['-p', 'flat_planner:start.moving:=refuse']  # else it would catch the arm
    world = World(graph, *NODES, arguments=refuse)

    def move_and_restart():
        """Return where the arm comes to rest though its planner was restarted in the motion."""
        world.move(2.0, 8.0)
        world.wait_until(world.begin + 2.0)
        world.kill('planner_node')
        world.start('planner_node')
        verdict = world.send(0.0)
        while verdict['error_name'].startswith('START_STATE'):
            verdict = world.send(0.0)
        if abs(world.states[-1].velocity[0]) < 0.15:
            raise Late('the restart took all of the motion')
        assert verdict['error_name'] == 'NOT_AT_REST'
        world.wait_until(world.end + 2.2)  # once a second the plant says what it has skipped
        return world.states[-1].position[0]

    assert world.in_time(move_and_restart) == pytest.approx(2.0, abs=1e-3)
    world.assert_next_goal_works(0.5)
