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

"""
A plant whose clock is ahead of everybody else's.

Usage: ahead_plant.py SECONDS [--ros-args ...].
"""

import sys

from flat_planner_ros.ros.nodes.node_runner import run
from flat_planner_ros.ros.nodes.plant_node import PlantNode
from rclpy.duration import Duration


class AheadClock:
    """The clock of a computer that is set wrong."""

    def __init__(self, clock, ahead):
        """Be ahead by a time [s]."""
        self._clock, self._ahead = clock, Duration(seconds=ahead)

    def now(self):
        """Return the time that this clock shows."""
        return self._clock.now() + self._ahead

    def __getattr__(self, name):
        """Be a clock otherwise."""
        return getattr(self._clock, name)


class AheadPlant(PlantNode):
    """A plant that lives by such a clock."""

    def get_clock(self):
        """Return it."""
        return AheadClock(super().get_clock(), float(sys.argv[1]))


if __name__ == '__main__':
    sys.exit(run([AheadPlant], [sys.argv[0], *sys.argv[2:]]))
