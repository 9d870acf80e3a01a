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

"""The paper's experiment, carried out on the three nodes by topics, services and parameters."""

from collections.abc import Callable, Sequence
from subprocess import Popen
from threading import Event
from time import monotonic
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from flat_planner_ros.core.arm import Drive
from flat_planner_ros.core.monitor import PlannedMotion
from flat_planner_ros.figures.paper_example import (
    DURATION,
    GOAL_ANGLE,
    Method,
    Recording,
    Result,
    Scenario,
)
from flat_planner_ros.ros.nodes.node_runner import new_executor
from flat_planner_ros.ros.parameters.arm_model import EXAMPLE_ARM
from flat_planner_ros.ros.programs.paper_company import has_company, OURS
from flat_planner_ros.ros.programs.played_motion import (
    ExperimentFailed,
    Interrupted,
    is_played,
    NotFound,
    of_joint_1,
    recording,
    TooBusy,
)
from flat_planner_ros.ros.wire import conversions, interfaces, stamps
from flat_planner_ros.ros.wire.verdict_text import values_of
import numpy as np
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.client import Client
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

LEAD = 0.3
"""Time from sending a goal to the start of its motion, in real time [s]."""

PATIENCE = 60.0
"""Real time that a step of the experiment may take [s]."""

FOUND_WITHIN = 20.0
"""Real time in which nodes that have just been started find each other [s]."""

REPORT_PATIENCE = 20.0
"""Real time that a motion and its report may take, unless simulated time is slow [s]."""

SAME_START = 1e-6
"""Difference of two starts up to which they are of one motion [s]."""

NO_SWING = 1e-6
"""Half a swing that counts as the amplitude where there is no oscillation to fit [rad]."""

PASSING = (
    'BUSY',
    'NOT_AT_REST',
    'OLD_HEADER_TIMESTAMP',
    'START_STATE_MISMATCH',
    'START_STATE_UNKNOWN',
    'START_STATE_STALE',
)
"""Rejections that a later try overcomes: the planner has not seen the reset, or was late."""

PAUSE = 0.1
"""Real time between two tries of a goal [s]."""

RECORDING = QoSProfile(depth=20_000, reliability=ReliabilityPolicy.RELIABLE)
"""Quality of service for the joint states of one run: none is lost while this process is busy."""


class NotPlayed(Exception):
    """A run that a busy machine has spoilt."""


class Experimenter(Node):
    """
    Talks to the three nodes as any user does.

    Parameters
    ----------
    speed
        Simulated seconds per second.
    processes
        Processes of the nodes; the experiment ends when one of them does.
    interrupted
        Ends it, too.
    drive
        With which the nodes were started.

    Attributes
    ----------
    nodes
        Names of those that take part.
    commanded
        Name of the one that hears the planner's command.
    attempts
        Runs of one case until it is carried out as planned.

    """

    nodes: tuple[str, ...] = OURS
    commanded: str = interfaces.PLANT
    attempts: int = 4

    def __init__(
        self,
        speed: float,
        processes: Sequence[Popen[bytes]],
        interrupted: Event,
        drive: Drive = Drive.EFFORT,
    ) -> None:
        super().__init__('paper_table')
        self._drive = drive
        self._spinner = new_executor()
        self._spinner.add_node(self)
        self._lead = LEAD * max(speed, 1.0)
        self._report_patience = REPORT_PATIENCE / min(speed, 1.0)
        self._processes = processes
        self._interrupted = interrupted
        self._states: list[JointState] = []
        self._plans: list[JointTrajectory] = []
        self._verdicts: list[DiagnosticArray] = []
        self._reports: list[DiagnosticArray] = []
        planner, plant, monitor = OURS
        goal, plan = (interfaces.topic_of(planner, t) for t in (interfaces.GOAL, interfaces.PLAN))
        status = interfaces.topic_of(planner, interfaces.STATUS)
        report = interfaces.topic_of(monitor, interfaces.REPORT)
        self._goals = self.create_publisher(JointTrajectory, goal, interfaces.RELIABLE)
        for kind, name, heard, quality in (
            (JointState, interfaces.JOINT_STATES, self._states, RECORDING),
            (JointTrajectory, plan, self._plans, interfaces.LATCHED),
            (DiagnosticArray, status, self._verdicts, interfaces.LATCHED_HISTORY),
            (DiagnosticArray, report, self._reports, interfaces.LATCHED),
        ):
            self.create_subscription(kind, name, heard.append, quality)
        self._setters = {
            name: self.create_client(SetParametersAtomically, f'{name}/set_parameters_atomically')
            for name in OURS
        }
        self._reset = self.create_client(Trigger, interfaces.topic_of(plant, interfaces.RESET))
        self._adopt = self.create_client(Trigger, interfaces.topic_of(planner, interfaces.ADOPT))

    def destroy_node(self) -> None:
        """Let go of the executor, too, which keeps what it spins."""
        self._spinner.shutdown()
        super().destroy_node()

    def wait_for_nodes(self) -> None:
        """
        Wait until all nodes answer and hear each other.

        Raises
        ------
        NotFound
            They do not within `FOUND_WITHIN`.

        """
        if not self._spin_until(lambda: not self._missing(), FOUND_WITHIN):
            raise NotFound(f'within {FOUND_WITHIN:g} s: {", ".join(self._missing())}')

    def _missing(self) -> list[str]:
        """Return what keeps the nodes from working together, in words."""
        present = self.get_node_names()
        count = {name: present.count(name) for name in self.nodes}
        ready = {name: client.service_is_ready() for name, client in self._setters.items()}
        planner, plant, monitor = OURS
        listeners = (
            (interfaces.topic_of(planner, interfaces.COMMAND), self.commanded),
            (interfaces.topic_of(planner, interfaces.PLAN), monitor),
            (interfaces.JOINT_STATES, planner),
            (interfaces.JOINT_STATES, monitor),
        )
        return [
            *(f'{name} is there {number} times' for name, number in count.items() if number != 1),
            *(f'{name} has no parameters' for name, is_ready in ready.items() if not is_ready),
            *(
                f'{name} does not hear {topic}'
                for topic, name in listeners
                if name not in self._listening_to(topic)
            ),
            *([] if self._reset.service_is_ready() else [f'{plant} has no service to reset it']),
            *([] if self._adopt.service_is_ready() else [f'{planner} has no service to adopt']),
            *([] if self._goals.get_subscription_count() else ['nobody hears goals']),
            *([] if self._states else ['no joint states']),
        ]

    def _listening_to(self, topic: str) -> list[str]:
        """Return the names of the nodes that subscribe to a topic."""
        infos = self.get_subscriptions_info_by_topic(self.resolve_topic_name(topic))
        return [info.node_name for info in infos]

    def run(self, scenario: Scenario, method: Method) -> Result:
        """
        Carry out one motion, or the second of two by a method that learns.

        A motion that the machine was too busy to play from the start is carried out again.

        Raises
        ------
        ExperimentFailed
            A node died, refused something or did not answer.

        """
        self._configure(scenario, method)
        if company := [name for name in self.nodes if self.get_node_names().count(name) > 1]:
            raise has_company(company)
        if method.learns:
            self._played(scenario, method)
            self._learn()
        return self._played(scenario, method)

    def _played(self, scenario: Scenario, method: Method) -> Result:
        """Return a motion that was played as planned."""
        for _ in range(self.attempts):
            try:
                return self._attempt(scenario, method)
            except NotPlayed as reason:
                self.get_logger().warning(f'{reason}; once more')
                self._lead *= 2.0
        raise TooBusy(f'not played as planned {self.attempts} times: the machine is too busy')

    def _learn(self) -> None:
        """Have the planner adopt the monitor's estimate as soon as it has heard of it."""
        deadline = monotonic() + REPORT_PATIENCE
        while not (answer := self._call(self._adopt, Trigger.Request())).success:
            if monotonic() > deadline:
                raise ExperimentFailed(f'no estimate was adopted: {answer.message}')
            self._spin_until(lambda: False, PAUSE)

    def _configure(self, scenario: Scenario, method: Method) -> None:
        """Set the planner, what it knows of the arm, and the plant's mismatch."""
        planner, plant, monitor = OURS
        damping = scenario.damping_factor * EXAMPLE_ARM['model.damping']
        self._set(
            planner,
            {
                **method.parameters,
                'model.stiffness': EXAMPLE_ARM['model.stiffness'],
                'model.damping': damping,
            },
        )
        self._set(monitor, {'model.damping': damping})
        mismatch = {
            'mismatch.stiffness_scale': scenario.stiffness_scale,
            'mismatch.damping_scale': scenario.damping_scale,
            'mismatch.inertia_scale': scenario.inertia_scale,
        }
        self._set(plant, mismatch)

    def _set(self, node: str, values: dict[str, Any]) -> None:
        """Set parameters of a node, all or none."""
        parameters = [Parameter(name, value=value) for name, value in values.items()]
        request = SetParametersAtomically.Request(
            parameters=[parameter.to_parameter_msg() for parameter in parameters]
        )
        answer = self._call(self._setters[node], request).result
        if not answer.successful:
            raise ExperimentFailed(f'{node} refused its parameters: {answer.reason}')

    def _attempt(self, scenario: Scenario, method: Method) -> Result:
        """Carry out one motion from rest."""
        self._reset_arm()
        for heard in (self._states, self._verdicts, self._plans, self._reports):
            heard.clear()
        self._await(lambda: bool(self._states), 'no joint states')
        start = self._accepted_start()
        # The report of a motion that was given up may still come.
        if not self._spin_until(
            lambda: bool(self._plans and self._report(start)), self._report_patience
        ):
            raise NotPlayed(f'no report of the motion at {start:.3f} s')
        played = recording(self._states, start)
        motion = conversions.planned_motion_from_trajectory(self._plans[0])
        self._check(played, motion)
        amplitude = self._amplitude(self._report(start), played)
        planned = of_joint_1(motion.efforts)
        # Imported here: it takes half a second, in which the nodes start by themselves.
        from scipy.integrate import trapezoid

        rms = float(np.sqrt(trapezoid(planned**2, motion.times) / DURATION))
        peak = float(np.abs(played.efforts).max() / np.abs(planned).max())
        return Result(scenario, method.name, rms, amplitude, played, self._drive, peak)

    def _reset_arm(self) -> None:
        """Bring the arm back to where it starts."""
        self._call(self._reset, Trigger.Request())

    def _amplitude(self, status: DiagnosticStatus, played: Recording) -> float:
        """Return the amplitude at the end of the motion, as the monitor reports it [rad]."""
        values = values_of(status)
        # A swing that is too small to be told from rounding has no amplitude of its own.
        swing = 0.5 * float(values.get('peak_to_peak', 'inf'))
        if 'amplitude' not in values and not swing < NO_SWING:
            raise NotPlayed(f'no amplitude: {status.message}')
        return float(values.get('amplitude', swing))

    def _check(self, played: Recording, motion: PlannedMotion) -> None:
        """Refuse a run that a busy machine has spoilt."""
        if not is_played(played, motion, self._drive):
            raise NotPlayed('the command reached the plant after its start')

    def _accepted_start(self) -> float:
        """Send the goal until the planner has seen the reset; return the motion's start [s]."""
        deadline = monotonic() + PATIENCE
        while True:
            start = stamps.seconds(self._states[-1].header.stamp) + self._lead
            self._verdicts.clear()
            self._goals.publish(_goal(start))
            self._await(lambda: self._verdict() is not None, 'no verdict on the goal')
            verdict = self._verdict()
            values = values_of(verdict)
            if values['state'] == 'ACCEPTED':
                return start
            if values['error_name'] not in PASSING or monotonic() > deadline:
                raise ExperimentFailed(f'the goal was rejected: {verdict.message}')
            self._spin_until(lambda: False, PAUSE)

    def _verdict(self) -> Any:
        """Return the verdict on a goal, None before; what became of the last motion is none."""
        for status in (status for msg in self._verdicts for status in msg.status):
            if any(pair.value in ('ACCEPTED', 'REJECTED') for pair in status.values):
                return status
        return None

    def _report(self, start: float) -> Any:
        """Return the report of the motion with a start [s], None before."""
        for status in (status for msg in self._reports for status in msg.status):
            if abs(float(values_of(status).get('start_time', 'nan')) - start) < SAME_START:
                return status
        return None

    def _call(self, client: Client, request: Any) -> Any:
        """Return the answer of a service."""
        future = client.call_async(request)
        self._await(future.done, f'{client.srv_name} does not answer')
        return future.result()

    def _await(self, condition: Callable[[], bool], complaint: str) -> None:
        """Spin until a condition holds."""
        if not self._spin_until(condition, PATIENCE):
            raise ExperimentFailed(f'{complaint} within {PATIENCE:g} s')

    def _spin_until(self, condition: Callable[[], bool], patience: float) -> bool:
        """Spin until a condition holds; return whether it did before patience [s] ended."""
        deadline = monotonic() + patience
        while not condition():
            if self._interrupted.is_set():
                raise Interrupted
            if any(process.poll() is not None for process in self._processes):
                raise ExperimentFailed('one of the nodes has ended')
            if monotonic() > deadline:
                return False
            self._spinner.spin_once(timeout_sec=0.1)
        return True


def _goal(start: float) -> JointTrajectory:
    """Return the goal of the example with its absolute start [s]."""
    point = JointTrajectoryPoint(
        positions=[float(GOAL_ANGLE)], time_from_start=stamps.duration_msg(DURATION)
    )
    goal = JointTrajectory(joint_names=[EXAMPLE_ARM['joints'][0]], points=[point])
    goal.header.stamp = stamps.time_msg(start)
    return goal
