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

"""Watch for a second node that sends what only one may send, and is alive."""

from collections import deque
from collections.abc import Callable
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

LOOK_PERIOD = 0.5
"""Time between two looks at the graph [s]."""

REMEMBERED = 500
"""Messages of one's own that are recognised when they come back: a second of them."""


class RivalWatch:
    """
    Listens to one's own topic where another publisher is listed, which may be dead.

    Parameters
    ----------
    node
        Node that publishes.
    publisher
        Its publisher of `Float64MultiArray`.
    on_rival
        Called for each message of somebody else.

    """

    def __init__(self, node: Node, publisher: Any, on_rival: Callable[[], None]) -> None:
        self._node = node
        self._publisher = publisher
        self._on_rival = on_rival
        self._listening: Any = None
        self._sent: deque[tuple[float, ...]] = deque(maxlen=REMEMBERED)
        node.create_timer(LOOK_PERIOD, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def sent(self, efforts: tuple[float, ...]) -> None:
        """Take note of a message of one's own."""
        self._sent.append(efforts)

    def _look(self) -> None:
        """Listen while another publisher is listed."""
        topic = self._publisher.topic_name
        is_doubled = self._node.count_publishers(topic) > 1
        if is_doubled and self._listening is None:
            kind = self._publisher.msg_type
            self._listening = self._node.create_subscription(kind, topic, self._on_message, 10)
        elif self._listening is not None and not is_doubled:
            self._node.destroy_subscription(self._listening)
            self._listening = None

    def _on_message(self, msg: Any) -> None:
        """Tell one's own messages from others."""
        if tuple(msg.data) not in self._sent:
            self._on_rival()
