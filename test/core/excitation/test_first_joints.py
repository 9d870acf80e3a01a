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

"""Motions of all joints: they tell the first links of arms that are not what is believed."""

from dataclasses import replace
from math import inf

from core.conftest import first_links
from flat_planner_ros.core.arm import InvalidRequest, PlanarArm
from flat_planner_ros.core.excitation import ExcitationSettings, Room
from flat_planner_ros.core.excitation.first_joints import FirstJoints
from flat_planner_ros.core.excitation.motions import joined
from flat_planner_ros.core.model_fit import first_misprediction, Measurements, parameters_of
from flat_planner_ros.core.planning import JointLimits, MotionRequest, plan, PlanningOptions
from flat_planner_ros.core.plant import DriveSettings, EffortProfile, SimulatedArm
import numpy as np
import pytest
from random_cases import cases

NOISE, PERIOD, REST = 1e-4, 0.005, 0.7
EARTH = 9.81
OPTIONS = PlanningOptions()


def arm_of(count, gravity, factors, friction, last):
    """Return an arm of `count` first links whose numbers are some factors off."""
    return PlanarArm.reduced(
        inertia_star=(7.2e-4 * last[0], 1.3e-4 * last[1]),
        stiffness=8e-3 * last[2],
        damping=8e-5,
        **first_links(count, mass=factors[:-1], inertia=factors[:-1], tip=factors[-1]),
        gravity=gravity,
        viscous_friction=[*friction[0], 2e-4 * last[3]],
        coulomb_friction=[*friction[1], 5e-4 * last[3]],
    )


class Bench:
    """An arm that carries motions of all joints out, its last two links known already."""

    def __init__(
        self, count, gravity, seed, *, gains=(0.0, 0.0), off=0.3, sign=1.0, smooth=1.0, **settings
    ):
        """Stand at zero."""
        self.rng = rng = np.random.default_rng(seed)
        frictions = smooth * rng.uniform([[0.01], [0.005]], [[0.03], [0.02]], (2, count))
        right, none = np.ones(count + 1), np.zeros((2, count))
        wrong = rng.choice([1.0 / 1.3, 1.3], count + 1)
        self.true = arm_of(count, gravity, right, frictions, (1.0, 1.0, 1.0, 1.0))
        self.believed = arm_of(count, gravity, wrong, none, (1.3, 1.3, 0.8, 0.0))
        self.estimate = arm_of(count, gravity, wrong, none, (1.0, 1.0, 1.0, 1.0))
        self.gains, self.sign = gains, sign
        weight = np.abs(self.true.gravity_effort(np.zeros(count + 2)))[:count]
        quick = 20.0 * np.diag(self.true.inertia)[:count]
        self.limits = JointLimits.of(
            count + 2, effort=np.array([*(2.0 * weight + quick + 0.2), 0.06, inf])
        )
        self.here = np.zeros(count + 2)
        self.room = Room.within(self.limits, self.here)
        self.settings = ExcitationSettings(noise=NOISE, **settings)
        self.firsts = FirstJoints(self.believed, OPTIONS, self.limits, self.room, self.settings)
        self.heard, self.seen, self.told = [], [], []

    def carry_out(self, wanted):
        """Return what is measured of a motion and of the time after it."""
        request = MotionRequest(start=self.here, final=wanted.final, duration=wanted.duration)
        samples = plan(request, self.believed, OPTIONS).sample(PERIOD)
        command = EffortProfile(
            start=0.05,
            times=samples.times + 0.05,
            efforts=samples.efforts[:, :-1],
            positions=samples.positions[:, :-1],
            velocities=samples.velocities[:, :-1],
        )
        p, d = ((gain,) * (self.true.n - 2) + (0.0,) for gain in self.gains)
        arm = SimulatedArm(self.true, drives=DriveSettings(feedback_p=p, feedback_d=d))
        arm.reset(self.here)
        arm.command(command, 0.0)
        times = np.arange(0.0, wanted.duration + REST, PERIOD)
        positions, efforts = [], []
        for time in times:
            arm.advance(time)
            positions.append(arm.position)
            efforts.append(arm.applied_effort[:-1])
        positions, efforts = np.array(positions), np.array(efforts)
        self.here = np.append(positions[-1, :-1], 0.0)
        self.seen.append((positions, efforts))
        noise = NOISE * self.rng.standard_normal(positions.shape)
        return Measurements(times=times, positions=self.sign * positions + noise, efforts=efforts)

    def step(self):
        """Carry out a motion and learn from it."""
        firsts = self.firsts
        shares = firsts.shares
        chosen = firsts.choose(self.here, self.estimate, NOISE)
        heard = self.carry_out(chosen.candidate.candidate)
        firsts.check_signs(heard)
        wrong = first_misprediction(self.estimate, heard, 0.0)
        self.heard.append(heard)
        self.estimate = firsts.learn(joined(self.heard[-6:]), heard, self.estimate, 0.0)
        firsts.grow(np.append(wrong, 0.0))
        self.told.append((shares, chosen, wrong, firsts.reached))

    def run(self, most=10):
        """Carry motions out until all that they tell is certain."""
        while not (self.firsts.is_certain and self.firsts.has_held) and len(self.told) < most:
            self.step()


def check_told(bench):
    """Check that all that is sought is certain, and true within three stated errors."""
    firsts = bench.firsts
    assert firsts.is_certain
    assert firsts.has_held
    sought = 4 * (bench.true.n - 2)
    told = np.array([name not in firsts.untold for name in firsts.names[:sought]])
    reached = firsts.reached[:sought][told]
    assert (reached <= bench.settings.accuracy).all()
    off = np.abs(parameters_of(bench.estimate) - parameters_of(bench.true))[:sought][told]
    assert (off <= 3.0 * reached * firsts.scales[:sought][told]).all()


def check_room(bench):
    """Check that no joint left its range, and no effort its limit or, in a plane, its share."""
    low, high = np.array(bench.room.ranges).T
    is_open_loop = not any(bench.gains)
    for (shares, *_), (positions, efforts) in zip(bench.told, bench.seen, strict=True):
        assert (positions >= low).all()
        assert (positions <= high).all()
        allowed = shares if is_open_loop else np.ones(shares.size)
        assert (np.abs(efforts).max(axis=0) <= allowed * bench.room.efforts * (1 + 1e-9)).all()


@pytest.mark.parametrize(('count', 'seed'), [(1, seed) for seed in range(cases(10, 2))] + [(2, 2)])
def test_a_vertical_arm_becomes_certain_within_its_room(count, seed):
    bench = Bench(count, EARTH, seed, gains=(20.0, 0.5))
    bench.run()
    check_told(bench)
    check_room(bench)
    assert bench.firsts.untold == ()
    assert (bench.told[0][0] == bench.settings.first_share).all()
    for (shares, _, wrong, _), (larger, *_) in zip(bench.told[:-1], bench.told[1:], strict=True):
        holds = np.append(wrong <= bench.settings.agreement, True)
        assert ((larger > shares) == (holds & (shares < 1.0))).all()


@pytest.mark.parametrize(
    ('count', 'gains', 'smooth'),
    [(1, (0.0, 0.0), 0.3), (2, (20.0, 0.5), 1.0)],
    ids=['by efforts alone', 'held to the plan'],
)
def test_what_a_horizontal_arm_does_not_tell_is_named(count, gains, smooth):
    bench = Bench(count, 0.0, 1, gains=gains, smooth=smooth)
    bench.run()
    check_told(bench)
    check_room(bench)
    assert bench.firsts.untold == ('static_moment[1]',)
    assert np.isinf(bench.firsts.reached[bench.firsts.names.index('static_moment[1]')])


def test_what_is_predicted_is_reached():
    bench = Bench(1, EARTH, 7, gains=(20.0, 0.5))
    bench.run()
    _, chosen, _, reached = bench.told[-1]
    # A prediction has white noise only, a fit what its windows leave over.
    assert (reached[:4] < 3.0 * chosen.after[:4]).all()
    assert (reached[:4] > chosen.after[:4] / 10.0).all()
    assert (chosen.after < chosen.before).any()


def test_joints_that_do_not_move_are_given_up_without_larger_motions():
    bench = Bench(1, 0.0, 3)
    bench.true = replace(bench.true, coulomb_friction=np.array([0.2, 5e-4]))
    with pytest.raises(InvalidRequest, match=r'at joint 1: .* is friction above 0\.1'):
        bench.run()
    assert len(bench.seen) == bench.settings.most_attempts
    assert bench.firsts.shares[0] == bench.settings.first_share


def test_a_wrong_sign_ends_it_at_the_first_motion():
    bench = Bench(1, EARTH, 3, gains=(20.0, 0.5), sign=-1.0)
    with pytest.raises(InvalidRequest, match='joint 1 turned by .* wrong'):
        bench.run()
    assert len(bench.seen) == 1


def test_joints_without_a_limit_of_their_effort_are_left_where_they_are():
    efforts = np.array([inf, 0.06, inf])
    assert Room.within(JointLimits.of(3, effort=efforts), np.zeros(3)).firsts == ()
    efforts[0] = 0.5
    limits = JointLimits.of(3, effort=efforts, position_max=np.array([0.1, inf, inf]))
    (joint,) = Room.within(limits, np.zeros(3)).firsts
    assert (joint.low, joint.high, joint.effort) == (-1.5, 0.1, 0.5)
    assert Room.within(limits, 0.0).firsts == ()
    with pytest.raises(InvalidRequest, match=r'joint 1 is at 0\.2 rad'):
        Room.within(limits, np.array([0.2, 0.0, 0.0]))
