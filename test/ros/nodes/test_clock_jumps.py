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

"""Clocks that are set back or changed while a motion is under way."""

import pytest
from ros.rig import Planner
from ros.timed_planner import LENIENT, Timed


def test_a_clock_set_back_in_a_motion_fails_it_and_the_next_goal_starts_anew(graph, capfd):
    rig = Timed(graph)
    rig.be(107.0)
    rig.measure()
    assert rig.send(1.0, 5.0)['state'] == 'ACCEPTED'
    rig.be(108.0)
    rig.be(1.0)
    graph.expect(lambda: rig.verdicts('FAILED'), 'the end of the motion')
    (failed,) = rig.verdicts('FAILED')
    assert failed['error_name'] == 'CLOCK_JUMPED'
    assert failed['error_code'] == '-124'
    assert float(failed['value']) == pytest.approx(-107.0)
    assert capfd.readouterr().err.count('the clock was set back by 107.000 s') == 1
    rig.measure((0.3, 0.0))
    verdict = rig.send(1.0, 2.0)
    assert verdict['state'] == 'ACCEPTED'
    assert 1.0 < float(verdict['start_time']) < 2.0
    graph.expect(lambda: len(rig.plans) == 2, 'the plan')
    assert rig.plans[-1].points[0].positions[0] == pytest.approx(0.3)


def test_use_sim_time_that_changes_in_a_motion_fails_it(graph):
    rig = Planner(graph, LENIENT)
    rig.measure()
    assert rig.send(1.0, 5.0)['state'] == 'ACCEPTED'
    assert graph.set_parameters('flat_planner', use_sim_time=True)[0].successful
    graph.expect(lambda: rig.verdicts('FAILED'), 'the end of the motion')
    assert rig.verdicts('FAILED')[0]['error_name'] == 'CLOCK_JUMPED'
    assert graph.logged('use_sim_time was changed')


def test_a_clock_that_goes_on_fails_nothing(graph):
    rig = Timed(graph)
    rig.be(10.0)
    rig.measure()
    assert rig.send(1.0, 1.0)['state'] == 'ACCEPTED'
    for time in (10.2, 10.15, 10.6, 11.5):
        rig.be(time)
    rig.measure((1.0, 0.0))
    rig.be(11.6)  # timers of a simulated clock go by it
    graph.expect(lambda: rig.verdicts('FINISHED'), 'the end of the motion')
    assert not rig.verdicts('FAILED')
