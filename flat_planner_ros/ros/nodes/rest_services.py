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

"""Services that bring the arm to rest, early or from what is measured."""

from collections.abc import Callable
from functools import partial

from flat_planner_ros.core.arm import FlatPlannerError
from flat_planner_ros.core.session import Motion, PlannerSession
from flat_planner_ros.ros.nodes.goal_queue import GoalQueue
from flat_planner_ros.ros.nodes.guarded_callbacks import GuardedNode
from flat_planner_ros.ros.wire import interfaces, stamps
from std_srvs.srv import Trigger

Act = Callable[[float, Callable[[], float]], Motion | None]
"""What the session does, with the present time [s] and a clock."""


class RestServices:
    """
    Offers `~/stop` and `~/settle`.

    Parameters
    ----------
    node
        Node that plans.
    session
        Session that knows what is under way.
    goals
        Those that wait are answered before.
    carry_out
        Sends the motion that an act of the session returns.

    """

    def __init__(
        self,
        node: GuardedNode,
        session: PlannerSession,
        goals: GoalQueue,
        carry_out: Callable[[str], object],
    ) -> None:
        self._node = node
        self._session = session
        self._goals = goals
        self._carry_out = carry_out
        for service, act in ((interfaces.STOP, self.stop), (interfaces.SETTLE, self.settle)):
            node.create_service(Trigger, service, partial(self._serve, act))

    def stop(self) -> tuple[bool, str]:
        """Bring the arm to rest early; return whether it will be, and a sentence."""
        return self._bring(self._session.stop, 'nothing to stop: no motion is under way')

    def settle(self) -> tuple[bool, str]:
        """Bring the arm to rest from what is measured; return whether, and a sentence."""
        return self._bring(self._session.settle, 'nothing to settle: the arm is at rest')

    def _serve(
        self,
        act: Callable[[], tuple[bool, str]],
        _: Trigger.Request,
        response: Trigger.Response,
    ) -> Trigger.Response:
        """Answer a request."""
        response.success, response.message = act()
        return response

    def _bring(self, act: Act, nothing: str) -> tuple[bool, str]:
        """Send the motion that an act of the session returns, if there is one."""
        self._goals.answer_all()
        try:
            motion = act(self._now(), self._now)
        except FlatPlannerError as error:
            return False, f'not brought to rest: {error}'
        if motion is None:
            return True, nothing
        left = motion.end - self._now()
        message = f'plan {motion.plan_id} comes to rest {left:.3f} s from now'
        self._carry_out(message)
        return True, message

    def _now(self) -> float:
        """Return the present time [s]."""
        return stamps.now(self._node.get_clock())
