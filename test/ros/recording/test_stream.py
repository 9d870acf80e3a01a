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

"""Long recordings: reports as they come, files of one time together, progress on a terminal."""

from array import array
import fcntl
import os
from pathlib import Path
import pty
import struct
import subprocess
import sys
import termios

from flat_planner_ros.core.monitor import MonitorSettings
from flat_planner_ros.ros.wire import interfaces, stamps
from flat_planner_ros.ros.wire.message_types import definition
import numpy as np
import pytest
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

pytest.importorskip('mcap')

from flat_planner_ros.ros.recording.recording import Recording, RecordingWriter  # noqa: E402, I100
from flat_planner_ros.ros.recording.replay import find_sources, replay  # noqa: E402

PLAN, STATES = '/flat_planner/plan', '/joint_states'
MOTIONS, EVERY, DURATION, PERIOD = 12, 2.0, 0.5, 0.002


def writer_at(path: Path) -> RecordingWriter:
    """Return the writer of a recording with both topics."""
    writer = RecordingWriter(path)
    for topic, kind in ((PLAN, 'trajectory_msgs/msg/JointTrajectory'), (STATES, KIND)):
        writer.add_topic(topic, kind, definition(kind), [interfaces.RELIABLE])
    return writer


KIND = 'sensor_msgs/msg/JointState'


def plan(number: int) -> JointTrajectory:
    """Return a motion that leads nowhere."""
    plan = JointTrajectory(joint_names=['joint1', 'joint2'])
    plan.header.stamp = stamps.time_msg(1000.0 + number * EVERY + 0.5)
    for time in (0.0, DURATION):
        point = JointTrajectoryPoint(positions=[0.0, 0.0])
        point.time_from_start = stamps.duration_msg(time)
        plan.points.append(point)
    return plan


def write(states: RecordingWriter, plans: RecordingWriter) -> None:
    """Write joint states, and plans before they start."""
    msg = JointState(name=['joint1', 'joint2'])
    for count in range(round(MOTIONS * EVERY / PERIOD)):
        time = count * PERIOD
        arrival = round((1000.0 + time) * 1e9)
        if count % round(EVERY / PERIOD) == 0:
            plans.write(PLAN, arrival, serialize_message(plan(round(time / EVERY))))
        msg.header.stamp = stamps.time_msg(1000.0 + time)
        msg.position = array('d', [0.0, 0.02 * np.cos(9.8 * time)])
        states.write(STATES, arrival, serialize_message(msg))
    states.close()
    plans.close()


@pytest.fixture(scope='module')
def file(tmp_path_factory):
    """Return a recording of several motions."""
    path = tmp_path_factory.mktemp('long') / 'a.mcap'
    writer = writer_at(path)
    write(writer, writer)
    return path


def judged(path: Path, read: list[float]) -> list[tuple[float, float, float]]:
    """Return start and amplitude of each motion, and the share that was read until then."""
    recording = Recording(path, read.append)
    settings = [(0, MonitorSettings(window=1.0))]
    found = replay(recording, find_sources(recording), settings)
    return [(each.report.start_time, each.report.fit.amplitude, sum(read)) for each in found]


def test_reports_come_while_the_recording_is_read(file):
    read = []
    found = judged(file, read)
    assert [start for start, *_ in found] == [1000.5 + EVERY * k for k in range(MOTIONS)]
    assert found[0][-1] < 0.6
    assert 0.9 < sum(read) <= 1.0 + 1e-9


def test_files_of_one_time_are_read_together(file, tmp_path):
    bag = tmp_path / 'bag'
    bag.mkdir()
    write(writer_at(bag / 'states.mcap'), writer_at(bag / 'plans.mcap'))
    expected = [row[:2] for row in judged(file, [])]
    assert [row[:2] for row in judged(bag, [])] == expected


def test_files_one_after_the_other_are_in_the_order_of_time(tmp_path):
    bag = tmp_path / 'bag'
    bag.mkdir()
    for name, first in (('b.mcap', 0), ('a.mcap', 100)):
        writer = writer_at(bag / name)
        for number in range(first, first + 100):
            writer.write(STATES, 10**9 + number, serialize_message(JointState(name=['joint1'])))
        writer.close()
    recording = Recording(bag)
    assert [path.name for path in recording.files] == ['b.mcap', 'a.mcap']
    times = [entry.time for entry in recording.entries({STATES})]
    assert times == [10**9 + number for number in range(200)]


PROGRAM = """
from flat_planner_ros.ros.programs.progress import progress
with progress(2.0, 'work') as advance:
    advance(1.0)
    advance(1.0)
"""


def shown(*arguments: str) -> str:
    """Return what a program shows on a terminal of its progress."""
    reader, terminal = pty.openpty()
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack('HHHH', 24, 80, 0, 0))
    try:
        command = [sys.executable, *arguments, '-c', PROGRAM]
        done = subprocess.run(command, stderr=terminal, stdout=subprocess.PIPE, check=True)
        assert done.stdout == b''
        os.write(terminal, b'.')
        return os.read(reader, 10000).decode()
    finally:
        os.close(reader)
        os.close(terminal)


def test_progress_is_shown_on_a_terminal_alone():
    pytest.importorskip('tqdm')
    assert 'work' in shown()
    command = [sys.executable, '-c', PROGRAM]
    assert subprocess.run(command, capture_output=True, check=True).stderr == b''


def test_without_its_library_there_is_no_progress(tmp_path, monkeypatch):
    (tmp_path / 'tqdm.py').write_text('raise ImportError')
    monkeypatch.setenv('PYTHONPATH', f'{tmp_path}:{os.environ.get("PYTHONPATH", "")}')
    assert shown() == '.'
