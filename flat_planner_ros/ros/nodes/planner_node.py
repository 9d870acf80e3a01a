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

"""Planner node: goals in, certified flat motions and verdicts out (docs/interfaces.md)."""

from collections.abc import Callable, Sequence
from functools import partial
from math import nan
import sys
from time import perf_counter
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from flat_planner_ros.core.arm import OffsetFilter
from flat_planner_ros.core.planning import Reason, RequestRejected
from flat_planner_ros.core.session import (
    clock_fault,
    Goal,
    Motion,
    PlannerSession,
    Shortfall,
)
from flat_planner_ros.ros.nodes.clock_watch import ClockWatch
from flat_planner_ros.ros.nodes.command_outlet import CommandOutlet
from flat_planner_ros.ros.nodes.controller_check import ControllerCheck
from flat_planner_ros.ros.nodes.early_loading import load_early, PLANNING
from flat_planner_ros.ros.nodes.effort_stream import EffortStream
from flat_planner_ros.ros.nodes.goal_queue import GoalQueue, Read, Tell, tell_nobody
from flat_planner_ros.ros.nodes.graph_watch import GraphWatch
from flat_planner_ros.ros.nodes.guarded_callbacks import GuardedNode
from flat_planner_ros.ros.nodes.introduction import planner_sentence
from flat_planner_ros.ros.nodes.joint_state_input import JointStateInput
from flat_planner_ros.ros.nodes.model_adoption import ModelAdoption
from flat_planner_ros.ros.nodes.node_runner import run
from flat_planner_ros.ros.nodes.rest_services import RestServices
from flat_planner_ros.ros.nodes.trajectory_server import TrajectoryServer
from flat_planner_ros.ros.parameters.node_parameters import NodeParameters
from flat_planner_ros.ros.parameters.planner import build, PlannerSettings, ROWS
from flat_planner_ros.ros.wire import conversions, diagnostics, interfaces, stamps
from flat_planner_ros.ros.wire.joint_states import JointStateReader
from flat_planner_ros.ros.wire.message_types import UnknownType
from flat_planner_ros.ros.wire.status_writer import Status
from flat_planner_ros.ros.wire.verdict_text import log_line, values_of
import numpy as np
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory


class PlannerNode(GuardedNode):
    """Answers goals with motions of one arm; options as for `rclpy.node.Node`."""

    def __init__(self, **options: Any) -> None:
        super().__init__(interfaces.PLANNER, **options)
        self._configuration = NodeParameters(self, ROWS, build, self._apply)
        self._session = PlannerSession(self._settings.session)
        self._reader = JointStateReader(self._joints, self._settings.joint_states)
        # Its spring tells in which turn the passive joint is.
        self._reader.align(np.array([*[nan] * (len(self._joints) - 1), 0.0]))
        self._goals = GoalQueue(self, self._session, self._answer)
        self._session.source = self.resolve_topic_name(interfaces.JOINT_STATES)
        self._sent_start: float | None = None
        self._offset = OffsetFilter()
        self._open_publishers()
        self._listen()
        self._efforts = EffortStream(self, self._outlet.efforts, self._session)
        self._adoption = ModelAdoption(
            self,
            self._log,
            lambda: self._settings,
            lambda: self._sent_start,
            self._publish_status,
            lambda: self._configuration.values,
        )
        self.create_service(Trigger, interfaces.REPLAN, self._on_replan)
        rest = RestServices(self, self._session, self._goals, self._carry_out)
        self._actions = self._offer_action(rest)
        self.create_timer(1.0 / self._settings.reference_rate, self._on_tick)
        commands = [interfaces.COMMAND, interfaces.EFFORT_COMMANDS]
        self._watch = GraphWatch(
            self, self._log, commands, [interfaces.JOINT_STATES], is_listening=True
        )
        self._check = ControllerCheck(self, self._log, self._outlet.controllers)
        self._input = JointStateInput(self._log, self._watch, self._now)
        self._clocks = ClockWatch(self, self._on_jump, self._report_ended)
        self._apply(self._settings)
        load_early(self, PLANNING)

    def _open_publishers(self) -> None:
        """Offer commands, plans and verdicts."""
        self._outlet = CommandOutlet(self, self._session, self._settings.controller)
        self._reference = self.create_publisher(
            JointState, interfaces.REFERENCE, interfaces.RELIABLE
        )
        self._status = self.create_publisher(
            DiagnosticArray, interfaces.STATUS, interfaces.VERDICTS
        )

    def _listen(self) -> None:
        """Subscribe to goals and joint states."""
        # As bytes: a message that is too long is refused before it takes seconds to be read.
        for kind, topic, read in (
            (JointTrajectory, interfaces.GOAL, conversions.goal_from_trajectory),
            (JointState, interfaces.GOAL_STATE, conversions.goal_from_joint_state),
        ):
            heard = partial(self._on_goal, read)
            self.create_subscription(kind, topic, heard, interfaces.BURST, raw=True)
        self.create_subscription(
            JointState, interfaces.JOINT_STATES, self._on_measured, interfaces.SENSOR_DATA
        )

    def _offer_action(self, rest: RestServices) -> TrajectoryServer | None:
        """Return the server of the action; None without control_msgs, which is said."""
        try:
            return TrajectoryServer(self, self._session, self._goals, rest.stop)
        except UnknownType as error:
            self._log.info(str(error))
            return None

    def rest(self) -> None:
        """Stream zeros until the next motion; a command that was sent ends at rest by itself."""
        self._efforts.rest()

    def destroy_node(self) -> None:
        """End the stream of efforts with zeros, and the actions, then the node."""
        self._efforts.end()
        self._outlet.close()
        if self._actions is not None:
            self._actions.close()
        super().destroy_node()

    @property
    def introduction(self) -> str:
        """Return what the node does, for its log."""
        return planner_sentence(self, self._settings)

    @property
    def _settings(self) -> PlannerSettings:
        """Return the settings in force."""
        return self._configuration.settings

    @property
    def _joints(self) -> Sequence[str]:
        """Return the arm's joints."""
        return self._settings.session.joints

    def _now(self) -> float:
        """Return the present time [s]."""
        return stamps.now(self.get_clock())

    def _apply(self, settings: PlannerSettings) -> None:
        """Plan the next goals with changed parameters."""
        self._session.settings = settings.session
        self._reader.rules = settings.joint_states
        self._efforts.configure(settings.stream_effort, settings.session.period)

    def _on_goal(self, read: Callable[[bytes], Goal], data: bytes) -> None:
        """Answer a goal, now or once the arm has been heard."""
        self._goals.put(partial(read, data))

    def _on_measured(self, msg: JointState) -> None:
        """Keep the measured state for the next start."""
        now = self._now()
        # A simulated clock is everybody's, and is heard in steps, perhaps after what it stamps.
        if stamps.is_stamped(msg) and not stamps.is_simulated(self.get_clock()):
            self._offset.hear(stamps.seconds(msg.header.stamp), now)
        for sample in self._input.samples(self._reader, msg):
            self._session.measure(sample, now)
        if self._reader.is_in_parts:
            self._session.lack = self._reader.lack
        self._goals.answer_due()

    def _on_replan(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Plan the last goal again."""
        status = self._answer(lambda: self._session.last_goal)
        response.success = status.level != DiagnosticStatus.ERROR
        response.message = status.message
        return response

    def _carry_out(self, message: str) -> None:
        """Send a motion to rest."""
        self._publish_motion()
        self._outlet.publish_plans()
        self._log.info(message)
        self._report_ended()

    def _on_tick(self) -> None:
        """Publish what is planned for now, and the end of a motion."""
        self._report_ended()
        now = self._now()
        if self._actions is not None:
            self._actions.tick(now)
        # Whoever begins to listen hears the next one.
        is_heard = self._reference.get_subscription_count() > 0
        samples = self._session.reference(now) if is_heard else None
        if samples is not None:
            self._reference.publish(conversions.reference_msg(samples, self._joints, now))

    def _on_jump(self, why: str, jump: float) -> None:
        """Give up what was planned for other times."""
        self._session.drop(clock_fault(why, jump))
        self._offset = OffsetFilter()

    def _report_ended(self) -> None:
        """Publish how motions have ended."""
        for astray in self._session.take_astray():
            self._publish_status(diagnostics.astray_status(astray))
        for ended in self._session.take_ended(self._now()):
            remark = '' if ended.shortfall is None else self._outlet.doubt(self._settings)
            status = diagnostics.ended_status(ended, remark)
            self._publish_status(status)
            if self._actions is not None:
                self._actions.ended(ended, values_of(status), status.message)

    def _answer(self, read: Read, tell: Tell = tell_nobody) -> Status:
        """Give a goal exactly one verdict, and tell it; carry the goal out if it is accepted."""
        goal = motion = None
        started = perf_counter()
        try:
            goal = read()
            motion = self._session.submit(goal, self._now(), self._now)
            elapsed = perf_counter() - started
            # The verdict's peaks take a while: the plant need not wait for them.
            self._publish_motion()
            status = diagnostics.accepted_status(
                motion,
                goal,
                self._joints,
                elapsed,
                with_advice=self._settings.report_advice,
                with_baselines=self._settings.report_baselines,
                doubt=self._doubt(),
                built=self._settings.session.built,
            )
        except RequestRejected as error:
            status = diagnostics.rejected_status(error, goal)
        except Exception as error:  # noqa: BLE001  A goal must be answered, whatever happens.
            status = self._internal_error(error, goal, motion)
        self._publish_status(diagnostics.with_clock(status, self._offset.sure))
        self._outlet.publish_plans()
        tell(values_of(status), status.message)
        self._report_ended()
        return status

    def _internal_error(
        self, error: Exception, goal: Goal | None, motion: Motion | None
    ) -> Status:
        """Refuse a goal that could not be worked on; nobody may have heard of its motion."""
        message = f'internal error: {error!r}'
        self._log.error(message)
        if motion is not None:
            self._session.drop(Shortfall(Reason.INTERNAL, message, '', 0.0, 0.0))
        return diagnostics.rejected_status(RequestRejected(Reason.INTERNAL, message), goal)

    def _doubt(self) -> str:
        """Return why a command may not be played as planned, a clause; empty if it should be."""
        lateness = self._session.lateness if self._settings.session.execute else ''
        return '; '.join(filter(None, (self._outlet.doubt(self._settings), lateness)))

    def _publish_motion(self) -> None:
        """Publish all that is still to be carried out."""
        track = self._session.track(self._now())
        self._sent_start = track.start
        self._outlet.publish(track, self._settings)

    def _publish_status(self, status: Status) -> None:
        """Publish and log a verdict."""
        self._status.publish(diagnostics.array_of(status, self._now()))
        say = {
            DiagnosticStatus.OK: self._log.info,
            DiagnosticStatus.WARN: self._log.warning,
            DiagnosticStatus.ERROR: self._log.error,
        }
        say[status.level](log_line(status.message, values_of(status)))


def main(args: Sequence[str] | None = None) -> int:
    """Run the planner node."""
    return run([PlannerNode], args)


if __name__ == '__main__':
    sys.exit(main())
