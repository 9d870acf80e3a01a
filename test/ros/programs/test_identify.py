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
from pathlib import Path

from flat_planner_ros.core.arm import PlanarArm
from flat_planner_ros.ros.parameters import plant as plant_parameters
from flat_planner_ros.ros.parameters.parameter_file import read_settings
from flat_planner_ros.ros.wire import stamps
from flat_planner_ros.ros.wire.message_types import definition
import numpy as np
import pytest
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from recorded_arm import recorded
from sensor_msgs.msg import JointState

pytest.importorskip('mcap')

from flat_planner_ros.ros.programs import identify  # noqa: E402, I100  It needs it.
from flat_planner_ros.ros.recording.recording import RecordingWriter  # noqa: E402

SHIPPED = Path(__file__).resolve().parents[3] / 'config' / 'arm_2dof.yaml'
KIND = 'sensor_msgs/msg/JointState'
BEGUN = 1000.0
"""Time of the first sample [s]."""

BELIEVED = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
TRUE = PlanarArm.reduced(
    inertia_star=(7e-4, 3e-5), stiffness=2.6e-3, damping=2.6e-5, viscous_friction=[2e-4]
)


def write(path: Path, *, with_efforts: bool = True) -> None:
    """Write a recording of four goals, with the spring's effort as drivers report it."""
    seen = recorded(TRUE, BELIEVED, noise=1e-5)
    writer = RecordingWriter(path)
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
    options = ['--params-file', str(SHIPPED), '-o', str(fitted), '--plot', str(picture)]
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
    assert f'# {printed.splitlines()[0]}' in fitted.read_text('utf-8')


def test_a_trusted_inertia_is_kept(tmp_path, capsys):
    bag = tmp_path / 'a.mcap'
    write(bag)
    options = ['--params-file', str(SHIPPED), '--trust', 'inertia']
    assert identify.main(['identify', str(bag), str(bag), *options]) == 0
    scale = BELIEVED.inertia_star.both / TRUE.inertia_star.both
    said = float(capsys.readouterr().out.split()[3])
    assert said == pytest.approx(scale, rel=1e-3)


def test_a_recording_without_efforts_is_refused_with_the_reason(tmp_path, capsys):
    bag = tmp_path / 'a.mcap'
    write(bag, with_efforts=False)
    assert identify.main(['identify', str(bag), '--params-file', str(SHIPPED)]) == 1
    assert 'with efforts' in capsys.readouterr().err
