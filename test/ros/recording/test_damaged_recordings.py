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

"""Recordings as they come: known by content, read as far as they are whole, never a traceback."""

from collections.abc import Iterator
from contextlib import closing
import json
from pathlib import Path
import sqlite3

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

pytest.importorskip('mcap')
zstandard = pytest.importorskip('zstandard')

from flat_planner_ros.ros.programs import analyse  # noqa: E402, I100  They need it.
from flat_planner_ros.ros.recording.recording import RecordingWriter  # noqa: E402
from flat_planner_ros.ros.wire import interfaces, stamps  # noqa: E402
from flat_planner_ros.ros.wire.message_types import definition  # noqa: E402

START, DURATION, WINDOW, PERIOD = 1000.0, 0.5, 1.5, 0.01
SWING, RATE, DECAY = 0.02, 9.785, 0.32
PLAN, STATES = '/flat_planner/plan', '/joint_states'
KINDS = {PLAN: 'trajectory_msgs/msg/JointTrajectory', STATES: 'sensor_msgs/msg/JointState'}


def messages() -> Iterator[tuple[str, float, bytes]]:
    """Yield topic, time from the start [s] and bytes of all messages of a motion."""
    plan = JointTrajectory(joint_names=['joint1', 'joint2'])
    plan.header.stamp = stamps.time_msg(START)
    for s in np.linspace(0.0, 1.0, 51).tolist():
        point = JointTrajectoryPoint(time_from_start=stamps.duration_msg(s * DURATION))
        point.positions = [10 * s**3 - 15 * s**4 + 6 * s**5, 0.0]
        plan.points.append(point)
    yield PLAN, -0.1, serialize_message(plan)
    for time in np.arange(-0.05, DURATION + WINDOW + 0.1, PERIOD).tolist():
        s = min(max(time / DURATION, 0.0), 1.0)
        after = time - DURATION
        swing = SWING * np.exp(-DECAY * after) * np.cos(RATE * after) if after >= 0.0 else 0.0
        msg = JointState(name=['joint1', 'joint2'])
        msg.header.stamp = stamps.time_msg(START + time)
        msg.position = [10 * s**3 - 15 * s**4 + 6 * s**5, float(swing)]
        yield STATES, time, serialize_message(msg)


def write_mcap(path: Path, *, spoilt: int = 0) -> None:
    """Write an MCAP file in which some messages are cut."""
    writer = RecordingWriter(path)
    for topic, kind in KINDS.items():
        writer.add_topic(topic, kind, definition(kind), [interfaces.RELIABLE])
    for number, (topic, time, data) in enumerate(messages()):
        is_spoilt = topic == STATES and 100 <= number < 100 + spoilt
        writer.write(topic, round((START + time) * 1e9), data[:20] if is_spoilt else data)
    writer.close()


def write_sqlite(path: Path, *, compressed: bool = False) -> None:
    """Write an sqlite3 bag as rosbag2 does, each message compressed or not."""
    pack = zstandard.ZstdCompressor().compress if compressed else bytes
    numbers = {topic: number for number, topic in enumerate(KINDS, 1)}
    with closing(sqlite3.connect(path)) as database:
        database.execute('CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT)')
        database.execute(
            'CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, '
            'data BLOB)'
        )
        for topic, number in numbers.items():
            database.execute('INSERT INTO topics VALUES (?, ?, ?)', (number, topic, KINDS[topic]))
        for topic, time, data in messages():
            database.execute(
                'INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)',
                (numbers[topic], round((START + time) * 1e9), pack(data)),
            )
        database.commit()


def analysed(path: Path, capsys) -> tuple[int, str, str, dict]:
    """Return exit code, output, errors and what the program writes, nothing where it fails."""
    written = path.with_name('report.json')
    written.unlink(missing_ok=True)
    command = ['analyse', str(path), '--json', str(written), '--window', str(WINDOW)]
    code = analyse.main(command)
    output = capsys.readouterr()
    document = json.loads(written.read_text()) if written.exists() else {}
    return code, output.out, output.err, document


def amplitude(path: Path, capsys) -> float:
    """Return the amplitude of the only report, which must be there."""
    code, _, err, document = analysed(path, capsys)
    assert (code, err) == (0, '')
    (report,) = document['reports']
    return report['values']['amplitude']


@pytest.mark.parametrize('name', ['a.MCAP', 'a', 'a.bag', 'a.db3'])
@pytest.mark.parametrize('write', [write_mcap, write_sqlite])
def test_a_file_is_known_by_its_content(name, write, tmp_path, capsys):
    write(tmp_path / name)
    assert amplitude(tmp_path / name, capsys) == pytest.approx(SWING, rel=1e-3)


@pytest.mark.parametrize('name', ['a.mcap.zst', 'a.mcap.zstd', 'a'])
@pytest.mark.parametrize('write', [write_mcap, write_sqlite])
def test_a_compressed_file_is_read(name, write, tmp_path, capsys):
    write(tmp_path / 'plain')
    packed = zstandard.ZstdCompressor().compress((tmp_path / 'plain').read_bytes())
    (tmp_path / name).write_bytes(packed)
    assert amplitude(tmp_path / name, capsys) == pytest.approx(SWING, rel=1e-3)


def test_compressed_messages_are_read(tmp_path, capsys):
    write_sqlite(tmp_path / 'a.db3', compressed=True)
    assert amplitude(tmp_path / 'a.db3', capsys) == pytest.approx(SWING, rel=1e-3)


@pytest.mark.parametrize('metadata', ['storage_identifier: ""\n', 'no: [yaml', None])
def test_a_directory_is_read_whatever_its_metadata(metadata, tmp_path, capsys):
    bag = tmp_path / 'bag'
    bag.mkdir()
    write_mcap(bag / 'bag_0.mcap')
    if metadata is not None:
        (bag / 'metadata.yaml').write_text(metadata)
    assert amplitude(bag, capsys) == pytest.approx(SWING, rel=1e-3)


def test_damaged_messages_are_left_out_and_counted(tmp_path, capsys):
    write_mcap(tmp_path / 'a.mcap', spoilt=7)
    code, _, err, document = analysed(tmp_path / 'a.mcap', capsys)
    assert (code, err) == (0, '')
    assert document['damage'] == '7 messages cannot be read, on /joint_states'
    assert document['reports'][0]['values']['amplitude'] == pytest.approx(SWING, rel=1e-3)


def test_a_file_without_its_plan_says_that_it_is_cut(tmp_path, capsys):
    write_mcap(tmp_path / 'a.mcap')
    data = (tmp_path / 'a.mcap').read_bytes()
    (tmp_path / 'a.mcap').write_bytes(data[:200])
    code, _, err, _ = analysed(tmp_path / 'a.mcap', capsys)
    assert code == 1
    assert 'the recording is cut short or damaged' in err


@pytest.mark.parametrize('content', [b'', b'hello', b'\x28\xb5\x2f\xfd', b'\x89MCAP0\r\n'])
def test_what_is_no_recording_is_said_in_a_line(content, tmp_path, capsys):
    (tmp_path / 'a').write_bytes(content)
    code, _, err, _ = analysed(tmp_path / 'a', capsys)
    assert code == 1
    assert err.startswith('analyse: ')
    assert err.count('\n') == 1


def test_other_types_under_the_usual_names_are_said_in_a_line(tmp_path, capsys):
    kind = 'std_msgs/msg/String'
    writer = RecordingWriter(tmp_path / 'a.mcap')
    for topic in KINDS:
        writer.add_topic(topic, kind, definition(kind), [interfaces.RELIABLE])
        writer.write(topic, 10**9, serialize_message(String(data='x')))
    writer.close()
    code, _, err, _ = analysed(tmp_path / 'a.mcap', capsys)
    assert code == 1
    assert 'no topic flat_planner/plan of type' in err
    assert err.count('\n') == 1


def packed(write, tmp_path: Path) -> bytes:
    """Return a recording, compressed as a whole."""
    write(tmp_path / 'plain')
    return zstandard.ZstdCompressor().compress((tmp_path / 'plain').read_bytes())


def whole(write, tmp_path: Path) -> bytes:
    """Return a recording as it is."""
    write(tmp_path / 'plain')
    return (tmp_path / 'plain').read_bytes()


@pytest.mark.parametrize('form', [whole, packed])
@pytest.mark.parametrize('write', [write_mcap, write_sqlite])
def test_no_damage_ends_in_a_traceback(write, form, tmp_path, capsys):
    data = form(write, tmp_path)
    random = np.random.default_rng(5)
    spoilt = [data[:size] for size in range(0, len(data), 1024)]
    for place in random.integers(0, len(data), 40).tolist():
        changed = bytearray(data)
        changed[place] ^= 1 << int(random.integers(8))
        spoilt.append(bytes(changed))
    path = tmp_path / 'spoilt'
    codes = set()
    for content in spoilt:
        path.write_bytes(content)
        code, out, err, _ = analysed(path, capsys)
        codes.add(code)
        assert code == 0 or out or err.count('\n') == 1
        assert code == 0 or out or err.startswith('analyse: ')
    assert 1 in codes


def test_a_topic_may_have_several_channels_and_others_no_schema(tmp_path, capsys):
    """As converters and splitters write them; a later channel of a topic may be announced late."""
    from mcap.writer import Writer

    path = tmp_path / 'a.mcap'
    with path.open('wb') as file:
        writer = Writer(file)
        writer.start(profile='ros2')
        bare = writer.register_channel('/note', 'json', 0)
        writer.add_message(bare, 1, b'{}', 1)
        for number, (topic, time, data) in enumerate(messages()):
            if number % 50 == 0:
                channels = {}
            if topic not in channels:
                kind = KINDS[topic]
                schema = writer.register_schema(kind, 'ros2msg', definition(kind).encode())
                channels[topic] = writer.register_channel(topic, 'cdr', schema)
            stamp = round((START + time) * 1e9)
            writer.add_message(channels[topic], stamp, data, stamp)
        writer.finish()
    assert amplitude(path, capsys) == pytest.approx(SWING, rel=1e-3)
