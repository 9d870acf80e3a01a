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

"""Plant node: a simulated arm that plays commands by time (docs/interfaces.md)."""

from collections.abc import Sequence
import sys
from typing import Any

from flat_planner_ros.core.arm import FlatPlannerError, InvalidCommand
from flat_planner_ros.core.plant import ArmState, PacedArm
from flat_planner_ros.ros.nodes.graph_watch import GraphWatch
from flat_planner_ros.ros.nodes.guarded_callbacks import GuardedNode
from flat_planner_ros.ros.nodes.introduction import arm_sentence
from flat_planner_ros.ros.nodes.node_runner import run
from flat_planner_ros.ros.parameters.node_parameters import NodeParameters
from flat_planner_ros.ros.parameters.plant import build, CommandInput, PlantSettings, ROWS
from flat_planner_ros.ros.parameters.row import InvalidParameter
from flat_planner_ros.ros.wire import conversions, interfaces, stamps
from flat_planner_ros.ros.wire.joint_state_writer import clock_bytes, JointStateWriter
from rclpy.clock import Clock as RosClock
from rclpy.clock import ClockType
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

CLOCK_START = 1.0
"""First time on /clock [s]; 0 would mean that there is no time yet."""

WARNING_PERIOD = 1.0
"""Time between two reports of what goes wrong again and again [s]."""


class PlantNode(GuardedNode):
    """Moves one simulated arm; options as for `rclpy.node.Node`."""

    def __init__(self, **options: Any) -> None:
        super().__init__(interfaces.PLANT, **options)
        self._configuration = NodeParameters(self, ROWS, build, self._apply)
        settings = self._settings
        if settings.publish_clock and self.get_parameter('use_sim_time').value:
            raise InvalidParameter(
                'publish_clock and use_sim_time exclude each other: a plant that makes the time '
                'cannot follow it, leave one of them out'
            )
        self._arm = PacedArm(settings.simulation, CLOCK_START if settings.publish_clock else None)
        self._joint_states = self.create_publisher(
            JointState, interfaces.JOINT_STATES, interfaces.RELIABLE
        )
        self._writer = JointStateWriter(settings.joints)
        self._graph_time: Publisher | None = None
        if settings.publish_clock:
            self._graph_time = self.create_publisher(Clock, interfaces.CLOCK, interfaces.RELIABLE)
        self._listen()
        self.create_service(Trigger, interfaces.RESET, self._on_reset)
        # Steady: with use_sim_time, timers of the node's own clock wait for a /clock.
        self._steady = RosClock(clock_type=ClockType.STEADY_TIME)
        rate = self._arm.call_rate(settings.real_time_factor)
        self.create_timer(1.0 / rate, self._on_tick, clock=self._steady)
        self.create_timer(WARNING_PERIOD, self._on_watch, clock=self._steady)
        self._on_tick()

    def rest(self) -> None:
        """Drop the command."""
        self._arm.drop()

    @property
    def introduction(self) -> str:
        """Return what the node does, for its log."""
        arm = arm_sentence(self._settings.joints, self._settings.simulation.drives.drive)
        return f'{arm}; hears {self.resolve_topic_name(self._commands)}'

    @property
    def _settings(self) -> PlantSettings:
        """Return the settings in force."""
        return self._configuration.settings

    def _listen(self) -> None:
        """Subscribe to what moves the arm."""
        is_tracked = self._settings.command_input is CommandInput.TRACKER
        sender = interfaces.TRACKER if is_tracked else interfaces.PLANNER
        efforts = (interfaces.EFFORT_COMMANDS, Float64MultiArray, self._on_effort)
        topic, kind, callback = {
            CommandInput.TRAJECTORY: (interfaces.COMMAND, JointTrajectory, self._on_trajectory),
            CommandInput.EFFORT: efforts,
            CommandInput.TRACKER: efforts,
        }[self._settings.command_input]
        self._commands = name = interfaces.topic_of(sender, topic)
        # As bytes: the points of a long command would take a second to become Python objects.
        raw = callback == self._on_trajectory
        listen = self.create_subscription
        listen(kind, name, callback, interfaces.RELIABLE, raw=raw)
        listen(Float64MultiArray, interfaces.PUSH, self._on_push, interfaces.RELIABLE)
        clock = [interfaces.CLOCK] if self._settings.publish_clock else []
        GraphWatch(self, self._log, [name, *clock], [interfaces.JOINT_STATES])

    def _apply(self, settings: PlantSettings) -> None:
        """Go on with another mismatch or other sensors."""
        self._catch_up()
        self._arm.settings = settings.simulation

    def _on_trajectory(self, data: bytes) -> None:
        """Play a command; one that cannot be played leaves the running one alone."""
        self._catch_up()
        try:
            points = conversions.points_of(data)
            if not len(points.times):
                raise InvalidCommand(
                    'it is empty; to end a motion call ~/reset, or ~/stop of the planner'
                )
            joints = self._settings.joints
            drive = self._settings.simulation.drives.drive
            profile = conversions.effort_profile(points, joints, self._arm.time, drive)
            remark = self._arm.command(profile)
        except FlatPlannerError as error:
            self._log.warning(f'trajectory ignored: {error}')
            return
        if remark:
            self._log.warning(f'trajectory accepted, but {remark}')

    def _on_effort(self, msg: Float64MultiArray) -> None:
        """Apply efforts until the next ones."""
        self._catch_up()
        try:
            self._arm.hold(msg.data)
        except FlatPlannerError as error:
            self._log.warning(f'effort ignored: {error}', WARNING_PERIOD)

    def _on_push(self, msg: Float64MultiArray) -> None:
        """Let somebody push the arm, for as long as an effort lasts."""
        self._catch_up()
        try:
            self._arm.push(msg.data)
        except FlatPlannerError as error:
            self._log.warning(f'push ignored: {error}', WARNING_PERIOD)

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Bring the arm back to rest where it started."""
        self._catch_up()
        self._arm.reset()
        position = ', '.join(f'{angle:g}' for angle in self._settings.simulation.position)
        response.success = True
        response.message = f'at rest at [{position}] rad, no command'
        return response

    def _catch_up(self) -> None:
        """Bring a plant that follows a clock to the present, where something is to change."""
        if not self._settings.publish_clock:
            self._on_tick()

    def _on_tick(self) -> None:
        """Go on to the present and publish what was passed."""
        settings = self._settings
        if settings.publish_clock:
            wall = stamps.now(self._steady)
            samples = self._arm.lead(wall, settings.real_time_factor)
        else:
            samples = self._arm.follow(stamps.now(self.get_clock()))
        for sample in samples:
            self._publish(sample)

    def _publish(self, sample: ArmState) -> None:
        """Publish a sample; its time first, so that nobody sees it before its time."""
        time, *numbers = sample
        stamp = stamps.sec_and_nanosec(time)
        if self._graph_time is not None:
            self._graph_time.publish(clock_bytes(stamp))
        self._joint_states.publish(self._writer.message(stamp, *numbers))

    def _on_watch(self) -> None:
        """Say what went wrong, with numbers, at most once per period."""
        for warning in self._arm.take_warnings():
            self._log.warning(warning)


def main(args: Sequence[str] | None = None) -> int:
    """Run the plant node."""
    return run([PlantNode], args)


if __name__ == '__main__':
    sys.exit(main())
