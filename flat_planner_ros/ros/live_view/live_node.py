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

"""Live node: what the graph says, for browsers; what browsers want, for the graph."""

import asyncio
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from time import monotonic
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from flat_planner_ros.core.arm import FlatPlannerError, InvalidRequest, JointSample
from flat_planner_ros.ros.live_view.feed import Feed
from flat_planner_ros.ros.live_view.page_settings import (
    checked_value,
    choices,
    number_within,
    SETTINGS,
    SHOWN,
)
from flat_planner_ros.ros.nodes.guarded_callbacks import GuardedNode
from flat_planner_ros.ros.wire import conversions, interfaces, stamps
from flat_planner_ros.ros.wire.joint_states import JointStateReader
from flat_planner_ros.ros.wire.verdict_text import list_text
from rclpy.clock import Clock, ClockType
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.serialization import deserialize_message
from rclpy.task import Future as RosFuture
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

MEASURED, REFERENCE, RESIDUAL = 'measured', 'reference', 'residual'
STREAMS = (MEASURED, REFERENCE, RESIDUAL)
"""Names of the streams; a row is the time, positions, velocities and efforts."""

ROW_PERIOD = 0.01
"""Shortest real time between two rows of a stream [s]; the page shows no more."""

POLL_PERIOD = 1.0
"""Time between two looks at nodes and parameters [s]."""

PATIENCE = 5.0
"""Longest wait for the answer of a node [s]."""

BACKWARD = 0.5
"""Backward step of the stamps from which another time has begun [s]."""

VERDICTS = 20
"""Verdicts that are kept [-]."""

ANSWERS = ('ACCEPTED', 'REJECTED')
"""States of verdicts on goals."""

PREDICTIONS = (
    'predicted_residual',
    'predicted_residual_worst',
    'predicted_residual_box',
    'advice',
)
"""What of a verdict's values the page shows."""

TEXT_LIMIT = 500
"""Longest text of a message that is shown [characters]."""

NODES = (interfaces.PLANNER, interfaces.PLANT, interfaces.MONITOR)

SERVICES = {
    'replan': interfaces.topic_of(interfaces.PLANNER, interfaces.REPLAN),
    'stop': interfaces.topic_of(interfaces.PLANNER, interfaces.STOP),
    'adopt': interfaces.topic_of(interfaces.PLANNER, interfaces.ADOPT),
    'reset': interfaces.topic_of(interfaces.PLANT, interfaces.RESET),
}
"""Services that the page calls, by the names of its buttons."""

LEVELS = {
    DiagnosticStatus.OK: 'ok',
    DiagnosticStatus.WARN: 'warn',
    DiagnosticStatus.ERROR: 'error',
    DiagnosticStatus.STALE: 'stale',
}


class LiveNode(GuardedNode):
    """
    Feeds browsers and carries out what they ask for.

    Parameters
    ----------
    options
        Arguments of `rclpy.node.Node`.

    Attributes
    ----------
    feed
        News for browsers.

    """

    def __init__(self, **options: Any) -> None:
        super().__init__(interfaces.LIVE_VIEW, **options)
        self.feed = Feed(STREAMS)
        self.feed.put('namespace', self.get_namespace())
        self.feed.put('choices', choices())
        self._joints: list[str] = []
        self._readers: dict[str, JointStateReader] = {}
        self._epoch: float | None = None
        self._last = dict.fromkeys(STREAMS, 0.0)
        self._verdicts: deque[dict[str, Any]] = deque(maxlen=VERDICTS)
        self._asked: dict[str, float] = {}
        self._sent: deque[tuple[str, RosFuture]] = deque(maxlen=VERDICTS)
        self._listen()
        self._goals = self.create_publisher(
            JointTrajectory,
            interfaces.topic_of(interfaces.PLANNER, interfaces.GOAL),
            interfaces.RELIABLE,
        )
        self._triggers = {
            name: self.create_client(Trigger, service) for name, service in SERVICES.items()
        }
        self._parameter_clients = {name: AsyncParameterClient(self, name) for name in NODES}
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(POLL_PERIOD, self._on_poll, clock=steady)

    async def obey(self, command: Any) -> tuple[bool, str]:
        """
        Carry out a browser's command; may be awaited in any thread's event loop.

        Returns
        -------
        tuple
            Whether it was carried out, and a sentence on it.

        """
        answer: Future[tuple[bool, str]] = Future()

        async def act() -> None:
            try:
                answer.set_result(await self._carry_out(command))
            except FlatPlannerError as error:
                answer.set_result((False, str(error)))
            except Exception as error:  # noqa: BLE001  The browser waits for an answer.
                answer.set_result((False, f'internal error: {error!r}'))

        if self.executor is None:
            return False, 'the live view is starting or ending'
        self.executor.create_task(act())
        try:
            return await asyncio.wait_for(asyncio.wrap_future(answer), PATIENCE)
        except asyncio.TimeoutError:  # noqa: UP041  Another class on Python 3.10.
            is_goal = isinstance(command, Mapping) and command.get('do') == 'goal'
            # A goal may wait for the first joint state; its verdict comes in the list.
            return is_goal, f'{"sent, but " if is_goal else ""}no answer within {PATIENCE:g} s'

    def _listen(self) -> None:
        """Subscribe to all that the page shows."""
        reference = interfaces.topic_of(interfaces.PLANNER, interfaces.REFERENCE)
        residual = interfaces.topic_of(interfaces.MONITOR, interfaces.RESIDUAL)
        for stream, topic in (
            (MEASURED, interfaces.JOINT_STATES),
            (REFERENCE, reference),
            (RESIDUAL, residual),
        ):
            self.create_subscription(
                JointState, topic, self._receiver(stream), interfaces.SENSOR_DATA, raw=True
            )
        plan = interfaces.topic_of(interfaces.PLANNER, interfaces.PLAN)
        status = interfaces.topic_of(interfaces.PLANNER, interfaces.STATUS)
        report = interfaces.topic_of(interfaces.MONITOR, interfaces.REPORT)
        self.create_subscription(JointTrajectory, plan, self._on_plan, interfaces.LATCHED)
        self.create_subscription(
            DiagnosticArray, status, self._on_status, interfaces.LATCHED_HISTORY
        )
        self.create_subscription(DiagnosticArray, report, self._on_report, interfaces.LATCHED)

    def _receiver(self, stream: str) -> Callable[[bytes], None]:
        """Return the callback of a stream, which reads only what will be shown."""

        def receive(data: bytes) -> None:
            reader = self._readers.get(stream)
            is_due = monotonic() - self._last[stream] >= ROW_PERIOD
            # Of joint states in parts every message counts.
            if is_due or (reader is not None and reader.is_in_parts):
                self._on_state(stream, deserialize_message(data, JointState))

        return receive

    def _on_state(self, stream: str, msg: JointState) -> None:
        """Add a row, unless the last one is too near."""
        if not self._joints:
            self._use_joints(msg.name)
        reader = self._readers[stream]
        with suppress(FlatPlannerError):
            for sample in reader.read(msg, lambda: stamps.now(self.get_clock())):
                now = monotonic()
                if now - self._last[stream] >= ROW_PERIOD:
                    self._last[stream] = now
                    self._show(stream, sample)
        for remark in reader.take_remarks():
            self._log.warning(remark)

    def _show(self, stream: str, sample: JointSample) -> None:
        """Add a row: time, positions, velocities and efforts, NaN where unknown."""
        time = self._relative(sample.time)
        unknown = [float('nan')] * len(self._joints)
        values = (sample.positions, sample.velocities, sample.efforts)
        row = [time]
        for array in values:
            row += unknown if array is None else array.tolist()
        self.feed.append(stream, row)

    def _on_plan(self, msg: JointTrajectory) -> None:
        """Tell when a motion is, and where it ends."""
        try:
            motion = conversions.planned_motion_from_trajectory(msg)
        except FlatPlannerError:
            return
        if tuple(self._joints) != motion.joint_names:
            self._use_joints(motion.joint_names)
        plan = {
            'start': self._relative(motion.start),
            'end': self._relative(motion.end),
            'final': motion.final.tolist(),
        }
        self.feed.put('plan', plan)

    def _on_status(self, msg: DiagnosticArray) -> None:
        """Tell a verdict."""
        for status in msg.status:
            values = _values(status)
            self._verdicts.appendleft(
                {
                    'time': stamps.seconds(msg.header.stamp),
                    'level': LEVELS.get(status.level, 'stale'),
                    'state': values.get('state', ''),
                    'text': status.message[:TEXT_LIMIT],
                    'values': {key: values[key] for key in PREDICTIONS if key in values},
                }
            )
            self._answer_goals(values, status.message)
        self.feed.put('verdicts', list(self._verdicts))

    def _answer_goals(self, values: Mapping[str, str], message: str) -> None:
        """Tell the browser whose goal a verdict is on, the first of those who sent the same."""
        state, positions = values.get('state'), values.get('goal.positions')
        if state not in ANSWERS:
            return
        for sent in self._sent:
            if sent[0] == positions:
                self._sent.remove(sent)
                is_accepted = state == ANSWERS[0]
                sent[1].set_result(
                    (is_accepted, message if is_accepted else f'rejected: {message}')
                )
                return

    def _on_report(self, msg: DiagnosticArray) -> None:
        """Tell what a motion has left."""
        for status in msg.status:
            values = _values(status)
            start, end = values.get('start_time'), values.get('end_time')
            report = {
                'level': LEVELS.get(status.level, 'stale'),
                'text': status.message[:TEXT_LIMIT],
                'values': values,
                'start': None if start is None else self._relative(float(start)),
                'end': None if end is None else self._relative(float(end)),
            }
            self.feed.put('report', report)

    def _use_joints(self, names: Sequence[str]) -> None:
        """Show these joints from now on."""
        self._joints = list(names)
        self._readers = {stream: JointStateReader(names) for stream in STREAMS}
        self.feed.restart()
        self.feed.put('joints', list(names))

    def _relative(self, time: float) -> float:
        """Return a time from the origin of the page's axis, a new one if time has gone back."""
        if self._epoch is None or time < self._epoch - BACKWARD:
            self._epoch = time
            self.feed.restart()
        return round(time - self._epoch, 6)

    def _on_poll(self) -> None:
        """See which nodes are there and what their parameters are."""
        ready = {
            name: client.services_are_ready() for name, client in self._parameter_clients.items()
        }
        self.feed.put('nodes', ready)
        for node in SETTINGS:
            is_asked = monotonic() - self._asked.get(node, -PATIENCE) < PATIENCE
            if not ready[node]:
                self._asked.pop(node, None)
                self.feed.put(f'settings of {node}', None)
            elif not is_asked and self.executor is not None:
                self._asked[node] = monotonic()
                self.executor.create_task(self._ask(node))

    async def _ask(self, node: str) -> None:
        """Tell the parameters of a node."""
        client, names = self._parameter_clients[node], (*SETTINGS[node], SHOWN)
        values = (await client.get_parameters(list(names))).values
        known = dict(zip(names, map(parameter_value_to_python, values), strict=False))
        self.feed.put(f'settings of {node}', known)
        if node == interfaces.PLANNER:
            answers = (await client.get_parameters(['model.link_length', 'joints'])).values
            # Empty where the model is reduced: it has no lengths for the last two links.
            self.feed.put('links', [list(value.double_array_value) for value in answers[:1]])
            # A message may have named a part of them only.
            joints = [name for value in answers[1:] for name in value.string_array_value]
            if joints and joints != self._joints:
                self._use_joints(joints)
        self._asked.pop(node, None)

    async def _carry_out(self, command: Any) -> tuple[bool, str]:
        """Do what a browser asks for."""
        if not isinstance(command, Mapping):
            raise InvalidRequest('a command is an object')
        deed = command.get('do')
        if deed == 'goal':
            return await self._send_goal(command.get('positions'), command.get('duration'))
        if deed == 'set':
            return await self._set(command.get('node'), command.get('values'))
        if deed == 'call':
            return await self._call(command.get('service'))
        raise InvalidRequest(f'unknown command {str(deed)[:TEXT_LIMIT]!r}')

    async def _send_goal(self, positions: Any, duration: Any) -> tuple[bool, str]:
        """Publish a goal for the actuated joints; return its verdict."""
        joints = self._joints[:-1]
        if not joints:
            raise InvalidRequest('the joints are not known yet: no joint states, no plan')
        if not isinstance(positions, list) or len(positions) != len(joints):
            raise InvalidRequest(f'a goal needs {len(joints)} positions, {", ".join(joints)}')
        if not self._goals.get_subscription_count():
            raise InvalidRequest('no planner is there to hear the goal')
        time = stamps.duration_msg(number_within(duration, 'duration', lower=0.0, upper=1e6))
        point = JointTrajectoryPoint(
            positions=[
                number_within(value, name, lower=-1e9, upper=1e9)
                for value, name in zip(positions, joints, strict=True)
            ],
            time_from_start=time,
        )
        verdict: RosFuture = RosFuture()
        self._sent.append((list_text(point.positions), verdict))
        self._goals.publish(JointTrajectory(joint_names=joints, points=[point]))
        answer: tuple[bool, str] = await verdict
        return answer

    async def _set(self, node: Any, values: Any) -> tuple[bool, str]:
        """Set parameters of a node, one after the other."""
        if node not in SETTINGS or not isinstance(values, Mapping) or not values:
            raise InvalidRequest('no such node, or no parameters')
        client = self._parameter_clients[node]
        if not client.services_are_ready():
            raise InvalidRequest(f'{node} is not there')
        parameters = []
        for name, value in values.items():
            if name not in SETTINGS[node]:
                raise InvalidRequest(f'{str(name)[:TEXT_LIMIT]} cannot be set here')
            parameters.append(Parameter(name, value=checked_value(node, name, value)))
        results = (await client.set_parameters(parameters)).results
        refusals = [result.reason for result in results if not result.successful]
        await self._ask(node)
        if refusals:
            return False, '; '.join(refusals)
        return True, ', '.join(f'{name} = {value}' for name, value in values.items())

    async def _call(self, service: Any) -> tuple[bool, str]:
        """Call a service."""
        if service not in SERVICES:
            raise InvalidRequest('no such service')
        client = self._triggers[service]
        if not client.service_is_ready():
            raise InvalidRequest(f'{SERVICES[service]} is not there')
        response = await client.call_async(Trigger.Request())
        return response.success, response.message


def _values(status: DiagnosticStatus) -> dict[str, str]:
    """Return the values of a status."""
    return {pair.key: pair.value[:TEXT_LIMIT] for pair in status.values}
