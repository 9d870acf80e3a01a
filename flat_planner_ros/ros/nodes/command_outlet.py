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

"""Outlet of commands and plans: what is to be carried out, as executors and viewers take it."""

from flat_planner_ros.core.session import PlannerSession, Track
from flat_planner_ros.ros.nodes.controller_client import ControllerClient
from flat_planner_ros.ros.nodes.graph_watch import Audience, listeners
from flat_planner_ros.ros.nodes.guarded_callbacks import GuardedNode
from flat_planner_ros.ros.parameters.planner import PlannerSettings
from flat_planner_ros.ros.wire import conversions, interfaces
from flat_planner_ros.ros.wire.command_form import WHOLE
from flat_planner_ros.ros.wire.message_types import message_class, UnknownType
from rclpy.clock import Clock, ClockType

JOINT_TRAJECTORY = 'trajectory_msgs/msg/JointTrajectory'
EFFORTS = 'std_msgs/msg/Float64MultiArray'

LOOK_PERIOD = 0.1
"""Time between two looks for those who listen to flat outputs [s]."""


class CommandOutlet:
    """
    Sends commands, on their topic or as goals of a controller; publishes plans and flat plans.

    Parameters
    ----------
    node
        Node that plans.
    session
        Session that is told what a controller answers.
    action
        Name of the controller's action; empty for the topic.

    Attributes
    ----------
    efforts
        Publisher of the stream of efforts, which is another way to the arm.

    Raises
    ------
    UnknownType
        An action is asked for, and control_msgs is not installed.

    """

    def __init__(self, node: GuardedNode, session: PlannerSession, action: str) -> None:
        self._node = node
        self._audience = Audience(node)
        self._controller = _controller(node, session, action) if action else None
        kind = message_class(JOINT_TRAJECTORY)
        self._command = node.create_publisher(kind, interfaces.COMMAND, interfaces.RELIABLE)
        self._plan = node.create_publisher(kind, interfaces.PLAN, interfaces.LATCHED)
        self._flat_plan = node.create_publisher(kind, interfaces.FLAT_PLAN, interfaces.LATCHED)
        self._kept: Track | None = None
        self._kept_plan: bytes | None = None
        # Steady: those who come while a simulated clock stands still hear it, too.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(LOOK_PERIOD, self._publish_flat, clock=steady)
        self.efforts = node.create_publisher(
            message_class(EFFORTS), interfaces.EFFORT_COMMANDS, interfaces.RELIABLE
        )

    def publish(self, track: Track, settings: PlannerSettings) -> None:
        """Publish a command, whose start is near; where there is none, the plan at once."""
        joints = settings.session.joints
        plan = conversions.command_bytes(track, joints)
        if settings.session.execute:
            command = plan
            if settings.command != WHOLE:
                command = conversions.command_bytes(track, joints, settings.command)
            if self._controller is None:
                self._command.publish(command)
            else:
                self._controller.send(command)
        self._kept, self._kept_plan = track, plan
        if not settings.session.execute:
            self._publish_plan()

    def publish_plans(self) -> None:
        """Publish the plan and the flat outputs of the same: whatever is urgent goes first."""
        self._publish_plan()
        self._publish_flat()

    def _publish_plan(self) -> None:
        """Publish the plan, unless that has been done."""
        if self._kept_plan is not None:
            self._plan.publish(self._kept_plan)
            self._kept_plan = None

    def _publish_flat(self) -> None:
        """Publish the flat outputs that nobody has heard, if anybody listens by now."""
        track = self._kept
        if track is not None and self._flat_plan.get_subscription_count() > 0:
            self._kept = None
            self._flat_plan.publish(conversions.flat_plan_bytes(track))

    def controllers(self) -> list[str]:
        """Return the full names of the nodes that carry out commands, as far as is known."""
        if self._controller is None:
            return listeners(self._node, interfaces.COMMAND)
        return [self._controller.node_name]

    def close(self) -> None:
        """Leave a controller alone with what it was sent."""
        if self._controller is not None:
            self._controller.close()

    def doubt(self, settings: PlannerSettings) -> str:
        """Return that nobody hears the commands, a clause; empty if somebody does or need not."""
        if not settings.session.execute:
            return ''
        if self._controller is not None:
            return self._controller.doubt
        streams = [self.efforts] if settings.stream_effort else []
        return self._audience.unheard(self._command, *streams)


def _controller(node: GuardedNode, session: PlannerSession, action: str) -> ControllerClient:
    """Return the client of a controller's action."""
    try:
        return ControllerClient(node, session, action)
    except UnknownType as error:
        raise UnknownType(
            f'command.interface: action needs control_msgs ({error}): install '
            f'ros-$ROS_DISTRO-control-msgs, or set command.interface: topic'
        ) from error
