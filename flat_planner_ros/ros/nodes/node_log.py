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

"""What a node says: a flood of faults in few lines, and never a wait for whoever reads them."""

from dataclasses import dataclass
import os
import re
import select

from flat_planner_ros.ros.wire import stamps
from flat_planner_ros.ros.wire.log_lines import write_line
from rclpy.clock import Clock, ClockType
from rclpy.logging import LoggingSeverity
from rclpy.node import Node

PERIOD = 1.0
"""Shortest time between two lines of one kind [s]."""

MOST_KINDS = 8
"""Kinds of faults that are told apart at a time; more are one kind."""

LONGEST = 2000
"""Characters of a line: with its head it fits into what a pipe that can be written to takes."""

NUMBER = re.compile(r'(?<!\w)[-+]?\d[\d.e+-]*')
"""Numbers do not make another kind of fault, but those in names do."""

LOST = '{} lines could not be written: nobody reads them'
"""What is said once a console that was full can be written to again."""


@dataclass
class _Kind:
    """A kind of fault: when it was said last, and what has been held back since."""

    said: float
    severity: LoggingSeverity
    period: float
    held: int = 0
    text: str = ''


class FaultGate:
    """
    Lets one fault of a kind pass in a period; counts the others.

    Faults are of one kind if their texts differ by numbers only.
    """

    def __init__(self) -> None:
        self._kinds: dict[str, _Kind] = {}

    def admits(self, text: str, severity: LoggingSeverity, period: float, now: float) -> bool:
        """Tell whether a fault may be said now [s]; else it is counted with its kind."""
        key = NUMBER.sub('#', text)
        if key not in self._kinds and len(self._kinds) >= MOST_KINDS:
            key = ''
        kind = self._kinds.get(key)
        if kind is None:
            self._kinds[key] = _Kind(now, severity, period)
            return True
        kind.held += 1
        kind.text = text
        return False

    def take_due(self, now: float) -> list[tuple[LoggingSeverity, str]]:
        """Return what has been held back for its period, and forget the kinds that are over."""
        lines = []
        for key, kind in list(self._kinds.items()):
            elapsed = now - kind.said
            if elapsed < kind.period:
                continue
            if not kind.held:
                del self._kinds[key]
                continue
            count = f' (the last of {kind.held} like it in {elapsed:.1f} s)'
            lines.append((kind.severity, kind.text + (count if kind.held > 1 else '')))
            kind.said = now
            kind.held = 0
        return lines


class NodeLog:
    """
    Log of a node, in whose callbacks a line costs little, whatever happens to it.

    A console that nobody reads fills up, and the logger would wait for it: then lines are lost
    instead, and counted. Warnings and errors pass a `FaultGate`.

    Parameters
    ----------
    node
        Node that speaks.

    """

    def __init__(self, node: Node) -> None:
        self._logger = node.get_logger()
        self._gate = FaultGate()
        self._lost = 0
        self._console = select.poll()
        is_stdout = os.environ.get('RCUTILS_LOGGING_USE_STDOUT') == '1'
        self._console.register(1 if is_stdout else 2, select.POLLOUT)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(PERIOD, self._on_timer, clock=self._steady)

    def info(self, text: str) -> None:
        """Say what is as it should be."""
        self._write(LoggingSeverity.INFO, text)

    def warning(self, text: str, period: float = PERIOD) -> None:
        """Say what is doubtful or left out; once in a period [s] of each kind."""
        self._fault(LoggingSeverity.WARN, text, period)

    def error(self, text: str, period: float = PERIOD) -> None:
        """Say what is wrong; once in a period [s] of each kind."""
        self._fault(LoggingSeverity.ERROR, text, period)

    def _fault(self, severity: LoggingSeverity, text: str, period: float) -> None:
        """Say a fault if it may pass."""
        if self._gate.admits(text, severity, period, stamps.now(self._steady)):
            self._write(severity, text)

    def _on_timer(self) -> None:
        """Say what has been held back."""
        for severity, text in self._gate.take_due(stamps.now(self._steady)):
            self._write(severity, text)

    def _write(self, severity: LoggingSeverity, text: str) -> None:
        """Write a line, unless that would have to wait."""
        if not any(event & select.POLLOUT for _, event in self._console.poll(0)):
            self._lost += 1
            return
        if self._lost:
            write_line(self._logger, LoggingSeverity.WARN, LOST.format(self._lost))
            self._lost = 0
        write_line(self._logger, severity, text[:LONGEST])
