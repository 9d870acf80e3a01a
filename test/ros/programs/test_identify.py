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

"""A recording of a simulated arm becomes a parameter file that the nodes read."""

from array import array
from dataclasses import replace
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from flat_planner_ros.core.arm import PlanarArm
from flat_planner_ros.core.model_fit import Measurements
from flat_planner_ros.ros.parameters import planner as planner_parameters
from flat_planner_ros.ros.parameters import plant as plant_parameters
from flat_planner_ros.ros.parameters.parameter_file import read_settings
from flat_planner_ros.ros.wire import stamps
from flat_planner_ros.ros.wire.interfaces import DIAGNOSTICS, TRACKER_NAME
from flat_planner_ros.ros.wire.message_types import definition
import numpy as np
import pytest
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from recorded_arm import held, recorded
from sensor_msgs.msg import JointState

pytest.importorskip('mcap')

from flat_planner_ros.ros.parameters.fitted_file import MATCHES  # noqa: E402, I100
from flat_planner_ros.ros.programs import identify  # noqa: E402, I100  It needs it.
from flat_planner_ros.ros.recording.csv_table import UnreadableTable  # noqa: E402
from flat_planner_ros.ros.recording.measured import measured  # noqa: E402
from flat_planner_ros.ros.recording.recording import RecordingWriter  # noqa: E402

SHIPPED = Path(__file__).resolve().parents[3] / 'config' / 'arm_2dof.yaml'
KIND = 'sensor_msgs/msg/JointState'
NEWS = 'diagnostic_msgs/msg/DiagnosticArray'
BEGUN = 1000.0
"""Time of the first sample [s]."""

BELIEVED = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
TRUE = PlanarArm.reduced(
    inertia_star=(7e-4, 3e-5), stiffness=2.6e-3, damping=2.6e-5, viscous_friction=[2e-4]
)


def write(path: Path, *, with_efforts: bool = True, tracker: str = '', until: float = 6.2) -> None:
    """Write a recording of goals, with the spring's effort as drivers report it."""
    seen = recorded(TRUE, BELIEVED, noise=1e-5, until=until)
    writer = RecordingWriter(path)
    if tracker:
        writer.add_topic(DIAGNOSTICS, NEWS, definition(NEWS), [])
        word = DiagnosticStatus(name=TRACKER_NAME, hardware_id=tracker)
        word.values = [KeyValue(key='phase', value='tracking')]
        msg = DiagnosticArray(status=[word])
        msg.header.stamp = stamps.time_msg(BEGUN + 0.1)
        writer.write(DIAGNOSTICS, int((BEGUN + 0.1) * 1e9), serialize_message(msg))
    writer.add_topic('/joint_states', KIND, definition(KIND), [QoSProfile(depth=10)])
    for time, angles, efforts in zip(seen.times, seen.positions, seen.efforts, strict=True):
        msg = JointState(name=['joint2', 'joint1'], position=array('d', angles[::-1]))
        msg.header.stamp = stamps.time_msg(BEGUN + time)
        if with_efforts:
            msg.effort = array('d', [float('nan'), *efforts])
        writer.write('/joint_states', int((BEGUN + time) * 1e9), serialize_message(msg))
    writer.close()


def test_a_recording_becomes_a_parameter_file(tmp_path, capsys):
    pytest.importorskip('matplotlib')
    bag, fitted, picture = (tmp_path / name for name in ('a.mcap', 'arm.yaml', 'fit.png'))
    write(bag)
    believed = tmp_path / 'believed.yaml'
    scale = 'stiffness_scale: {}'.format
    believed.write_text(SHIPPED.read_text('utf-8').replace(scale(1.0), scale(0.87)), 'utf-8')
    options = ['--params-file', str(believed), '-o', str(fitted), '--plot', str(picture)]
    assert identify.main(['identify', str(bag), *options]) == 0
    printed = capsys.readouterr().out
    assert 'stiffness' in printed
    assert picture.stat().st_size > 10_000
    rows, build = plant_parameters.ROWS, plant_parameters.build
    arm = read_settings(fitted, rows, build, node='flat_plant').simulation.arm
    assert [*arm.inertia_star, arm.stiffness, arm.damping] == pytest.approx(
        [*TRUE.inertia_star, TRUE.stiffness, TRUE.damping], rel=0.01
    )
    assert np.allclose(arm.viscous_friction, TRUE.viscous_friction, rtol=0.01)
    text = fitted.read_text('utf-8')
    assert f'# {printed.splitlines()[0]}' in text
    assert scale(0.87) not in text
    assert MATCHES in text


def test_efforts_of_a_tracked_arm_are_held(tmp_path):
    """Another arm's tracker is none."""
    joints = 'joint1', 'joint2'
    for tracker, is_tracked in (
        ('/flat_tracker', True),
        ('/arm2/flat_tracker', False),
        ('', False),
    ):
        bag = tmp_path / f'{is_tracked}{len(tracker)}.mcap'
        write(bag, tracker=tracker, until=1.0)
        assert measured([bag], joints).are_held == is_tracked
    assert measured([bag, *tmp_path.glob('True*')], joints).are_held


def test_a_trusted_inertia_is_kept(tmp_path, capsys):
    bag = tmp_path / 'a.mcap'
    write(bag)
    options = ['--params-file', str(SHIPPED), '--trust', 'inertia']
    assert identify.main(['identify', str(bag), str(bag), *options]) == 0
    scale = BELIEVED.inertia_star.both / TRUE.inertia_star.both
    said = float(capsys.readouterr().out.split()[3])
    assert said == pytest.approx(scale, rel=1e-3)


def rosbag_of(path: Path, seen: Measurements) -> None:
    """Write a directory as `ros2 bag record` does, by a library of others."""
    rosbag2 = pytest.importorskip('rosbags.rosbag2')
    typesys = pytest.importorskip('rosbags.typesys')
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    with rosbag2.Writer(path, version=9) as writer:
        link = writer.add_connection('/joint_states', KIND, typestore=store)
        for time, angles, efforts in zip(seen.times, seen.positions, seen.efforts, strict=True):
            msg = JointState(name=['joint1', 'joint2'], position=array('d', angles))
            msg.header.stamp = stamps.time_msg(BEGUN + time)
            msg.effort = array('d', [*efforts, float('nan')])
            writer.write(link, int((BEGUN + time) * 1e9), serialize_message(msg))


def test_a_directory_of_rosbag2_and_a_table_are_the_same(tmp_path):
    seen = recorded(TRUE, BELIEVED, until=1.0, goals=(1.0,))
    bag, table = tmp_path / 'bag', tmp_path / 'run.csv'
    rosbag_of(bag, seen)
    # As PlotJuggler exports it, with a line that is not whole.
    names = '__time,/joint_states/joint1/effort,/joint_states/joint1/position,joint2.position'
    columns = seen.times + BEGUN, seen.efforts[:, 0], *seen.positions.T
    lines = [','.join(f'{number:.17g}' for number in row) for row in zip(*columns, strict=True)]
    table.write_text('\n'.join([names, *lines, '1e9,,0.1,0.2']), 'utf-8')
    joints = 'joint1', 'joint2'
    for found in (measured([path], joints) for path in (bag, table)):
        assert found.times == pytest.approx(seen.times, abs=1e-6)
        assert found.positions == pytest.approx(seen.positions, abs=1e-12)
        assert found.efforts == pytest.approx(seen.efforts, abs=1e-12)
    table.write_text('time;joint1.position\n0;0', 'utf-8')
    with pytest.raises(UnreadableTable, match='no column for joint2.position'):
        measured([table], joints)


def test_a_vertical_arm_is_written_as_the_nodes_read_it(tmp_path):
    source = SHIPPED.with_name('arm_4dof.yaml')
    rows, build = planner_parameters.ROWS, planner_parameters.build
    believed = read_settings(source, rows, build, node='flat_planner').session.arm
    true = replace(
        believed.with_last_links(
            inertia_star=tuple(1.1 * each for each in believed.inertia_star),
            stiffness=0.22,
            damping=4e-4,
            viscous=1e-3,
            coulomb=2e-3,
        ),
        static_moment=np.append(0.97 * believed.static_moment[:2], [0.0, 0.0]),
        viscous_friction=np.array([0.2, 0.1, 1e-3]),
        coulomb_friction=np.array([0.1, 0.05, 2e-3]),
        gravity=9.81,
    )
    coupled = true.inertia.copy()
    coupled[0, 1] = coupled[1, 0] = 0.97 * coupled[0, 1]
    true = replace(true, inertia=coupled)
    seen = held(true, believed, noise=1e-5, goals=(1.5, -0.5, 1.0, -1.0), gains=(50.0, 5.0))
    table, fitted = tmp_path / 'run.csv', tmp_path / 'arm.yaml'
    names = [f'joint{i}.position' for i in range(1, 5)] + [f'joint{i}.effort' for i in range(1, 4)]
    data = np.column_stack((seen.times, seen.positions, seen.efforts))
    np.savetxt(table, data, delimiter=',', header=','.join(['time', *names]), comments='')
    options = ['--params-file', str(source), '-o', str(fitted)]
    assert identify.main(['identify', str(table), *options]) == 0
    arm = read_settings(fitted, rows, build, node='flat_planner').session.arm
    assert arm.inertia_star == pytest.approx(true.inertia_star, rel=0.01)
    assert arm.static_moment == pytest.approx(true.static_moment, rel=0.005, abs=1e-9)
    assert arm.inertia == pytest.approx(true.inertia, rel=0.02, abs=1e-9)
    assert arm.viscous_friction == pytest.approx(true.viscous_friction, rel=0.1)


def test_a_recording_without_efforts_is_refused_with_the_reason(tmp_path, capsys):
    bag = tmp_path / 'a.mcap'
    write(bag, with_efforts=False)
    assert identify.main(['identify', str(bag), '--params-file', str(SHIPPED)]) == 1
    assert 'with efforts' in capsys.readouterr().err


def test_a_joint_that_stands_still_is_refused_with_the_reason(tmp_path, capsys):
    seen = recorded(TRUE, BELIEVED, until=1.0)
    table = tmp_path / 'run.csv'
    data = np.column_stack((seen.times, 0.0 * seen.times, seen.positions[:, 1], seen.efforts))
    names = 'time,joint1.position,joint2.position,joint1.effort'
    np.savetxt(table, data, delimiter=',', header=names, comments='')
    options = ['--params-file', str(SHIPPED), '-o', str(tmp_path / 'arm.yaml')]
    assert identify.main(['identify', str(table), *options]) == 1
    assert 'joint 1 stands exactly still' in capsys.readouterr().err
    assert not (tmp_path / 'arm.yaml').exists()
