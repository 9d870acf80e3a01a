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

"""The planner as a server of FollowJointTrajectory, for motion planners and other clients."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from flat_planner_ros.core.session import Ended, Outcome, PlannerSession
from flat_planner_ros.ros.nodes.goal_queue import GoalQueue
from flat_planner_ros.ros.nodes.guarded_callbacks import GuardedNode
from flat_planner_ros.ros.wire import follow_joint_trajectory as action
from flat_planner_ros.ros.wire import interfaces
from rclpy.action import ActionServer, CancelResponse

FEEDBACK_PERIOD = 0.05
"""Time between two messages of feedback [s], as joint_trajectory_controller has it."""

NOT_FINISHED = -1
"""Code of a goal that gave way to something else; the status has 0, which clients misread."""

PLANNED_ONLY = 'it was planned, but nothing moves: execute is false'
"""What is said of goals that no command follows."""


@dataclass
class _OpenGoal:
    """
    A goal whose client waits for the result.

    Attributes
    ----------
    handle
        Of rclpy.
    plan_id
        Number of its motion, None until it has one.
    outcome, code, words
        How it has ended; no words before.

    """

    handle: Any
    plan_id: int | None = None
    outcome: Outcome = Outcome.FAILED
    code: int = 0
    words: str = ''

    def end(self, outcome: Outcome, values: Mapping[str, str], words: str) -> None:
        """Note how it has ended, with the values and the sentence of a status."""
        self.outcome = outcome
        self.code = int(values['error_code'])
        self.words = words


class TrajectoryServer:
    """
    Hands goals to the planner, and the ends of their motions to the clients.

    Every goal is accepted at first and aborted if the planner rejects it: a client that is
    rejected learns no reason. Results are set with the ticks, after the request that a cancelled
    goal is cancelled by has been served.

    Parameters
    ----------
    node
        Node that plans.
    session
        Session that knows what is under way.
    goals
        Queue that gives goals their verdicts.
    stop
        Brings the arm to rest early; returns whether it does, and a sentence.

    Raises
    ------
    UnknownType
        control_msgs is not installed.

    """

    def __init__(
        self,
        node: GuardedNode,
        session: PlannerSession,
        goals: GoalQueue,
        stop: Callable[[], tuple[bool, str]],
    ) -> None:
        self._node = node
        self._session = session
        self._goals = goals
        self._stop = stop
        self._open: list[_OpenGoal] = []
        self._told = 0.0
        name = interfaces.FOLLOW
        self._server = ActionServer(
            node,
            action.action_type(),
            name,
            execute_callback=lambda _: action.result(NOT_FINISHED, 'it was not worked on'),
            handle_accepted_callback=node.guarded(self._on_goal, f'a goal of {name}'),
            cancel_callback=node.guarded(self._on_cancel, f'a cancellation of {name}'),
        )

    def ended(self, ended: Ended, values: Mapping[str, str], words: str) -> None:
        """Take how a motion has ended, and what is said of it."""
        for goal in self._open:
            if goal.plan_id == ended.motion.plan_id and not goal.words:
                goal.end(ended.outcome, values, words)

    def close(self) -> None:
        """End the action: it does not end with its node."""
        self._server.destroy()

    def tick(self, now: float) -> None:
        """Send results, and feedback at its rate; the present time [s]."""
        for goal in [goal for goal in self._open if goal.words]:
            self._open.remove(goal)
            goal.handle.execute(partial(self._finish, goal))
        if self._open and not 0.0 <= now - self._told < FEEDBACK_PERIOD:
            self._told = now
            self._tell(now)

    def _on_goal(self, handle: Any) -> None:
        """Let the planner answer a goal, now or when it knows the start."""
        goal = _OpenGoal(handle)
        self._open.append(goal)
        self._goals.put(
            partial(action.planner_goal, handle.request), partial(self._on_verdict, goal)
        )

    def _on_verdict(self, goal: _OpenGoal, values: Mapping[str, str], words: str) -> None:
        """Take the planner's verdict on a goal."""
        if values['state'] == 'REJECTED':
            goal.end(Outcome.FAILED, values, words)
        elif not self._session.settings.execute:
            goal.words, goal.code = PLANNED_ONLY, NOT_FINISHED
        else:
            goal.plan_id = int(values['plan_id'])

    def _on_cancel(self, _: Any) -> CancelResponse:
        """Bring the arm to rest; refuse where it comes to rest as soon as it is."""
        is_stopping, words = self._stop()
        if is_stopping:
            return CancelResponse.ACCEPT
        self._node.get_logger().debug(words)
        return CancelResponse.REJECT

    def _finish(self, goal: _OpenGoal, handle: Any) -> Any:
        """Set the final state of a goal; return its result."""
        code = goal.code
        gave_way = goal.outcome in (Outcome.STOPPED, Outcome.PREEMPTED)
        if goal.outcome is Outcome.FINISHED:
            handle.succeed()
        elif gave_way and handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
            code = code or NOT_FINISHED
        return action.result(code, goal.words)

    def _tell(self, now: float) -> None:
        """Publish the reference of the motion under way to the client that has asked for it."""
        motion = self._session.under_way(now)
        for goal in self._open:
            if motion is not None and goal.plan_id == motion.plan_id:
                joints = self._session.settings.joints
                said = action.feedback(joints, motion, self._session.measured, now)
                goal.handle.publish_feedback(said)
