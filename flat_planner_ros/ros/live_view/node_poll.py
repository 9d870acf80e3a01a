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

"""Which nodes are there and what their parameters are, asked for again and again."""

from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from time import monotonic
from typing import Any

from flat_planner_ros.ros.live_view.feed import Feed
from flat_planner_ros.ros.live_view.page_settings import ROWS, SETTINGS, SHOWN
from flat_planner_ros.ros.parameters.limits import LIMITS
from flat_planner_ros.ros.wire import interfaces
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient

PERIOD = 1.0
"""Time between two looks at nodes and parameters [s]."""

PATIENCE = 5.0
"""Time after which a question without an answer is asked again [s]."""

NODES = (interfaces.PLANNER, interfaces.PLANT, interfaces.MONITOR)

LINK_LENGTH, STIFFNESS, JOINTS = 'model.link_length', 'model.stiffness', 'joints'


class NodePoll:
    """
    Looks at the nodes that the page shows, and at their parameters.

    Parameters
    ----------
    node
        Asks.
    feed
        Is told.
    use_joints
        Is called with the joints that the planner names.

    Attributes
    ----------
    clients
        Of the nodes' parameters, by their names.

    """

    def __init__(
        self, node: Node, feed: Feed, use_joints: Callable[[Sequence[str]], None]
    ) -> None:
        self._node = node
        self._feed = feed
        self._use_joints = use_joints
        self._asked: dict[str, float] = {}
        self.clients = {name: AsyncParameterClient(node, name) for name in NODES}
        node.create_timer(PERIOD, self._on_poll, clock=Clock(clock_type=ClockType.STEADY_TIME))

    async def ask(self, name: str) -> None:
        """Tell the parameters of a node that the page shows."""
        known = await self._values(name, (*SETTINGS[name], *SHOWN[name]))
        self._feed.put(f'settings of {name}', known)
        if name == interfaces.PLANNER:
            await self._ask_for_arm()
        self._asked.pop(name, None)

    async def _ask_for_arm(self) -> None:
        """Tell what the picture of the arm and the plots need."""
        limits = {name: f'limits.{name}' for name in LIMITS}
        names = (LINK_LENGTH, STIFFNESS, JOINTS, *limits.values())
        known = await self._values(interfaces.PLANNER, names)
        # None where the model is reduced: it has no lengths for the last two links.
        self._feed.put('links', known.get(LINK_LENGTH))
        self._feed.put('stiffness', known.get(STIFFNESS))
        self._feed.put('limits', {key: known.get(name) for key, name in limits.items()})
        # A message may have named a part of the joints only.
        if known.get(JOINTS):
            self._use_joints(known[JOINTS])

    async def _values(self, name: str, names: Sequence[str]) -> Mapping[str, Any]:
        """Return parameters of a node as JSON knows them; what has no value is left out."""
        rows = ROWS[name]
        # A parameter without a value would leave the others of the same question unanswered.
        alone = [key for key in names if isinstance(rows[key].given, Parameter.Type)]
        together = [key for key in names if key not in alone]
        known: dict[str, Any] = {}
        for question in filter(None, (together, *([key] for key in alone))):
            values = (await self.clients[name].get_parameters(question)).values
            answers = [_plain(parameter_value_to_python(value)) for value in values]
            known |= dict(zip(question, answers, strict=False))
        return known

    def _on_poll(self) -> None:
        """See which nodes are there and ask those that have answered before."""
        ready = {name: client.services_are_ready() for name, client in self.clients.items()}
        self._feed.put('nodes', ready)
        for name in SETTINGS:
            is_asked = monotonic() - self._asked.get(name, -PATIENCE) < PATIENCE
            if not ready[name]:
                self._asked.pop(name, None)
                self._feed.put(f'settings of {name}', None)
            elif not is_asked and self._node.executor is not None:
                self._asked[name] = monotonic()
                self._node.executor.create_task(self.ask(name))


def _plain(value: Any) -> Any:
    """Return a parameter's value as JSON knows it: null where there is no limit."""
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, str | bool | int) or value is None:
        return value
    return [_plain(entry) for entry in value]
