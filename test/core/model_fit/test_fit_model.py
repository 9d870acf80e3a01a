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

"""The whole model from one recording: how near it comes, what it admits, what it refuses."""

from dataclasses import replace
from math import pi

from flat_planner_ros.core.arm import displaced_com, InvalidRequest, PlanarArm
from flat_planner_ros.core.model_fit import fit_model, Measurements, Trust
from flat_planner_ros.core.motion_law import Strategy
from free_arm import measured, pushes, simulated
import numpy as np
import pytest
from recorded_arm import recorded
from scipy.optimize import least_squares

BELIEVED = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
TRUE = PlanarArm.reduced(
    inertia_star=(1.11 * 6.4e-4, 0.91 * 3.3e-5),
    stiffness=0.87 * 3e-3,
    damping=1.3 * 2e-5,
    viscous_friction=[2e-4],
    coulomb_friction=[5e-4],
)

SHORT = {'goals': (pi, 0.5 * pi), 'until': 3.1}
TIMES = np.arange(0.0, 6.0, 0.01)
FREE = {'both': 7e-4, 'last': 3e-5}
STIFFNESS, DAMPING = 2.7e-3, 2.5e-5


def linear(q, rate):
    """Return the effort of the spring that the model has [N m]."""
    return STIFFNESS * q + DAMPING * rate


def backlash(q, rate):
    """Return the effort of one with 5 mrad of backlash [N m]."""
    return linear(q - np.clip(q, -0.005, 0.005), rate)


def six(arm):
    """Return what the last two links of an arm depend on, shape (6,)."""
    friction = arm.viscous_friction[-1], arm.coulomb_friction[-1]
    return np.array([*arm.inertia_star, arm.stiffness, arm.damping, *friction])


def z_scores(fit, arm):
    """Return the errors of the six in standard errors."""
    values = np.array([(e.value, e.std) for e in fit.estimates[:6]])
    return (values[:, 0] - six(arm)) / values[:, 1]


@pytest.mark.parametrize(
    ('rate', 'noise', 'bits', 'bound'),
    [(200.0, 0.0, 0, 0.002), (200.0, 1e-4, 14, 0.005), (50.0, 1e-3, 12, 0.02)],
)
def test_four_goals_tell_all_six(rate, noise, bits, bound):
    step = 2 * pi / 2**bits if bits else 0.0
    fit = fit_model(recorded(TRUE, BELIEVED, rate=rate, noise=noise, step=step), BELIEVED)
    assert six(fit.arm) == pytest.approx(six(TRUE), rel=bound)
    assert np.abs(z_scores(fit, TRUE)).max() < 4.0
    untold = {estimate.name for estimate in fit.estimates if not estimate.is_told}
    assert untold == {'offset[1]'}
    assert fit.misfit == ''


def test_a_start_that_friction_hides_leads_nowhere_wrong():
    """The noise of this seed says 0.2 rad/s for a joint at rest, which stops within a sample."""
    friction = {'viscous': 2e-4, 'coulomb': 5e-4}
    arm = BELIEVED.with_last_links(
        inertia_star=BELIEVED.inertia_star, stiffness=3e-3, damping=2e-5, **friction
    )
    fit = fit_model(recorded(arm, arm, noise=1e-3, seed=8, **SHORT), arm)
    assert np.abs(z_scores(fit, arm)).max() < 4.0
    assert fit.misfit == ''


@pytest.mark.parametrize(
    'motion',
    [
        {
            'goals': (0.3, 0.0),
            'duration': 1.027,
            'strategy': Strategy.MIN_CONTROL_EFFORT,
            'spacing': 2.5,
            'until': 5.2,
            'seed': 1,
        },
        {'goals': (0.45, 0.0), 'duration': 1.5, 'spacing': 4.0, 'until': 8.2},
    ],
    ids=['weak form astray', 'ratios alone'],
)
def test_small_motions_that_stick_tell_friction_and_ratios(motion):
    """The efforts are up to 1.1e-3 N m: the arm moves by 0.016 rad at most."""
    sticky = replace(TRUE, coulomb_friction=[9e-4])
    found = fit_model(recorded(sticky, BELIEVED, noise=1e-4, **motion), BELIEVED).arm
    assert found.coulomb_friction[-1] == pytest.approx(9e-4, rel=0.01)
    ratio = found.stiffness / found.inertia_star[-1]
    assert ratio == pytest.approx(TRUE.stiffness / TRUE.inertia_star[-1], rel=0.01)


def test_a_delay_and_an_offset_are_found():
    late, bent = 0.012, 0.03
    seen = recorded(TRUE, BELIEVED, noise=1e-4)
    efforts = np.interp(seen.times + late, seen.times, seen.efforts[:, 0])
    shifted = Measurements(
        times=seen.times, positions=seen.positions + [0.0, bent], efforts=efforts[:, None]
    )
    fit = fit_model(shifted, BELIEVED)
    assert fit.estimate('delay').value == pytest.approx(late, abs=2e-4)
    assert fit.estimate('offset').value == pytest.approx(bent, abs=1e-4)
    assert six(fit.arm) == pytest.approx(six(TRUE), rel=0.01)


def test_uneven_times_and_a_gap_do_no_harm():
    rng = np.random.default_rng(1)
    times = np.sort(rng.uniform(0.0, 6.0, 1200))
    times = times[(times < 2.0) | (times > 2.4)]
    fit = fit_model(measured(pushes, times, spring=linear, noise=1e-5, **FREE), BELIEVED)
    assert [fit.arm.stiffness, fit.arm.damping] == pytest.approx([STIFFNESS, DAMPING], rel=0.005)
    assert fit.arm.inertia_star == pytest.approx((7e-4, 3e-5), rel=0.005)
    # There is no friction: an estimate of it is not known to half of itself.
    assert fit.estimate('coulomb_friction[1]').remark.startswith('hardly told; slow motions')
    assert fit.estimate('stiffness').remark == ''


def test_scipy_alone_finds_the_same_from_a_random_start():
    """Second route: least_squares with an integrator, all from the start of the recording."""
    times = np.arange(0.0, 1.5, 0.02)
    seen = measured(pushes, times, spring=linear, noise=1e-3, seed=3, **FREE)
    fit = fit_model(seen, BELIEVED)
    unit = np.array([7e-4, 3e-5, STIFFNESS, DAMPING])

    def miss(log):
        both, last, k, c = unit * np.exp(log[:4])
        angles = simulated(
            pushes, times, both=both, last=last, spring=lambda q, v: k * q + c * v, start=log[4:]
        )
        return (angles - seen.positions).ravel()

    start = np.append(np.random.default_rng(4).normal(0.0, 0.1, 4), np.zeros(4))
    alone = unit * np.exp(least_squares(miss, start, x_scale='jac').x[:4])
    stds = np.array([estimate.std for estimate in fit.estimates[:4]])
    # Friction, offset and delay are free in the fit alone: the two may differ by noise.
    assert np.abs((six(fit.arm)[:4] - alone) / stds).max() < 2.0
    assert alone == pytest.approx(unit, rel=0.1)


def test_a_swing_without_effort_tells_ratios_alone():
    still = {'spring': linear, 'start': (0.0, 0.3, 0.0, 0.0), **FREE}
    seen = measured(np.zeros_like, TIMES, noise=1e-4, **still)
    fit = fit_model(seen, BELIEVED)
    untold = {estimate.name for estimate in fit.estimates if not estimate.is_told}
    assert {'inertia_star.last', 'coulomb_friction[1]', 'delay'} <= untold
    assert fit.estimate('inertia_star.last').value == BELIEVED.inertia_star.last
    assert 'effort' in fit.estimate('delay').remark
    ratio = fit.arm.stiffness / fit.arm.inertia_star.last
    assert ratio == pytest.approx(STIFFNESS / 3e-5, rel=0.01)


def test_trusted_inertia_gives_the_scale_of_the_effort():
    seen = recorded(TRUE, BELIEVED, **SHORT)
    wrong = Measurements(times=seen.times, positions=seen.positions, efforts=seen.efforts / 1.25)
    start = PlanarArm.reduced(
        inertia_star=(TRUE.inertia_star.both, 3.3e-5), stiffness=3e-3, damping=2e-5
    )
    fit = fit_model(wrong, start, trust=Trust.INERTIA)
    assert fit.effort_scale == pytest.approx(1.25, rel=1e-3)
    assert six(fit.arm) == pytest.approx(six(TRUE), rel=2e-3)
    assert fit.estimate('inertia_star.both').std == pytest.approx(0.0, abs=1e-12)
    assert six(fit_model(wrong, start).arm) == pytest.approx(six(TRUE) / 1.25, rel=2e-3)


@pytest.mark.parametrize(
    'spring',
    [
        linear,
        lambda q, v: linear(q * (1.0 + 0.05 * (q / 0.3) ** 2), v),
        backlash,
    ],
    ids=['as modelled', 'stiffens by 5 % at 0.3 rad', 'backlash of 5 mrad'],
)
def test_another_structure_is_noticed(spring):
    fit = fit_model(measured(pushes, TIMES, spring=spring, noise=1e-4, **FREE), BELIEVED)
    assert ('passive joint' in fit.misfit) == (spring is not linear)
    assert fit.misfit in fit.text


def ramps(t):
    """Return an effort with corners that 50 samples a second do not show [N m]."""
    corners = [0.113, 0.357, 0.605, 0.851, 1.613, 1.857, 2.105, 2.351]
    return np.interp(np.mod(t, 3.0), corners, [0.0, 0.01, -0.01, 0.0, 0.0, -0.01, 0.01, 0.0])


@pytest.mark.parametrize(
    'spring',
    [linear, backlash],
    ids=['as modelled', 'backlash of 5 mrad'],
)
def test_corners_of_the_effort_between_samples_are_no_misfit(spring):
    """Of 0.04 mrad without noise; backlash leaves 2 mrad."""
    seen = measured(ramps, np.arange(0.0, 6.0, 0.02), spring=spring, **FREE)
    fit = fit_model(seen, BELIEVED)
    assert bool(fit.misfit) == (spring is not linear)
    if spring is linear:
        assert six(fit.arm)[:4] == pytest.approx([7e-4, 3e-5, STIFFNESS, DAMPING], rel=0.004)


@pytest.mark.parametrize('spring', [linear, backlash], ids=['no', 'yes'])
def test_another_structure_is_told_from_efforts_at_unknown_times(spring):
    """
    Each is held until the next one, which begins to act anywhere between two samples.

    Once none comes for a quarter of a second; where that ends is what would err most.
    """
    times = np.arange(0.0, 2.0, 0.01)
    begins = times[:-1] + 0.01 * np.random.default_rng(1).uniform(size=times.size - 1)
    sent = pushes(times)
    sent[25:50] = sent[25]

    def in_steps(t):
        return sent[np.searchsorted(begins, t)]

    seen = measured(in_steps, times, spring=spring, noise=1e-4, **FREE)
    fit = fit_model(replace(seen, are_held=True), BELIEVED)
    if spring is linear:
        assert fit_model(seen, BELIEVED).misfit != ''
        assert fit.misfit == ''
        stds = np.array([estimate.std for estimate in fit.estimates[:4]])
        errors = six(fit.arm)[:4] - [*FREE.values(), STIFFNESS, DAMPING]
        assert np.abs(errors / stds).max() < 4.0
        assert (stds < 0.006 * six(fit.arm)[:4]).all()
    else:
        assert 'passive joint' in fit.misfit


def test_an_imbalance_is_noticed_and_found():
    links = {
        'link_length': [0.1, 0.1],
        'link_mass': [0.05, 0.02],
        'link_inertia': [1e-4, 2e-5],
        'counterbalance_mass': [0.14, 0.04],
        'counterbalance_arm': [0.05, 0.025],
        'stiffness': 5e-3,
        'damping': 5e-5,
    }
    com = np.array([0.02, 0.05])
    believed = PlanarArm.from_links(link_com=com, **links)
    believed.check_flat()
    moment = 0.02 * 0.04 * 0.025
    off = displaced_com(com, links['link_mass'], [0.0, moment])
    arms = believed, PlanarArm.from_links(link_com=off, **links)
    seen = [recorded(arm, believed, noise=1e-5, **SHORT) for arm in arms]
    balanced, unbalanced = (fit_model(each, believed, with_imbalance=True) for each in seen)
    assert balanced.misfit == ''
    assert fit_model(seen[1], believed).misfit != ''
    assert unbalanced.misfit == ''
    assert not balanced.imbalance.is_seen
    assert 'imbalance of link n: none above' in balanced.text
    found, coupling = unbalanced.imbalance, arms[1].inertia[0, 1]
    assert found.is_seen
    assert found.coupling == pytest.approx(coupling, rel=0.01)
    assert 'of its counterbalance larger by' in unbalanced.text


def test_what_tells_nothing_is_refused():
    seen = recorded(TRUE, BELIEVED, until=1.0)
    with pytest.raises(InvalidRequest, match='3 joints'):
        fit_model(
            Measurements(
                times=seen.times,
                positions=np.zeros((seen.times.size, 3)),
                efforts=np.zeros((seen.times.size, 2)),
            ),
            BELIEVED,
        )
    with pytest.raises(InvalidRequest, match='no joint moves'):
        fit_model(replace(seen, positions=0.0 * seen.positions), BELIEVED)
    # As after a goal where the arm is already: an encoder takes a step, and nothing swings.
    step = np.outer(seen.times > 0.5, [2 * pi / 2**14, 0.0])
    with pytest.raises(InvalidRequest, match='joint 2 stands still'):
        fit_model(replace(seen, positions=step, efforts=0.0 * seen.efforts), BELIEVED)
    moving = recorded(TRUE, BELIEVED, **SHORT)
    noise = 1e-5 * np.random.default_rng(0).standard_normal(moving.positions.shape)
    for shaken, said in ((0.0, 'joint 1 stands exactly still'), (noise, 'no more than its noise')):
        with pytest.raises(InvalidRequest, match=said):
            fit_model(replace(moving, positions=moving.positions * [0.0, 1.0] + shaken), BELIEVED)
    with pytest.raises(InvalidRequest, match='fewest'):
        Measurements(times=seen.times[:9], positions=seen.positions[:9], efforts=seen.efforts[:9])
    with pytest.raises(InvalidRequest, match='increase'):
        Measurements(times=seen.times[::-1], positions=seen.positions, efforts=seen.efforts)
