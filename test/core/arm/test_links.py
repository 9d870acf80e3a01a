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

"""Rigid bodies of links: alike to the arm in every pose, seen through plain kinematics."""

from flat_planner_ros.core.arm.errors import InvalidModel
from flat_planner_ros.core.arm.links import (
    bodies_from_links,
    bodies_from_reduced,
    DRAWN_LENGTH,
)
from flat_planner_ros.core.arm.planar_arm import PlanarArm
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

SPRING = {'stiffness': 3e-3, 'damping': 2e-5}
PAPER = (6.4e-4, 3.3e-5)
GRAVITY = 9.81

lengths = st.floats(0.05, 0.5)
masses = st.floats(0.01, 2.0)
inertias = st.floats(1e-6, 1e-2)


def kinetic_matrix(bodies, q):
    """Return the mass matrix from the velocities of the bodies' centres, column by column."""
    n = len(bodies)
    theta = np.cumsum(q)
    along = np.stack([np.cos(theta), np.sin(theta)], axis=1)
    across = np.stack([-np.sin(theta), np.cos(theta)], axis=1)
    assert np.allclose(np.sum(along * across, axis=1), 0.0)
    matrix = np.zeros((n, n))
    for i, body in enumerate(bodies):
        levers = [b.length for b in bodies[:i]] + [body.com]
        speed = np.zeros((2, n))  # of the centre, per joint rate
        for j in range(i + 1):
            speed[:, : j + 1] += (levers[j] * across[j])[:, None]
        turning = np.arange(n) <= i
        matrix += body.mass * speed.T @ speed + body.inertia * np.outer(turning, turning)
    return matrix


def height(bodies, q):
    """Return the potential energy over gravity [kg m]."""
    theta = np.cumsum(q)
    base, total = 0.0, 0.0
    for body, angle in zip(bodies, theta, strict=True):
        total += body.mass * (base + body.com * np.sin(angle))
        base += body.length * np.sin(angle)
    return total


def assert_alike(bodies, arm, q):
    """Compare mass matrix and weight at a pose."""
    expected = arm.mass_matrix(q)
    assert np.allclose(kinetic_matrix(bodies, q), expected, rtol=0, atol=1e-12 * expected.max())
    weight = (arm.energy(q, 0 * q) - arm.stiffness * q[-1] ** 2 / 2) / GRAVITY
    scale = sum(b.mass * (b.length + abs(b.com)) for b in bodies)
    assert abs(height(bodies, q) - weight) <= 1e-12 * scale


@pytest.mark.parametrize('drawn_length', [None, 0.02, 0.7])
def test_the_papers_arm_is_realised_for_any_drawn_length(drawn_length):
    bodies = bodies_from_reduced(inertia_star=PAPER, drawn_length=drawn_length)
    arm = PlanarArm.reduced(inertia_star=PAPER, gravity=GRAVITY, **SPRING)
    assert bodies[0].length == (drawn_length or DRAWN_LENGTH)
    assert all(body.mass > 0.0 and body.inertia > 0.0 for body in bodies)
    for q in np.linspace(-3.0, 3.0, 7):
        assert_alike(bodies, arm, np.array([q, 0.3 * q]))


@given(
    first=st.tuples(lengths, lengths, masses, inertias),
    tip=st.floats(0.01, 5.0),
    last=inertias,
    ratio=st.floats(1.01, 50.0),
    drawn=st.none() | lengths,
    q=st.tuples(*[st.floats(-3.0, 3.0)] * 3),
)
def test_the_reduced_form_of_three_joints_is_realised(first, tip, last, ratio, drawn, q):
    names = ('link_length', 'link_com', 'link_mass', 'link_inertia')
    model = {name: [value] for name, value in zip(names, first, strict=True)}
    model |= {'inertia_star': (ratio * last, last), 'tip_mass': tip}
    bodies = bodies_from_reduced(**model, drawn_length=drawn)
    arm = PlanarArm.reduced(**model, gravity=GRAVITY, **SPRING)
    assert bodies[1].mass + bodies[2].mass == pytest.approx(tip, rel=1e-12)
    assert min(body.mass for body in bodies) > 0.0
    assert_alike(bodies, arm, np.array(q))


@given(
    links=st.lists(st.tuples(lengths, lengths, masses, inertias), min_size=2, max_size=5),
    weights=st.tuples(masses, masses),
    arms=st.tuples(lengths, lengths),
    angle=st.floats(-3.0, 3.0),
)
def test_the_full_form_is_realised_balanced_or_not(links, weights, arms, angle):
    names = ('link_length', 'link_com', 'link_mass', 'link_inertia')
    model = dict(zip(names, map(list, zip(*links, strict=True)), strict=True))
    model |= {'counterbalance_mass': weights, 'counterbalance_arm': arms}
    bodies = bodies_from_links(**model)
    arm = PlanarArm.from_links(**model, gravity=GRAVITY, **SPRING)
    assert_alike(bodies, arm, angle * np.arange(1, len(links) + 1))


def test_without_a_tip_mass_the_last_links_have_inertia_alone():
    model = {
        'inertia_star': PAPER,
        'link_length': [0.3],
        'link_com': [0.1],
        'link_mass': [0.5],
        'link_inertia': [1e-3],
    }
    bodies = bodies_from_reduced(**model)
    assert [body.mass for body in bodies] == [0.5, 0.0, 0.0]
    assert_alike(bodies, PlanarArm.reduced(**model, gravity=9.81, **SPRING), np.array([1, 2, 3.0]))


@pytest.mark.parametrize(
    'model',
    [{'inertia_star': (3.3e-5, 6.4e-4)}, {'inertia_star': PAPER, 'drawn_length': 0.0}],
)
def test_what_is_no_arm_is_refused(model):
    with pytest.raises(InvalidModel, match='must'):
        bodies_from_reduced(**model)
