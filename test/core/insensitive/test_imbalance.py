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

"""What imbalance leaves, against simulation of the arm as it is built."""

from flat_planner_ros.core.arm import balanced, counterbalances, Drive, imbalance, PlanarArm
from flat_planner_ros.core.insensitive import imbalance_residual, usual_imbalance_residual
from flat_planner_ros.core.planning import MotionRequest, plan, PlanningOptions
from flat_planner_ros.core.plant import EffortProfile, rollout
import numpy as np
import pytest

LINKS = {
    'link_length': [0.25, 0.2, 0.15],
    'link_com': [0.12, 0.11, 0.075],
    'link_mass': [0.5, 0.2, 0.05],
    'link_inertia': [3e-3, 8e-4, 1e-4],
}
SPRING = {'stiffness': 0.12, 'damping': 2e-4}


def built(n, excess, gravity=0.0):
    """Return an arm whose last two counterbalances are off by shares of their arms."""
    links = {name: values[-n:] for name, values in LINKS.items()}
    shape = {name: links[name] for name in ('link_length', 'link_com', 'link_mass')}
    added = counterbalances(**shape, arm=[0.05, 0.0375])
    return PlanarArm.from_links(
        **links,
        counterbalance_mass=added.mass,
        counterbalance_arm=added.arm * (1.0 + np.array(excess)),
        **SPRING,
        gravity=gravity,
    )


def swing(arm, planned):
    """Return the complex amplitude of the passive joint's oscillation after a plan is played."""
    samples = planned.sample(0.002)
    profile = EffortProfile(start=1.0, times=samples.times, efforts=samples.efforts[:, :-1])
    end = rollout(arm, profile, 1.0 + planned.duration, step=1e-3)
    mode = planned.problem.arm.natural_mode()
    pole = -mode.decay_rate + 1j * mode.damped_frequency
    angle, rate = end.positions[-1, -1], end.velocities[-1, -1]
    return (rate - np.conj(pole) * angle) / pole.imag


def moved(arm, duration=0.9):
    """Return the plan of a large motion."""
    final = np.append(np.linspace(1.2, 2.0, arm.n - 1), 0.0)
    request = MotionRequest(start=np.zeros(arm.n), final=final, duration=duration)
    return plan(request, arm, PlanningOptions())


@pytest.mark.parametrize('excess', [(0.0, 1e-3), (2e-3, 0.0), (-1e-3, 1e-3)])
@pytest.mark.parametrize('n', [2, 3])
def test_what_is_left_is_what_the_arm_as_built_does(n, excess):
    real = built(n, excess)
    nominal = balanced(real)
    planned = moved(nominal)
    samples = planned.sample(0.002)
    motion = samples.positions, samples.velocities, samples.accelerations
    said = imbalance_residual(real, nominal, motion, planned.duration)
    seen = abs(swing(real, planned) - swing(nominal, planned))
    assert said == pytest.approx(seen, rel=0.05, abs=1e-7)
    if n == 3 or excess[1]:
        assert seen > 1e-5


def test_of_two_joints_in_a_horizontal_plane_the_first_link_needs_no_balance():
    """Its static moment couples to nothing: the base does not move."""
    real = built(2, (0.3, 0.0))
    assert imbalance(real) < 1e-15
    assert usual_imbalance_residual(real, balanced(real))[0] < 1e-15
    assert imbalance(built(2, (0.3, 0.0), gravity=9.81)) > 0.01


def test_a_balanced_copy_differs_in_nothing_else():
    real = built(3, (0.01, -0.02))
    mended = balanced(real)
    mended.check_flat()
    np.testing.assert_array_equal(np.diag(mended.inertia), np.diag(real.inertia))
    np.testing.assert_array_equal(mended.inertia[:1, :1], real.inertia[:1, :1])
    assert mended.static_moment[0] == real.static_moment[0]
    assert imbalance(mended) == 0.0


@pytest.mark.parametrize('drive', Drive)
@pytest.mark.parametrize('gravity', [0.0, 9.81])
def test_what_is_usual_grows_with_the_imbalance(drive, gravity):
    left = []
    for size in (1e-3, 2e-3):
        real = built(3, (0.0, size), gravity)
        left.append(usual_imbalance_residual(real, balanced(real), drive)[0])
    assert left[1] == pytest.approx(2.0 * left[0], rel=1e-2)
    assert left[0] > 1e-5


def test_hanging_under_its_weight_is_no_oscillation():
    """An arm that does not move swings about nothing, however it hangs."""
    real = built(2, (0.0, 1e-2), gravity=9.81)
    still = np.zeros((200, 2))
    motion = still, still, still
    hangs = 9.81 * abs(real.static_moment[-1]) / real.stiffness
    left = imbalance_residual(real, balanced(real), motion, 1.0, Drive.POSITION)
    assert left < 2e-3 * hangs


def test_the_size_that_the_issue_of_a_rounded_arm_has():
    """A counterbalance arm rounded to a tenth of a millimetre is far within a hundredth."""
    links = {name: values[-2:] for name, values in LINKS.items()}
    shape = {name: links[name] for name in ('link_length', 'link_com', 'link_mass')}
    exact = counterbalances(**shape, mass=[1.04, 0.1]).arm
    real = PlanarArm.from_links(
        **links,
        counterbalance_mass=[1.04, 0.1],
        counterbalance_arm=np.round(exact, 4) + [0.0, 1e-5],
        **SPRING,
    )
    assert 0.0 < imbalance(real) < 0.01
