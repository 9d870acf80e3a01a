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

"""Weights without dimension: one motion for arms of any size; two forms, one value."""

from flat_planner_ros.core.arm import flat_map, InvalidCost, PlanarArm
from flat_planner_ros.core.planning import MotionRequest, plan, PlanningOptions, Strategy
from flat_planner_ros.core.planning.cost_weights import MAX_RELATIVE_WEIGHT, MAX_WEIGHT
import numpy as np
import pytest

SHARES = np.linspace(0.0, 1.0, 41)
STRATEGIES = [Strategy.MIN_CONTROL_EFFORT, Strategy.MIN_POTENTIAL_ENERGY, Strategy.MIXED]


def sized(arm, mass=1.0, pace=1.0):
    """Return an arm of other masses that swings faster or slower, with the same damping ratio."""
    both, last = arm.inertia_star
    return PlanarArm.reduced(
        inertia_star=(mass * both, mass * last),
        stiffness=mass * pace**2 * arm.stiffness,
        damping=mass * pace * arm.damping,
    )


def course(arm, options, duration):
    """Return effort of joint n-1 and deflection over a half turn, at even shares of it."""
    request = MotionRequest(start=[0.0, 0.0], final=[np.pi, 0.0], duration=duration)
    samples = plan(request, arm, options).at(duration * SHARES)
    return samples.driving_effort, samples.positions[:, 1]


@pytest.mark.parametrize('strategy', STRATEGIES)
def test_arms_of_any_size_move_alike(paper_arm, strategy):
    """With another unit of mass and of time, the motion is the same but for these units."""
    options = PlanningOptions(strategy=strategy)
    effort, deflection = course(paper_arm, options, 1.0)
    for mass, pace in ((40.0, 1.0), (1.0, 8.0), (1e3, 0.3)):
        arm = sized(paper_arm, mass, pace)
        larger, same = course(arm, options, 1.0 / pace)
        np.testing.assert_allclose(same, deflection, rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(
            larger / (mass * pace**2), effort, rtol=0.0, atol=1e-9 * np.abs(effort).max()
        )
        # The paper's own weights do not do that.
        own = PlanningOptions(strategy=strategy, r=150.0, p=17.0)
        assert not np.allclose(course(arm, own, 1.0 / pace)[1], deflection, rtol=0.0, atol=1e-4)


def test_the_default_is_the_papers_choice_on_its_arm(paper_arm):
    r, p = PlanningOptions().weights(paper_arm)
    assert r == pytest.approx(150.0, rel=1e-3)
    assert p == pytest.approx(17.0, rel=1e-3)


def test_both_weights_count_alike_in_a_slow_motion(paper_arm):
    """There tau = I w'': equal weights without dimension weight w'' equally."""
    r, p = PlanningOptions(effort_weight=3.0, energy_weight=3.0).weights(paper_arm)
    both = paper_arm.inertia_star.both
    assert r**8 * both**2 == pytest.approx(p**8, rel=1e-12)


@pytest.mark.parametrize(
    ('given', 'wanted'),
    [
        ({'r': 20.0, 'p': 3.0}, (20.0, 3.0)),
        ({'r': 0.0, 'p': 0.0}, (0.0, 0.0)),
        ({'r': 20.0, 'effort_weight': 0.0, 'p': 3.0, 'energy_weight': 0.0}, (20.0, 3.0)),
        ({'effort_weight': 0.0, 'energy_weight': 0.0}, (0.0, 0.0)),
    ],
)
def test_the_papers_weights_are_taken_as_they_are(paper_arm, given, wanted):
    assert PlanningOptions(**given).weights(paper_arm) == wanted


def test_a_weight_of_0_in_the_papers_form_leaves_it_to_the_other(paper_arm):
    given = {'effort_weight': 1.0, 'energy_weight': 1.0}
    assert PlanningOptions(**given, r=0.0, p=0.0).weights(paper_arm) == PlanningOptions(
        **given
    ).weights(paper_arm)


def test_a_cost_without_weights_is_formed_once_for_all_arms(paper_arm):
    arms = paper_arm, sized(paper_arm, mass=3.0, pace=0.5)
    own = np.diag([1.0, 0.0, 2.0, 0.0, 0.0, 1.0])
    for options, wanted in (
        (PlanningOptions(strategy=Strategy.CUSTOM, custom=own), own),
        (PlanningOptions(strategy=Strategy.POLYNOMIAL), np.diag([0.0] * 5 + [1.0])),
    ):
        first, second = (options.cost(arm, flat_map(arm)) for arm in arms)
        assert first is second
        np.testing.assert_array_equal(first.matrix, wanted)
    weighted = PlanningOptions(strategy=Strategy.MIXED)
    first, second = (weighted.cost(arm, flat_map(arm)).matrix for arm in arms)
    assert not np.allclose(first, second)


@pytest.mark.parametrize(
    ('given', 'message'),
    [
        ({'effort_weight': 1.0, 'r': 2.0}, r'weights.effort = 1 and weights.r = 2 say one weight'),
        ({'energy_weight': 1.0, 'p': 2.0}, r'weights.energy = 1 and weights.p = 2 say one weight'),
        ({'r': MAX_WEIGHT * (1 + 1e-12)}, r'weight r = 1000 is outside \[0, 1000\]'),
        ({'p': -1e-9}, r'weight p = -1e-09 is outside'),
        ({'r': np.nan}, r'weight r = nan is outside'),
        ({'effort_weight': MAX_RELATIVE_WEIGHT + 1.0}, r'weight effort = 31 is outside \[0, 30\]'),
        ({'energy_weight': np.inf}, r'weight energy = inf is outside'),
    ],
)
def test_refuses_weights_in_two_forms_and_out_of_range(given, message):
    with pytest.raises(InvalidCost, match=message):
        PlanningOptions(**given)
