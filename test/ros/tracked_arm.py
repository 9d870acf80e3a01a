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

"""A planner in the test's process; a tracker and its arm in processes of their own."""

from math import tau
from time import monotonic

from flat_planner_ros.ros.nodes.planner_node import PlannerNode
import numpy as np
import pytest
from ros.conftest import TIMEOUT
from ros.rig import COMMAND, Rig, stamp
from std_msgs.msg import Float64MultiArray

START_DELAY = 1.0
"""From a verdict to the motion [s]; a tracker that has just started hears the arm by then."""

EFFORTS = '/flat_tracker/effort_commands'
ELDER = 'another tracker moves this arm and was started before'

RATE = 250.0
"""Joint states and efforts per second of simulated time [Hz]."""

PLANT = {
    'input': 'tracker',
    'input_timeout': 0.2,
    'publish_rate': RATE,
    'publish_clock': 'true',
    'real_time_factor': 0.5,  # a busy machine has 8 ms for a period
    'encoder.resolution': tau / 2**14,
}
TRACKER = {'use_sim_time': 'true', 'rate': RATE, 'timeout': 0.4, 'max_age': 0.2}


def arguments(values):
    """Return parameters as a command line."""
    given = [('-p', f'{name}:={value}') for name, value in values.items()]
    return ['--ros-args', *(part for pair in given for part in pair)]


class Tracked(Rig):
    """A planner in the test, a plant and a tracker in processes of their own."""

    def __init__(self, graph, **mismatch):
        """Start them and wait for the first joint state."""
        super().__init__(graph)
        self.sent = self.hear(Float64MultiArray, EFFORTS, matched=False)
        self.hear_plant(matched=False)
        settings = {'start_delay': START_DELAY, 'use_sim_time': True}
        self.planner = graph.create(PlannerNode, settings)
        self.hear_planner()
        self.plant = graph.start('plant_node', *arguments({**PLANT, **mismatch}))
        self.start_tracker()
        graph.expect(lambda: self.states, 'a joint state')

    def start_tracker(self, **given):
        """Start a tracker, with other parameters if `given`, and wait until it hears commands."""
        known = self._trackers()
        self.tracker = self.graph.start('tracker_node', *arguments({**TRACKER, **given}))
        self.graph.expect(lambda: self._trackers() - known, 'a tracker')

    def _trackers(self):
        """Return the ends of the trackers that commands are sent to."""
        readers = self.graph.probe.get_subscriptions_info_by_topic(COMMAND)
        return {bytes(r.endpoint_gid) for r in readers if r.node_name == 'flat_tracker'}

    def pass_time(self, duration):
        """Let simulated time [s] pass."""
        self.wait_until(stamp(self.states[-1]) + duration)

    def await_silence(self):
        """Wait until no more efforts come; those on their way may be late on a busy machine."""
        until = monotonic() + TIMEOUT
        count = -1
        while len(self.sent) > count:
            assert monotonic() < until, 'efforts go on'
            count = len(self.sent)
            self.pass_time(0.1)

    def move_until_rivals_meet(self, *positions):
        """Move until a tracker leaves it to another, which may not hear at first; return where."""
        return self.move_until(
            self.has_met, 'a tracker that leaves the arm to another', *positions
        )

    def move_until(self, condition, what, *positions):
        """Move, to one position after the other, until a condition holds; return where to."""
        for position in positions:
            self.move(position)
            self.graph.spin_until(lambda: condition() or stamp(self.states[-1]) > self.end)
            if condition():
                return position
        return pytest.fail(f'in none of {len(positions)} motions: {what}')

    def has_met(self):
        """Return whether a tracker leaves the arm to another."""
        return bool(self.graph.logged(ELDER))

    def errors(self, time, position):
        """Return the largest error and swing from a time on [rad]."""
        late = [state.position for state in self.states if stamp(state) >= time]
        return np.abs(np.array(late) - [position, 0.0]).max(axis=0)
