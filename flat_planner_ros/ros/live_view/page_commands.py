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

"""What browsers ask for: goals, parameters and services, carried out on the graph."""

from collections.abc import Mapping, Sequence
from typing import Any

from flat_planner_ros.core.arm import InvalidRequest
from flat_planner_ros.ros.live_view.node_poll import NodePoll
from flat_planner_ros.ros.live_view.page_settings import (
    checked_value,
    list_within,
    number_within,
    SETTINGS,
)
from flat_planner_ros.ros.live_view.status_news import TEXT_LIMIT, Verdicts
from flat_planner_ros.ros.wire import interfaces, stamps
from flat_planner_ros.ros.wire.verdict_text import list_text
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

SERVICES = {
    'replan': interfaces.topic_of(interfaces.PLANNER, interfaces.REPLAN),
    'stop': interfaces.topic_of(interfaces.PLANNER, interfaces.STOP),
    'settle': interfaces.topic_of(interfaces.PLANNER, interfaces.SETTLE),
    'adopt': interfaces.topic_of(interfaces.PLANNER, interfaces.ADOPT),
    'reset': interfaces.topic_of(interfaces.PLANT, interfaces.RESET),
    'release': interfaces.topic_of(interfaces.TRACKER, interfaces.RELEASE),
}
"""Services that the page calls, by the names of its buttons."""

MAX_VIA = 50
"""Most via points of a goal, as the planner takes them [-]."""


class PageCommands:
    """
    Carries out what browsers ask for.

    Parameters
    ----------
    node
        Publishes and calls.
    poll
        Knows the nodes' parameters.
    verdicts
        Has the answers to goals.

    Attributes
    ----------
    joints
        The arm's joints, the passive one last; empty while they are not known.

    """

    def __init__(self, node: Node, poll: NodePoll, verdicts: Verdicts) -> None:
        self.joints: Sequence[str] = ()
        self._poll = poll
        self._verdicts = verdicts
        self._goals = node.create_publisher(
            JointTrajectory,
            interfaces.topic_of(interfaces.PLANNER, interfaces.GOAL),
            interfaces.RELIABLE,
        )
        self._pushes = node.create_publisher(
            Float64MultiArray,
            interfaces.topic_of(interfaces.PLANT, interfaces.PUSH),
            interfaces.RELIABLE,
        )
        self._triggers = {
            name: node.create_client(Trigger, service) for name, service in SERVICES.items()
        }

    async def carry_out(self, command: Any) -> tuple[bool, str]:
        """
        Do what a browser asks for; return whether it was done, and a sentence on it.

        Raises
        ------
        FlatPlannerError
            It makes no sense, or nobody is there to do it.

        """
        if not isinstance(command, Mapping):
            raise InvalidRequest('a command is an object')
        deed = command.get('do')
        if deed == 'goal':
            return await self._send_goal(command)
        if deed == 'set':
            return await self._set(command.get('node'), command.get('values'))
        if deed == 'call':
            return await self._call(command.get('service'))
        if deed == 'push':
            return self._push(command.get('efforts'))
        raise InvalidRequest(f'unknown command {str(deed)[:TEXT_LIMIT]!r}')

    async def _send_goal(self, command: Mapping[str, Any]) -> tuple[bool, str]:
        """Publish a goal for the actuated joints; return its verdict."""
        joints = list(self.joints[:-1])
        if not joints:
            raise InvalidRequest('the joints are not known yet: no joint states, no plan')
        via = list_within(command.get('via', []), 'via', MAX_VIA)
        final = _point(joints, command.get('positions'), command.get('duration'), 'duration')
        points = [_via_point(joints, entry) for entry in via]
        if not self._goals.get_subscription_count():
            raise InvalidRequest('no planner is there to hear the goal')
        verdict = self._verdicts.expect(list_text(final.positions))
        self._goals.publish(JointTrajectory(joint_names=joints, points=[*points, final]))
        answer: tuple[bool, str] = await verdict
        return answer

    async def _set(self, node: Any, values: Any) -> tuple[bool, str]:
        """Set parameters of a node, all of them or none."""
        if node not in SETTINGS or not isinstance(values, Mapping) or not values:
            raise InvalidRequest('no such node, or no parameters')
        client = self._poll.clients[node]
        if not client.services_are_ready():
            raise InvalidRequest(f'{node} is not there')
        parameters = []
        for name, value in values.items():
            if name not in SETTINGS[node]:
                raise InvalidRequest(f'{str(name)[:TEXT_LIMIT]} cannot be set here')
            parameters.append(Parameter(name, value=checked_value(node, name, value)))
        result = (await client.set_parameters_atomically(parameters)).result
        await self._poll.ask(node)
        if not result.successful:
            return False, result.reason
        return True, ', '.join(f'{name} = {value}' for name, value in values.items())

    def _push(self, efforts: Any) -> tuple[bool, str]:
        """Push the simulated arm for a moment."""
        if not self._pushes.get_subscription_count():
            raise InvalidRequest('no simulated arm is there to be pushed')
        numbers = list_within(efforts, 'efforts', len(self.joints))
        data = [number_within(effort, 'effort') for effort in numbers]
        self._pushes.publish(Float64MultiArray(data=data))
        return True, 'pushed'

    async def _call(self, service: Any) -> tuple[bool, str]:
        """Call a service."""
        if service not in SERVICES:
            raise InvalidRequest('no such service')
        client = self._triggers[service]
        if not client.service_is_ready():
            raise InvalidRequest(f'{SERVICES[service]} is not there')
        response = await client.call_async(Trigger.Request())
        return response.success, response.message


def _via_point(joints: Sequence[str], entry: Any) -> JointTrajectoryPoint:
    """Return a point that is passed on the way."""
    if not isinstance(entry, Mapping):
        raise InvalidRequest('a via point is an object with positions and time')
    return _point(joints, entry.get('positions'), entry.get('time'), 'time of a via point')


def _point(joints: Sequence[str], positions: Any, time: Any, meaning: str) -> JointTrajectoryPoint:
    """Return a point of a goal."""
    if not isinstance(positions, list) or len(positions) != len(joints):
        raise InvalidRequest(f'a goal needs {len(joints)} positions, {", ".join(joints)}')
    seconds = number_within(time, meaning, lower=0.0, upper=1e6)
    return JointTrajectoryPoint(
        positions=[
            number_within(value, name, lower=-1e9, upper=1e9)
            for value, name in zip(positions, joints, strict=True)
        ],
        time_from_start=stamps.duration_msg(seconds),
    )
