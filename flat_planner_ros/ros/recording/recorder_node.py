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

"""Recorder node: everything that crosses the graph about motions, into one MCAP file."""

from collections.abc import Callable
import json
from pathlib import Path
from time import time_ns
from typing import Any

from flat_planner_ros.core.arm import FlatPlannerError
from flat_planner_ros.ros.nodes.guarded_callbacks import GuardedNode
from flat_planner_ros.ros.recording.recording import PARAMETERS, RecordingWriter
from flat_planner_ros.ros.wire import interfaces
from flat_planner_ros.ros.wire.joint_states import NO_STAMP
from flat_planner_ros.ros.wire.message_types import definition, message_class, UnknownType
from rclpy.clock import Clock, ClockType
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

DEPTH = 1000
"""Messages of a topic that wait while the disk is slow."""

WATCH_PERIOD = 0.5
"""Time between two looks at the graph, each followed by writing out what has come [s]."""

JOINT_TRAJECTORY = 'trajectory_msgs/msg/JointTrajectory'
JOINT_STATE = 'sensor_msgs/msg/JointState'
DIAGNOSTIC_ARRAY = 'diagnostic_msgs/msg/DiagnosticArray'

PARAMETER_EVENTS = '/parameter_events'

NOT_SET = Parameter.Type.NOT_SET.value

OURS = {
    interfaces.PLANNER: {
        interfaces.COMMAND: (JOINT_TRAJECTORY, interfaces.RELIABLE),
        interfaces.EFFORT_COMMANDS: ('std_msgs/msg/Float64MultiArray', interfaces.RELIABLE),
        interfaces.PLAN: (JOINT_TRAJECTORY, interfaces.LATCHED),
        interfaces.FLAT_PLAN: (JOINT_TRAJECTORY, interfaces.LATCHED),
        interfaces.REFERENCE: (JOINT_STATE, interfaces.RELIABLE),
        interfaces.STATUS: (DIAGNOSTIC_ARRAY, interfaces.LATCHED_HISTORY),
    },
    interfaces.PLANT: {
        interfaces.PUSH: ('std_msgs/msg/Float64MultiArray', interfaces.RELIABLE),
    },
    interfaces.MONITOR: {
        interfaces.RESIDUAL: (JOINT_STATE, interfaces.RELIABLE),
        interfaces.REPORT: (DIAGNOSTIC_ARRAY, interfaces.LATCHED),
        interfaces.MODEL_DRIFT: (DIAGNOSTIC_ARRAY, interfaces.LATCHED),
    },
    interfaces.TRACKER: {
        interfaces.EFFORT_COMMANDS: ('std_msgs/msg/Float64MultiArray', interfaces.RELIABLE),
    },
}
"""
Topics of each of our nodes that are recorded, with their types and qualities.

Not the goals: whoever sends one and waits for a listener would take the recorder for the planner.
Verdicts echo them.
"""

SHARED = {
    interfaces.JOINT_STATES: (JOINT_STATE, interfaces.RELIABLE),
    interfaces.DIAGNOSTICS: (DIAGNOSTIC_ARRAY, interfaces.RELIABLE),
    interfaces.CLOCK: ('rosgraph_msgs/msg/Clock', interfaces.RELIABLE),
    PARAMETER_EVENTS: ('rcl_interfaces/msg/ParameterEvent', interfaces.RELIABLE),
}
"""Other topics that are recorded."""

STAMP = slice(4, 12)
"""Bytes of a serialised message with a header that are its stamp, after those of the format."""


class RecordingFailed(FlatPlannerError):
    """The file cannot be opened; the message says why."""


class RecorderNode(GuardedNode):
    """
    Writes messages as they come, serialised, with their definitions.

    Parameters
    ----------
    path
        File to write; the directory must exist.
    everything
        Record every topic of the graph, not only ours.
    overwrite
        Replace a file that exists.
    options
        Arguments of `rclpy.node.Node`.

    Attributes
    ----------
    failure
        Reason why the file could not be written any further, empty if it can.

    Raises
    ------
    RecordingFailed
        The file cannot be opened.

    """

    def __init__(
        self,
        path: Path,
        *,
        everything: bool = False,
        overwrite: bool = False,
        **options: Any,
    ) -> None:
        super().__init__(interfaces.RECORDER, **options)
        self._path = path
        self._everything = everything
        self.failure = ''
        self._said_unstamped = False
        try:
            self._writer = RecordingWriter(path, overwrite=overwrite)
        except FileExistsError as error:
            raise RecordingFailed(f'{path} exists; --force replaces it') from error
        except OSError as error:
            raise RecordingFailed(f'cannot write {path}: {error.strerror}') from error
        self._heard: dict[str, tuple[Any, QoSProfile]] = {}
        self._wanted: dict[str, tuple[str, QoSProfile]] = {}
        self._refused: set[str] = set()
        self._parameter_clients = {name: AsyncParameterClient(self, name) for name in OURS}
        self._stale = set(OURS)
        topics = dict(SHARED)
        for node, private in OURS.items():
            topics |= {interfaces.topic_of(node, name): value for name, value in private.items()}
        for name, wanted in topics.items():
            self._wanted[self.resolve_topic_name(name)] = wanted
        # Also where a simulated clock stands still.
        self.create_timer(
            WATCH_PERIOD, self._on_watch, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )
        self._on_watch()

    @property
    def summary(self) -> str:
        """Return what has been recorded so far, in a sentence."""
        return f'{self._path}: {self._writer.summary}'

    def destroy_node(self) -> None:
        """Finish the file."""
        self._guarded(self._writer.close)
        super().destroy_node()

    def _on_watch(self) -> None:
        """Follow the graph, and keep what has come safe from a sudden end."""
        if self._everything:
            self._discover()
        for topic, (kind, quality) in self._wanted.items():
            self._listen(topic, kind, quality)
        for node in tuple(self._stale):
            if self.executor and self._parameter_clients[node].services_are_ready():
                self._stale.discard(node)
                self.executor.create_task(self._note_parameters(node))
        self._guarded(self._writer.flush)

    def _discover(self) -> None:
        """Want every topic that there is."""
        for topic, kinds in self.get_topic_names_and_types():
            if topic in self._wanted or topic in self._refused:
                continue
            if len(kinds) != 1:
                self._refuse(topic, f'it has several types, {", ".join(kinds)}')
            else:
                self._wanted[topic] = (kinds[0], interfaces.RELIABLE)

    def _listen(self, topic: str, kind: str, quality: QoSProfile) -> None:
        """Subscribe to a topic, again if its publishers have come to offer something else."""
        offered = [info.qos_profile for info in self.get_publishers_info_by_topic(topic)]
        request = _request(quality, offered)
        subscription, former = self._heard.get(topic, (None, None))
        if topic in self._refused or former == request:
            return
        try:
            schema, message = definition(kind), message_class(kind)
        except UnknownType as error:
            self._refuse(topic, str(error))
            return
        if subscription is not None:
            self.destroy_subscription(subscription)
        receive = self._receiver(topic, kind, schema, quality)
        subscription = self.create_subscription(message, topic, receive, request, raw=True)
        self._heard[topic] = subscription, request

    def _receiver(
        self, topic: str, kind: str, schema: str, quality: QoSProfile
    ) -> Callable[[bytes], None]:
        """Return the callback of a topic."""
        is_measured = topic == self.resolve_topic_name(interfaces.JOINT_STATES)

        def write(message: bytes) -> None:
            if is_measured and not any(message[STAMP]) and not self._said_unstamped:
                self._said_unstamped = True
                self._log.warning(f'{NO_STAMP} from the recording')
            if not self._writer.knows(topic):
                infos = self.get_publishers_info_by_topic(topic)
                offered = [info.qos_profile for info in infos] or [quality]
                self._writer.add_topic(topic, kind, schema, offered)
            self._writer.write(topic, time_ns(), message)

        def receive(message: bytes) -> None:
            self._guarded(lambda: write(message))
            if topic == PARAMETER_EVENTS:
                self._stale.update(OURS)

        return receive

    def _refuse(self, topic: str, reason: str) -> None:
        """Leave a topic out, saying so once."""
        self._refused.add(topic)
        self._log.warning(f'{topic} is not recorded: {reason}')

    async def _note_parameters(self, node: str) -> None:
        """Write down all parameters of one of our nodes."""
        client = self._parameter_clients[node]
        names = list((await client.list_parameters()).result.names)
        types = (await client.get_parameter_types(names)).types
        # One name without a value would make the node answer nothing at all, as may its end.
        names = [n for n, kind in zip(names, types, strict=False) if kind != NOT_SET]
        values = map(parameter_value_to_python, (await client.get_parameters(names)).values)
        record = {
            'node': f'{self.get_namespace().rstrip("/")}/{node}',
            'time': str(time_ns()),
            'values': json.dumps({n: _plain(v) for n, v in zip(names, values, strict=False)}),
        }
        self._guarded(lambda: self._writer.note(PARAMETERS, record))

    def _guarded(self, act: Callable[[], Any]) -> None:
        """Do something to the file; if that fails, give it up and end the process in order."""
        if self.failure:
            return
        try:
            act()
        except OSError as error:
            self.failure = f'cannot write {self._path}: {error.strerror or error}'
            self._writer.abandon()
            # An exception would be logged with its traceback by the executor.
            self.context.try_shutdown()


def _request(known: QoSProfile, offered: list[QoSProfile]) -> QoSProfile:
    """Return what to request so that every publisher is heard, and latched messages are too."""
    reliability, durability = known.reliability, known.durability
    if offered:
        is_reliable = all(o.reliability == ReliabilityPolicy.RELIABLE for o in offered)
        is_latched = all(o.durability == DurabilityPolicy.TRANSIENT_LOCAL for o in offered)
        reliability = ReliabilityPolicy.RELIABLE if is_reliable else ReliabilityPolicy.BEST_EFFORT
        durability = DurabilityPolicy.TRANSIENT_LOCAL if is_latched else DurabilityPolicy.VOLATILE
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=DEPTH,
        reliability=reliability,
        durability=durability,
    )


def _plain(value: Any) -> Any:
    """Return a parameter's value as JSON has it; infinity is written as Python reads it."""
    return value.tolist() if hasattr(value, 'tolist') else value
