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

"""Topics that one node alone may publish: whoever else does is named, once a second."""

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from flat_planner_ros.ros.nodes.node_log import NodeLog
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.publisher import Publisher

WATCH_PERIOD = 1.0
"""Time between two looks at the graph, and thus between two errors [s]."""

EXCUSED_LOOKS = 5
"""Looks for which a message about another part explains a second publisher."""

REMARK = 'a killed node stays listed for up to 20 s'
"""Time for which DDS takes a silent participant for alive."""

RECORDERS = ('flat_recorder', 'rosbag2_recorder')
"""Nodes that listen to commands and carry none out."""


def listeners(node: Node, topic: str) -> list[str]:
    """Return the full names of the nodes that carry out what is published on a topic."""
    infos = node.get_subscriptions_info_by_topic(node.resolve_topic_name(topic))
    return [
        f'{info.node_namespace.rstrip("/")}/{info.node_name}'
        for info in infos
        if info.node_name not in RECORDERS
    ]


class Audience:
    """
    Whether anybody carries out what a node publishes.

    Who listens is looked up when their number changes, and once in WATCH_PERIOD beside the goals:
    it takes as long as planning a motion.

    Parameters
    ----------
    node
        Node that publishes.

    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._looks: dict[Publisher, _Look] = {}
        clock = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(WATCH_PERIOD, self._look_again, clock=clock)

    def unheard(self, *publishers: Publisher) -> str:
        """Return that nobody carries out what publishers send, a clause, or nothing."""
        if any(self._is_heard(publisher) for publisher in publishers):
            return ''
        return f'nobody listens to {" or ".join(each.topic_name for each in publishers)}'

    def _is_heard(self, publisher: Publisher) -> bool:
        """Tell whether anybody carries out what a publisher sends."""
        number = publisher.get_subscription_count()
        look = self._looks.get(publisher)
        # Who has just been matched may not be named yet.
        if look is None or number != look.number or not look.is_heard:
            look = self._look(publisher, number)
        return look.is_heard

    def _look_again(self) -> None:
        """Look for those who have taken others' places."""
        for publisher in self._looks:
            self._look(publisher, publisher.get_subscription_count())

    def _look(self, publisher: Publisher, number: int) -> '_Look':
        """Return a new look at what a publisher's topic has, and keep it."""
        look = _Look(number, bool(listeners(self._node, publisher.topic_name)))
        self._looks[publisher] = look
        return look


class _Look(NamedTuple):
    """A look at a topic: number of subscribers, whether one is no recorder."""

    number: int
    is_heard: bool


class GraphWatch:
    """
    Looks for topics with several publishers and says who they are.

    Parameters
    ----------
    node, log
        Node that complains, and where.
    sole
        Topics that may have one publisher.
    shared
        Topics that several nodes may publish, each its part, such as joint states of several
        robots: an error only if one name publishes twice, or if all that was heard for
        EXCUSED_LOOKS was about the same part.
    is_listening
        Whether the node listens to the shared ones and calls `heard_other_part`.

    """

    def __init__(
        self,
        node: Node,
        log: NodeLog,
        sole: Sequence[str],
        shared: Sequence[str] = (),
        *,
        is_listening: bool = False,
    ) -> None:
        self._node = node
        self._log = log
        self._sole = [node.resolve_topic_name(topic) for topic in sole]
        self._shared = [node.resolve_topic_name(topic) for topic in shared]
        self._is_listening = is_listening
        self._looks_to_excuse = 0
        # Steady: whatever the time of the graph does.
        node.create_timer(WATCH_PERIOD, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def heard_other_part(self) -> None:
        """Take note of a message on a shared topic that is not about one's own part."""
        self._looks_to_excuse = EXCUSED_LOOKS

    def _look(self) -> None:
        """Report topics with too many publishers."""
        complaints = [
            f'{topic} is published by {", ".join(names)}'
            for topic in (*self._sole, *self._shared)
            if len(names := self._publishers(topic)) > 1 and self._is_wrong(topic, names)
        ]
        self._looks_to_excuse = max(0, self._looks_to_excuse - 1)
        if complaints:
            self._log.error(f'{"; ".join(complaints)}: only one of them may run ({REMARK})')

    def _publishers(self, topic: str) -> list[str]:
        """Return the full names of the nodes that publish on a topic."""
        if self._node.count_publishers(topic) < 2:
            return []
        infos = self._node.get_publishers_info_by_topic(topic)
        return sorted(f'{info.node_namespace.rstrip("/")}/{info.node_name}' for info in infos)

    def _is_wrong(self, topic: str, names: Sequence[str]) -> bool:
        """Return whether publishers of a topic exclude each other."""
        if topic in self._sole or max(Counter(names).values()) > 1:
            return True
        return self._is_listening and not self._looks_to_excuse
