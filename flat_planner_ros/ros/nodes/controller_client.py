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

"""Commands as goals of a controller's action, and what the controller answers."""

from functools import partial
from typing import Any

from flat_planner_ros.core.planning import Reason
from flat_planner_ros.core.session import PlannerSession, Shortfall
from flat_planner_ros.ros.nodes.guarded_callbacks import GuardedNode
from flat_planner_ros.ros.wire import follow_joint_trajectory as action
from rclpy.action import ActionClient
from rclpy.task import Future

ANSWER = 'an answer of the controller'
"""What is lost where an answer cannot be worked on."""


class ControllerClient:
    """
    Sends each command as a goal; what becomes of the last one belongs to the motion's end.

    A controller gives up a goal for the next one, which says nothing of the motion: answers on
    goals that were followed by another are left alone.

    Parameters
    ----------
    node
        Node that plans.
    session
        Session that is told the answers.
    name
        Of the action, e.g. ``flat_arm_controller/follow_joint_trajectory``.

    Raises
    ------
    UnknownType
        control_msgs is not installed.

    """

    def __init__(self, node: GuardedNode, session: PlannerSession, name: str) -> None:
        self._node = node
        self._session = session
        self._name = node.resolve_topic_name(name)
        self._client = ActionClient(node, action.action_type(), name)
        self._count = 0
        # The client forgets a handle that nobody else holds, and its result with it.
        self._handle: Any = None

    @property
    def doubt(self) -> str:
        """Return that no controller offers the action, a clause; empty if one does."""
        if self._client.server_is_ready():
            return ''
        return f'no controller offers the action {self._name}'

    @property
    def node_name(self) -> str:
        """Return the full name of the controller, whose actions are private by convention."""
        return self._name.rpartition('/')[0]

    def send(self, command: bytes) -> None:
        """Send a serialised command; without a controller its motions fail at once."""
        self._count += 1
        self._handle = None
        if self.doubt:
            self._fail(self.doubt)
            return
        future = self._client.send_goal_async(action.controller_goal(command))
        self._when_done(future, self._on_response)

    def close(self) -> None:
        """Listen to no more answers: the client does not end with its node."""
        self._count += 1
        self._client.destroy()

    def _when_done(self, future: Future, act: Any) -> None:
        """Act on an answer about the present goal."""
        done = partial(self._on_done, self._count, act)
        future.add_done_callback(self._node.guarded(done, ANSWER))

    def _on_done(self, count: int, act: Any, future: Future) -> None:
        """Act on an answer, unless it is about an earlier goal."""
        if count == self._count:
            act(future.result())

    def _on_response(self, handle: Any) -> None:
        """Wait for the result of a goal that was accepted."""
        if not handle.accepted:
            self._fail(f'{self._name} has rejected it; the log of the controller says why')
            return
        self._handle = handle
        self._when_done(handle.get_result_async(), self._on_result)

    def _on_result(self, answer: Any) -> None:
        """Tell the session how the controller has ended."""
        if action.has_succeeded(answer):
            self._session.answered(action.words_of(answer))
        else:
            self._session.give_up(action.shortfall_of(answer, self._name))

    def _fail(self, message: str) -> None:
        """Give up what no controller carries out."""
        self._session.give_up(Shortfall(Reason.CONTROLLER_FAILED, message, '', 0.0, 0.0))
