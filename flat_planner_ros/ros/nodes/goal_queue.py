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

"""Queue of goals: those that come before the first joint state wait for it, bounded."""

from collections import deque
from collections.abc import Callable, Mapping
from time import monotonic

from flat_planner_ros.core.planning import RequestRejected
from flat_planner_ros.core.session import Goal, PlannerSession
from flat_planner_ros.ros.wire import interfaces, stamps
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

LOOK_PERIOD = 0.05
"""Time between two looks for goals that have waited long enough [s]."""

Read = Callable[[], Goal]
"""What reads a goal; may refuse it."""

Tell = Callable[[Mapping[str, str], str], object]
"""What else is to be told the verdict on a goal: its values, and its sentence."""


def tell_nobody(_: Mapping[str, str], __: str) -> None:
    """Leave a verdict to those who listen to the status."""


class GoalQueue:
    """
    Hands goals on in the order of arrival: at once, or when the session can judge them.

    Parameters
    ----------
    node
        Node whose clock is used.
    session
        Session that knows how long a goal may wait.
    answer
        Gives a goal its verdict, and tells it.

    """

    def __init__(
        self, node: Node, session: PlannerSession, answer: Callable[[Read, Tell], object]
    ) -> None:
        self._node = node
        self._session = session
        self._answer = answer
        self._waiting: deque[tuple[Read, Tell, float]] = deque()
        # Steady: a simulated clock may be what goals wait for.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(LOOK_PERIOD, self.answer_due, clock=steady)

    def put(self, read: Read, tell: Tell = tell_nobody) -> None:
        """Take a goal."""
        if not self._waiting and self._session.knows_start(stamps.now(self._node.get_clock())):
            self._answer(read, tell)
            return
        self._waiting.append((read, tell, monotonic() + self._patience(read)))
        self.answer_due()

    def answer_due(self) -> None:
        """Hand on all goals that need not wait any longer."""
        while self._waiting and self._is_due(self._waiting[0][-1]):
            self._answer(*self._waiting.popleft()[:-1])

    def answer_all(self) -> None:
        """Hand on all goals, whether they can be judged or not."""
        while self._waiting:
            self._answer(*self._waiting.popleft()[:-1])

    def _is_due(self, until: float) -> bool:
        """Tell whether the first goal, which may wait until a time [s], is to be handed on."""
        return (
            self._session.knows_start(stamps.now(self._node.get_clock()))
            or monotonic() >= until
            or len(self._waiting) > interfaces.BURST.depth
        )

    def _patience(self, read: Read) -> float:
        """Return how long a goal may wait [s]."""
        now = stamps.now(self._node.get_clock())
        if self._session.knows_start(now):
            return 0.0
        try:
            return self._session.patience(read(), now)
        except (RequestRejected, MemoryError):  # its verdict says so
            return 0.0
