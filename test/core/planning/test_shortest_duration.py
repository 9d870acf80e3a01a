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

"""The shortest duration within limits: bounds that hold for any motion, neighbours, refusals."""

from dataclasses import replace
from math import inf, pi, sqrt

from flat_planner_ros.core.arm.errors import InvalidRequest, UncertifiedPlan
from flat_planner_ros.core.arm.flat_map import FlatModel
from flat_planner_ros.core.arm.planar_arm import PlanarArm
from flat_planner_ros.core.motion_law.cost import Strategy
from flat_planner_ros.core.planning.extrema import extrema_of, Quantity
from flat_planner_ros.core.planning.limits import JointLimits
from flat_planner_ros.core.planning.planner import plan
from flat_planner_ros.core.planning.request import MotionRequest, PlanningOptions
from flat_planner_ros.core.planning.shortest_duration import (
    DURATION_TOLERANCE,
    NoFeasibleDuration,
    SCAN_DEPTH,
    SCAN_STEP,
    shortest_plan,
)
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq, fsolve

TORQUE = 0.015
"""Limit of the paper's arm in these tests [N m]."""

BANG_BANG = 0.832479
"""Shortest time of any motion of the paper's arm over pi within it, to all digits shown [s]."""

RATIOS = {
    Strategy.POLYNOMIAL: 1.2062,
    Strategy.MIN_CONTROL_EFFORT: 1.1388,
    Strategy.MIN_POTENTIAL_ENERGY: 1.2744,
    Strategy.MIXED: 1.1462,
}
"""What strategies with their default weights take with the exact map, relative to that [-]."""

RANGE = {'shortest': 0.05, 'longest': 600.0}

RANDOM_CASES = 12


def arm_of(joints, gravity=0.0):
    """Return an arm with equal links before the last two."""
    first = joints - 2
    return PlanarArm.reduced(
        inertia_star=(0.04, 0.01),
        stiffness=2.0,
        damping=0.01,
        link_length=[0.3] * first,
        link_com=[0.15] * first,
        link_mass=[1.0] * first,
        link_inertia=[0.01] * first,
        tip_mass=1.5,
        gravity=gravity,
    )


def motions(arm, final, start=None, **options):
    """Return the function from a duration to the plan of a motion."""
    start = np.zeros(len(final)) if start is None else start
    request = MotionRequest(start=start, final=final, duration=1.0)
    chosen = PlanningOptions(**options)
    return lambda duration: plan(replace(request, duration=duration), arm, chosen)


def uses_of(planned, limits):
    """Return how often limits of velocity and effort are used up, by dense sampling."""
    samples = planned.at(np.linspace(0.0, planned.duration, 20_001))
    velocity, effort = np.abs(samples.velocities).max(axis=0), np.abs(samples.efforts).max(axis=0)
    return max((velocity / limits.velocity).max(), (effort / limits.effort).max())


def free_motion(arm, efforts, edges):
    """Return q1 - pi, q2 and their velocities after piecewise constant efforts of joint 1."""
    inner, last = arm.inertia_star
    inverse = np.linalg.inv(np.array([[inner, last], [last, last]]))
    passive = np.array([[0.0, 0.0], [0.0, 1.0]])
    system = np.zeros((5, 5))  # the last state is the constant 1 that the effort multiplies
    system[:2, 2:4] = np.eye(2)
    system[2:4, :2] = -arm.stiffness * inverse @ passive
    system[2:4, 2:4] = -arm.damping * inverse @ passive
    state = np.array([-pi, 0.0, 0.0, 0.0, 1.0])
    for effort, length in zip(efforts, np.diff(edges), strict=True):
        system[2:4, 4] = effort * inverse[:, 0]
        state = expm(system * length) @ state
    return state[:4], system


def bang_bang(arm, torque):
    """Return switches and end of the fastest motion over pi, from the joints' dynamics alone."""
    signs = torque * np.array([1.0, -1.0, 1.0, -1.0])
    scale = np.array([1.0, 1.0, 10.0, 10.0])

    def miss(edges):
        return free_motion(arm, signs, [0.0, *edges])[0] / scale

    rigid = 2.0 * sqrt(arm.inertia_star[0] * pi / torque)
    guess = rigid * np.array([0.4, 0.55, 0.7, 1.1])
    edges, _, found, message = fsolve(miss, guess, xtol=1e-13, full_output=True)
    assert found == 1, message
    assert np.abs(miss(edges)).max() < 1e-9
    return edges, rigid


def test_the_bang_bang_time_is_that_of_the_maximum_principle(paper_arm):
    edges, rigid = bang_bang(paper_arm, TORQUE)
    assert edges[-1] == pytest.approx(BANG_BANG, abs=5e-7)
    assert rigid == pytest.approx(0.73223, abs=5e-6)
    # Three switches fix the costate up to its size; the effort must have its sign everywhere.
    _, system = free_motion(paper_arm, [1.0], [0.0, 0.0])
    drift, column = system[:4, :4], system[:4, 4]

    def responses(times):
        return np.array([expm(drift * (edges[-1] - t)) @ column for t in times])

    costate = np.linalg.svd(responses(edges[:3]))[2][-1]
    times = np.linspace(0.0, edges[-1], 2001)
    switching = responses(times) @ costate
    switching *= np.sign(switching[0])
    wanted = np.array([1.0, -1.0, 1.0, -1.0])[np.searchsorted(edges[:3], times)]
    away = np.abs(np.subtract.outer(times, edges[:3])).min(axis=1) > 1e-6
    assert away.sum() > 1990
    assert (switching[away] * wanted[away] > 0.0).all()


@pytest.mark.parametrize('flat_model', FlatModel)
@pytest.mark.parametrize('strategy', RATIOS)
def test_no_law_claims_less_than_bang_bang(paper_arm, strategy, flat_model):
    limits = JointLimits.of(2, effort=[TORQUE, inf])
    planned = shortest_plan(
        motions(paper_arm, [pi, 0.0], strategy=strategy, flat_model=flat_model), limits, **RANGE
    )
    edges, _ = bang_bang(paper_arm, TORQUE)
    ratio = planned.duration / edges[-1]
    assert ratio > 1.0
    assert ratio == pytest.approx(
        RATIOS[strategy], rel=1e-3 if flat_model.value == 'exact' else 0.01
    )
    assert uses_of(planned, limits) <= 1.0


@pytest.mark.parametrize('seed', range(RANDOM_CASES))
def test_the_answer_obeys_and_nothing_shorter_does(seed):
    rng = np.random.default_rng(seed)
    joints = int(rng.integers(2, 5))
    arm = arm_of(joints)
    final = np.append(rng.uniform(-2.0, 2.0, joints - 1), 0.0)
    strategy = rng.choice(list(RATIOS))
    motion = motions(arm, final, strategy=strategy, r=10 ** rng.uniform(0, 1.5), p=17.0)
    # Ordinary limits: those of the motion itself at some duration, each with some play.
    position, velocity, effort = extrema_of(motion(10 ** rng.uniform(-0.5, 0.7)))
    del position
    limits = JointLimits.of(
        joints,
        velocity=velocity.peak * rng.uniform(0.8, 2.0, joints) + 1e-6,
        effort=effort.peak * rng.uniform(0.8, 2.0, joints) + 1e-6,
    )
    found = shortest_plan(motion, limits, **RANGE)
    assert uses_of(found, limits) <= 1.0 + 1e-9
    shorter = found.duration * (1.0 - 1.5 * DURATION_TOLERANCE)
    assert uses_of(motion(shorter), limits) > 1.0
    grid = found.duration * np.geomspace(0.5, 0.999, 60)
    assert min(uses_of(motion(duration), limits) for duration in grid[::6]) > 1.0
    worst = [limits.worst(motion(duration)) for duration in grid]
    assert all(use.is_exceeded for use in worst)


def test_velocity_alone_gives_the_time_of_the_polynomials_peak():
    # Without an elastic effect to speak of, q1' is w', whose peak is 693/256 of its mean.
    stiff = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-9), stiffness=3e-1, damping=0.0)
    limits = JointLimits.of(2, velocity=[6.0, inf])
    found = shortest_plan(motions(stiff, [pi, 0.0], strategy=Strategy.POLYNOMIAL), limits, **RANGE)
    assert found.duration == pytest.approx(693 / 256 * pi / 6.0, rel=2 * DURATION_TOLERANCE)
    assert found.duration >= 693 / 256 * pi / 6.0 * (1.0 - 1e-6)
    likely = limits.likely_duration(np.array([pi, 0.0]))
    assert likely == pytest.approx(found.duration, rel=2 * DURATION_TOLERANCE)


def test_no_time_is_tried_in_which_a_joint_would_be_too_fast_on_average():
    tried = []
    start, final = np.array([-0.9, 0.0, 0.0, 0.0]), np.array([0.9, 0.5, -0.3, 0.0])
    motion = motions(arm_of(4, gravity=9.81), final, start)

    def noted(duration):
        tried.append(duration)
        return motion(duration)

    limits = JointLimits.of(4, effort=[25.0, 12.0, 0.5, inf], velocity=[3.0] * 4)
    found = shortest_plan(noted, limits, **RANGE)
    # Else it would have been scanned down to 1 / SCAN_DEPTH of the answer.
    assert found.duration < SCAN_DEPTH * 0.6
    assert limits.least_duration(final - start) == pytest.approx(0.6)
    assert 0.6 <= min(tried) < 0.6 * SCAN_STEP
    assert uses_of(motion(0.6), limits) > 1.0


def test_a_position_limit_may_ask_for_more_time(paper_arm):
    motion = motions(paper_arm, [pi, 0.0])
    limits = JointLimits.of(2, position_min=[-inf, -0.1], position_max=[inf, 0.1])
    found = shortest_plan(motion, limits, **RANGE)
    assert limits.worst(found).joint == 1
    samples = found.at(np.linspace(0.0, found.duration, 100_001))
    deflection = np.abs(samples.positions[:, 1]).max()
    assert 0.1 * (1.0 - 1e-3) < deflection <= 0.1 + 1e-9


def test_what_obeys_at_once_takes_the_shortest_duration_allowed(paper_arm):
    limits = JointLimits.of(2, effort=[1e6, inf])
    found = shortest_plan(motions(paper_arm, [0.1, 0.0]), limits, shortest=0.3, longest=10.0)
    assert found.duration == 0.3
    still = motions(paper_arm, [0.1, 0.0], start=[0.1, 0.0])
    assert shortest_plan(still, limits, shortest=0.3, longest=10.0).duration == 0.3


def test_a_motion_that_has_begun_obeys_too(paper_arm):
    motion = motions(paper_arm, [pi, 0.0])
    jets = motion(1.0).trajectory.jets(np.array([0.4]))[:, :6, 0]
    request = MotionRequest(start=[0.0, 0.0], final=[pi, 0.0], duration=1.0, start_jets=jets)
    limits = JointLimits.of(2, effort=[0.02, inf], velocity=[8.0, inf])

    def onwards(duration):
        return plan(
            replace(request, duration=duration),
            paper_arm,
            PlanningOptions(strategy=Strategy.POLYNOMIAL),
        )

    found = shortest_plan(onwards, limits, **RANGE)
    assert uses_of(found, limits) <= 1.0
    assert uses_of(onwards(found.duration * 0.999), limits) > 1.0


def lift(effort):
    """Return motions that lift joint 1 past the horizontal, and a limit of its effort."""
    arm = arm_of(3, gravity=9.81)
    motion = motions(arm, [0.6, -0.6, 0.0], start=[-1.5, 1.5, 0.0], strategy=Strategy.POLYNOMIAL)
    return motion, JointLimits.of(3, effort=[effort, inf, inf])


def test_a_faster_motion_may_take_less_effort_and_is_found():
    # Slowly, joint 1 must hold its load where it is horizontal; in a window of faster
    # motions it has just left that pose behind with the speed gained before, and brakes there.
    motion, _ = lift(inf)
    durations = np.geomspace(0.3, 20.0, 200)
    peaks = np.array([extrema_of(motion(t), [Quantity.EFFORT])[0].peak[0] for t in durations])
    best = int(np.argmin(peaks))
    static = peaks[-1]
    assert peaks[best] < 0.95 * static  # else the case shows nothing
    limit = 0.5 * (peaks[best] + static)
    motion, limits = lift(limit)
    found = shortest_plan(motion, limits, **RANGE)
    assert found.duration < durations[best]
    assert uses_of(found, limits) <= 1.0 + 1e-9
    assert limits.worst(motion(20.0)).is_exceeded


def test_a_load_on_the_way_that_no_duration_lifts_is_refused_with_its_number():
    # It could be held at both ends, and the best motion takes 5.30 N m.
    motion, limits = lift(5.2)
    with pytest.raises(NoFeasibleDuration) as refusal:
        shortest_plan(motion, limits, **RANGE)
    use = refusal.value.use
    assert (use.joint, use.quantity, abs(use.limit)) == (0, Quantity.EFFORT, 5.2)
    assert 5.3 <= abs(use.value) < 5.35
    assert 1.2 < refusal.value.duration < 2.2
    assert not refusal.value.at_end


def test_a_load_at_rest_is_refused_at_once():
    arm = arm_of(3, gravity=9.81)
    tried = []

    def motion(duration):
        tried.append(duration)
        return motions(arm, [0.0, 1.0, 0.0], start=[pi / 2, 0.0, 0.0])(duration)

    with pytest.raises(NoFeasibleDuration) as refusal:
        shortest_plan(motion, JointLimits.of(3, effort=[2.0, inf, inf]), **RANGE)
    assert refusal.value.at_end
    assert len(tried) == 1
    held = arm.gravity_effort(np.array([0.0, 1.0, 0.0]))[0]
    assert refusal.value.use.value == pytest.approx(held, rel=1e-9)
    assert refusal.value.use.time == tried[0]


def test_a_law_without_certificate_is_no_answer(paper_arm):
    motion = motions(paper_arm, [1.0, 0.0])

    def certified_above(duration, least=0.7):
        if duration < least:
            raise UncertifiedPlan('boundary residual', 1.0, 1e-9)
        return motion(duration)

    found = shortest_plan(certified_above, JointLimits.of(2, effort=[1e3, inf]), **RANGE)
    assert 0.7 <= found.duration <= 0.7 * (1.0 + DURATION_TOLERANCE)
    with pytest.raises(UncertifiedPlan):
        shortest_plan(
            lambda t: certified_above(t, inf), JointLimits.of(2, effort=[1.0, inf]), **RANGE
        )


@pytest.mark.parametrize('span', [(0.0, 1.0), (2.0, 1.0), (1.0, inf)])
def test_a_range_without_durations_is_refused(paper_arm, span):
    with pytest.raises(InvalidRequest, match='no range of durations'):
        shortest_plan(
            motions(paper_arm, [1.0, 0.0]), JointLimits.of(2), shortest=span[0], longest=span[1]
        )


def test_times_of_scaled_limits_scale_as_the_dynamics_do():
    # The polynomial law on a rigid arm: four times the torque, half the time.
    stiff = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-9), stiffness=3e-1, damping=0.0)
    motion = motions(stiff, [pi, 0.0], strategy=Strategy.POLYNOMIAL)
    one, four = (
        shortest_plan(motion, JointLimits.of(2, effort=[torque, inf]), **RANGE).duration
        for torque in (TORQUE, 4.0 * TORQUE)
    )
    assert one / four == pytest.approx(2.0, rel=3 * DURATION_TOLERANCE)


def test_peaks_at_the_limit_are_reached(paper_arm):
    limits = JointLimits.of(2, effort=[TORQUE, inf])
    found = shortest_plan(motions(paper_arm, [pi, 0.0]), limits, **RANGE)

    def excess(duration):
        effort = extrema_of(motions(paper_arm, [pi, 0.0])(duration), [Quantity.EFFORT])[0]
        return effort.peak[0] - TORQUE

    root = brentq(excess, 0.9 * found.duration, 1.1 * found.duration, xtol=1e-12)
    assert root <= found.duration <= root * (1.0 + DURATION_TOLERANCE)


@pytest.mark.parametrize('first', [0.06, 0.9, 1.02, 30.0])
@pytest.mark.parametrize('strategy', RATIOS)
def test_where_a_search_starts_does_not_matter(paper_arm, strategy, first):
    plans = motions(paper_arm, np.array([pi, 0.0]), strategy=strategy)
    limits = JointLimits.of(2, effort=[TORQUE, np.inf])
    found = shortest_plan(plans, limits, **RANGE, first=first)
    expected = shortest_plan(plans, limits, **RANGE)
    assert found.duration == pytest.approx(expected.duration, rel=DURATION_TOLERANCE)
    assert uses_of(found, limits) <= 1.0 + 1e-9


@pytest.mark.parametrize('strategy', RATIOS)
def test_a_search_from_just_below_the_answer_tries_little_more(paper_arm, strategy):
    # By samples, the first duration seems to obey.
    plans = motions(paper_arm, np.array([pi, 0.0]), strategy=strategy)
    limits = JointLimits.of(2, effort=[TORQUE, np.inf])
    expected = shortest_plan(plans, limits, **RANGE).duration
    tried = []

    def counted(duration):
        tried.append(duration)
        return plans(duration)

    found = shortest_plan(counted, limits, **RANGE, first=expected * (1.0 - 1e-4))
    assert found.duration == pytest.approx(expected, rel=DURATION_TOLERANCE)
    assert len(tried) < 20


def test_a_search_that_is_over_tries_longer_ones_until_one_obeys(paper_arm):
    plans = motions(paper_arm, np.array([pi, 0.0]))
    limits = JointLimits.of(2, effort=[TORQUE, np.inf])
    tried = []

    def counted(duration):
        tried.append(duration)
        return plans(duration)

    found = shortest_plan(counted, limits, **RANGE, first=0.1, is_over=lambda: True)
    assert uses_of(found, limits) <= 1.0 + 1e-9
    assert found.duration == max(tried)
    assert len(tried) < 10
    still = shortest_plan(counted, limits, **RANGE, first=5.0, is_over=lambda: True)
    assert still.duration == 5.0
