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

"""Which of several nodes that would move one arm lets go of it."""

from collections import deque
from collections.abc import Callable, Iterable
from math import inf
from time import time_ns
from typing import Any, NamedTuple
from uuid import uuid4

from flat_planner_ros.ros.wire import interfaces, stamps
from flat_planner_ros.ros.wire.message_types import message_class
from flat_planner_ros.ros.wire.verdict_text import values_of
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

LOOK_PERIOD = 0.5
"""Time between two looks at the graph [s]."""

REMEMBERED = 500
"""Messages of one's own that are recognised when they come back: a second of them."""

ALIVE = 3.0
"""Time after its last word for which a twin counts as alive [s]; it speaks once a second."""

INTRODUCTION = 2.0
"""Time in which a node of the same name is to say what it is, once it is listed [s]."""

PATIENCE = 5.0
"""Time for which a younger twin may go on sending efforts [s]."""


UNNAMED = '_NODE_NAME_UNKNOWN_'
"""What the graph calls a node whose publisher it has heard of before; one without ROS keeps it."""


def are_twins(name: str, publishers: Iterable[str]) -> bool:
    """Tell whether all nodes that publish are, or may turn out to be, of one name."""
    return {name, UNNAMED}.issuperset(publishers)


class Seniority(NamedTuple):
    """
    What a node says of itself: the efforts that it sends, and since when it lives.

    Attributes
    ----------
    topic
        With its namespace.
    started
        Time of its start [ns].
    token
        Different from any other node's.

    """

    topic: str
    started: int
    token: str

    @classmethod
    def of(cls, text: str) -> 'Seniority | None':
        """Return what a text says, None if it is no such text."""
        parts = text.split()
        if len(parts) != 3 or not parts[1].isdecimal():
            return None
        return cls(parts[0], int(parts[1]), parts[2])

    def is_elder(self, other: 'Seniority') -> bool:
        """Tell whether this one goes on where there are two."""
        return self[1:] < other[1:]


class RivalWatch:
    """
    Looks who else publishes the efforts of a node, and decides who lets go: exactly one goes on.

    Of twins, which are nodes of the same name, the one that was started first goes on, and every
    other one keeps silent while that one lives: both letting go would leave an arm in motion to
    itself. Whoever else sends efforts knows nothing of this, and has the arm. Publishers of killed
    nodes stay listed for a while: what counts is what is heard.

    Parameters
    ----------
    node
        Node that publishes.
    publisher
        Its publisher of `Float64MultiArray`.
    on_elder
        Called when an elder twin is first heard.
    on_rival
        Called for each message of somebody else.
    introduce
        Publishes what the node does, with its `seniority`, on `/diagnostics`.

    """

    def __init__(
        self,
        node: Node,
        publisher: Any,
        *,
        on_elder: Callable[[], object],
        on_rival: Callable[[], object],
        introduce: Callable[[], object],
    ) -> None:
        self._node = node
        self._publisher = publisher
        self._on_elder = on_elder
        self._on_rival = on_rival
        self._introduce = introduce
        self._own = Seniority(publisher.topic_name, time_ns(), uuid4().hex)
        self._listening: list[Any] = []
        self._sent: deque[tuple[float, ...]] = deque(maxlen=REMEMBERED)
        self._are_twins = False
        self._elder = self._younger = -inf
        self._since = self._disturbed = inf
        self._foreign = -inf
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(LOOK_PERIOD, self._look, clock=self._steady)

    @property
    def seniority(self) -> str:
        """Return what the node is to say of itself."""
        return ' '.join(map(str, self._own))

    @property
    def has_elder(self) -> bool:
        """Tell whether another node of the same name was started before, and lives."""
        return self._now() - self._elder < ALIVE

    def sent(self, efforts: tuple[float, ...]) -> None:
        """Take note of a message of one's own."""
        self._sent.append(efforts)

    def _now(self) -> float:
        """Return a time that nobody sets [s]."""
        return stamps.now(self._steady)

    def _look(self) -> None:
        """Listen, and introduce oneself, while another publisher is listed."""
        topic = self._own.topic
        if self._node.count_publishers(topic) > 1:
            infos = self._node.get_publishers_info_by_topic(topic)
            self._are_twins = are_twins(self._node.get_name(), (i.node_name for i in infos))
            if not self._listening:
                self._listen(topic)
            self._introduce()
        elif self._listening:
            for subscription in self._listening:
                self._node.destroy_subscription(subscription)
            self._listening = []

    def _listen(self, topic: str) -> None:
        """Listen to efforts, and to what nodes say of themselves."""
        self._since = self._now()
        health = message_class('diagnostic_msgs/msg/DiagnosticArray')
        listen = self._node.create_subscription
        self._listening = [
            listen(self._publisher.msg_type, topic, self._on_efforts, 10),
            listen(health, interfaces.DIAGNOSTICS, self._on_health, 10),
        ]

    def _on_health(self, msg: Any) -> None:
        """Learn of twins."""
        for status in msg.status:
            other = Seniority.of(values_of(status).get('seniority', ''))
            if other is None or other.topic != self._own.topic or other == self._own:
                continue
            if other.is_elder(self._own):
                is_new = not self.has_elder
                self._elder = self._now()
                if is_new:
                    self._on_elder()
            else:
                self._younger = self._now()

    def _on_efforts(self, msg: Any) -> None:
        """Let go if somebody else sends efforts to whom this node need not be silent."""
        if tuple(msg.data) in self._sent or self.has_elder:
            return
        now = self._now()
        if self._are_twins:
            if now - self._foreign > ALIVE:
                self._disturbed = now
            self._foreign = now
            is_younger = now - self._younger < ALIVE
            allowed = self._disturbed + PATIENCE if is_younger else self._since + INTRODUCTION
            if now < allowed:
                return
        self._on_rival()
