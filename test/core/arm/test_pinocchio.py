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

"""The arm's dynamics beside those of Pinocchio, a library of rigid body dynamics."""

from flat_planner_ros.core.arm.planar_arm import PlanarArm
import numpy as np
import pytest

pin = pytest.importorskip('pinocchio')

SIZES = [2, 3, 4, 5, 6, 7]
ARMS = 8
STATES = 5

TOLERANCE = 1e-10
"""Largest difference relative to the largest number compared [-]."""


def random_links(rng, n):
    """Return links with counterbalances that do not balance them."""
    return {
        'link_length': rng.uniform(0.1, 0.6, n),
        'link_com': rng.uniform(-0.1, 0.4, n),
        'link_mass': rng.uniform(0.05, 2.0, n),
        'link_inertia': rng.uniform(1e-4, 1e-2, n),
        'counterbalance_mass': rng.uniform(0.0, 0.5, 2),
        'counterbalance_arm': rng.uniform(0.0, 0.2, 2),
    }


def model_of(links, gravity):
    """Return Pinocchio's model: bodies on revolute joints about z, gravity along -y."""
    model, n = pin.Model(), len(links['link_mass'])
    parent, place = 0, 0.0
    for i in range(n):
        step = pin.SE3(np.eye(3), np.array([place, 0.0, 0.0]))
        parent = model.addJoint(parent, pin.JointModelRZ(), step, f'joint{i + 1}')
        place = links['link_length'][i]
        mass, com = links['link_mass'][i], links['link_com'][i]
        inertia = np.diag([1.0, 1.0, links['link_inertia'][i]])
        lever = np.array([com, 0.0, 0.0])
        model.appendBodyToJoint(parent, pin.Inertia(mass, lever, inertia), pin.SE3.Identity())
        if i >= n - 2:
            weight = links['counterbalance_mass'][i - n + 2]
            behind = np.array([-links['counterbalance_arm'][i - n + 2], 0.0, 0.0])
            point = pin.Inertia(weight, behind, np.zeros((3, 3)))
            model.appendBodyToJoint(parent, point, pin.SE3.Identity())
    model.gravity.linear = np.array([0.0, -gravity, 0.0])
    return model


@pytest.mark.parametrize('n', SIZES)
def test_dynamics_are_pinocchios(n):
    rng = np.random.default_rng(100 + n)
    checked = 0
    for _ in range(ARMS):
        links, gravity = random_links(rng, n), rng.choice([0.0, 9.81])
        arm = PlanarArm.from_links(
            **links,
            stiffness=rng.uniform(0.1, 5.0),
            damping=rng.uniform(0.0, 0.1),
            gravity=gravity,
            viscous_friction=rng.uniform(0.0, 0.5, n - 1),
            coulomb_friction=rng.uniform(0.0, 0.5, n - 1),
        )
        model = model_of(links, gravity)
        data = model.createData()
        for _ in range(STATES):
            q, dq, ddq = rng.uniform(-3.0, 3.0, (3, n))
            effort = rng.uniform(-5.0, 5.0, n - 1)
            # What acts besides the motors: spring, damper and friction.
            passive = np.append(-arm.friction(dq), arm.passive_effort(q[-1], dq[-1]))
            mass = pin.crba(model, data, q)
            weight = pin.computeGeneralizedGravity(model, data, q)
            bias = pin.nonLinearEffects(model, data, q, dq) - weight
            inverse = pin.rnea(model, data, q, dq, ddq)
            forward = pin.aba(model, data, q, dq, np.append(effort, 0.0) + passive)
            energy = pin.computeKineticEnergy(model, data, q, dq)
            energy += pin.computePotentialEnergy(model, data, q) + arm.stiffness * q[-1] ** 2 / 2
            for found, expected, scale in (
                (arm.mass_matrix(q), np.triu(mass) + np.triu(mass, 1).T, 0.0),
                (arm.coriolis(q, dq), bias, np.abs(inverse).max()),
                (arm.gravity_effort(q), weight, np.abs(inverse).max()),
                (arm.rigid_effort(q, dq, ddq), inverse, 0.0),
                (arm.inverse_dynamics(q, dq, ddq), inverse - passive, 0.0),
                (arm.forward_dynamics(q, dq, effort), forward, 0.0),
                (arm.energy(q, dq), energy, 1.0),
            ):
                scale = max(scale, np.abs(expected).max())
                assert np.abs(found - expected).max() <= TOLERANCE * scale
                checked += 1
    assert checked == ARMS * STATES * 7
