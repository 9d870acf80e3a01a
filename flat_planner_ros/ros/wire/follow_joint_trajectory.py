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

"""FollowJointTrajectory of control_msgs, which need not be installed: goals, answers, feedback."""

from importlib import import_module
from typing import Any

from action_msgs.msg import GoalStatus
from flat_planner_ros.core.arm import JointSample
from flat_planner_ros.core.planning import PlanSamples, Reason, RequestRejected
from flat_planner_ros.core.session import Goal, Motion, path_goal, Shortfall
from flat_planner_ros.ros.wire import stamps
from flat_planner_ros.ros.wire.conversions import goal_of_trajectory
from flat_planner_ros.ros.wire.interfaces import ERROR_CODES
from flat_planner_ros.ros.wire.message_types import UnknownType
from rclpy.serialization import deserialize_message
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

ABSENT = 'control_msgs is not installed: there are no actions'
"""What is said where neither goals of an action can be taken nor commands sent as such."""

ENDS = {
    GoalStatus.STATUS_ABORTED: 'aborted',
    GoalStatus.STATUS_CANCELED: 'cancelled',
}
"""What a controller has done to a goal that it has not carried out."""

OWN_REASONS = {
    ERROR_CODES[reason]: reason
    for reason in (Reason.PATH_TOLERANCE_VIOLATED, Reason.GOAL_TOLERANCE_VIOLATED)
}
"""Reasons by which a controller gives up a motion that it has begun, by its codes."""


def action_type() -> Any:
    """
    Return the type of the action.

    Raises
    ------
    UnknownType
        control_msgs is not installed.

    """
    try:
        return import_module('control_msgs.action').FollowJointTrajectory
    except ImportError as error:
        raise UnknownType(ABSENT) from error


def planner_goal(request: Any) -> Goal:
    """
    Return what the goal of an action asks of the planner, unchecked.

    Raises
    ------
    RequestRejected
        It asks for joints of several degrees of freedom.

    """
    others = request.multi_dof_trajectory
    if others.joint_names or others.points:
        raise RequestRejected(
            Reason.INVALID_GOAL, 'the arm has no joints for a multi_dof_trajectory; leave it out'
        )
    return path_goal(goal_of_trajectory(request.trajectory))


def controller_goal(command: bytes) -> Any:
    """Return a goal for a controller whose trajectory is a serialised command."""
    goal = action_type().Goal()
    goal.trajectory = deserialize_message(command, JointTrajectory)
    return goal


def result(code: int, words: str) -> Any:
    """Return the result of a goal."""
    return action_type().Result(error_code=code, error_string=words)


def has_succeeded(answer: Any) -> bool:
    """Tell whether a controller says that it has carried out a goal."""
    return bool(answer.status == GoalStatus.STATUS_SUCCEEDED)


def words_of(answer: Any) -> str:
    """Return what a controller says of a goal that it has carried out, a clause."""
    said = answer.result.error_string.strip()
    return f'the controller has succeeded{f": {said}" if said else ""}'


def shortfall_of(answer: Any, name: str) -> Shortfall:
    """Return why a controller, named, has not carried out a goal, in its words."""
    end = ENDS.get(answer.status, f'ended (status {answer.status})')
    code, said = answer.result.error_code, answer.result.error_string.strip()
    words = f': {said}' if said else ', without a word'
    return Shortfall(
        OWN_REASONS.get(code, Reason.CONTROLLER_FAILED),
        f'{name} has {end} it (error code {code}){words}',
        '',
        float(code),
        0.0,
    )


def feedback(
    joints: tuple[str, ...], motion: Motion, measured: JointSample | None, now: float
) -> Any:
    """Return the reference of a motion at the present time [s], and what is measured."""
    planned = motion.reference(now)
    message = action_type().Feedback(joint_names=list(joints))
    message.header.stamp = stamps.time_msg(now)
    message.desired = _reference_point(planned, now - motion.start)
    if measured is not None:
        message.actual = JointTrajectoryPoint(positions=measured.positions.tolist())
        message.error.positions = (planned.positions[0] - measured.positions).tolist()
        if measured.velocities is not None:
            message.actual.velocities = measured.velocities.tolist()
            message.error.velocities = (planned.velocities[0] - measured.velocities).tolist()
    return message


def _reference_point(planned: PlanSamples, elapsed: float) -> JointTrajectoryPoint:
    """Return what is planned for a time [s] after the start."""
    return JointTrajectoryPoint(
        positions=planned.positions[0].tolist(),
        velocities=planned.velocities[0].tolist(),
        accelerations=planned.accelerations[0].tolist(),
        effort=planned.efforts[0].tolist(),
        time_from_start=stamps.duration_msg(elapsed),
    )
