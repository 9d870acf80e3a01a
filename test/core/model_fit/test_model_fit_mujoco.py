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

"""A recording of MuJoCo's arm, which shares no code with ours, tells its model."""

from math import pi

from flat_planner_ros.core.arm import PlanarArm
from flat_planner_ros.core.model_fit import fit_model, Measurements
import numpy as np
import pytest
from recorded_arm import commanded

mujoco = pytest.importorskip('mujoco')

from mujoco_model import mujoco_model  # noqa: E402, I100

PERIOD, SUBSTEPS = 0.005, 10
"""Time between samples [s], and steps of the integration in it."""

VISCOUS = 2e-4
BELIEVED = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
TRUE = PlanarArm.reduced(inertia_star=(7.1e-4, 3e-5), stiffness=2.6e-3, damping=2.6e-5)


def played(effort):
    """Return times, angles and efforts of MuJoCo's arm under an effort that is linear between."""
    model = mujoco.MjModel.from_xml_string(mujoco_model(TRUE, PERIOD / SUBSTEPS))
    model.dof_damping[0] = VISCOUS
    state = mujoco.MjData(model)
    times = np.arange(0.0, 3.1, PERIOD)
    angles = np.empty((times.size, 2))
    given = np.array([float(effort(time)[0]) for time in times])
    for k, time in enumerate(times):
        angles[k] = state.qpos
        for part in range(SUBSTEPS):
            middle = time + (part + 0.5) * PERIOD / SUBSTEPS
            state.qfrc_applied[0] = np.interp(middle, times, given)
            mujoco.mj_step(model, state)
    return times, angles, given[:, None]


def test_the_model_of_mujocos_arm_is_found():
    times, angles, efforts = played(commanded(BELIEVED, goals=(pi, 0.5 * pi)).effort)
    noise = 1e-4 * np.random.default_rng(7).standard_normal(angles.shape)
    seen = Measurements(times=times, positions=angles + noise, efforts=efforts)
    fit = fit_model(seen, BELIEVED)
    assert fit.arm.inertia_star == pytest.approx(TRUE.inertia_star, rel=0.005)
    assert fit.arm.stiffness == pytest.approx(TRUE.stiffness, rel=0.005)
    assert fit.arm.damping == pytest.approx(TRUE.damping, rel=0.01)
    assert fit.arm.viscous_friction[0] == pytest.approx(VISCOUS, rel=0.01)
    coulomb = fit.estimate('coulomb_friction[1]')
    assert abs(coulomb.value) < 4.0 * coulomb.std
    assert fit.misfit == ''
