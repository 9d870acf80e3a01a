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

"""Stream of efforts for executors that take one effort after the other, not a trajectory."""

from flat_planner_ros.core.session import Motion, PlannerSession
from flat_planner_ros.ros.wire import conversions, stamps
import numpy as np
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.timer import Timer

FINAL_ZEROS = 10
"""Zeros at the end of a motion: one that is lost leaves no joint driven."""


class EffortStream:
    """
    Publishes the planned effort of the actuated joints while a motion is under way.

    An executor holds each value until the next one arrives. What is sent is therefore the effort
    planned for the middle of that time: the mean over it, but for the effort's curvature.

    Parameters
    ----------
    node
        Node whose clock is used.
    publisher
        Publisher of std_msgs/Float64MultiArray.
    session
        Session that knows what is planned.

    """

    def __init__(self, node: Node, publisher: Publisher, session: PlannerSession) -> None:
        self._node = node
        self._session = session
        self._publisher = publisher
        self._timer: Timer | None = None
        self._period = 0.0
        self._zeros_left = 0
        self._given_up: Motion | None = None

    def configure(self, enabled: bool, period: float) -> None:
        """Stream with a period [s] from now on, or no more."""
        if enabled and self._timer is not None and period == self._period:
            return
        self.end()
        self._period = period
        if enabled:
            self._timer = self._node.create_timer(period, self._on_tick)

    def end(self) -> None:
        """Stop streaming; the last efforts are zero."""
        if self._timer is None:
            return
        self._node.destroy_timer(self._timer)
        self._timer = None
        if self._zeros_left:
            self._publish(np.zeros(len(self._session.settings.joints) - 1))
            self._zeros_left = 0

    def rest(self) -> None:
        """Stream zeros instead of what is left of the present motion."""
        self._given_up = self._session.motion
        self._send_zero()

    def _on_tick(self) -> None:
        """Publish the effort planned for the middle of the coming period."""
        if self._given_up is not None and self._session.motion is self._given_up:
            self._send_zero()
            return
        now = stamps.now(self._node.get_clock())
        is_moving = self._session.moves(now, now + self._period)
        samples = self._session.reference(now + 0.5 * self._period) if is_moving else None
        if samples is not None:
            self._zeros_left = FINAL_ZEROS
            self._publish(samples.efforts[0, :-1])
        else:
            self._send_zero()

    def _send_zero(self) -> None:
        """Publish one of the zeros that follow efforts, if one is left."""
        if self._zeros_left:
            self._zeros_left -= 1
            self._publish(np.zeros(len(self._session.settings.joints) - 1))

    def _publish(self, efforts: np.ndarray) -> None:
        """Publish efforts of the actuated joints [N m]."""
        self._publisher.publish(conversions.effort_msg(efforts))
