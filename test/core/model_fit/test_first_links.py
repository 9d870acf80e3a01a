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

"""The first links of longer arms: what tells them, how well, and what does not."""

from dataclasses import replace
from types import SimpleNamespace

from core.conftest import first_links
from flat_planner_ros.core.arm import InvalidRequest, PlanarArm
from flat_planner_ros.core.model_fit import fit_model, Measurements, Trust
from flat_planner_ros.core.model_fit.first_fit import fit_first_links
from flat_planner_ros.core.model_fit.first_links import (
    Chain,
    ChainSignals,
    KINDS,
    parameters_of,
    rows,
)
from flat_planner_ros.core.model_fit.weak_form import Windows
from free_arm import carried
import numpy as np
import pytest
from random_cases import cases
from recorded_arm import held, recorded

EARTH = 9.81
GOALS = (1.5, -0.5, 1.0, -1.0)


def arms(count, gravity, seed):
    """Return an arm as believed and one whose first links are up to a fifth off it."""
    rng = np.random.default_rng(seed)

    def first(off):
        com, mass, inertia, tips, _ = 1.0 + rng.uniform(-off, off, (5, count))
        links = first_links(count, com=com, mass=mass, inertia=inertia, tip=tips[0])
        return {**links, 'gravity': gravity}

    believed = PlanarArm.reduced(
        inertia_star=(6.4e-4, 1.5e-4), stiffness=9e-3, damping=6e-5, **first(0.0)
    )
    true = PlanarArm.reduced(
        inertia_star=(7.2e-4, 1.3e-4),
        stiffness=8e-3,
        damping=8e-5,
        viscous_friction=[*rng.uniform(0.01, 0.03, count), 2e-4],
        coulomb_friction=[*rng.uniform(0.005, 0.02, count), 5e-4],
        **first(0.2),
    )
    return believed, true


def beyond(arm):
    """Return the last two links of an arm of three, as one of two."""
    return PlanarArm.reduced(
        inertia_star=arm.inertia_star,
        stiffness=arm.stiffness,
        damping=arm.damping,
        viscous_friction=arm.viscous_friction[1:],
        coulomb_friction=arm.coulomb_friction[1:],
    )


def first_estimates(fit, arm):
    """Return estimates of the first links with the true values, by name."""
    return {
        estimate.name: (estimate, true)
        for estimate, true in zip(fit.estimates[8:], [*parameters_of(arm), 0.0], strict=True)
    }


def directly(seen, believed, true):
    """Fit the first links alone, the last ones known; return a dictionary alike."""
    friction = float(true.viscous_friction[-1]), float(true.coulomb_friction[-1])
    period = 2 * np.pi / believed.natural_mode().frequency
    fit = fit_first_links(seen, believed, period, friction, 0.0)
    names = [f'{kind}[{i}]' for kind in KINDS for i in range(1, believed.n - 1)]
    stds = np.sqrt(np.diag(fit.errors))
    rows_of = zip(names, fit.values, stds, parameters_of(true), strict=True)
    found = {
        name: (SimpleNamespace(value=value, std=std, is_told=index in fit.free), value_true)
        for index, (name, value, std, value_true) in enumerate(rows_of)
    }
    return found, fit.misfit


def check_told(found, names, bound):
    """Check that some parameters are told, within a relative bound and their own errors."""
    for name in names:
        estimate, true = found[name]
        assert estimate.is_told, name
        assert estimate.value == pytest.approx(true, rel=bound), name
        assert abs(estimate.value - true) < 4.0 * estimate.std, name


def test_a_vertical_arm_tells_weights_inertias_and_friction():
    noise = 3e-4
    believed, true = arms(2, EARTH, seed=1)
    fit = fit_model(held(true, believed, noise=noise, goals=GOALS), believed)
    found = first_estimates(fit, true)
    share = noise / 1e-4
    both = [f'{kind}[{i}]' for kind in ('inertia', 'static_moment') for i in (1, 2)]
    check_told(found, both, 0.003 * share)
    friction = [f'{kind}_friction[{i}]' for kind in ('viscous', 'coulomb') for i in (1, 2)]
    check_told(found, friction, 0.02 * share)
    assert [name for name, (e, _) in found.items() if not e.is_told] == ['offset[3]']
    assert fit.misfit == ''
    assert fit.arm.static_moment == pytest.approx(true.static_moment, rel=0.003 * share)
    assert fit.arm.inertia == pytest.approx(true.inertia, rel=0.01 * share)


def test_a_horizontal_arm_does_not_tell_the_weight_of_its_first_link():
    believed, true = arms(2, 0.0, seed=2)
    fit = fit_model(recorded(true, believed, noise=1e-4), believed)
    found = first_estimates(fit, true)
    check_told(found, ['inertia[1]', 'inertia[2]', 'static_moment[2]'], 0.01)
    for name in ('static_moment[1]', 'offset[1]', 'offset[3]'):
        assert not found[name][0].is_told
        assert found[name][0].value == found[name][0].start
    assert 'vertical plane' in found['static_moment[1]'][0].remark
    assert 'mark' in found['offset[3]'][0].remark


def test_offsets_of_the_first_encoders_show_in_a_vertical_plane():
    believed, true = arms(2, EARTH, seed=3)
    seen = held(true, believed, noise=1e-5, goals=GOALS)
    off = np.array([0.03, -0.05, 0.0, 0.0])
    shifted = Measurements(times=seen.times, positions=seen.positions + off, efforts=seen.efforts)
    found, _ = directly(shifted, believed, true)
    for joint in (1, 2):
        assert found[f'offset[{joint}]'][0].value == pytest.approx(off[joint - 1], abs=1e-3)
    check_told(found, ['static_moment[1]', 'static_moment[2]', 'inertia[1]'], 0.005)


def test_a_joint_that_never_moves_tells_nothing_of_itself():
    believed, true = arms(1, 0.0, seed=4)
    seen = recorded(true, believed, until=3.1, goals=(1.0, -1.0))
    still = seen.positions * [0.0, 1.0, 1.0]
    held_still = Measurements(times=seen.times, positions=still, efforts=seen.efforts)
    found, _ = directly(held_still, believed, true)
    assert not any(estimate.is_told for estimate, _ in found.values())
    assert found['inertia[1]'][0].value == pytest.approx(believed.inertia[0, 0])
    # The last links are told by motions of joint n-1, whatever stands still before it.
    for moves in ([1.0, 0.0, 1.0], [0.0, 0.0, 1.0]):
        with pytest.raises(InvalidRequest, match='joint 2 stands exactly still'):
            fit_model(replace(seen, positions=seen.positions * moves), believed)


def test_a_recording_shorter_than_a_window_tells_nothing_of_the_first_links():
    believed, true = arms(1, 0.0, seed=1)
    seen = recorded(true, believed, noise=1e-4, until=1.6)
    part = slice(20, 80)
    short = Measurements(
        times=seen.times[part], positions=seen.positions[part], efforts=seen.efforts[part]
    )
    found = first_estimates(fit_model(short, believed), true)
    assert not any(estimate.is_told for estimate, _ in found.values())


@pytest.mark.parametrize('noise', [0.0, 1e-5])
def test_a_first_joint_that_is_held_fast_leaves_the_last_links_told(noise):
    """The arm beyond joint 1, recorded on its own, with an encoder that shows nothing."""
    believed, true = arms(1, 0.0, seed=4)
    seen = recorded(beyond(true), beyond(believed), until=3.1, goals=GOALS[:2], noise=noise)
    fast = Measurements(
        times=seen.times,
        positions=np.column_stack((0.0 * seen.times, seen.positions)),
        efforts=np.column_stack((0.0 * seen.times, seen.efforts)),
    )
    fit = fit_model(fast, believed)
    assert fit.misfit == ''
    assert fit.arm.inertia_star == pytest.approx(true.inertia_star, rel=2e-3)
    assert fit.arm.stiffness == pytest.approx(true.stiffness, rel=2e-3)
    assert [e.name for e in fit.estimates[:6] if not e.is_told] == []
    firsts = fit.estimates[8:]
    assert not any(estimate.is_told for estimate in firsts)
    assert all('would tell it' in estimate.remark for estimate in firsts)


@pytest.mark.parametrize('noise', [1e-4, 1e-3])
def test_noise_of_a_first_joint_at_rest_does_not_turn_friction(noise):
    """Second route: link n-1 of an arm of two, seen with the noise of both encoders."""
    believed, true = arms(1, 0.0, seed=4)
    pairs = [beyond(arm) for arm in (true, believed)]
    seen = recorded(*pairs, until=3.1, goals=GOALS[:2], noise=noise)
    first = noise * np.random.default_rng(9).standard_normal(seen.times.size)
    alone = seen.positions + np.column_stack((first, 0.0 * first))
    three = Measurements(
        times=seen.times,
        positions=np.column_stack((first, seen.positions)),
        efforts=np.column_stack((0.0 * seen.times, seen.efforts)),
    )
    found = [estimate.value for estimate in fit_model(three, believed).estimates[:6]]
    two = [
        estimate.value
        for estimate in fit_model(replace(seen, positions=alone), pairs[1]).estimates[:6]
    ]
    assert found == pytest.approx(two, rel=1e-4)


def test_friction_that_noise_hides_is_not_told():
    """An error is not small because the effort is large: 151 % of the friction was told."""
    believed, true = arms(5, EARTH, seed=1)
    clean = held(true, believed, goals=GOALS)
    noise = 1e-3 * np.random.default_rng(1).standard_normal(clean.positions.shape)
    step = 2 * np.pi / 2**12
    rounded = step * np.round((clean.positions + noise) / step)
    found, misfit = directly(replace(clean, positions=rounded), believed, true)
    assert misfit == ''
    for name, (estimate, value) in found.items():
        if 'friction' in name and estimate.is_told:
            assert estimate.std <= 0.3 * abs(estimate.value), name
            assert abs(estimate.value - value) < 4.0 * estimate.std, name
    for name in ('viscous_friction[1]', 'viscous_friction[2]', 'coulomb_friction[1]'):
        assert not found[name][0].is_told
        assert found[name][0].value == found[name][0].std == 0.0
    check_told(found, ['inertia[1]', 'inertia[5]', 'static_moment[1]'], 0.05)


def test_first_links_that_are_no_arm_stay_as_believed():
    """Each inertia is found within its errors, and yet they do not belong together."""
    believed, true = arms(2, 0.0, seed=102)
    goals = tuple(np.random.default_rng(103).uniform(-1.5, 1.5, 4))
    fit = fit_model(recorded(true, believed, noise=1e-3, goals=goals, seed=102), believed)
    assert 'no arm' in fit.misfit
    assert 'positive definite' in fit.misfit
    assert fit.arm.inertia[0, 0] == believed.inertia[0, 0]
    told = [estimate.name for estimate in fit.estimates if estimate.is_told]
    assert 'stiffness' in told
    assert not {'inertia[1]', 'inertia[2]', 'static_moment[2]'} & set(told)


def test_no_friction_is_told_as_none():
    believed, true = arms(1, EARTH, seed=2)
    smooth = replace(true, viscous_friction=np.zeros(2), coulomb_friction=np.zeros(2))
    seen = held(smooth, believed, noise=1e-5, goals=GOALS)
    found, _ = directly(seen, believed, smooth)
    for name in ('viscous_friction[1]', 'coulomb_friction[1]'):
        estimate = found[name][0]
        assert estimate.is_told
        assert abs(estimate.value) < max(4.0 * estimate.std, 1e-5)


def test_trusted_inertia_scales_the_first_links_too():
    believed, true = arms(1, EARTH, seed=5)
    seen = held(true, believed, goals=GOALS)
    both = true.inertia_star.both
    start = believed.with_last_links(
        inertia_star=(both, 1.5e-4), stiffness=9e-3, damping=6e-5, viscous=0.0, coulomb=0.0
    )
    wrong = Measurements(times=seen.times, positions=seen.positions, efforts=seen.efforts / 1.25)
    fit = fit_model(wrong, start, trust=Trust.INERTIA)
    assert fit.effort_scale == pytest.approx(1.25, rel=5e-3)
    check_told(first_estimates(fit, true), ['static_moment[1]', 'inertia[1]'], 0.01)


def test_a_missing_friction_is_said_where_the_first_links_have_another():
    """Friction that grows with the square of the velocity is not in the model."""
    believed, true = arms(1, 0.0, seed=6)
    seen = recorded(true, believed)
    rate = np.gradient(seen.positions[:, 0], seen.times)
    efforts = seen.efforts + np.column_stack((0.02 * rate * np.abs(rate), 0.0 * rate))
    braked = Measurements(times=seen.times, positions=seen.positions, efforts=efforts)
    assert 'N m at link 1' in directly(braked, true, true)[1]
    assert directly(seen, believed, true)[1] == ''


@pytest.mark.parametrize('backlash', [0.0, 0.005], ids=['as modelled', 'backlash of 5 mrad'])
def test_five_joints_tell_the_last_two_as_well_as_two_do(backlash):
    """Noise of three encoders at the base is no misfit, and what else is wrong stays one."""
    believed, true = arms(3, EARTH, seed=1)
    short = {'goals': GOALS[:2], 'until': 3.1}
    clean = held(true, believed, **short)
    if backlash:

        def spring(q, rate):
            pulled = q - np.clip(q, -backlash, backlash)
            return true.stiffness * pulled + true.damping * rate

        clean = carried(clean, true, spring=spring)
    noise = 1e-4 * np.random.default_rng(1).standard_normal(clean.positions.shape)
    fit = fit_model(replace(clean, positions=clean.positions + noise), believed)
    if backlash:
        assert 'rad off' in fit.misfit
        return
    assert fit.misfit == ''
    last = [*true.inertia_star, true.stiffness, true.damping]
    friction = [true.viscous_friction[-1], true.coulomb_friction[-1]]
    found = fit.estimates[:6]
    assert [each.value for each in found] == pytest.approx(last + friction, rel=0.005)
    for each, value in zip(found, last + friction, strict=True):
        assert abs(each.value - value) < 4.0 * each.std, each.name


@pytest.mark.parametrize('count', [1, 2, 3, 5])
def test_the_rows_are_those_of_inverse_dynamics(count):
    """Second route: the arm's own efforts of a smooth motion, in the mean over every window."""
    arm = arms(count, EARTH, seed=count)[1]
    times = np.linspace(0.0, 3.0, 1501)
    phases = np.arange(1.0, count + 3.0)
    waves = np.outer(times, 1.0 + 0.3 * phases) + phases
    speed = 1.0 + 0.3 * phases
    q, dq, ddq = np.sin(waves), speed * np.cos(waves), -(speed**2) * np.sin(waves)
    efforts = arm.inverse_dynamics(q, dq, ddq)[:, :-1]
    signals = ChainSignals(
        times=times,
        angles=np.cumsum(q, axis=1)[:, :count],
        rates=np.cumsum(dq, axis=1)[:, :count],
        last_rate=dq[:, count],
        efforts=efforts,
        resting=np.zeros((times.size, count + 1)),
    )
    friction = float(arm.viscous_friction[-1]), float(arm.coulomb_friction[-1])
    windows = Windows(times, 0.4, 6)
    chain, here = Chain.of(arm, friction), parameters_of(arm)
    slopes, left = rows(signals, windows, chain, here)
    assert np.abs(left).max() < 1e-5 * np.abs(efforts).max()
    offset = 1e-6
    for i in range(count):
        moved = here.copy()
        moved[4 * count + i] += offset
        change = (left - rows(signals, windows, chain, moved)[1]) / offset
        scale = np.abs(slopes[:, :, 4 * count + i]).max()
        assert change == pytest.approx(slopes[:, :, 4 * count + i], abs=1e-4 * scale + 1e-9)


@pytest.mark.parametrize('seed', range(cases(40, 10)))
def test_errors_of_random_arms_are_within_those_stated(seed):
    believed, true = arms(1 + seed % 2, EARTH * (seed % 3 > 0), seed=100 + seed)
    seen = held(true, believed, noise=1e-4, seed=seed, goals=GOALS)
    for name, (estimate, value) in directly(seen, believed, true)[0].items():
        if estimate.is_told:
            assert abs(estimate.value - value) < 5.0 * estimate.std, name
