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

"""Motions that tell a model: over random arms that are not what is believed, within their room."""

from math import inf, pi

from core.conftest import first_links
from flat_planner_ros.core.arm import InvalidRequest, PlanarArm
from flat_planner_ros.core.excitation import Excitation, ExcitationSettings, Room
from flat_planner_ros.core.model_fit import Measurements
from flat_planner_ros.core.planning import JointLimits, MotionRequest, plan, PlanningOptions
from flat_planner_ros.core.plant import EffortProfile, SimulatedArm
import numpy as np
import pytest
from random_cases import cases

NOISE, PERIOD = 1e-4, 0.005
OPTIONS = PlanningOptions()
FIRST = ('inertia', 'viscous_friction', 'coulomb_friction')
"""What a motion in a plane tells of the first link."""


class Bench:
    """An arm that plays the proposals, at rest before each, and is measured with noise."""

    def __init__(self, true, believed, limits, rng, *, effort=1.0, angle=1.0, **settings):
        """Stand at zero."""
        self.true, self.believed, self.rng = true, believed, rng
        self.effort_sign, self.angle_sign = effort, angle
        self.here = np.zeros(true.n)
        self.seen = []
        self.room = Room.within(limits, self.here)
        self.excitation = Excitation(
            believed, OPTIONS, limits, self.room, ExcitationSettings(**settings)
        )

    def carry_out(self, proposal):
        """Return what is measured of the proposal and of the time after it."""
        wanted = proposal.candidate
        request = MotionRequest(start=self.here, final=wanted.final, duration=wanted.duration)
        samples = plan(request, self.believed, OPTIONS).sample(PERIOD)
        command = EffortProfile(
            start=0.05, times=samples.times + 0.05, efforts=samples.efforts[:, :-1]
        )
        arm = SimulatedArm(self.true)
        arm.reset(self.here)
        arm.command(command, 0.0)
        times = np.arange(0.0, wanted.duration + self.excitation.record_time, PERIOD)
        positions = []
        for time in times:
            arm.advance(time)
            positions.append(arm.position)
        efforts = np.array([command.effort(time) for time in times])
        self.here = np.append(arm.position[:-1], 0.0)
        self.seen.append((np.array(positions), efforts))
        noise = NOISE * self.rng.standard_normal((times.size, self.true.n))
        return Measurements(
            times=times,
            positions=self.angle_sign * np.array(positions) + noise,
            efforts=self.effort_sign * efforts,
        )

    def run(self):
        """Carry out what is proposed until it is done; return proposals and what was heard."""
        told = []
        while not self.excitation.is_done:
            share = self.excitation.share
            proposal = self.excitation.propose(self.here)
            told.append((share, proposal, self.excitation.hear(self.carry_out(proposal))))
        return told


def six(arm):
    """Return what the last two links of an arm depend on, shape (6,)."""
    friction = arm.viscous_friction[-1], arm.coulomb_friction[-1]
    return np.array([*arm.inertia_star, arm.stiffness, arm.damping, *friction])


def random_arm(rng):
    """Return an arm and its effort limit [N m], which a quick turn of 1 rad takes."""
    both = 10.0 ** rng.uniform(-3.5, -1.5)
    last = both * rng.uniform(0.05, 0.4)
    frequency = 2 * pi * rng.uniform(1.0, 3.0)
    stiffness = frequency**2 * last * (1.0 - last / both)
    effort = 6.0 * both * (frequency / (2 * pi)) ** 2
    arm = PlanarArm.reduced(
        inertia_star=(both, last),
        stiffness=stiffness,
        damping=2 * rng.uniform(0.005, 0.05) * stiffness / frequency,
        viscous_friction=[rng.uniform(0.0, 0.05) * effort / frequency],
        coulomb_friction=[rng.uniform(0.0, 0.03) * effort],
    )
    return arm, effort


def believed_of(arm, rng):
    """Return what is believed of an arm: 30 % off in all, and nothing of its friction."""
    both, last, stiffness, damping = six(arm)[:4] * rng.choice([1 / 1.3, 1.3], 4)
    return PlanarArm.reduced(
        inertia_star=(both, min(last, 0.6 * both)), stiffness=stiffness, damping=damping
    )


@pytest.mark.parametrize('seed', range(cases(5)))
def test_arms_that_are_30_percent_off_become_certain_within_their_room(seed):
    rng = np.random.default_rng(seed)
    true, effort = random_arm(rng)
    limits = JointLimits.of(2, effort=np.array([effort, inf]))
    bench = Bench(true, believed_of(true, rng), limits, rng)
    told = bench.run()
    assert bench.excitation.is_certain
    fit = told[-1][2].fit
    stds = np.array([estimate.std for estimate in fit.estimates[:6]])
    assert (np.abs(six(fit.arm) - six(true)) < 4.0 * stds).all()
    room = bench.room
    for (share, proposal, _), (positions, efforts) in zip(told, bench.seen, strict=True):
        assert np.abs(efforts).max() <= share * effort
        assert room.low <= positions[:, 0].min() <= positions[:, 0].max() <= room.high
        assert np.abs(positions[:, 1]).max() <= room.passive_high
        assert proposal.after[:6].max() < proposal.before[:6].max()
    assert told[0][0] == ExcitationSettings().first_share
    for (share, *_, heard), (larger, *_) in zip(told[:-1], told[1:], strict=True):
        assert (larger > share) == (heard.holds and share < 1.0)
    assert all(heard.misprediction.max() < 0.05 for *_, heard in told[2:])


def three(inertia, friction, *, factor=1.0):
    """Return an arm of three joints in a horizontal plane."""
    return PlanarArm.reduced(
        inertia_star=(7.2e-4 * factor, 1.3e-4),
        stiffness=8e-3 * factor,
        damping=8e-5,
        **first_links(inertia=inertia),
        viscous_friction=friction[0],
        coulomb_friction=friction[1],
    )


def test_an_arm_of_three_tells_its_last_links_first_and_then_the_other():
    rng = np.random.default_rng(2)
    true = three(1.0, ([6e-3, 2e-4], [2e-3, 5e-4]))
    believed = three(3.4, ([0.0, 0.0], [0.0, 0.0]), factor=1.2)
    assert believed.inertia[0, 0] == pytest.approx(1.3 * true.inertia[0, 0], abs=1e-6)
    limits = JointLimits.of(3, effort=np.array([0.4, 0.06, inf]))
    bench = Bench(true, believed, limits, rng)
    told = bench.run()
    excitation = bench.excitation
    assert excitation.is_certain
    assert excitation.untold == ('static_moment[1]',)
    found, right = excitation.estimate, [*six(true), true.inertia[0, 0]]
    friction = found.viscous_friction[0], found.coulomb_friction[0]
    reached = told[-1][2].reached
    places = [*range(6), *(excitation.names.index(f'{kind}[1]') for kind in FIRST)]
    off = np.array([*six(found), found.inertia[0, 0], *friction]) - [*right, 6e-3, 2e-3]
    stds = (reached * told[-1][1].scales)[places]
    assert (np.abs(off) < 3.0 * stds).all()
    assert (reached[places] <= excitation.settings.accuracy).all()
    firsts = [proposal.sought.endswith('[1]') for _, proposal, _ in told]
    assert firsts == sorted(firsts)
    for (_, proposal, heard), (positions, efforts) in zip(told, bench.seen, strict=True):
        moves = abs(proposal.candidate.final[0] - positions[0, 0]) > 1e-9
        assert moves == proposal.sought.endswith('[1]') == (heard.misprediction.size == 3)
        assert (np.abs(efforts).max(axis=0) <= proposal.candidate.most_effort).all()
        assert (np.abs(positions).max(axis=0) <= [1.5, 1.5, bench.room.passive_high]).all()


def test_what_is_predicted_is_reached():
    rng = np.random.default_rng(7)
    true, effort = random_arm(rng)
    limits = JointLimits.of(2, effort=np.array([effort, inf]))
    told = Bench(true, true, limits, rng).run()
    _, proposal, heard = told[-1]
    assert heard.reached[:6] == pytest.approx(proposal.after[:6], rel=1.5, abs=1e-3)


@pytest.mark.parametrize(
    ('signs', 'said'),
    [({'effort': -1.0}, 'the other way: their sign'), ({'angle': -1.0}, 'were planned')],
)
def test_a_wrong_sign_ends_it_at_the_first_motion(signs, said):
    rng = np.random.default_rng(3)
    true, effort = random_arm(rng)
    limits = JointLimits.of(2, effort=np.array([effort, inf]))
    bench = Bench(true, true, limits, rng, **signs)
    with pytest.raises(InvalidRequest, match=said):
        bench.run()
    assert len(bench.seen) == 1


def test_an_arm_that_does_not_move_is_given_up_without_larger_motions():
    rng = np.random.default_rng(3)
    true, effort = random_arm(rng)
    limits = JointLimits.of(2, effort=np.array([effort, inf]))
    bench = Bench(true, true, limits, rng, angle=0.0)
    with pytest.raises(InvalidRequest, match='is friction above'):
        bench.run()
    assert len(bench.seen) == ExcitationSettings().most_attempts
    assert bench.excitation.share == ExcitationSettings().first_share


def test_limits_of_position_and_velocity_are_kept_with_a_margin():
    rng = np.random.default_rng(5)
    true, effort = random_arm(rng)
    limits = JointLimits.of(
        2,
        effort=np.array([effort, inf]),
        velocity=np.array([2.0, 4.0]),
        position_min=np.array([-0.2, -0.08]),
        position_max=np.array([0.5, 0.1]),
    )
    bench = Bench(true, believed_of(true, rng), limits, rng, most_motions=3)
    bench.run()
    for positions, _ in bench.seen:
        assert (positions >= [-0.2, -0.08]).all()
        assert (positions <= [0.5, 0.1]).all()
        assert (np.abs(np.diff(positions, axis=0)).max(axis=0) / PERIOD <= [2.0, 4.0]).all()


def test_without_a_limit_of_the_effort_nothing_is_tried():
    with pytest.raises(InvalidRequest, match=r'finite limits\.effort'):
        Room.within(JointLimits.of(2), 0.0)
    limits = JointLimits.of(2, effort=np.array([1.0, inf]), position_max=np.array([0.1, inf]))
    with pytest.raises(InvalidRequest, match='not inside its limits'):
        Room.within(limits, 0.2)


@pytest.mark.parametrize(
    'changes', [{'accuracy': 0.0}, {'noise': -1.0}, {'first_share': 1.5}, {'most_motions': 0}]
)
def test_settings_without_meaning_are_refused(changes):
    with pytest.raises(InvalidRequest, match=next(iter(changes))):
        ExcitationSettings(**changes)
