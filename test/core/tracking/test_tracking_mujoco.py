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

"""The tracker's loop around MuJoCo's arm, which shares no code with the simulated one."""

from core.conftest import ARM
from core.tracking.closed_loop import ClosedLoop, motion_of, samples_of, settling
from flat_planner_ros.core.tracking import Phase, Tracker, TrackerSettings
from mujoco_model import mujoco_model
import numpy as np
import pytest

mujoco = pytest.importorskip('mujoco')

SUBSTEP = 2e-4
"""Integration step [s]."""


class MujocoArm:
    """What the loop needs of an arm."""

    def __init__(self, arm):
        """Stand still at zero."""
        text = mujoco_model(arm, SUBSTEP)
        self._model = mujoco.MjModel.from_xml_string(text)
        self._data = mujoco.MjData(self._model)

    @property
    def time(self):
        """Return the simulated time [s]."""
        return self._data.time

    @property
    def position(self):
        """Return the joint angles [rad]."""
        return np.array(self._data.qpos)

    def hold(self, effort):
        """Apply an effort from now on."""
        self._data.qfrc_applied[0] = effort[0]

    def advance(self, until):
        """Integrate up to a time [s]."""
        while self._data.time < until - SUBSTEP / 2:
            mujoco.mj_step(self._model, self._data)


@pytest.mark.parametrize(
    ('factors', 'within'),
    [
        ({}, 0.0),
        ({'stiffness': 0.9, 'damping': 0.9}, 0.5),
        ({'stiffness': 1.25, 'damping': 1.25}, 0.9),
        ({'inertia': 1.1}, 0.9),
    ],
)
def test_mujoco_s_arm_ends_at_rest_where_it_should(factors, within):
    settings = TrackerSettings(delay=0.002)
    true = ARM.scaled(**factors)
    loop = ClosedLoop(Tracker(ARM, settings), true, late=1)
    loop.arm = MujocoArm(true)
    loop.run(0.02)
    samples = samples_of()
    motion = motion_of(samples, loop.arm.time)
    loop.tracker.follow(motion, loop.arm.time)
    times, positions, efforts = loop.run(2.1)
    errors = positions - np.array([motion.at(time).positions for time in times])
    assert loop.tracker.phase is Phase.TRACKING
    assert settling(times, errors, motion.end) <= within
    assert np.abs(efforts).max() <= 1.5 * np.abs(samples.efforts).max()
