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

"""All three nodes in a process and an executor that are not ours, under a burst of goals."""

from pathlib import Path
import sys

from flat_planner_ros.ros.wire import interfaces
import pytest
from ros.rig import ANSWERS, GOAL, goal, not_verified, Rig, values

GOALS = 20

PATIENCE = 20.0
"""Time in which a burst is answered and carried out, many times what it takes [s]."""

ENDS = ('FINISHED', 'FAILED', 'PREEMPTED', 'STOPPED')

UNSEEN = 'no joint state tells whether the arm is there'
"""What is said of an end that came while joint states waited for their turn."""

PROGRAM = Path(__file__).with_name('foreign_process.py')


@pytest.mark.parametrize('executor', ['SingleThreadedExecutor', 'MultiThreadedExecutor'])
def test_each_goal_of_a_burst_has_one_verdict_and_one_end(graph, executor):
    process = graph.run([sys.executable, str(PROGRAM), executor])
    rig = Rig(graph)
    rig.hear_planner()
    rig.hear_plant()
    graph.expect(lambda: rig.states, 'joint states')
    for number in range(GOALS):
        # A publisher that keeps ten loses the others, where the planner is busy.
        graph.publish(GOAL, goal((number + 1) / GOALS, 0.5), interfaces.BURST)

    def said(*states):
        return [v for v in map(values, rig.status) if v['state'] in states]

    def has_ended():
        return len(said(*ENDS)) == len(said('ACCEPTED'))

    if not graph.spin_until(lambda: len(said(*ANSWERS)) == GOALS and has_ended(), PATIENCE):
        # The status keeps ten: on a very busy machine some may never have been sent.
        count = len(rig.status)
        graph.publish(GOAL, goal(0.0, 0.5), interfaces.BURST)
        graph.expect(lambda: len(rig.status) > count, 'another verdict')
        not_verified('verdicts were lost on their way')
    accepted = [verdict['plan_id'] for verdict in said('ACCEPTED')]
    assert accepted
    assert sorted(verdict['plan_id'] for verdict in said(*ENDS)) == sorted(accepted)
    (last,) = (end for end in said(*ENDS) if end['plan_id'] == accepted[-1])
    wanted = float(said('ACCEPTED')[-1]['goal.positions'].strip('[]'))
    if last['state'] == 'FINISHED' and UNSEEN not in rig.status[-1].status[0].message:
        graph.expect(lambda: abs(rig.states[-1].position[0] - wanted) < 0.11, 'the arm there')
    assert len(said(*ANSWERS)) == GOALS
    assert process.exit_code is None, process.stderr
    assert 'internal error' not in process.stderr
    assert 'Traceback' not in process.stderr
