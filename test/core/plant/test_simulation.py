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

"""The simulated arm against conservation laws, other integrators and its command's rules."""

from dataclasses import replace
from math import pi

from core.conftest import envelope
from flat_planner_ros.core.arm.errors import InvalidCommand, InvalidModel
from flat_planner_ros.core.arm.planar_arm import PlanarArm
from flat_planner_ros.core.plant.drives import DriveSettings
from flat_planner_ros.core.plant.effort_profile import EffortProfile
from flat_planner_ros.core.plant.rollout import rollout
from flat_planner_ros.core.plant.simulation import SimulatedArm
import numpy as np
import pytest
from scipy.integrate import simpson, solve_ivp
from scipy.linalg import expm

SIZES = [2, 3, 4, 5, 6, 7]

STEP = {2: 2.5e-4, 3: 2.5e-4, 4: 2.5e-4, 5: 2.5e-4, 6: 2e-4, 7: 1e-4}
"""Integration step by the number of links [s]: the last of many whips."""
PAPER = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)


def any_arm(n, **options):
    """Return an arm of n unequal links, balanced by nobody."""
    rng = np.random.default_rng(n)
    options = {'damping': 0.0, **options}
    return PlanarArm.from_links(
        link_length=rng.uniform(0.2, 0.5, n),
        link_com=rng.uniform(0.05, 0.3, n),
        link_mass=rng.uniform(0.2, 0.8, n),
        link_inertia=rng.uniform(1e-3, 1e-2, n),
        stiffness=0.5,
        **options,
    )


def swing(motors, *, start=0.0, peak=0.3, points=201, **options):
    """Return one sine wave of effort at each motor over one second."""
    times = np.linspace(0.0, 1.0, points)
    efforts = peak * np.sin(2 * pi * times)[:, None] * np.arange(1, motors + 1)
    efforts[-1] = 0.0
    return EffortProfile(start=start, times=times, efforts=efforts, **options)


def simple(**options):
    """Return a three-point profile for one motor, first point half a second after the start."""
    data = {'start': 10.0, 'times': [0.5, 1.0, 2.0], 'efforts': [[2.0], [4.0], [0.0]]}
    return EffortProfile(**{**data, **options})


def vertical_arm(n, **options):
    """Return a flat arm in the vertical plane; its first n-2 links have a weight."""
    count = n - 2
    return PlanarArm.reduced(
        inertia_star=(6.4e-4, 3.3e-5),
        stiffness=3e-3,
        damping=2e-5,
        link_length=[0.3] * count,
        link_com=[0.12] * count,
        link_mass=[0.8] * count,
        link_inertia=[4e-3] * count,
        tip_mass=0.4,
        gravity=9.81,
        **options,
    )


def kicked(arm, velocity, **options):
    """Return an arm that moves already, after a short kick by its motors."""
    simulated = SimulatedArm(arm, **options)
    simulated.hold(np.asarray(velocity))
    simulated.advance(0.1)
    simulated.hold(np.zeros(arm.n - 1))
    return simulated


@pytest.mark.parametrize('n', SIZES)
def test_free_motion_keeps_its_energy(n):
    arm = any_arm(n, gravity=9.81)
    simulated = SimulatedArm(arm, position=np.linspace(0.5, -0.7, n), step=STEP[n])
    simulated.hold(np.zeros(n - 1))  # releases the brakes
    before = arm.energy(simulated.position, simulated.velocity)
    turned = 0.0
    for _ in range(20):
        simulated.advance(simulated.time + 0.05)
        turned = max(turned, np.abs(simulated.velocity).max())
        energy = arm.energy(simulated.position, simulated.velocity)
        assert energy == pytest.approx(before, abs=1e-7 * arm.gravity)
    assert turned > 1.0


@pytest.mark.parametrize('n', SIZES)
def test_free_base_keeps_angular_momentum_where_a_motor_would_change_it(n):
    arm = any_arm(n, damping=0.02)
    inner = np.append(0.0, np.full(n - 2, 0.05)) if n > 2 else np.zeros(1)
    simulated = kicked(arm, np.full(n - 1, 0.3), step=5e-4)

    def momentum():
        return (arm.mass_matrix(simulated.position) @ simulated.velocity)[0]

    before = momentum()
    assert abs(before) > 1e-3
    simulated.hold(inner)  # torques between links leave the whole arm's momentum alone
    simulated.advance(1.1)
    assert momentum() == pytest.approx(before, rel=1e-8)
    simulated.hold(np.append(0.1, inner[1:]))
    simulated.advance(2.1)
    assert momentum() == pytest.approx(before + 0.1, rel=1e-8)


@pytest.mark.parametrize('n', SIZES)
def test_energy_changes_by_what_motors_give_and_dampers_and_friction_take(n):
    friction = {'viscous_friction': np.full(n - 1, 0.02), 'coulomb_friction': np.zeros(n - 1)}
    arm = any_arm(n, gravity=9.81, damping=0.03, **friction)
    course = swing(n - 1, points=1001)
    run = rollout(arm, course, 1.0, step=5e-4)
    effort = np.array([course.effort(t) for t in run.times])
    given = np.sum(effort * run.velocities[:, :-1], axis=1)
    taken = 0.03 * run.velocities[:, -1] ** 2 + 0.02 * np.sum(run.velocities[:, :-1] ** 2, axis=1)
    energy = arm.energy(run.positions, run.velocities)
    work = simpson(given - taken, x=run.times)
    assert simpson(taken, x=run.times) > 1e-3
    assert energy[-1] - energy[0] == pytest.approx(work, abs=1e-6)


def test_friction_at_rest_brings_the_motors_to_a_stop():
    arm = any_arm(3, damping=0.02, coulomb_friction=[0.05, 0.05], viscous_friction=[0.05, 0.05])
    simulated = kicked(arm, [0.3, 0.3])
    assert np.abs(simulated.velocity).max() > 0.1
    simulated.advance(20.0)
    assert np.abs(simulated.velocity).max() < 1e-4


@pytest.mark.parametrize('arm', [PAPER, any_arm(4, gravity=9.81)], ids=['paper', 'four links'])
def test_integration_is_of_fourth_order(arm):
    scale = 5e-3 if arm is PAPER else 0.3
    steps = [0.01, 0.005, 0.0025]
    profile = swing(arm.n - 1, peak=scale, points=101)  # kinks on every grid
    exact = rollout(arm, profile, 1.0, step=1.25e-4).positions[-1]
    errors = [
        np.abs(rollout(arm, profile, 1.0, step=step).positions[-1] - exact).max() for step in steps
    ]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 4.0, atol=0.5)


@pytest.mark.parametrize('n', SIZES)
def test_agrees_with_an_adaptive_integrator_of_the_equation_of_motion(n):
    arm = any_arm(n, gravity=9.81, damping=0.03)

    def rate(t, x):
        q, dq = x[:n], x[n:]
        effort = np.append(np.arange(1, n) * 0.2 * t, 0.0)
        bias = arm.coriolis(q, dq) + arm.gravity_effort(q)
        bias += arm.stiffness_matrix @ q + arm.damping_matrix @ dq
        return np.append(dq, np.linalg.inv(arm.mass_matrix(q)) @ (effort - bias))

    start = np.linspace(0.4, -0.3, n)
    simulated = SimulatedArm(arm, position=start, step=STEP[n])
    ramp = np.arange(1, n)[None] * np.array([[0.0], [0.4], [0.0]])
    simulated.command(EffortProfile(start=0.0, times=[0, 2, 3], efforts=ramp), 0.0)
    simulated.advance(1.0)
    exact = solve_ivp(
        rate, (0.0, 1.0), np.append(start, np.zeros(n)), method='DOP853', rtol=1e-12, atol=1e-12
    ).y[:, -1]
    np.testing.assert_allclose(simulated.position, exact[:n], atol=1e-7)
    np.testing.assert_allclose(simulated.velocity, exact[n:], atol=1e-6)


def test_two_link_arm_follows_the_matrix_exponential():
    inverse = np.linalg.inv(PAPER.mass_matrix(np.zeros(2)))
    linear = np.zeros((5, 5))  # position, velocity, constant effort
    linear[:2, 2:4] = np.eye(2)
    linear[2:4, :2] = -inverse @ PAPER.stiffness_matrix
    linear[2:4, 2:4] = -inverse @ PAPER.damping_matrix
    linear[2:4, 4] = inverse[:, 0]
    simulated = SimulatedArm(PAPER, position=[0.2, 0.1])
    simulated.hold([5e-3])
    simulated.advance(1.0)
    exact = expm(linear) @ [0.2, 0.1, 0.0, 0.0, 5e-3]
    np.testing.assert_allclose(simulated.position, exact[:2], atol=1e-7)
    np.testing.assert_allclose(simulated.velocity, exact[2:4], atol=1e-6)


@pytest.mark.parametrize('step', [1e-3, 7e-4, 0.1])
def test_clock_stays_on_its_grid(step):
    simulated = SimulatedArm(PAPER, time=1.7e9, step=step)
    for k in range(1, 200):
        simulated.advance(1.7e9 + 0.0333 * k)
    steps = round((simulated.time - 1.7e9) / step)
    assert simulated.time == 1.7e9 + steps * step
    assert 0.0333 * 199 - step < simulated.time - 1.7e9 <= 0.0333 * 199 + 1e-6


def test_advance_counts_whole_steps_and_never_goes_back():
    simulated = SimulatedArm(PAPER, step=0.1)
    assert simulated.advance(0.3) == 3  # 0.3 / 0.1 is below 3 in floating point
    assert simulated.advance(0.39) == 0
    assert simulated.advance(0.1) == 0
    assert simulated.advance(0.75) == 4
    assert simulated.time == pytest.approx(0.7)


def test_pieces_of_time_make_no_difference():
    runs = []
    for pieces in (1, 7):
        simulated = SimulatedArm(any_arm(3))
        simulated.command(swing(2), 0.0)
        for k in range(1, pieces + 1):
            simulated.advance(1.2 * k / pieces)
        simulated.advance(1.2)
        runs.append(simulated.state)
    np.testing.assert_array_equal(runs[0].position, runs[1].position)
    assert runs[0].time == runs[1].time


@pytest.mark.parametrize(
    ('t', 'effort'),
    [(9.0, 0.0), (10.25, 1.0), (10.5, 2.0), (10.75, 3.0), (11.0, 4.0), (11.25, 3.0), (13.0, 0.0)],
)
def test_effort_is_linear_between_points_from_zero_to_the_last(t, effort):
    assert simple().effort(t) == pytest.approx([effort])


def test_first_point_at_the_start_needs_no_ramp():
    profile = simple(times=[0.0, 1.0, 2.0])
    assert profile.effort(10.0 - 1e-9) == [0.0]
    assert profile.effort(10.0) == [2.0]


@pytest.mark.parametrize(
    ('at', 't', 'effort'),
    [
        (9.5, 9.0, 6.0),
        (9.5, 10.0, 4.0),
        (10.3, 10.4, 4.0),
        (10.3, 10.75, 3.0),
        (10.5, 10.5, 2.0),
        (10.75, 10.75, 3.0),
    ],
)
def test_profile_taken_over_ramps_from_the_effort_of_that_time(at, t, effort):
    assert simple().taken_over(at, [6.0]).effort(t) == pytest.approx([effort])


def test_reference_passes_points_with_their_velocities():
    times = np.array([0.0, 0.4, 1.0])
    cubic = np.array([1.0, -1.75, 0.5, 0.3])  # at rest at the end
    positions = np.polyval(cubic, times)[:, None]
    velocities = np.polyval(np.polyder(cubic), times)[:, None]
    profile = EffortProfile(
        start=5.0,
        times=times,
        efforts=np.zeros((3, 1)),
        positions=positions,
        velocities=velocities,
    )
    for t in (0.0, 0.1, 0.7, 0.999):
        found = profile.reference(5.0 + t)
        assert found.position == pytest.approx([np.polyval(cubic, t)])
        assert found.velocity == pytest.approx([np.polyval(np.polyder(cubic), t)])
    for t, end in ((4.0, 0), (7.0, -1)):
        assert profile.reference(t).position == pytest.approx(positions[end])
        assert profile.reference(t).velocity == [0.0]
    linear = replace(profile, velocities=None).reference(5.2)
    assert linear.position == pytest.approx((positions[0] + positions[1]) / 2)
    assert linear.velocity == pytest.approx((positions[1] - positions[0]) / 0.4)


def test_one_point_is_a_profile():
    profile = EffortProfile(start=0.0, times=[1.0], efforts=[[0.0]], positions=[[0.3]])
    assert profile.reference(0.5).position == [0.3]
    assert profile.taken_over(0.0, [2.0]).effort(0.75) == pytest.approx([0.5])


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'start': float('nan')}, 'start'),
        ({'times': [0.5, 0.5, 2.0]}, 'increase'),
        ({'times': [0.5, 2.0, 1.0]}, 'increase'),
        ({'times': [-0.1, 1.0, 2.0]}, 'negative'),
        ({'times': [0.5, 1.0]}, 'efforts'),
        ({'times': [], 'efforts': np.zeros((0, 1))}, 'm >= 1'),
        ({'efforts': [[2.0], [float('inf')], [0.0]]}, 'efforts must be finite'),
        ({'efforts': [[2.0], [1.1e6], [0.0]]}, r'effort of 1\.1e\+06 N m is beyond'),
        ({'positions': [[0.0], [-1e300], [0.0]]}, r'position of 1e\+300 rad'),
        (
            {'positions': np.zeros((3, 1)), 'velocities': [[0.0], [1e5], [0.0]]},
            r'velocity of 1e\+05 rad/s',
        ),
        ({'positions': np.zeros((3, 1)), 'velocities': np.ones((3, 1))}, 'last velocity'),
        ({'efforts': [2.0, 4.0, 0.0]}, 'efforts'),
        ({'efforts': np.zeros((3, 0))}, 'efforts'),
        ({'positions': [[0.0], [0.0]]}, 'positions'),
        ({'velocities': np.zeros((3, 1))}, 'need positions'),
        ({'positions': np.zeros((3, 1)), 'velocities': np.zeros((3, 2))}, 'velocities'),
        ({'anchor_time': 9.0}, 'anchor'),
        ({'anchor_time': 9.0, 'anchor_effort': [1.0, 2.0]}, 'anchor_effort'),
    ],
)
def test_profiles_that_cannot_be_played_are_refused(change, message):
    with pytest.raises(InvalidCommand, match=message):
        simple(**change)


@pytest.mark.parametrize('last', [1e-300, -2.0])
def test_nothing_is_held_after_the_last_point(last):
    simulated = SimulatedArm(PAPER)
    with pytest.raises(InvalidCommand, match='last effort must be 0 N m'):
        simulated.command(simple(start=0.0, efforts=[[2e-3], [4e-3], [last]]), 0.0)
    simulated.advance(1.0)
    assert not simulated.position.any()


@pytest.mark.parametrize('n', [2, 4])
def test_brakes_hold_an_arm_that_gravity_would_move_until_its_command_starts(n):
    arm = any_arm(n, gravity=9.81)
    position = np.linspace(0.5, -0.7, n)
    simulated = SimulatedArm(arm, position=position, step=1e-3)
    simulated.advance(0.1)
    profile = EffortProfile(start=0.2, times=[0.0, 0.3], efforts=np.zeros((2, n - 1)))
    simulated.command(profile, 0.1)
    simulated.advance(0.2)
    np.testing.assert_array_equal(simulated.position, position)
    simulated.advance(0.21)
    falling = simulated.velocity
    assert np.abs(falling).max() > 0.01
    free = SimulatedArm(arm, position=position, step=1e-3)
    free.hold(np.zeros(n - 1))
    free.advance(0.01)
    np.testing.assert_allclose(falling, free.velocity, rtol=1e-9)
    simulated.release()
    fallen = simulated.position
    simulated.advance(1.0)
    np.testing.assert_array_equal(simulated.position, fallen)
    np.testing.assert_array_equal(simulated.velocity, 0.0)
    simulated.reset(position)
    simulated.advance(2.0)
    np.testing.assert_array_equal(simulated.position, position)


def test_an_arm_with_weight_is_held_after_its_last_effort():
    arm = PlanarArm.from_links(
        link_length=[0.3, 0.2, 0.2],
        link_com=[0.1, 0.0, 0.0],
        link_mass=[0.5, 0.0, 0.1],
        link_inertia=[1e-3] * 3,
        counterbalance_mass=[0.2, 0.0],
        counterbalance_arm=[0.1, 0.0],
        stiffness=0.5,
        damping=0.0,
        gravity=9.81,
    )
    position = np.array([-1.5, 0.4, 0.0])  # hangs, nearly: what small errors grow into stays small
    efforts = np.tile(arm.gravity_effort(position)[:-1], (2, 1))
    profile = EffortProfile(start=0.2, times=[0.0, 0.3], efforts=efforts)
    simulated = SimulatedArm(arm, position=position, step=1e-3)
    simulated.command(profile, 0.0)
    simulated.advance(2.0)
    np.testing.assert_allclose(simulated.position, position, atol=1e-12)


@pytest.mark.parametrize('n', [3, 4, 7])
def test_motors_without_a_command_carry_the_weight(n):
    arm = vertical_arm(n)
    position = np.append(np.linspace(0.4, 1.1, n - 1), 0.0)
    simulated = SimulatedArm(arm, position=position)
    weight = arm.gravity_effort(position)[:-1]
    assert np.abs(weight).max() > 1.0

    def rests():
        moved = np.abs(simulated.position - position).max()
        return moved < 1e-9 and simulated.applied_effort[:-1] == pytest.approx(weight, abs=1e-6)

    simulated.advance(2.0)
    assert rests()
    # Until the first point as well, whatever effort a wrong model puts there, and after the last.
    times, efforts = [0.0, 1e-3], np.array([1.3 * weight, 1.3 * weight])
    profile = EffortProfile(start=5.0, times=times, efforts=efforts)
    simulated.command(profile, simulated.time)
    simulated.advance(4.999)
    assert rests()
    simulated.advance(5.001)
    assert simulated.applied_effort[:-1] == pytest.approx(1.3 * weight, rel=1e-3)
    simulated.advance(5.1)
    now = simulated.position
    assert simulated.applied_effort[:-1] == pytest.approx(arm.gravity_effort(now)[:-1])
    simulated.hold(np.zeros(n - 1), until=6.0)  # An effort of zero is a command: the arm falls.
    simulated.advance(5.5)
    assert np.abs(simulated.position - now).max() > 0.1


def test_command_takes_over_from_the_effort_of_the_one_before():
    simulated = SimulatedArm(PAPER, step=0.01)
    simulated.command(swing(1, peak=4e-3), 0.0)
    simulated.advance(0.25)
    np.testing.assert_allclose(simulated.applied_effort[0], 4e-3, rtol=1e-6)
    following = EffortProfile(start=0.45, times=[0.0, 1.0], efforts=[[0.0], [0.0]])
    simulated.command(following, 0.25)
    simulated.advance(0.35)
    np.testing.assert_allclose(simulated.applied_effort[0], 2e-3, rtol=1e-6)


def test_past_points_are_skipped():
    early, late = SimulatedArm(PAPER, time=0.25), SimulatedArm(PAPER, time=0.25)
    early.command(swing(1, peak=4e-3), 0.25)
    cut = swing(1, peak=4e-3)
    late.command(replace(cut, times=cut.times[40:], efforts=cut.efforts[40:]), 0.25)
    early.advance(1.0)
    late.advance(1.0)
    np.testing.assert_allclose(early.position, late.position, rtol=1e-12)


def test_command_that_has_ended_is_refused_and_leaves_the_present_one():
    simulated = SimulatedArm(PAPER, time=12.5)
    simulated.command(swing(1, start=12.5), 12.5)
    simulated.advance(12.75)
    before = simulated.applied_effort
    with pytest.raises(InvalidCommand, match=r'12\.000000 s.*12\.750000 s'):
        simulated.command(simple(), 12.75)
    with pytest.raises(InvalidCommand, match='1 motors, the command 2'):
        simulated.command(swing(2, start=13.0), 12.75)
    np.testing.assert_array_equal(simulated.applied_effort, before)
    assert before[0] > 0.0


def test_saturation_clips_and_counts():
    profile = swing(1, peak=4e-3)
    free, limited = (
        SimulatedArm(PAPER),
        SimulatedArm(PAPER, drives=DriveSettings(saturation=(2e-3,))),
    )
    for simulated in (free, limited):
        simulated.command(profile, 0.0)
        simulated.advance(0.25)
    assert free.applied_effort[0] == pytest.approx(4e-3)
    assert limited.applied_effort[0] == 2e-3
    assert free.take_clipped_steps() == 0
    clipped = limited.take_clipped_steps()
    assert abs(clipped - 250 * 2 / 3) < 2  # sine above one half from 1/12 s on
    assert limited.take_clipped_steps() == 0
    held = SimulatedArm(PAPER)
    clip = np.minimum(np.maximum(profile.efforts, -2e-3), 2e-3)
    held.command(replace(profile, efforts=clip), 0.0)
    held.advance(0.25)
    np.testing.assert_allclose(limited.position, held.position, rtol=1e-3)
    assert abs(free.position[0] - held.position[0]) > 0.01


def test_feedback_adds_gains_times_errors():
    gains = DriveSettings(feedback_p=(0.02,), feedback_d=(0.005,))
    simulated = SimulatedArm(PAPER, position=[0.1, 0.0], step=5e-3, drives=gains)
    positions = np.array([[0.3], [0.5]])
    profile = EffortProfile(
        start=0.0,
        times=[0.0, 1.0],
        efforts=[[1e-3], [0.0]],
        positions=positions,
        velocities=[[0.4], [0.0]],
    )
    simulated.command(profile, 0.0)
    expected = 1e-3 + 0.02 * (0.3 - 0.1) + 0.005 * 0.4
    assert simulated.applied_effort == pytest.approx([expected, 0.0])
    simulated.advance(40.0)
    assert simulated.position == pytest.approx([0.5, 0.0], abs=1e-4)


def test_without_gains_nothing_brings_a_displaced_arm_back():
    profile = EffortProfile(
        start=0.0, times=[0.0, 1.0], efforts=[[0.0], [0.0]], positions=[[0.3], [0.3]]
    )
    simulated = SimulatedArm(PAPER, position=[0.1, 0.0])
    simulated.command(profile, 0.0)
    simulated.advance(5.0)
    np.testing.assert_array_equal(simulated.position, [0.1, 0.0])


def test_feedback_without_a_reference_is_refused():
    simulated = SimulatedArm(PAPER, drives=DriveSettings(feedback_p=(0.02,)))
    with pytest.raises(InvalidCommand, match='positions'):
        simulated.command(swing(1), 0.0)


def test_reset_rests_the_arm_and_forgets_the_command_but_not_the_time():
    simulated = SimulatedArm(PAPER, drives=DriveSettings(feedback_p=(0.02,)))
    still = {'positions': np.zeros((201, 1)), 'velocities': np.zeros((201, 1))}
    simulated.command(swing(1, **still), 0.0)
    simulated.advance(0.5)
    assert np.abs(simulated.velocity).max() > 0.0
    simulated.reset([0.7, 0.0])
    assert simulated.time == 0.5
    simulated.advance(0.8)
    state = simulated.state
    np.testing.assert_array_equal(state.position, [0.7, 0.0])
    np.testing.assert_array_equal(state.velocity, [0.0, 0.0])
    np.testing.assert_array_equal(state.effort, [0.0, 0.0])
    assert state.time == 0.8


def test_applied_effort_of_the_passive_joint_is_its_spring_and_damper():
    simulated = kicked(PAPER, [5e-3])
    q, dq = simulated.position[-1], simulated.velocity[-1]
    assert abs(dq) > 0.01
    assert simulated.applied_effort[-1] == pytest.approx(-3e-3 * q - 2e-5 * dq, rel=1e-12)


def test_arm_may_change_between_steps():
    simulated = kicked(PAPER, [5e-3])
    position = simulated.position
    simulated.arm = PAPER.scaled(stiffness=2.0)
    np.testing.assert_array_equal(simulated.position, position)
    expected = -6e-3 * position[-1] - 2e-5 * simulated.velocity[-1]
    assert simulated.applied_effort[-1] == pytest.approx(expected, rel=1e-12)
    with pytest.raises(InvalidModel, match='2 joints'):
        simulated.arm = any_arm(3)


def test_state_is_copied_out():
    simulated = SimulatedArm(PAPER, position=np.asfortranarray([0.1, 0.2]))
    for array in (simulated.position, simulated.velocity, *simulated.state[1:]):
        assert array.flags.c_contiguous
        array[:] = 9.0
    np.testing.assert_array_equal(simulated.position, [0.1, 0.2])
    np.testing.assert_array_equal(simulated.velocity, [0.0, 0.0])


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'step': 0.0}, 'step'),
        ({'step': float('nan')}, 'step'),
        ({'time': float('inf')}, 'time'),
        ({'position': [0.0]}, 'position'),
        ({'position': [0.0, float('nan')]}, 'position'),
        ({'drives': DriveSettings(saturation=(-1.0,))}, 'saturation'),
        ({'drives': DriveSettings(saturation=(1.0, 1.0))}, 'saturation'),
        ({'drives': DriveSettings(feedback_p=(float('nan'),))}, 'feedback_p'),
        ({'drives': DriveSettings(feedback_d=(-1.0,))}, 'feedback_d'),
    ],
)
def test_options_without_meaning_are_refused(change, message):
    with pytest.raises(InvalidModel, match=message):
        SimulatedArm(PAPER, **change)


def test_rollout_is_the_simulated_arm_at_every_step():
    profile = swing(2, start=3.0)
    run = rollout(any_arm(3), profile, 3.5, step=0.01, position=[0.1, 0.2, 0.0])
    simulated = SimulatedArm(any_arm(3), position=[0.1, 0.2, 0.0], time=3.0, step=0.01)
    simulated.command(profile, 3.0)
    simulated.advance(3.5)
    assert run.times.shape == (51,)
    assert run.positions.shape == run.velocities.shape == (51, 3)
    np.testing.assert_array_equal(run.positions[0], [0.1, 0.2, 0.0])
    np.testing.assert_array_equal(run.positions[-1], simulated.position)
    np.testing.assert_array_equal(run.velocities[-1], simulated.velocity)


@pytest.mark.parametrize(
    ('damping', 'mismatch', 'amplitude'),
    [(0.0, 1.0, 0.0), (1.0, 1.0, 0.00449), (1.0, 1.1, 0.0980), (1.0, 0.9, 0.115)],
)
def test_paper_arm_is_left_oscillating_as_much_as_is_known(damping, mismatch, amplitude):
    """Amplitudes of the polynomial law, 0 to pi in 1 s, in the paper's scenarios."""
    arm = PAPER.scaled(damping=damping)
    both, last = arm.inertia_star
    k, c = arm.stiffness, arm.damping
    bell = np.polynomial.Polynomial([0, 1, -1]) ** 5
    y = pi * bell.integ() / bell.integ()(1.0)
    law = both * y.deriv(2) + last * (both - last) / k * (y.deriv(4) - c / k * y.deriv(5))
    times = np.linspace(0.0, 1.0, 201)
    efforts = law(times)[:, None]
    efforts[-1] = 0.0
    plant = arm.scaled(stiffness=mismatch, damping=mismatch)
    run = rollout(plant, EffortProfile(start=0.0, times=times, efforts=efforts), 1.0)
    found = envelope(plant, run.positions[-1, -1], run.velocities[-1, -1])
    assert found == pytest.approx(amplitude, abs=5e-6 if amplitude < 0.05 else 5e-4)


def test_free_oscillation_has_the_natural_frequency_and_decay():
    mode = PAPER.natural_mode()
    simulated = SimulatedArm(PAPER, position=[0.0, 0.1], step=5e-4)
    period = 2 * pi / mode.damped_frequency
    run = []
    for k in (1, 2, 3):
        simulated.advance(k * period)
        late = simulated.time - k * period  # the grid ends up to one step before
        run.append(simulated.position[-1] / np.cos(mode.damped_frequency * late))
    np.testing.assert_allclose(
        run, 0.1 * np.exp(-mode.decay_rate * period * np.arange(1, 4)), rtol=1e-3
    )
