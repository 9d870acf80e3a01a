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

"""Nodes in processes of their own, and the other side of their topics."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
import os
from pathlib import Path
import struct
import subprocess
import sys
import tempfile
from time import monotonic
from typing import NamedTuple

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node

PATIENCE = 30.0
"""Time in which a process must start or end [s]."""

SHIPPED = 'as shipped'
"""The executor that the node's own program chooses."""

SINGLE, EVENTS = 'SingleThreadedExecutor', 'EventsExecutor'
"""Executors to compare it with."""

BARE = 'bare'
"""Name of a node of rclpy that is nobody's, `bare_node.py`."""

BARE_ANSWER = '/bare/answer'
"""Its service."""

BARE_PLANNER = 'bare planner'
"""Name of a node of rclpy that answers goals with messages made beforehand, `bare_planner.py`."""

AS_MESSAGES, AS_BYTES = 'bare planner, messages', 'bare planner, bytes'
"""Names of the same node that makes its answers of ready arrays for each goal."""

PROGRAMS = {BARE: 'bare_node.py'} | dict.fromkeys(
    (BARE_PLANNER, AS_MESSAGES, AS_BYTES), 'bare_planner.py'
)
"""Files of the nodes that are not the package's; each is told its name."""

STAMP = struct.Struct('<iI')
"""Seconds and nanoseconds, behind the four bytes that start a serialised message."""


class Usage(NamedTuple):
    """
    Work of a process between two looks.

    Attributes
    ----------
    share
        Time on a processor over time [-]; 1 is one core.
    seconds
        Time between the looks [s].

    """

    share: float
    seconds: float


class NodeProcess:
    """
    A node that runs beside this process.

    Parameters
    ----------
    name
        `planner`, `plant`, `monitor` or one of `PROGRAMS`.
    executor
        What spins it.
    parameters : dict[str, str]
        Its parameters by name, as on the command line.
    file
        Of parameters that come before these.

    """

    def __init__(
        self, name: str, executor: str, parameters: dict[str, str], file: Path | None = None
    ) -> None:
        """Start it."""
        # What `ros2 run` starts.
        entry = f'from flat_planner_ros.programs import {name}_node as run'
        program = ['-c', f'{entry}; raise SystemExit(run())']
        if name in PROGRAMS:
            program = [str(Path(__file__).parent / PROGRAMS[name]), name]
        elif executor != SHIPPED:
            program = [str(Path(__file__).parent / 'spin_node.py'), name, executor]
        values = [f'{key}:={value}' for key, value in parameters.items()]
        overrides = ['--params-file', str(file)] if file else []
        overrides += [word for value in values for word in ('-p', value)]
        self._log = tempfile.TemporaryFile()  # noqa: SIM115  Closed by `stop`.
        self._popen = subprocess.Popen(
            [sys.executable, *program, '--ros-args', *overrides],
            stdout=self._log,
            stderr=self._log,
            start_new_session=True,
        )
        self._seen: tuple[float, float] = (0.0, 0.0)

    @property
    def log(self) -> str:
        """Return what it has printed."""
        return os.pread(self._log.fileno(), 1 << 20, 0).decode(errors='replace')

    @property
    def warnings(self) -> list[str]:
        """Return its warnings and errors."""
        return [line for line in self.log.splitlines() if 'WARN' in line or 'ERROR' in line]

    def is_running(self) -> bool:
        """Return whether it has not ended."""
        return self._popen.poll() is None

    def look(self) -> Usage:
        """Return its work since the last look."""
        text = Path(f'/proc/{self._popen.pid}/stat').read_text(encoding='utf-8')
        user, system = text.rsplit(')', 1)[1].split()[11:13]
        now = monotonic(), (int(user) + int(system)) / os.sysconf('SC_CLK_TCK')
        before, self._seen = self._seen, now
        elapsed = now[0] - before[0]
        return Usage((now[1] - before[1]) / elapsed, elapsed)

    def stop(self) -> None:
        """End it."""
        self._popen.terminate()
        try:
            self._popen.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self._popen.kill()
            self._popen.wait()
        self._log.close()


@contextmanager
def processes(*started: NodeProcess) -> Iterator[None]:
    """End processes at the end."""
    try:
        yield
    finally:
        for each in started:
            each.stop()


class Listener:
    """A node of this process with an executor that costs little."""

    def __init__(self, name: str) -> None:
        """Open it."""
        rclpy.init(args=[])
        self.node = Node(name, enable_rosout=False, start_parameter_services=False)
        self._executor = new_executor(EVENTS)
        self._executor.add_node(self.node)

    def close(self) -> None:
        """Close it."""
        with suppress(ExternalShutdownException):
            self._executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown()

    def spin(self, seconds: float) -> None:
        """Serve callbacks for a time."""
        end = monotonic() + seconds
        while (left := end - monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=min(left, 0.1))

    def spin_until(self, condition: Callable[[], object], what: str) -> None:
        """Serve callbacks until something holds."""
        end = monotonic() + PATIENCE
        while not condition():
            if monotonic() > end:
                raise TimeoutError(f'not within {PATIENCE:g} s: {what}')
            self._executor.spin_once(timeout_sec=0.01)


@contextmanager
def listener(name: str) -> Iterator[Listener]:
    """Open a listener for a while."""
    opened = Listener(name)
    try:
        yield opened
    finally:
        opened.close()


def executors() -> Sequence[str]:
    """Return the executors that this ROS has, the shipped choice first."""
    try:
        from rclpy.experimental import EventsExecutor  # noqa: F401
    except ImportError:
        return SHIPPED, SINGLE
    return SHIPPED, SINGLE, EVENTS


def new_executor(name: str):  # noqa: ANN201  The two classes have no common one.
    """Return an executor by name, the ordinary one where there is no other."""
    if name == EVENTS and EVENTS in executors():
        from rclpy.experimental import EventsExecutor

        return EventsExecutor()
    return SingleThreadedExecutor()


def spin(node: Node, executor_name: str) -> None:
    """Spin a node until the process is asked to end."""
    executor = new_executor(executor_name)
    executor.add_node(node)
    try:
        # A spin without a timeout would starve the callbacks of an EventsExecutor.
        while rclpy.ok():
            executor.spin_once(timeout_sec=0.1)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def stamp_of(serialised: bytes, offset: int = 4) -> float:
    """Return the stamp at the front of a serialised message [s]."""
    seconds, nanoseconds = STAMP.unpack_from(serialised, offset)
    return seconds + 1e-9 * nanoseconds
