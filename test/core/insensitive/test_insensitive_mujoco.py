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

"""Commands of insensitive motions played by MuJoCo, on arms that differ from the model."""

from core.conftest import ARM, envelope
from flat_planner_ros.core.insensitive.insensitivity import Insensitivity, Nominal
from flat_planner_ros.core.insensitive.oscillator import Oscillator
from flat_planner_ros.core.insensitive.residual import residual_amplitude
from flat_planner_ros.core.motion_law.cost import Strategy
from flat_planner_ros.core.planning.planner import plan
from flat_planner_ros.core.planning.request import MotionRequest, PlanningOptions
from flat_planner_ros.core.planning.tradeoff import residual_of_plan
from mujoco_model import mujoco_model
import numpy as np
import pytest

mujoco = pytest.importorskip('mujoco')

PERIOD = 0.005
SUBSTEPS = 10


def played(samples, stiffness, damping):
    """Return the joint angles and velocities when a command has ended."""
    arm = ARM.scaled(stiffness=stiffness, damping=damping)
    compiled = mujoco.MjModel.from_xml_string(mujoco_model(arm, PERIOD / SUBSTEPS))
    data = mujoco.MjData(compiled)
    times, torque = samples.times, samples.driving_effort
    while data.time < times[-1] - 1e-9:
        # A step holds its effort: that of its middle keeps the second order.
        middle = data.time + 0.5 * PERIOD / SUBSTEPS
        data.qfrc_applied[0] = np.interp(middle, times, torque)
        mujoco.mj_step(compiled, data)
    return np.array(data.qpos), np.array(data.qvel)


@pytest.mark.parametrize('nominal', Nominal)
@pytest.mark.parametrize('factors', [(1.0, 1.0), (1.1, 1.1), (0.9, 0.9), (1.1, 0.9)])
def test_mujoco_s_arm_swings_as_predicted(nominal, factors):
    request = MotionRequest(start=np.zeros(2), final=np.array([np.pi, 0.0]), duration=1.0)
    options = PlanningOptions(
        strategy=Strategy.INSENSITIVE, insensitivity=Insensitivity(nominal=nominal)
    )
    result = plan(request, ARM, options)
    samples = result.sample(PERIOD)
    angles, rates = played(samples, *factors)
    other = ARM.scaled(stiffness=factors[0], damping=factors[1])
    amplitude = envelope(other, angles[1], rates[1])
    oscillator = Oscillator.of(ARM)
    poles = oscillator.poles(np.array([factors]))
    (predicted,) = residual_amplitude(oscillator, samples.driving_effort, 1.0, poles)
    assert amplitude == pytest.approx(predicted, rel=2e-3, abs=1e-6)
    assert amplitude <= residual_of_plan(result, samples).worst * 1.002 <= 0.0121
    assert abs(angles.sum() - np.pi) < 0.02
