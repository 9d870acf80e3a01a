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

"""What a command contains, and how large it is."""

from flat_planner_ros.core import MotionRequest, plan, PlanningOptions
from flat_planner_ros.core.arm import InvalidCommand
from flat_planner_ros.core.session import Piece, Track
from flat_planner_ros.ros.parameters.planner import build, ROWS
from flat_planner_ros.ros.wire.command_form import CommandForm
from flat_planner_ros.ros.wire.conversions import command_bytes
import numpy as np
import pytest
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message
from trajectory_msgs.msg import JointTrajectory

SIZES = [
    (CommandForm(), 201, 21_000),
    (CommandForm(include_passive_joint=False), 201, 14_900),
    (CommandForm(include_passive_joint=False, include_acceleration=False), 201, 11_600),
    (CommandForm(include_effort=False, tolerance=1e-6), 57, 5_000),
    (
        CommandForm(
            include_passive_joint=False,
            include_acceleration=False,
            include_effort=False,
            tolerance=1e-6,
        ),
        39,
        1_950,
    ),
]
"""Form, points and bytes at most of the paper's motion; docs/two_computers.md has them."""


GIVEN = {
    **{row.name: row.default for row in ROWS if not isinstance(row.default, Parameter.Type)},
    'joints': ['joint1', 'joint2'],
    'model.inertia_star': [6.4e-4, 3.3e-5],
    'model.stiffness': 3e-3,
    'model.damping': 2e-5,
}


@pytest.fixture(scope='module')
def track():
    """Return the motion of the paper, a point every 5 ms."""
    paper_arm = build(GIVEN).session.arm
    request = MotionRequest(start=(0.0, 0.0), final=(np.pi, 0.0), duration=1.0)
    samples = plan(request, paper_arm, PlanningOptions()).sample(0.005)
    return Track(start=1.7e9, times=samples.times, pieces=(Piece(samples, slice(None)),))


@pytest.mark.parametrize(('form', 'points', 'size'), SIZES)
def test_a_command_has_what_its_form_says(track, form, points, size):
    data = command_bytes(track, ['joint1', 'joint2'], form)
    assert 0.9 * size < len(data) <= size
    msg = deserialize_message(data, JointTrajectory)
    assert 0.9 * points < len(msg.points) <= points
    joints = 2 if form.include_passive_joint else 1
    assert len(msg.joint_names) == joints
    for point in (msg.points[0], msg.points[-1]):
        assert len(point.positions) == len(point.velocities) == joints
        assert len(point.accelerations) == joints * form.include_acceleration
        assert len(point.effort) == joints * form.include_effort
    assert list(msg.points[-1].positions) == track.positions[-1, :joints].tolist()


def test_efforts_are_sent_as_dense_as_they_are_planned():
    assert build({**GIVEN, 'command.tolerance': 1e-6, 'command.include_effort': False})
    with pytest.raises(InvalidCommand, match='command.tolerance = 1e-06 rad needs'):
        build({**GIVEN, 'command.tolerance': 1e-6})
