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

"""Recordings: complete, readable by others, safe from sudden ends, and judged as at the time."""

from array import array
from contextlib import suppress
from functools import partial
import json
from pathlib import Path
import signal
import sys

from diagnostic_msgs.msg import DiagnosticArray
from flat_planner_ros.ros.nodes.monitor_node import MonitorNode
from flat_planner_ros.ros.nodes.planner_node import PlannerNode
from flat_planner_ros.ros.nodes.plant_node import PlantNode
from flat_planner_ros.ros.wire import interfaces, stamps
from flat_planner_ros.ros.wire.message_types import definition, message_class, UnknownType
import numpy as np
import pytest
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message
from ros.rig import goal, stamp, values
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

pytest.importorskip('mcap')
rosbag2 = pytest.importorskip('rosbags.rosbag2')
highlevel = pytest.importorskip('rosbags.highlevel')

from flat_planner_ros.ros.programs import analyse  # noqa: E402, I100  They need it.
from flat_planner_ros.ros.recording.recorder_node import RecorderNode  # noqa: E402
from flat_planner_ros.ros.recording.recording import Recording, RecordingWriter  # noqa: E402
from flat_planner_ros.ros.recording.storage import UnreadableRecording  # noqa: E402
from mcap.reader import make_reader  # noqa: E402

OURS = {
    '/flat_planner/joint_trajectory',
    '/flat_planner/plan',
    '/flat_planner/flat_plan',
    '/flat_planner/reference',
    '/flat_planner/status',
    '/flat_monitor/residual',
    '/flat_monitor/report',
    '/joint_states',
}
"""Topics of a motion."""

MONITORED = {'/flat_monitor/residual', '/flat_monitor/report', '/diagnostics'}
"""Topics of a monitor."""

WINDOW = 1.5
"""Time after a motion that is judged [s]."""

AGREEMENT = 1e-9
"""Relative difference of two reports with 9 digits that say the same [-]."""

START, MOTION, PERIOD = 1000.0, 0.5, 0.01
"""Start and duration of a motion, and time between two joint states [s]."""

SWING, DECAY, RATE = 0.02, 0.32, 9.785
"""Amplitude [rad], decay [1/s] and angular frequency [rad/s] of the passive joint after it."""


def plan() -> JointTrajectory:
    """Return a motion of joint 1 to 1 rad and back to rest."""
    points = [
        JointTrajectoryPoint(
            positions=[10 * s**3 - 15 * s**4 + 6 * s**5, 0.0],
            time_from_start=stamps.duration_msg(s * MOTION),
        )
        for s in np.linspace(0.0, 1.0, 51).tolist()
    ]
    msg = JointTrajectory(joint_names=['joint1', 'joint2'], points=points)
    msg.header.stamp = stamps.time_msg(START)
    return msg


def swinging(time: float) -> JointState:
    """Return a state at a time from the start: at rest, then swinging about the final pose."""
    after = time - MOTION
    swing = SWING * np.exp(-DECAY * after) * np.cos(RATE * after) if after >= 0.0 else 0.0
    # A free joint 1 moves against the last link, in proportion to the inertias.
    position = [1.0 - 3.3e-5 / 6.4e-4 * swing, swing]
    msg = JointState(name=['joint1', 'joint2'], position=array('d', position))
    msg.header.stamp = stamps.time_msg(START + time)
    return msg


def record(graph, path: Path, **options) -> RecorderNode:
    """Return a recorder in this process."""
    return graph.create(partial(RecorderNode, path, **options))


def start_recorder(graph, *arguments: str):
    """Return a recorder in a process of its own, once it listens."""
    process = graph.start('record', *arguments)
    graph.expect(
        lambda: process.exit_code is not None or 'flat_recorder' in graph.probe.get_node_names(),
        'the recorder',
    )
    return process


def publish_states(graph, count: int) -> None:
    """Publish joint states with the times 1, 2, ... s, once somebody listens."""
    for k in range(count):
        msg = JointState(name=['joint1'], position=array('d', [float(k)]))
        msg.header.stamp.sec = k + 1
        graph.publish('/joint_states', msg, 1000)


def record_motion(graph, path: Path, speed: float = 3.0) -> list[DiagnosticArray]:
    """
    Record the three nodes for a motion; return the reports.

    Their time goes on by `speed` simulated seconds per second, or as fast as the machine follows.
    """
    simulated = {'use_sim_time': True}
    graph.create(PlannerNode, {'start_delay': 0.5, **simulated})
    graph.create(MonitorNode, {'window': WINDOW, **simulated})
    # So rarely that one process hears all of them several times on a busy machine.
    plant = {'mismatch.stiffness_scale': 1.1, 'noise.position_std': 1e-4, 'publish_rate': 50.0}
    graph.create(PlantNode, {'publish_clock': True, 'real_time_factor': speed, **plant})
    reports = graph.collect(DiagnosticArray, '/flat_monitor/report', interfaces.LATCHED)
    states = graph.collect(JointState, '/joint_states')
    graph.expect(lambda: states, 'joint states')
    recorder = record(graph, path)
    for topic in ('/joint_states', '/flat_planner/joint_trajectory'):
        graph.expect(
            lambda topic=topic: any(
                info.node_name == recorder.get_name()
                for info in graph.probe.get_subscriptions_info_by_topic(topic)
            ),
            f'the recorder on {topic}',
        )
    graph.publish('/flat_planner/goal', goal(1.0, 0.5))
    graph.expect(lambda: reports, 'a report')
    judged = float(values(reports[0])['end_time']) + WINDOW
    # The recorder takes its messages in turns with the test; a look into the file on the way would
    # take as long as hundreds of them.
    graph.expect(
        lambda: stamp(states[-1]) >= judged + 0.1, 'the samples that the report rests on, and more'
    )
    graph.remove(recorder)
    assert set(Recording(path).topics) >= OURS
    assert last_state(path) >= judged
    return reports


def last_state(path: Path) -> float:
    """Return the time of the last joint state that has been recorded [s]."""
    *_, last = Recording(path).entries({'/joint_states'})
    return stamp(deserialize_message(last.message, JointState))


def test_three_nodes_are_recorded_and_judged_again(graph, tmp_path, capsys):
    path = tmp_path / 'motion.mcap'
    # No faster: the monitor hears the newest only, and is to lose none.
    reports = record_motion(graph, path, 1.0)

    with highlevel.AnyReader([path]) as reader:
        assert set(reader.topics) >= OURS
        for connection, _, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            ours = deserialize_message(raw, message_class(connection.msgtype))
            if connection.topic == '/joint_states':
                assert message.position.tolist() == ours.position.tolist()
        counts = {topic: info.msgcount for topic, info in reader.topics.items()}
    assert counts['/flat_monitor/report'] == 1
    # One that sends a goal and waits for a listener must not take the recorder for it.
    assert '/flat_planner/goal' not in counts

    assert analyse.main(['analyse', str(path), '--json', '-']) == 0
    (report,) = json.loads(capsys.readouterr().out)['reports']
    live = values(reports[0])
    again = report['values']
    assert again['start_time'] == float(live['start_time'])
    # On a busy machine it does lose samples that are recorded.
    if again['samples'] == int(live['samples']) and 'amplitude' in live:
        assert again['amplitude'] == pytest.approx(float(live['amplitude']), rel=AGREEMENT)


def test_a_recording_gives_the_report_of_the_time(graph, tmp_path, capsys):
    """Sample by sample, so that the monitor loses none: all values agree, model and all."""
    path = tmp_path / 'motion.mcap'
    model = {
        'joints': ['joint1', 'joint2'],
        'model.inertia_star': [6.4e-4, 3.3e-5],
        'model.stiffness': 3.1e-3,
        'model.damping': 2.1e-5,
    }
    graph.create(MonitorNode, {'window': WINDOW, 'timeout': 10.0, **model})
    recorder = record(graph, path)
    reports = graph.collect(DiagnosticArray, '/flat_monitor/report', interfaces.LATCHED)
    residuals = graph.collect(JointState, '/flat_monitor/residual')
    graph.publish('/flat_planner/plan', plan(), interfaces.LATCHED, readers=2)
    graph.expect(lambda: ' 1 messages' in recorder.summary, 'the plan')
    count = 0
    for k in range(round((MOTION + WINDOW) / PERIOD) + 1):
        graph.publish('/joint_states', swinging(k * PERIOD), readers=2)
        graph.expect(lambda n=count: len(residuals) > n or reports, 'a residual')
        count = len(residuals)
    graph.expect(lambda: reports, 'a report')
    topics = {'/flat_planner/plan', '/joint_states', *MONITORED}
    graph.expect(lambda: set(Recording(path).topics) >= topics, 'all that was said')
    graph.expect(lambda: b'stiffness' in path.read_bytes(), 'parameters of the monitor')
    graph.remove(recorder)

    assert analyse.main(['analyse', str(path), '--json', '-']) == 0
    (report,) = json.loads(capsys.readouterr().out)['reports']
    its = values(reports[0])
    assert set(report['values']) == set(its) >= {'amplitude', 'stiffness_estimate'}
    assert report['message'] == reports[0].status[0].message
    for key, text in its.items():
        value = report['values'][key]
        if isinstance(value, float):
            assert value == pytest.approx(float(text), rel=AGREEMENT), key
        else:
            assert str(value).lower() == text, key
    assert report['values']['amplitude'] == pytest.approx(SWING, rel=1e-3)
    assert analyse.main(['analyse', str(path)]) == 0
    assert 'the recorded report says the same' in capsys.readouterr().out


def test_a_recording_is_what_the_specification_of_mcap_asks_for(graph, tmp_path):
    decoder = pytest.importorskip('mcap_ros2.decoder')
    path = tmp_path / 'states.mcap'
    recorder = record(graph, path)
    publish_states(graph, 20)
    graph.publish('/flat_planner/plan', goal(1.0, 0.5), interfaces.LATCHED)
    graph.expect(lambda: ': 21 messages on 2 topics' in recorder.summary, 'all messages')
    graph.remove(recorder)
    with path.open('rb') as file:
        reader = make_reader(
            file, validate_crcs=True, decoder_factories=[decoder.DecoderFactory()]
        )
        assert reader.get_header().profile == 'ros2'
        summary = reader.get_summary()
        assert {s.encoding for s in summary.schemas.values()} == {'ros2msg'}
        assert {c.message_encoding for c in summary.channels.values()} == {'cdr'}
        decoded = [item.decoded_message for item in reader.iter_decoded_messages()]
        assert summary.statistics.message_count == len(decoded) == 21
        states = [message.position for message in decoded if hasattr(message, 'position')]
        assert states == [[float(k)] for k in range(20)]
    with rosbag2.Reader(path) as reader:
        offers = {c.topic: c.ext.offered_qos_profiles[0] for c in reader.connections}
    assert offers['/flat_planner/plan'].durability.name == 'TRANSIENT_LOCAL'
    assert offers['/joint_states'].durability.name == 'VOLATILE'


def test_what_was_latched_before_is_recorded_and_best_effort_is_heard(graph, tmp_path):
    latched = graph.probe.create_publisher(
        JointTrajectory, '/flat_planner/plan', interfaces.LATCHED
    )
    latched.publish(goal(1.0))
    quality = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
    states = graph.probe.create_publisher(JointState, '/joint_states', quality)
    recorder = record(graph, tmp_path / 'x.mcap')
    graph.expect(states.get_subscription_count, 'the recorder on joint_states')

    def are_both_recorded() -> bool:
        states.publish(JointState(name=['joint1'], position=array('d', [0.0])))
        return 'on 2 topics' in recorder.summary

    graph.expect(are_both_recorded, 'a plan and a joint state')


def test_a_publisher_that_comes_to_offer_less_is_heard(graph, tmp_path):
    recorder = record(graph, tmp_path / 'x.mcap')
    quality = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
    states = graph.probe.create_publisher(JointState, '/joint_states', quality)

    def is_recorded() -> bool:
        states.publish(JointState(name=['joint1'], position=array('d', [0.0])))
        return 'on 1 topics' in recorder.summary

    graph.expect(is_recorded, 'a joint state')


def test_a_namespace_is_followed(graph, tmp_path):
    path = tmp_path / 'left.mcap'
    recorder = graph.create(partial(RecorderNode, path), None, '-r', '__ns:=/left')
    graph.publish('/left/flat_planner/joint_trajectory', goal(1.0, 0.5))
    graph.publish('/left/joint_states', JointState(name=['joint1']))
    graph.expect(lambda: ': 2 messages on 2 topics' in recorder.summary, 'both messages')
    graph.remove(recorder)
    assert set(Recording(path).topics) == {
        '/left/flat_planner/joint_trajectory',
        '/left/joint_states',
    }


def test_all_topics_are_recorded_if_asked_for(graph, tmp_path):
    recorder = record(graph, tmp_path / 'x.mcap', everything=True)
    graph.publish('/elsewhere', String(data='x'))
    graph.expect(lambda: ' 0 messages' not in recorder.summary, 'a message of another topic')


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_recording_in_order(graph, tmp_path, number):
    path = tmp_path / 'x.mcap'
    process = start_recorder(graph, '--output', str(path))
    publish_states(graph, 10)
    graph.expect(lambda: path.exists() and path.stat().st_size > 1000, 'messages in the file')
    assert process.stop(number) == 0
    assert 'Traceback' not in process.stderr
    assert '10 messages on 1 topics' in process.stdout
    recording = Recording(path)
    assert recording.damage == ''
    assert len(list(recording.entries({'/joint_states'}))) == 10


def test_a_killed_recorder_leaves_a_file_that_can_be_read(graph, tmp_path):
    path = tmp_path / 'x.mcap'
    process = start_recorder(graph, '--output', str(path))
    publish_states(graph, 10)

    def is_flushed() -> bool:
        with suppress(UnreadableRecording):  # not even its head is written yet
            return len(list(Recording(path).entries({'/joint_states'}))) == 10
        return False

    graph.expect(is_flushed, 'messages in the file')
    process.kill()
    recording = Recording(path)
    assert len(list(recording.entries({'/joint_states'}))) == 10
    assert recording.damage
    # Also if the last piece was being written.
    torn = tmp_path / 'torn.mcap'
    torn.write_bytes(path.read_bytes()[:-7])
    recording = Recording(torn)
    assert recording.topics == {'/joint_states': 'sensor_msgs/msg/JointState'} or not (
        list(recording.entries({'/joint_states'}))
    )
    assert recording.damage


def test_a_full_disk_is_one_line(graph):
    process = graph.start('record', '--output', '/dev/full', '--force')
    graph.expect(lambda: process.exit_code is not None, 'the end')
    assert process.exit_code == 1
    assert 'Traceback' not in process.stderr
    assert process.stderr.splitlines()[-1] == 'cannot write /dev/full: No space left on device'


def test_a_disk_that_fills_up_is_one_line_and_leaves_what_fitted(graph, tmp_path):
    path = tmp_path / 'x.mcap'
    limit = (
        f'ulimit -f 8 && exec {sys.executable} -m flat_planner_ros.ros.programs.record -o {path}'
    )
    process = graph.run(['bash', '-c', limit])
    states = graph.probe.create_publisher(JointState, '/joint_states', 1000)
    noise = np.random.default_rng(1)

    def is_full() -> bool:
        msg = JointState(name=['joint1'], position=array('d', noise.random(100)))
        states.publish(msg)
        return process.exit_code is not None

    graph.expect(is_full, 'the end')
    assert process.exit_code == 1
    assert process.stderr.splitlines()[-1] == f'cannot write {path}: File too large'
    assert 'Traceback' not in process.stderr
    assert path.stat().st_size <= 8 * 1024
    assert Recording(path).damage


@pytest.mark.parametrize(
    ('name', 'reason'),
    [
        ('there.mcap', '{} exists; --force replaces it'),
        ('no/x.mcap', 'cannot write {}: No such file or directory'),
    ],
)
def test_a_file_that_cannot_be_opened_is_one_line(graph, tmp_path, name, reason):
    (tmp_path / 'there.mcap').write_text('precious')
    process = graph.start('record', '-o', str(tmp_path / name))
    assert process.wait() == 1
    assert process.stderr == f'cannot start: {reason.format(tmp_path / name)}\n'
    assert (tmp_path / 'there.mcap').read_text() == 'precious'


@pytest.mark.parametrize('program', ['record', 'analyse'])
def test_a_missing_library_is_one_line(graph, tmp_path, program):
    (tmp_path / 'mcap.py').write_text('raise ModuleNotFoundError("none", name="mcap")')
    paths = f'{tmp_path}:{Path(analyse.__file__).parents[3]}'
    process = graph.start(program, *(['x.mcap'] * (program == 'analyse')), PYTHONPATH=paths)
    assert process.wait() == 1
    expected = "mcap is not installed: pip install '.[record]' in the checkout, or mcap itself\n"
    assert process.stderr == expected


def test_definitions_are_complete():
    text = definition('trajectory_msgs/msg/JointTrajectory')
    parts = text.split('=' * 80 + '\n')
    assert [part.partition('\n')[0] for part in parts[1:]] == [
        'MSG: std_msgs/Header',
        'MSG: trajectory_msgs/JointTrajectoryPoint',
        'MSG: builtin_interfaces/Time',
        'MSG: builtin_interfaces/Duration',
    ]
    for name in ('sensor_msgs/JointState', 'nowhere_msgs/msg/X', 'sensor_msgs/msg/X'):
        with pytest.raises(UnknownType, match=name.split('/')[-1]):
            definition(name)


def test_a_bag_of_another_storage_with_other_names_is_analysed(graph, tmp_path, capsys):
    """An sqlite3 bag, other names, a command without a stamp, no model: no expectations."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import get_typestore, Stores

    path = tmp_path / 'motion.mcap'
    reports = record_motion(graph, path)
    names = {'/flat_planner/plan': '/robot/command', '/joint_states': '/robot/measured'}
    bag = tmp_path / 'bag'
    types = get_typestore(Stores.ROS2_JAZZY)
    with Writer(bag, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connections = {}
        for entry in Recording(path).entries(names):
            if entry.topic not in connections:
                connections[entry.topic] = writer.add_connection(
                    names[entry.topic], entry.kind, typestore=types
                )
            writer.write(connections[entry.topic], entry.time, entry.message)
    assert analyse.main(['analyse', str(bag)]) == 1
    assert '/robot/command' in capsys.readouterr().err
    chosen = ['--plan', '/robot/command', '--joint-states', '/robot/measured']
    assert (
        analyse.main(['analyse', str(bag), *chosen, '--json', '-', '--window', str(WINDOW)]) == 0
    )
    (report,) = json.loads(capsys.readouterr().out)['reports']
    assert report['values']['start_time'] == float(values(reports[0])['start_time'])
    assert report['values']['samples'] > 0
    assert 'frequency_expected' not in report['values']


def test_recorded_joint_states_in_parts_without_stamps_are_analysed(tmp_path, capsys):
    path = tmp_path / 'parts.mcap'
    writer = RecordingWriter(path)
    for topic, kind in (('/flat_planner/plan', JointTrajectory), ('/joint_states', JointState)):
        name = f'{kind.__module__.split(".")[0]}/msg/{kind.__name__}'
        writer.add_topic(topic, name, definition(name), [interfaces.RELIABLE])
    writer.write('/flat_planner/plan', round(START * 1e9), serialize_message(plan()))
    for k in range(round((MOTION + WINDOW) / PERIOD) + 2):
        whole = swinging(k * PERIOD)
        for name, position in zip(whole.name, whole.position, strict=True):
            part = JointState(name=[name], position=[position])
            arrival = round((START + k * PERIOD) * 1e9)
            writer.write('/joint_states', arrival, serialize_message(part))
    writer.close()
    assert analyse.main(['analyse', str(path), '--json', '-', '--window', str(WINDOW)]) == 0
    document = json.loads(capsys.readouterr().out)
    (report,) = document['reports']
    assert report['values']['amplitude'] == pytest.approx(SWING, rel=1e-3)
    assert len(document['remarks']) == 3
    assert 'joint states have no stamp: the time of their arrival is taken' in document['remarks']


def test_a_recorder_says_that_joint_states_have_no_stamp(graph, tmp_path):
    recorder = record(graph, tmp_path / 'a.mcap')
    for _ in range(3):
        graph.publish('/joint_states', JointState(name=['joint1'], position=[0.0]))
    graph.expect(lambda: ' 3 messages' in recorder.summary, 'the messages')
    graph.expect(lambda: graph.logged('have no stamp'), 'a warning')
    assert len(graph.logged('have no stamp')) == 1


def test_a_motion_is_drawn(graph, tmp_path):
    pytest.importorskip('matplotlib')
    path, picture = tmp_path / 'motion.mcap', tmp_path / 'motion.png'
    record_motion(graph, path)
    film = tmp_path / 'motion.gif'
    arguments = ['--plot', str(picture), '--animate', str(film)]
    assert analyse.main(['analyse', str(path), *arguments]) == 0
    assert picture.read_bytes().startswith(b'\x89PNG')
    assert film.read_bytes().startswith(b'GIF89a')


@pytest.mark.parametrize(
    ('name', 'content', 'text'),
    [
        ('no.mcap', None, 'No such file'),
        ('text.mcap', b'hello', 'is no MCAP file'),
        ('empty.mcap', b'', 'is no MCAP file'),
        ('x.txt', b'hello', 'is no MCAP file and no sqlite3 bag, by its content'),
    ],
)
def test_what_is_no_recording_is_one_line(tmp_path, capsys, name, content, text):
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    assert analyse.main(['analyse', str(path)]) == 1
    complaint = capsys.readouterr().err
    assert text in complaint
    assert complaint.count('\n') == 1
