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

"""Carries motions out that tell an arm's model: goals by topic, joint states, and a stop."""

from collections.abc import Callable
from math import inf
import select
import sys
from threading import Event
from time import monotonic

from diagnostic_msgs.msg import DiagnosticArray
from flat_planner_ros.core.arm import FlatPlannerError, FloatArray, JointSample
from flat_planner_ros.core.excitation import Proposal, Room
from flat_planner_ros.core.model_fit import Measurements
from flat_planner_ros.core.session import SessionSettings
from flat_planner_ros.ros.nodes.node_runner import new_executor
from flat_planner_ros.ros.wire import interfaces, stamps
from flat_planner_ros.ros.wire.joint_states import JointStateReader
import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

DISCOVERY = 20.0
"""Real time in which planner and joint states must be found [s]."""

SILENCE = 10.0
"""Real time for which joint states and verdicts may stay away [s]."""

PATIENCE = 120.0
"""Real time in which a goal must be accepted; an arm that swings may have to swing out [s]."""

PAUSE = 0.5
"""Real time between two tries of a goal [s]."""

STOPPING = 10.0
"""Real time in which the arm must come to rest once it is stopped [s]."""

BEFORE = 0.1
"""Time before a motion that counts to its recording [s]."""

EXCESS = 2.0
"""Effort planned, relative to what was to be, from which the planner has another model [-]."""

STATES = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Joint states: those of a second may wait while this process is busy."""

PASSING = ('BUSY', 'NOT_AT_REST', 'START_STATE_UNKNOWN', 'START_STATE_STALE')
LIMITS = ('POSITION_LIMIT', 'VELOCITY_LIMIT', 'EFFORT_LIMIT')
"""Rejections that a later try overcomes, the latter where the arm still swings."""

ENDS = ('FINISHED', 'FAILED', 'STOPPED', 'PREEMPTED')
"""States of a motion that has ended."""


class ExcitationFailed(FlatPlannerError):
    """The motions cannot go on; the message says why."""


class Aborted(Exception):
    """A key, SIGINT or SIGTERM."""


class Exciter(Node):
    """
    Talks to a planner as any user does, whatever carries its commands out.

    Parameters
    ----------
    settings
        Of the planner.
    interrupted
        Ends it, as a line on the terminal does.

    """

    def __init__(self, settings: SessionSettings, interrupted: Event) -> None:
        super().__init__('flat_exciter')
        self._spinner = new_executor()
        self._spinner.add_node(self)
        self._joints = tuple(settings.joints)
        self._interrupted = interrupted
        self._reader = JointStateReader(self._joints)
        self._samples: list[JointSample] = []
        self._heard = monotonic()
        self._verdicts: list[dict[str, str]] = []
        planner = interfaces.PLANNER
        self._goals = self.create_publisher(
            JointTrajectory, interfaces.topic_of(planner, interfaces.GOAL), interfaces.BURST
        )
        self.create_subscription(JointState, interfaces.JOINT_STATES, self._on_state, STATES)
        self.create_subscription(
            DiagnosticArray,
            interfaces.topic_of(planner, interfaces.STATUS),
            self._on_status,
            interfaces.RELIABLE,
        )
        self._stop = self.create_client(Trigger, interfaces.topic_of(planner, interfaces.STOP))

    def wait_for_nodes(self) -> None:
        """Wait until the planner listens and the arm is measured."""
        if not self._spin_until(
            lambda: bool(
                self._goals.get_subscription_count()
                and self.count_publishers(
                    interfaces.topic_of(interfaces.PLANNER, interfaces.STATUS)
                )
                and self._stop.service_is_ready()
                and self._samples
            ),
            DISCOVERY,
        ):
            what = 'joint states with all joints' if not self._samples else 'planner'
            raise ExcitationFailed(f'no {what} within {DISCOVERY:g} s')

    def pose(self) -> FloatArray:
        """Return the measured joint angles, shape (n,) [rad]."""
        self._samples.clear()
        self._await_samples(lambda: bool(self._samples))
        return self._samples[-1].positions

    def carry_out(self, proposal: Proposal, record_time: float, room: Room) -> Measurements:
        """
        Return what is measured of a motion and of the time after it.

        Parameters
        ----------
        proposal
            The motion.
        record_time
            Time after it [s].
        room
            Where the arm may be; it is stopped where it leaves that.

        Raises
        ------
        ExcitationFailed
            The planner refuses the motion, the arm leaves its room, or nothing is measured.
        Aborted
            Whoever watches wants no more.

        """
        verdict = self._accepted(proposal)
        self._check_efforts(verdict, proposal.candidate.most_effort)
        start = float(verdict['start_time'])
        until = start + float(verdict['duration']) + record_time

        def is_over() -> bool:
            newest = self._samples[-1] if self._samples else None
            if newest is not None and newest.time >= start:
                self._check_room(newest, room)
            return newest is not None and newest.time >= until

        self._await_samples(is_over)
        return self._measured(start - BEFORE, until)

    def stop(self) -> str:
        """Bring the arm to rest; return what the planner said."""
        self._verdicts.clear()
        future = self._stop.call_async(Trigger.Request())
        if not self._spin_until(future.done, STOPPING, is_final=True):
            return f'the planner did not answer ~/stop within {STOPPING:g} s'
        answer = future.result()
        self._spin_until(self._has_ended, STOPPING, is_final=True)
        return str(answer.message if answer is not None else '')

    def _accepted(self, proposal: Proposal) -> dict[str, str]:
        """Send the goal until it is accepted; return the verdict."""
        deadline = monotonic() + PATIENCE
        goal = self._goal(proposal)
        while True:
            self._verdicts.clear()
            self._samples.clear()
            self._goals.publish(goal)
            if not self._spin_until(lambda: self._answer() is not None, SILENCE):
                raise ExcitationFailed(f'no verdict on a goal within {SILENCE:g} s')
            verdict = self._answer() or {}
            if verdict['state'] == 'ACCEPTED':
                return verdict
            is_passing = verdict['error_name'] in (*PASSING, *LIMITS)
            if not is_passing or monotonic() > deadline:
                raise ExcitationFailed(f'the goal was rejected: {verdict["message"]}')
            self._spin_until(lambda: False, PAUSE)

    def _goal(self, proposal: Proposal) -> JointTrajectory:
        """Return the goal of a motion."""
        wanted = proposal.candidate
        point = JointTrajectoryPoint(
            positions=wanted.final[:-1].tolist(),
            time_from_start=stamps.duration_msg(wanted.duration),
        )
        return JointTrajectory(joint_names=list(self._joints[:-1]), points=[point])

    def _answer(self) -> dict[str, str] | None:
        """Return the verdict on the goal, None before."""
        found = [v for v in self._verdicts if v.get('state') in ('ACCEPTED', 'REJECTED')]
        return found[0] if found else None

    def _has_ended(self) -> bool:
        """Tell whether a motion has ended since the verdicts were cleared."""
        return any(verdict.get('state') in ENDS for verdict in self._verdicts)

    def _check_efforts(self, verdict: dict[str, str], most_effort: FloatArray) -> None:
        """Refuse a plan that takes far more than joints were to give (n-1,) [N m]."""
        for joint, most in zip(self._joints[:-1], most_effort.tolist(), strict=True):
            peak = float(verdict.get(f'peak_effort.{joint}', 'nan'))
            if most < inf and not peak <= EXCESS * most:
                raise ExcitationFailed(
                    f'the planner takes {peak:.3g} N m of {joint} where at most {most:.3g} N m '
                    'were to be: does it have another model than the parameter file, or does the '
                    'arm swing?'
                )

    def _check_room(self, sample: JointSample, room: Room) -> None:
        """Refuse an arm that has left its room."""
        moved = len(room.ranges)
        places = zip(self._joints[-moved:], sample.positions[-moved:].tolist(), strict=True)
        for (name, value), (low, high) in zip(places, room.ranges, strict=True):
            if not low <= value <= high:
                raise ExcitationFailed(
                    f'{name} is at {value:.4g} rad, outside {low:.4g} to {high:.4g} rad: stopped'
                )

    def _measured(self, since: float, until: float) -> Measurements:
        """Return the samples of a time, those with efforts."""
        last = -inf
        kept, efforts = [], []
        for sample in self._samples:
            given = np.array([np.nan]) if sample.efforts is None else sample.efforts[:-1]
            if np.isfinite(given).all() and max(since, last) < sample.time <= until:
                kept.append(sample)
                efforts.append(given)
                last = sample.time
        if not kept:
            raise ExcitationFailed(
                'the joint states have no efforts: the driver must report what its motors apply'
            )
        return Measurements(
            times=np.array([sample.time for sample in kept]),
            positions=np.array([sample.positions for sample in kept]),
            efforts=np.array(efforts),
        )

    def _on_state(self, msg: JointState) -> None:
        """Keep what a message completes."""
        self._heard = monotonic()
        self._samples += self._reader.read(msg, lambda: stamps.now(self.get_clock()))

    def _on_status(self, msg: DiagnosticArray) -> None:
        """Keep verdicts with their sentences."""
        for status in msg.status:
            if status.name == interfaces.STATUS_NAME:
                values = {pair.key: pair.value for pair in status.values}
                self._verdicts.append({**values, 'message': status.message})

    def _await_samples(self, condition: Callable[[], bool]) -> None:
        """Spin until a condition holds, as long as joint states come."""
        self._heard = monotonic()
        while not self._spin_until(condition, PAUSE):
            if monotonic() - self._heard > SILENCE:
                raise ExcitationFailed(f'no joint states for {SILENCE:g} s')

    def _spin_until(
        self, condition: Callable[[], bool], patience: float, *, is_final: bool = False
    ) -> bool:
        """Spin until a condition holds; return whether it did before patience [s] ended."""
        deadline = monotonic() + patience
        while not condition():
            if not is_final and (self._interrupted.is_set() or _is_key_pressed()):
                raise Aborted
            if monotonic() > deadline:
                return False
            self._spinner.spin_once(timeout_sec=0.05)
        return True


def _is_key_pressed() -> bool:
    """Tell whether a line was entered on the terminal."""
    if not sys.stdin.isatty():
        return False
    ready, _, _ = select.select([sys.stdin], [], [], 0.0)
    if ready:
        sys.stdin.readline()
    return bool(ready)
