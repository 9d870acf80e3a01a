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
"""A planner whose time a test makes."""

from flat_planner_ros.ros.wire import stamps
import pytest
from ros.rig import Planner
from rosgraph_msgs.msg import Clock

LENIENT = {'start.joint_state_timeout': 1e6}


class Timed(Planner):
    """A planner alone, in this process, for which time passes as a test has it."""

    def __init__(self, graph, **parameters):
        """Start it."""
        super().__init__(graph, {'use_sim_time': True, **LENIENT, **parameters})

    def be(self, time):
        """Set the time [s] and wait until the planner has it."""
        clock = Clock(clock=stamps.time_msg(time))
        self.graph.publish('/clock', clock)
        self.graph.expect(lambda: self.now() == pytest.approx(time), 'the time')
