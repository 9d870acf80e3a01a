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

"""Monitor node: what planned motions leave behind, from any source (docs/interfaces.md)."""

from collections.abc import Sequence
import sys
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from flat_planner_ros.core.arm import Drive, FlatPlannerError, JointSample
from flat_planner_ros.core.monitor import (
    DriftWatch,
    MonitorSettings,
    PlannedMotion,
    VibrationMonitor,
    VibrationReport,
)
from flat_planner_ros.ros.nodes.early_loading import load_early, REPORTING
from flat_planner_ros.ros.nodes.graph_watch import GraphWatch
from flat_planner_ros.ros.nodes.guarded_callbacks import GuardedNode
from flat_planner_ros.ros.nodes.introduction import arm_sentence
from flat_planner_ros.ros.nodes.joint_state_input import JointStateInput
from flat_planner_ros.ros.nodes.node_runner import run
from flat_planner_ros.ros.nodes.stamp_clock import StampClock
from flat_planner_ros.ros.parameters.arm_model import model_parameters
from flat_planner_ros.ros.parameters.monitor import build, ROWS
from flat_planner_ros.ros.parameters.node_parameters import NodeParameters
from flat_planner_ros.ros.parameters.row import InvalidParameter
from flat_planner_ros.ros.wire import conversions, diagnostics, estimates, interfaces, stamps
from flat_planner_ros.ros.wire.drift_status import drift_status
from flat_planner_ros.ros.wire.joint_states import JointStateReader
from flat_planner_ros.ros.wire.tracker_word import hear_tracker
from rclpy.clock import Clock, ClockType
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

TICK_PERIOD = 0.1
"""Time between two looks for silence [s]."""

LATE_TICK = 2.0 * TICK_PERIOD
"""Time between two such looks beyond which the node has not been listening all the time [s]."""

DIAGNOSTICS_PERIOD = 1.0
"""Time between two messages on `/diagnostics` [s]."""

SAME_CLOCK = 3600.0
"""Distance of a plan's start from the node's time below which both are of one clock [s]."""


class MonitorNode(GuardedNode):
    """Judges what each latched plan leaves behind; options as for `rclpy.node.Node`."""

    def __init__(self, **options: Any) -> None:
        super().__init__(interfaces.MONITOR, **options)
        self._configuration = NodeParameters(self, ROWS, build, self._apply)
        self._monitor = VibrationMonitor(self._configuration.settings)
        self._forget()
        self._residual = self.create_publisher(
            JointState, interfaces.RESIDUAL, interfaces.RELIABLE
        )
        self._reports = self.create_publisher(
            DiagnosticArray, interfaces.REPORT, interfaces.LATCHED
        )
        self._drifts = self.create_publisher(
            DiagnosticArray, interfaces.MODEL_DRIFT, interfaces.LATCHED
        )
        self._health = self.create_publisher(
            DiagnosticArray, interfaces.DIAGNOSTICS, interfaces.RELIABLE
        )
        plan = interfaces.topic_of(interfaces.PLANNER, interfaces.PLAN)
        self._plan_topic = self.resolve_topic_name(plan)
        # As bytes: the points of a long plan would take a second to become Python objects.
        self.create_subscription(
            JointTrajectory, plan, self._on_plan, interfaces.LATCHED, raw=True
        )
        self.create_subscription(
            JointState, interfaces.JOINT_STATES, self._on_measured, interfaces.SENSOR_DATA
        )
        status = interfaces.topic_of(interfaces.PLANNER, interfaces.STATUS)
        self.create_subscription(
            DiagnosticArray, status, self._on_status, interfaces.LATCHED_HISTORY
        )
        # For the feedback of a tracker, which is not to be taken for the arm's own damping.
        self.create_subscription(
            DiagnosticArray, interfaces.DIAGNOSTICS, self._on_health, interfaces.RELIABLE
        )
        self._watch = GraphWatch(
            self, self._log, [plan], [interfaces.JOINT_STATES], is_listening=True
        )
        self._input = JointStateInput(self._log, self._watch, self._now)
        self.create_service(Trigger, interfaces.RESET, self._on_reset)
        # A simulated clock can stand still; noticing that must not depend on it.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._steady = steady
        self._ticked = stamps.now(steady)
        self.create_timer(TICK_PERIOD, self._on_tick, clock=steady)
        self.create_timer(DIAGNOSTICS_PERIOD, self._on_diagnostics, clock=steady)
        load_early(self, REPORTING)

    @property
    def introduction(self) -> str:
        """Return what the node does, for its log."""
        joints = self.get_parameter('joints').value
        drive = Drive(self.get_parameter('drive').value)
        return f'{arm_sentence(joints, drive)}; judges the motions on {self._plan_topic}'

    def _now(self) -> float:
        """Return the node's time [s]."""
        return stamps.now(self.get_clock())

    def _forget(self) -> None:
        """Wait for a plan, as at the start."""
        self._monitor.reset()
        self._drift = DriftWatch()
        self._drifting = False
        self._stamps = StampClock()
        self._reader: JointStateReader | None = None
        self._plan: PlannedMotion | None = None
        self._report: VibrationReport | None = None

    def _apply(self, settings: MonitorSettings) -> None:
        """Judge with changed parameters from now on."""
        self._monitor.settings = settings
        if self._reader is not None:
            self._reader.rules = settings.joint_states

    def _on_plan(self, data: bytes) -> None:
        """Take a plan, for whatever joints it names."""
        try:
            motion = conversions.planned_motion(conversions.points_of(data))
            if not self._configuration.is_example:
                conversions.check_passive_joint(motion, self.get_parameter('joints').value)
        except FlatPlannerError as error:
            self._log.warning(f'plan ignored: {error}')
            return
        if self._plan is None or self._plan.joint_names != motion.joint_names:
            self._forget()
            self._reader = JointStateReader(
                motion.joint_names, self._monitor.settings.joint_states
            )
        if self._reader is not None:
            self._reader.align(motion.positions[0])
        self._plan = motion
        self._publish_reports(self._monitor.watch(motion, self._now()))

    def _on_measured(self, msg: JointState) -> None:
        """Take what a message completes."""
        if self._reader is None:
            return
        # A simulated clock is everybody's, and is heard in steps, perhaps after what it stamps.
        if stamps.is_stamped(msg) and not stamps.is_simulated(self.get_clock()):
            self._monitor.hear(stamps.seconds(msg.header.stamp), self._now())
        for sample in self._input.samples(self._reader, msg):
            self._take(sample, msg.header, self._reader.joints)

    def _take(self, sample: JointSample, header: Header, joints: Sequence[str]) -> None:
        """Take a sample and tell how far it is from the plan."""
        reports = self._monitor.add(sample)
        self._stamps.stamp = sample.time
        if self._residual.get_subscription_count():
            residual = self._monitor.residual(sample)
            if residual is not None:
                header = stamps.header_at(header, sample.time)
                self._residual.publish(conversions.residual_msg(header, joints, residual))
        self._publish_reports(reports)

    def _on_status(self, msg: DiagnosticArray) -> None:
        """Expect what the planner expects, once it has adopted other values than its file's."""
        try:
            own = self._monitor.settings.arm
            arm = None if own is None else estimates.adopted_arm(msg, own)
            if arm is not None and own is not None:
                result = self.set_parameters_atomically(model_parameters(self, arm, own))
                if not result.successful:
                    raise InvalidParameter(result.reason)
        except FlatPlannerError as error:
            self._log.warning(f"the planner's model is not followed: {error}")

    def _on_health(self, msg: DiagnosticArray) -> None:
        """Learn when a tracker moves the arm."""
        hear_tracker(msg, self.get_namespace(), self._monitor.feedback)

    def _on_tick(self) -> None:
        """Notice silence, unless the node itself has been busy: samples may be waiting then."""
        steady = stamps.now(self._steady)
        elapsed = steady - self._ticked
        self._ticked = steady
        if elapsed > LATE_TICK:
            return
        now = self._stamps.now(self._now())
        plan = self._plan
        # The node's own time would end the watch of a plan that is of another clock.
        is_known = self._stamps.stamp is not None
        if plan is not None and (is_known or abs(now - plan.start) < SAME_CLOCK):
            self._publish_reports(self._monitor.tick(now))

    def _on_diagnostics(self) -> None:
        """Publish the present state, and say what was wrong since the last time."""
        for warning in self._monitor.take_warnings():
            self._log.warning(warning)
        status = diagnostics.monitor_status(
            self._report,
            self._monitor.phase.value,
            self._monitor.dropped,
            self._monitor.clock_offset,
        )
        self._health.publish(diagnostics.array_of(status, self._now()))

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Forget plans, samples and the last report."""
        self._forget()
        response.success = True
        response.message = 'waiting for the next plan'
        return response

    def _publish_reports(self, reports: Sequence[VibrationReport]) -> None:
        """Publish and log reports, each in a message of its own."""
        for report in reports:
            self._report = report
            status = diagnostics.report_status(report)
            self._reports.publish(diagnostics.array_of(status, self._stamps.now(self._now())))
            # One call for both would not do: a place in the code may log at one severity only.
            if status.level == DiagnosticStatus.OK:
                self._log.info(status.message)
            else:
                self._log.warning(status.message)
            self._watch_drift(report)

    def _watch_drift(self, report: VibrationReport) -> None:
        """Publish how the arm ages, where a report tells, and say once that it does."""
        drifts = self._drift.hear(report, self._monitor.settings.drift)
        if not drifts:
            return
        status = drift_status(drifts)
        self._drifts.publish(diagnostics.array_of(status, self._stamps.now(self._now())))
        former, self._drifting = self._drifting, status.level != DiagnosticStatus.OK
        if self._drifting and not former:
            self._log.warning(status.message)


def main(args: Sequence[str] | None = None) -> int:
    """Run the monitor node."""
    return run([MonitorNode], args)


if __name__ == '__main__':
    sys.exit(main())
