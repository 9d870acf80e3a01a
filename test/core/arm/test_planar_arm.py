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

"""The arm's dynamics against Lagrangian mechanics done the long way."""

from dataclasses import FrozenInstanceError

from flat_planner_ros.core.arm.dynamics import COULOMB_VELOCITY
from flat_planner_ros.core.arm.errors import InvalidModel, NotFlat
from flat_planner_ros.core.arm.planar_arm import BALANCE_TOLERANCE, PlanarArm
import numpy as np
import pytest

SIZES = [2, 3, 4, 5]
PAPER = {'inertia_star': (6.4e-4, 3.3e-5), 'stiffness': 3e-3, 'damping': 2e-5}


def random_links(rng, n):
    """Return the data of n links with two counterbalances that do not balance them."""
    return {
        'link_length': rng.uniform(0.2, 0.5, n),
        'link_com': rng.uniform(-0.1, 0.3, n),
        'link_mass': rng.uniform(0.1, 0.8, n),
        'link_inertia': rng.uniform(1e-3, 1e-2, n),
        'counterbalance_mass': rng.uniform(0.05, 0.3, 2),
        'counterbalance_arm': rng.uniform(0.05, 0.2, 2),
    }


def balanced_links(rng, n):
    """Return links whose counterbalances balance them, by the definition in the paper."""
    links = random_links(rng, n)
    links['link_com'][-2:] = rng.uniform(0.05, 0.2, 2)
    length, com, mass = links['link_length'], links['link_com'], links['link_mass']
    counter, arm = links['counterbalance_mass'], links['counterbalance_arm']
    arm[1] = mass[-1] * com[-1] / counter[1]
    rider = mass[-1] + counter[1]
    arm[0] = (mass[-2] * com[-2] + rider * length[-2]) / counter[0]
    return links


def bodies(links, n):
    """Yield (mass, inertia, link, distance along it) of each link and counterbalance."""
    for i in range(n):
        yield links['link_mass'][i], links['link_inertia'][i], i, links['link_com'][i]
    for j, i in enumerate((n - 2, n - 1)):
        yield links['counterbalance_mass'][j], 0.0, i, -links['counterbalance_arm'][j]


def long_way(links, gravity, q, dq):
    """Return kinetic and potential energy from the velocities of all centres of mass."""
    n = len(q)
    angle, rate = np.cumsum(q), np.cumsum(dq)
    kinetic = potential = 0.0
    for mass, inertia, link, place in bodies(links, n):
        reach = [*links['link_length'][:link], place]
        x_rate = -sum(r * np.sin(angle[i]) * rate[i] for i, r in enumerate(reach))
        y_rate = sum(r * np.cos(angle[i]) * rate[i] for i, r in enumerate(reach))
        height = sum(r * np.sin(angle[i]) for i, r in enumerate(reach))
        kinetic += mass * (x_rate**2 + y_rate**2) / 2 + inertia * rate[link] ** 2 / 2
        potential += mass * gravity * height
    return kinetic, potential


def gradient(function, x, h=1e-5):
    """Return central differences of fourth order."""
    rows = np.eye(len(x)) * h
    return np.array(
        [
            (8 * (function(x + e) - function(x - e)) - function(x + 2 * e) + function(x - 2 * e))
            / (12 * h)
            for e in rows
        ]
    )


def flat_arm(rng, n, **options):
    """Return a balanced arm with passive joint and motors of ordinary size."""
    return PlanarArm.from_links(**balanced_links(rng, n), stiffness=0.5, damping=0.01, **options)


@pytest.fixture
def rng():
    return np.random.default_rng(7)


@pytest.mark.parametrize('n', SIZES)
def test_terms_are_those_of_the_lagrangian_of_the_moving_masses(rng, n):
    links, gravity = random_links(rng, n), 9.81
    arm = PlanarArm.from_links(**links, stiffness=1.0, damping=0.0, gravity=gravity)
    for _ in range(5):
        q, dq = rng.uniform(-3, 3, n), rng.uniform(-3, 3, n)

        def kinetic(q, dq):
            return long_way(links, gravity, q, dq)[0]

        def mass(q):
            """Second differences of a quadratic form are exact."""
            eye = np.eye(n)
            return np.array(
                [[kinetic(q, a + b) - kinetic(q, a) - kinetic(q, b) for a in eye] for b in eye]
            )

        weight = gradient(lambda q: long_way(links, gravity, q, dq)[1], q)  # noqa: B023
        slope = gradient(mass, q)  # d M / d q_k first
        coriolis = (
            np.einsum('k,kij,j->i', dq, slope, dq) - np.einsum('i,kij,j->k', dq, slope, dq) / 2
        )
        scale = np.abs(arm.mass_matrix(q)).max()
        np.testing.assert_allclose(arm.mass_matrix(q), mass(q), atol=1e-12 * scale)
        np.testing.assert_allclose(arm.coriolis(q, dq), coriolis, atol=1e-8 * scale * (dq @ dq))
        np.testing.assert_allclose(arm.gravity_effort(q), weight, atol=1e-8 * np.abs(weight).max())
        total = sum(long_way(links, gravity, q, dq)) + q[-1] ** 2 / 2
        assert arm.energy(q, dq) == pytest.approx(total, rel=1e-12)


@pytest.mark.parametrize('n', SIZES)
def test_mass_matrix_is_symmetric_and_positive_definite(rng, n):
    arm = PlanarArm.from_links(**random_links(rng, n), stiffness=1.0, damping=0.0)
    mass = arm.mass_matrix(rng.uniform(-4, 4, (200, n)))
    np.testing.assert_allclose(mass, np.swapaxes(mass, 1, 2), atol=1e-14)
    assert np.linalg.eigvalsh(mass).min() > 0.0


@pytest.mark.parametrize('n', SIZES)
def test_flat_arm_has_the_papers_last_two_rows_and_no_bias_there(rng, n):
    arm = flat_arm(rng, n, gravity=9.81)
    both, last = arm.inertia_star
    q, dq = rng.uniform(-3, 3, (50, n)), rng.uniform(-3, 3, (50, n))
    rows = np.full((2, n), both)
    rows[:, -1] = rows[-1, :] = last
    mass = arm.mass_matrix(q)
    np.testing.assert_allclose(mass[:, -2:], np.broadcast_to(rows, (50, 2, n)), rtol=1e-12)
    scale = np.abs(mass).max() * 100
    np.testing.assert_allclose(arm.coriolis(q, dq)[:, -2:], 0.0, atol=1e-13 * scale)
    np.testing.assert_allclose(arm.gravity_effort(q)[:, -2:], 0.0, atol=1e-13 * scale)


def test_unbalanced_arm_has_neither(rng):
    arm = PlanarArm.from_links(**random_links(rng, 3), stiffness=1.0, damping=0.0, gravity=9.81)
    q, dq = rng.uniform(-3, 3, (50, 3)), rng.uniform(-3, 3, (50, 3))
    assert np.ptp(arm.mass_matrix(q)[:, -1, 0]) > 1e-3
    assert np.abs(arm.coriolis(q, dq)[:, -1]).max() > 1e-3
    assert np.abs(arm.gravity_effort(q)[:, -1]).max() > 1e-3


@pytest.mark.parametrize('n', SIZES)
@pytest.mark.parametrize('make', [random_links, balanced_links])
def test_inverse_dynamics_undoes_forward_dynamics(rng, n, make):
    arm = PlanarArm.from_links(
        **make(rng, n),
        stiffness=0.5,
        damping=0.01,
        gravity=9.81,
        viscous_friction=rng.uniform(0, 0.1, n - 1),
        coulomb_friction=rng.uniform(0, 0.1, n - 1),
    )
    q, dq = rng.uniform(-3, 3, (20, n)), rng.uniform(-3, 3, (20, n))
    effort = rng.uniform(-1, 1, (20, n - 1))
    ddq = arm.forward_dynamics(q, dq, effort)
    scale = 1.0 + np.abs(arm.coriolis(q, dq)).max() + np.abs(arm.gravity_effort(q)).max()
    back = arm.inverse_dynamics(q, dq, ddq)
    np.testing.assert_allclose(back[:, :-1], effort, atol=1e-12 * scale)
    np.testing.assert_allclose(back[:, -1], 0.0, atol=1e-12 * scale)
    one = arm.forward_dynamics(q[0], dq[0], effort[0])
    np.testing.assert_allclose(one, ddq[0], rtol=1e-12)


@pytest.mark.parametrize('n', SIZES)
def test_equation_of_motion_is_the_papers(rng, n):
    arm = flat_arm(rng, n, gravity=9.81)
    q, dq, ddq = rng.uniform(-3, 3, (3, n))
    effort = (
        arm.mass_matrix(q) @ ddq
        + arm.damping_matrix @ dq
        + arm.stiffness_matrix @ q
        + arm.coriolis(q, dq)
        + arm.gravity_effort(q)
    )
    found = arm.inverse_dynamics(q, dq, ddq)
    np.testing.assert_allclose(found, effort, atol=1e-12 * np.abs(effort).max())
    assert arm.passive_effort(q[-1], dq[-1]) == pytest.approx(-0.5 * q[-1] - 0.01 * dq[-1])


@pytest.mark.parametrize('n', SIZES)
def test_reduced_form_is_the_balanced_full_form(rng, n):
    links = balanced_links(rng, n)
    full = PlanarArm.from_links(**links, stiffness=0.5, damping=0.01, gravity=9.81)
    first = {k: v[: n - 2] for k, v in links.items() if k.startswith('link')}
    tip = links['link_mass'][-2:].sum() + links['counterbalance_mass'].sum()
    reduced = PlanarArm.reduced(
        inertia_star=full.inertia_star,
        stiffness=0.5,
        damping=0.01,
        gravity=9.81,
        tip_mass=tip,
        **first,
    )
    q, dq, ddq = rng.uniform(-3, 3, (3, 20, n))
    effort = full.inverse_dynamics(q, dq, ddq)
    found = reduced.inverse_dynamics(q, dq, ddq)
    np.testing.assert_allclose(found, effort, atol=1e-12 * np.abs(effort).max())


@pytest.mark.parametrize('n', SIZES)
def test_inertia_star_is_the_inertia_about_the_last_two_joints(rng, n):
    links = balanced_links(rng, n)
    last = both = 0.0
    for mass, inertia, link, place in bodies(links, n):
        if link == n - 1:
            last += inertia + mass * place**2
            both += mass * links['link_length'][-2] ** 2
        if link == n - 2:
            both += inertia + mass * place**2
    arm = PlanarArm.from_links(**links, stiffness=0.5, damping=0.0)
    np.testing.assert_allclose(arm.inertia_star, (both + last, last), rtol=1e-13)


def test_two_link_arm_of_the_paper_has_its_matrices():
    arm = PlanarArm.reduced(**PAPER)
    q = np.array([0.3, -0.2])
    np.testing.assert_allclose(
        arm.mass_matrix(q), [[6.4e-4, 3.3e-5], [3.3e-5, 3.3e-5]], rtol=1e-14
    )
    np.testing.assert_array_equal(arm.stiffness_matrix, [[0, 0], [0, 3e-3]])
    np.testing.assert_array_equal(arm.damping_matrix, [[0, 0], [0, 2e-5]])
    assert arm.inertia_star == pytest.approx((6.4e-4, 3.3e-5))


@pytest.mark.parametrize('n', SIZES)
def test_advised_counterbalances_mend_the_arm(rng, n):
    links = random_links(rng, n)
    named = []
    for _ in range(2):
        arm = PlanarArm.from_links(**links, stiffness=1.0, damping=0.0)
        with pytest.raises(NotFlat, match='counterbalance') as caught:
            arm.check_flat()
        named.append(caught.value.link)
        j = caught.value.link - n + 1
        mass_arm = links['counterbalance_mass'][j] * links['counterbalance_arm'][j]
        wanted = mass_arm + caught.value.static_moment
        links['counterbalance_arm'][j] = wanted / links['counterbalance_mass'][j]
        if wanted < 0.0:  # the mass belongs on the link's own side
            links['link_com'][n - 2 + j] -= wanted / links['link_mass'][n - 2 + j]
            links['counterbalance_arm'][j] = 0.0
    assert named == [n, n - 1]
    PlanarArm.from_links(**links, stiffness=1.0, damping=0.0).check_flat()


def test_not_flat_says_how_far_the_centre_of_mass_is(rng):
    links = balanced_links(rng, 3)
    links['link_com'][2] += 1e-3
    arm = PlanarArm.from_links(**links, stiffness=1.0, damping=0.0)
    with pytest.raises(NotFlat) as caught:
        _ = arm.inertia_star
    mass = links['link_mass'][2] + links['counterbalance_mass'][1]
    moment = links['link_mass'][2] * 1e-3
    assert caught.value.link == 3
    assert caught.value.static_moment == pytest.approx(moment, rel=1e-9)
    assert f'{moment / mass:.6g} m off' in str(caught.value)
    assert f'(mass * arm) by +{moment:.6g}'[:-1] in str(caught.value)


@pytest.mark.parametrize(('factor', 'flat'), [(0.5, True), (2.0, False)])
def test_balance_tolerance_is_relative_to_mass_and_inertia(rng, factor, flat):
    links = balanced_links(rng, 2)
    arm = PlanarArm.from_links(**links, stiffness=1.0, damping=0.0)
    limit = BALANCE_TOLERANCE * np.sqrt(arm.carried_mass[1] * arm.inertia[1, 1])
    links['link_com'][1] += factor * limit / links['link_mass'][1]
    arm = PlanarArm.from_links(**links, stiffness=1.0, damping=0.0)
    if flat:
        arm.check_flat()
    else:
        with pytest.raises(NotFlat):
            arm.check_flat()


@pytest.mark.parametrize('n', SIZES)
@pytest.mark.parametrize('held', [False, True])
def test_natural_mode_is_an_eigenvalue_of_the_linear_arm(rng, n, held):
    arm = flat_arm(rng, n)
    q = rng.uniform(-3, 3, n)
    free = [n - 1] if held else list(range(n))
    mass = arm.mass_matrix(q)[np.ix_(free, free)]
    pick = np.ix_(free, free)
    size = len(free)
    linear = np.block(
        [
            [np.zeros((size, size)), np.eye(size)],
            [
                -np.linalg.solve(mass, arm.stiffness_matrix[pick]),
                -np.linalg.solve(mass, arm.damping_matrix[pick]),
            ],
        ]
    )
    pole = max(np.linalg.eigvals(linear), key=lambda value: value.imag)
    mode = arm.natural_mode(held=held)
    assert mode.frequency == pytest.approx(abs(pole), rel=1e-9)
    assert mode.damped_frequency == pytest.approx(pole.imag, rel=1e-9)
    assert mode.decay_rate == pytest.approx(-pole.real, rel=1e-6)


def test_overdamped_joint_does_not_oscillate():
    arm = PlanarArm.reduced(**PAPER).scaled(damping=100.0)
    assert arm.natural_mode().damping_ratio > 1.0
    assert arm.natural_mode().damped_frequency == 0.0


def test_scaled_arm_has_each_quantity_scaled_alone(rng):
    arm = flat_arm(rng, 3, gravity=9.81)
    other = arm.scaled(stiffness=1.1, damping=1.2, inertia=1.3)
    q, dq = rng.uniform(-3, 3, (2, 3))
    assert other.stiffness == pytest.approx(1.1 * arm.stiffness)
    assert other.damping == pytest.approx(1.2 * arm.damping)
    np.testing.assert_allclose(other.mass_matrix(q), 1.3 * arm.mass_matrix(q))
    np.testing.assert_allclose(
        other.gravity_effort(q)[0], 1.3 * arm.gravity_effort(q)[0], rtol=1e-12
    )
    np.testing.assert_allclose(other.coriolis(q, dq)[0], 1.3 * arm.coriolis(q, dq)[0], rtol=1e-12)
    other.check_flat()


def test_friction_opposes_each_motor_and_saturates(rng):
    arm = flat_arm(rng, 3, viscous_friction=[0.1, 0.2], coulomb_friction=[0.3, 0.4])
    fast = np.array([1.0, -2.0, 5.0])
    np.testing.assert_allclose(arm.friction(fast), [0.1 + 0.3, -0.4 - 0.4], rtol=1e-12)
    slow = np.array([COULOMB_VELOCITY, 0.0, 5.0])
    expected = 0.1 * COULOMB_VELOCITY + 0.3 * np.tanh(1.0)
    np.testing.assert_allclose(arm.friction(slow), [expected, 0.0], rtol=1e-12)


def test_arm_cannot_be_changed():
    arm = PlanarArm.reduced(**PAPER)
    with pytest.raises(ValueError, match='read-only'):
        arm.inertia[0, 0] = 1.0
    with pytest.raises(ValueError, match='read-only'):
        arm.static_moment[0] = 1.0
    with pytest.raises(FrozenInstanceError):
        arm.stiffness = 1.0


LINK = {'link_length': [0.3], 'link_com': [0.1], 'link_mass': [0.2], 'link_inertia': [1e-3]}


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'stiffness': 0.0}, 'stiffness'),
        ({'stiffness': float('nan')}, 'stiffness'),
        ({'damping': -1e-9}, 'damping'),
        ({'gravity': float('inf')}, 'gravity'),
        ({'inertia_star': (3.3e-5, 3.3e-5)}, 'inertia_star'),
        ({'inertia_star': (6.4e-4, 0.0)}, 'inertia_star'),
        ({'inertia_star': (6.4e-4,)}, 'inertia_star'),
        ({'tip_mass': -0.1}, 'tip_mass'),
        ({'link_com': [0.1, 0.2]}, 'link_com'),
        ({'link_mass': [-0.2]}, 'link_mass'),
        ({'link_length': [-0.3]}, 'link_length'),
        ({'link_inertia': [float('nan')]}, 'link_inertia'),
        ({'link_mass': [0.0], 'link_inertia': [0.0]}, 'inertia'),
        ({'viscous_friction': [0.1]}, 'viscous_friction'),
        ({'coulomb_friction': [0.1, -0.1]}, 'coulomb_friction'),
    ],
)
def test_unphysical_data_are_refused_by_name(change, message):
    PlanarArm.reduced(**{**PAPER, **LINK})
    with pytest.raises(InvalidModel, match=message):
        PlanarArm.reduced(**{**PAPER, **LINK, **change})


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'inertia': [[1.0, 0.1], [0.2, 1.0]]}, 'symmetric'),
        ({'inertia': [[1.0, 2.0], [2.0, 1.0]]}, 'positive definite'),
        ({'inertia': [[1.0, 0.0], [0.0, -1.0]]}, 'above 0'),
        ({'inertia': [[1.0, 0.1], [0.1, 1.0]]}, 'disagree'),
        ({'static_moment': [2.0, 0.0]}, 'carried_mass'),
        ({'inertia': [[1.0]]}, 'n >= 2'),
    ],
)
def test_coefficients_that_no_masses_have_are_refused(change, message):
    data = {
        'inertia': np.eye(2),
        'static_moment': np.zeros(2),
        'carried_mass': np.ones(2),
        'stiffness': 1.0,
        'damping': 0.0,
        'gravity': 0.0,
        'viscous_friction': np.zeros(1),
        'coulomb_friction': np.zeros(1),
    }
    PlanarArm(**data)
    with pytest.raises(InvalidModel, match=message):
        PlanarArm(**{**data, **change})


def test_one_link_is_no_arm():
    with pytest.raises(InvalidModel, match='at least 2 links'):
        PlanarArm.from_links(**LINK, stiffness=1.0, damping=0.0)
