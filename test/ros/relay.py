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

"""A relay between two topics that loses, repeats, reorders and delays what it passes on."""

from __future__ import annotations

from dataclasses import dataclass
import heapq
from itertools import count
from typing import Any

import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile

PERIOD = 0.01
"""Time between two looks for messages that are due [s]."""

QUEUE = QoSProfile(depth=1000)
"""What comes and goes is lost by intention only."""


@dataclass(frozen=True, kw_only=True)
class Faults:
    """
    What happens to messages.

    Attributes
    ----------
    loss, duplication, reordering
        Probabilities that a message is lost, comes twice, or comes after the one that follows it.
    delay
        Shortest and longest delay, even between them [s].

    """

    loss: float = 0.0
    duplication: float = 0.0
    reordering: float = 0.0
    delay: tuple[float, float] = (0.0, 0.0)


class Relay(Node):
    """
    Passes on messages of one topic to another, not without faults.

    Parameters
    ----------
    message_type, source, target
        What is passed on, from where to where.
    faults
        May be replaced at any time.
    seed
        Of the random numbers.
    options
        As for `rclpy.node.Node`.

    Attributes
    ----------
    received, delivered
        All messages, in the order in which they came and went.

    """

    def __init__(
        self,
        message_type: type,
        source: str,
        target: str,
        *,
        faults: Faults = Faults(),  # noqa: B008  It is frozen.
        seed: int = 0,
        **options: Any,
    ) -> None:
        """Open both ends."""
        super().__init__(
            'relay_to_' + target.strip('/').replace('/', '_'),
            start_parameter_services=False,
            enable_rosout=False,
            **options,
        )
        self.faults = faults
        self.received: list[Any] = []
        self.delivered: list[Any] = []
        self._random = np.random.default_rng(seed)
        self._due: list[tuple[float, int, Any]] = []
        self._held: Any = None
        self._order = count()
        self._system = Clock(clock_type=ClockType.SYSTEM_TIME)
        self.target = self.create_publisher(message_type, target, QUEUE)
        self.source = self.create_subscription(message_type, source, self._on_message, QUEUE)
        self._timer = self.create_timer(
            PERIOD, self._on_tick, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    @property
    def is_idle(self) -> bool:
        """Return whether nothing is on its way."""
        return not self._due and self._held is None

    def _now(self) -> float:
        """Return the time of the clock that stamps messages as they are sent [s]."""
        return self._system.now().nanoseconds * 1e-9

    def _on_message(self, message: Any, info: dict[str, int]) -> None:
        """Decide what becomes of a message."""
        self.received.append(message)
        faults, chance = self.faults, self._random.random
        # As many random numbers for each, so that a seed means the same whatever happens.
        is_lost = chance() < faults.loss
        copies = 2 if chance() < faults.duplication else 1
        is_late = chance() < faults.reordering
        # From when it was sent: a busy machine is no reason to come even later.
        since = min(self._now() - info['source_timestamp'] * 1e-9, faults.delay[1])
        delays = self._random.uniform(*faults.delay, size=2)[:copies] - since
        if is_lost:
            return
        if is_late and self._held is None:
            self._held = message, delays
            self._on_tick()
            return
        self._send(message, delays)
        self._release()

    def _release(self) -> None:
        """Send what was held back."""
        if self._held is not None:
            held, self._held = self._held, None
            self._send(*held)

    def _send(self, message: Any, delays: Any) -> None:
        """Put copies of a message on their way."""
        for delay in delays:
            heapq.heappush(self._due, (self._now() + delay, next(self._order), message))
        self._on_tick()

    def _on_tick(self) -> None:
        """Deliver what is due; with nothing else on its way, nothing is held back for good."""
        while self._due and self._due[0][0] <= self._now():
            _, _, message = heapq.heappop(self._due)
            self.delivered.append(message)
            self.target.publish(message)
        if self.faults.reordering == 0.0:
            self._release()
        if self._timer.is_canceled() and not self.is_idle:
            self._timer.reset()
        elif self.is_idle:
            self._timer.cancel()
