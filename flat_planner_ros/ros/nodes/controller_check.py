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

"""Parameters of a controller with which it plays commands otherwise than they are meant."""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

from flat_planner_ros.ros.nodes.guarded_callbacks import GuardedNode
from flat_planner_ros.ros.nodes.node_log import NodeLog
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import GetParameters
from rclpy.client import Client
from rclpy.clock import Clock, ClockType
from rclpy.task import Future

LOOK_PERIOD = 1.0
"""Time between two looks for controllers [s]."""

REPLACEMENT = 'allow_trajectory_replacement'
"""True, the default of joint_trajectory_controller after August 2026, forgets what stamps say."""

WARNING = (
    '{}: {} is true: a command that takes over in motion is played from its first point on '
    'arrival, milliseconds late; set it to false'
)


class ControllerCheck:
    """
    Asks each controller once.

    Parameters
    ----------
    node, log
        Node that sends commands, and where it warns.
    controllers
        Returns the full names of the nodes that may take them.

    """

    def __init__(
        self, node: GuardedNode, log: NodeLog, controllers: Callable[[], Iterable[str]]
    ) -> None:
        self._node = node
        self._log = log
        self._controllers = controllers
        self._asked: dict[str, Client | None] = {}
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(LOOK_PERIOD, self._look, clock=steady)

    def _look(self) -> None:
        """Ask who has not been asked yet, as soon as it answers."""
        for name in set(self._controllers()) - self._asked.keys():
            self._asked[name] = self._client(name)
        for name, client in self._asked.items():
            if client is not None and client.service_is_ready():
                self._asked[name] = None
                future = client.call_async(GetParameters.Request(names=[REPLACEMENT]))
                answered = partial(self._on_answer, name, client)
                future.add_done_callback(self._node.guarded(answered, f'an answer of {name}'))

    def _client(self, name: str) -> Client | None:
        """Return a client for the parameters of a node; None where that is not permitted."""
        try:
            return self._node.create_client(GetParameters, f'{name}/get_parameters')
        except RuntimeError:
            return None

    def _on_answer(self, name: str, client: Client, future: Future) -> None:
        """Warn of a parameter that is set the wrong way; most nodes do not have it."""
        self._node.destroy_client(client)
        answer: Any = future.result()
        if any(v.type == ParameterType.PARAMETER_BOOL and v.bool_value for v in answer.values):
            self._log.warning(WARNING.format(name, REPLACEMENT))
