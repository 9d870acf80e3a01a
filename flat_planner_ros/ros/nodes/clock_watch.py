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

"""A clock that jumps: what was planned for its old times is for nobody any more."""

from collections.abc import Callable

from flat_planner_ros.ros.wire import stamps
from flat_planner_ros.ros.wire.point_writer import NANOSECONDS
from rclpy.clock import Clock, ClockChange, ClockType, JumpThreshold, ROSClock, TimeJump
from rclpy.duration import Duration
from rclpy.node import Node

BACK, FORWARD = 0.1, 1.0
"""Jumps of a clock that make its times another's [s]; the plant has the same bounds."""

LOOK_PERIOD = 0.1
"""Time between two comparisons of the computer's clock with its steady one [s]."""


class ClockWatch:
    """
    Tells of jumps of a node's clock.

    A simulated clock jumps when it is set back, and when `use_sim_time` changes. One that is set
    forward cannot be told from one that is seldom heard: what a motion then lacks is measured. The
    computer's clock jumps where the steady one does not.

    Parameters
    ----------
    node
        Node whose clock it is.
    jumped
        Called at once with what the clock has done and the jump [s]; may not ask for the time.
    report
        Called soon after.

    """

    def __init__(
        self, node: Node, jumped: Callable[[str, float], object], report: Callable[[], object]
    ) -> None:
        self._clock = node.get_clock()
        self._jumped = jumped
        self._report = report
        self._is_new = False
        self._offset: float | None = None
        threshold = JumpThreshold(
            min_forward=None, min_backward=Duration(seconds=-BACK), on_clock_change=True
        )
        self._handle = self._clock.create_jump_callback(threshold, post_callback=self._on_jump)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(LOOK_PERIOD, self._on_look, clock=self._steady)

    def _on_jump(self, jump: TimeJump) -> None:
        """Tell of a jump of a simulated clock."""
        delta = jump.delta.nanoseconds / NANOSECONDS
        self._is_new = True
        if jump.clock_change in (ClockChange.ROS_TIME_ACTIVATED, ClockChange.ROS_TIME_DEACTIVATED):
            self._offset = None
            self._jumped('the clock is another one (use_sim_time was changed)', delta)
        else:
            self._jumped(f'the clock was set back by {-delta:.3f} s', delta)

    def _on_look(self) -> None:
        """Report a jump that was told of; look for one of the computer's clock."""
        self._look()
        if self._is_new:
            self._is_new = False
            self._report()

    def _look(self) -> None:
        """Compare the computer's clock with its steady one."""
        if isinstance(self._clock, ROSClock) and self._clock.ros_time_is_active:
            self._offset = None
            return
        offset = stamps.now(self._clock) - stamps.now(self._steady)
        former, self._offset = self._offset, offset
        if former is None:
            return
        jump = offset - former
        if not -BACK <= jump <= FORWARD:
            self._is_new = True
            direction = 'back' if jump < 0.0 else 'forward'
            self._jumped(f'the clock was set {direction} by {abs(jump):.3f} s', jump)
