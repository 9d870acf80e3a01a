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
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from time import monotonic
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from flat_planner_ros.core.arm import FlatPlannerError, JointSample
from flat_planner_ros.ros.live_view.feed import Feed
from flat_planner_ros.ros.live_view.node_poll import NodePoll, PATIENCE
from flat_planner_ros.ros.live_view.page_commands import PageCommands
from flat_planner_ros.ros.live_view.page_settings import choices
from flat_planner_ros.ros.live_view.status_news import state_of, Verdicts
from flat_planner_ros.ros.nodes.guarded_callbacks import GuardedNode
from flat_planner_ros.ros.wire import conversions, interfaces, stamps
from flat_planner_ros.ros.wire.joint_states import JointStateReader
from flat_planner_ros.ros.wire.tracker_word import tracker_of
from rclpy.clock import Clock, ClockType
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

MEASURED, REFERENCE, RESIDUAL = 'measured', 'reference', 'residual'
STREAMS = (MEASURED, REFERENCE, RESIDUAL)
"""Names of the streams; a row is the time, positions, velocities and efforts."""

ROW_PERIOD = 0.01
"""Shortest real time between two rows of a stream [s]; the page shows no more."""

BACKWARD = 0.5
"""Backward step of the stamps from which another time has begun [s]."""

WAY_POINTS = 60
"""Poses of a plan that the page draws [-]."""

TRACKER_SILENCE = 3.0
"""Time without a word of the tracker, which speaks once a second, after which it is gone [s]."""


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
        self._tracker_heard = -TRACKER_SILENCE
        self._verdicts = Verdicts(self.feed)
        self._listen()
        poll = NodePoll(self, self.feed, self._use_joints)
        self._commands = PageCommands(self, poll, self._verdicts)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(TRACKER_SILENCE / 3.0, self._on_look, clock=steady)

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
                answer.set_result(await self._commands.carry_out(command))
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
        listen, history = self.create_subscription, interfaces.LATCHED_HISTORY
        listen(JointTrajectory, plan, self._on_plan, interfaces.LATCHED)
        listen(DiagnosticArray, status, self._verdicts.hear, history)
        listen(DiagnosticArray, report, self._on_report, interfaces.LATCHED)
        drift = interfaces.topic_of(interfaces.MONITOR, interfaces.MODEL_DRIFT)
        listen(DiagnosticArray, drift, self._on_drift, interfaces.LATCHED)
        listen(DiagnosticArray, interfaces.DIAGNOSTICS, self._on_diagnostics, interfaces.RELIABLE)

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
        """Tell when a motion is, where it ends, and the poses on its way."""
        try:
            motion = conversions.planned_motion_from_trajectory(msg)
        except FlatPlannerError:
            return
        self._use_joints(motion.joint_names)
        every = max(1, len(motion.times) // WAY_POINTS)
        plan = {
            'start': self._relative(motion.start),
            'end': self._relative(motion.end),
            'final': motion.final.tolist(),
            'way': motion.positions[::every].round(4).tolist(),
        }
        self.feed.put('plan', plan)

    def _on_report(self, msg: DiagnosticArray) -> None:
        """Tell what a motion has left."""
        for status in msg.status:
            report = state_of(status)
            for key in ('start', 'end'):
                time = report['values'].get(f'{key}_time')
                report[key] = None if time is None else self._relative(float(time))
            self.feed.put('report', report)

    def _on_drift(self, msg: DiagnosticArray) -> None:
        """Tell how the arm ages."""
        for status in msg.status:
            self.feed.put('drift', state_of(status))

    def _on_diagnostics(self, msg: DiagnosticArray) -> None:
        """Tell what the tracker of this namespace does, if there is one."""
        tracker = tracker_of(msg, self.get_namespace())
        if tracker is not None:
            self._tracker_heard = monotonic()
            self.feed.put('tracker', state_of(tracker))

    def _on_look(self) -> None:
        """Forget a tracker that says nothing any more."""
        if monotonic() - self._tracker_heard > TRACKER_SILENCE:
            self.feed.put('tracker', None)

    def _use_joints(self, names: Sequence[str]) -> None:
        """Show these joints from now on."""
        if self._joints == list(names):
            return
        self._joints = list(names)
        self._commands.joints = self._joints
        self._readers = {stream: JointStateReader(names) for stream in STREAMS}
        self.feed.restart()
        self.feed.put('joints', list(names))

    def _relative(self, time: float) -> float:
        """Return a time from the origin of the page's axis, a new one if time has gone back."""
        if self._epoch is None or time < self._epoch - BACKWARD:
            self._epoch = time
            self.feed.restart()
            self.feed.put('epoch', time)
        return round(time - self._epoch, 6)
