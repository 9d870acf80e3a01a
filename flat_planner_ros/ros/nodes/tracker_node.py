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

"""Tracker node: feedback of all joints around planned motions (docs/interfaces.md)."""

from collections.abc import Sequence
import sys
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from flat_planner_ros.core.arm import Drive, FlatPlannerError, FloatArray
from flat_planner_ros.core.tracking import Tracker
from flat_planner_ros.ros.nodes.graph_watch import GraphWatch
from flat_planner_ros.ros.nodes.guarded_callbacks import GuardedNode
from flat_planner_ros.ros.nodes.introduction import arm_sentence
from flat_planner_ros.ros.nodes.joint_state_input import JointStateInput
from flat_planner_ros.ros.nodes.node_runner import run
from flat_planner_ros.ros.nodes.rate_watch import RateWatch
from flat_planner_ros.ros.nodes.rival_watch import RivalWatch
from flat_planner_ros.ros.nodes.tracker_renewal import TrackerRenewal
from flat_planner_ros.ros.parameters.node_parameters import NodeParameters
from flat_planner_ros.ros.parameters.tracker import build, ROWS, TrackerNodeSettings
from flat_planner_ros.ros.wire import conversions, diagnostics, estimates, interfaces, stamps
from flat_planner_ros.ros.wire.joint_states import JointStateReader
from flat_planner_ros.ros.wire.tracked_motion import tracked_motion
from flat_planner_ros.ros.wire.tracker_word import tracker_status
from rclpy.clock import Clock, ClockType
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

LOOKS = 4
"""Looks for silence in the time that joint states may be silent."""

LATE_LOOK = 2.0
"""Looks that come later, in terms of their period, say nothing: samples may be waiting [-]."""

ELDER = 'another tracker moves this arm and was started before: this one keeps silent'
"""Why a tracker does nothing."""

HEALTH_PERIOD = 1.0
"""Time between two messages on `/diagnostics` [s]."""


class TrackerNode(GuardedNode):
    """Turns the planner's command and joint states into efforts."""

    def __init__(self, **options: Any) -> None:
        """Read the parameters and open the interface; options as for `rclpy.node.Node`."""
        super().__init__(interfaces.TRACKER, **options)
        self._configuration = NodeParameters(self, ROWS, build, self._apply)
        settings = self._configuration.settings
        self._joints = settings.joints
        self._tracker = Tracker(settings.arm, settings.tracker)
        self._renewal = TrackerRenewal(settings.arm, settings.tracker)
        self._fault, self._phase = '', self._tracker.phase
        self._ahead = 0.0
        self._reader = JointStateReader(settings.joints, settings.joint_states)
        efforts = interfaces.EFFORT_COMMANDS
        self._efforts = self.create_publisher(Float64MultiArray, efforts, interfaces.RELIABLE)
        command = interfaces.topic_of(interfaces.PLANNER, interfaces.COMMAND)
        states, listen = interfaces.JOINT_STATES, self.create_subscription
        # As bytes: the points of a long command would take a second to become Python objects.
        listen(JointTrajectory, command, self._on_command, interfaces.RELIABLE, raw=True)
        listen(JointState, states, self._on_measured, interfaces.SENSOR_DATA)
        status = interfaces.topic_of(interfaces.PLANNER, interfaces.STATUS)
        listen(DiagnosticArray, status, self._on_status, interfaces.LATCHED_HISTORY)
        self._watch = GraphWatch(self, self._log, [efforts, command], [states], is_listening=True)
        self._input = JointStateInput(self._log, self._watch, self._now)
        self._rate = RateWatch(settings.tracker.rate)
        self._rivals = RivalWatch(
            self,
            self._efforts,
            on_elder=self._on_elder,
            on_rival=self._on_rival,
            introduce=self._introduce,
        )
        self._health = self.create_publisher(
            DiagnosticArray, interfaces.DIAGNOSTICS, interfaces.RELIABLE
        )
        self.create_service(Trigger, interfaces.RELEASE, self._on_release)
        # A simulated clock can stand still; the effort must not hang on it.
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._looked = stamps.now(self._steady)
        self._look_period = settings.tracker.timeout / LOOKS
        self.create_timer(self._look_period, self._on_look, clock=self._steady)
        self.create_timer(HEALTH_PERIOD, self._on_health, clock=self._steady)
        self._log.info(f'certified: {self._tracker.certificate.sentence}')

    @property
    def introduction(self) -> str:
        """Return what the node does, for its log."""
        command = self.resolve_topic_name(
            interfaces.topic_of(interfaces.PLANNER, interfaces.COMMAND)
        )
        return f'{arm_sentence(self._joints, Drive.EFFORT)}; tracks the command on {command}'

    def _apply(self, settings: TrackerNodeSettings) -> None:
        """Read joint states with changed parameters from now on; the others are fixed."""
        self._reader.rules = settings.joint_states

    def rest(self) -> None:
        """Give no more efforts until the next command; the last ones are zero."""
        self._send(self._tracker.drop(self._present()))

    def _now(self) -> float:
        """Return the node's time [s]."""
        return stamps.now(self.get_clock())

    def _present(self) -> float:
        """Return the time by the clock of the joint states, if that is ahead of the node's [s]."""
        return self._now() + self._ahead

    def _on_command(self, data: bytes) -> None:
        """Follow a motion; one that cannot be followed leaves the present one alone."""
        now = self._now()
        if self._rivals.has_elder:
            self._log.warning(f'command ignored: {ELDER}')
            return
        try:
            motion = tracked_motion(conversions.points_of(data), self._joints, now)
            self._tracker.follow(motion, now)
            self._reader.align(motion.at(motion.start).positions)
            self._fault = ''
        except FlatPlannerError as error:
            self._log.warning(f'command ignored: {error}')

    def _on_measured(self, msg: JointState) -> None:
        """Answer the samples that a message completes with efforts."""
        samples = self._input.samples(self._reader, msg)
        former, self._tracker = self._tracker, self._renewal.renewed(self._tracker, self._now())
        if self._tracker is not former:
            self._log.info(f'follows the adopted model: {self._tracker.certificate.sentence}')
        for sample in samples:
            self._rate.heard(sample.time)
            now = self._now()
            self._ahead = max(0.0, sample.time - now)
            self._send(self._tracker.hear(sample, now + self._ahead))

    def _on_look(self) -> None:
        """Notice silence, and go on with an effort that fades."""
        steady = stamps.now(self._steady)
        elapsed, self._looked = steady - self._looked, steady
        if elapsed <= LATE_LOOK * self._look_period:
            self._send(self._tracker.watch(self._present()))

    def _on_status(self, msg: DiagnosticArray) -> None:
        """Follow the model that the planner adopts, between motions."""
        try:
            self._renewal.adopt(estimates.adopted_arm(msg, self._renewal.arm))
        except FlatPlannerError as error:
            self._log.warning(f"the planner's model is not followed: {error}")

    def _on_elder(self) -> None:
        """Leave the arm to the tracker that was started before."""
        self._send(self._tracker.drop(self._present(), ELDER))

    def _on_rival(self) -> None:
        """Let go of an arm that somebody else moves, too."""
        self._tracker.release(
            self._present(), 'another node sends efforts, too; the effort goes to zero'
        )

    def _on_health(self) -> None:
        """Say what the tracker does."""
        self._renewal.adopt(None)  # what has come while another one was made
        for remark in (self._renewal.take_refusal(), self._rate.take_remark()):
            if remark:
                self._log.warning(remark)
        self._introduce()

    def _introduce(self) -> None:
        """Publish the present state."""
        seniority = self._rivals.seniority
        status = tracker_status(self._tracker, self._fault, seniority)
        status.hardware_id = self.get_fully_qualified_name()
        self._health.publish(diagnostics.array_of(status, self._now()))

    def _on_release(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Let the arm go."""
        self._tracker.release(self._present())
        response.success, response.message = True, 'the effort goes to zero; idle until a command'
        return response

    def _send(self, efforts: FloatArray | None) -> None:
        """Publish efforts, if there are any, and say why tracking was given up, if it was."""
        if efforts is not None:
            self._rivals.sent(tuple(efforts.tolist()))
            self._efforts.publish(conversions.effort_msg(efforts))
        fault = self._tracker.take_fault()
        if fault:
            self._fault = fault
            self._log.error(fault)
        if self._tracker.phase is not self._phase:
            self._phase = self._tracker.phase
            self._introduce()


def main(args: Sequence[str] | None = None) -> int:
    """Run the tracker node."""
    return run([TrackerNode], args)


if __name__ == '__main__':
    sys.exit(main())
