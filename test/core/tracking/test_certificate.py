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

"""The certificate against what loops do."""

from dataclasses import replace
from itertools import product

from core.conftest import ARM, ELBOW
from core.tracking.closed_loop import ClosedLoop, motion_of, samples_of
from flat_planner_ros.core.arm import UncertifiedLoop
from flat_planner_ros.core.tracking import certify, Phase, Tracker, TrackerSettings, Uncertainty
from flat_planner_ros.core.tracking.certificate import SampledLoop
from flat_planner_ros.core.tracking.chain import last_links
import numpy as np
import pytest

NONE = Uncertainty(stiffness=0.0, damping=0.0, inertia=0.0, samples=0)
SETTINGS = TrackerSettings(delay=0.002)
BANDWIDTH = SETTINGS.bandwidth_of(ARM)


def loop_with(late=0, **factors):
    """Return the loop of an arm that differs from the model."""
    true = last_links(ARM.scaled(**factors))
    return SampledLoop(true, last_links(ARM), SETTINGS, BANDWIDTH, late)


def test_the_nominal_loop_has_the_poles_of_feedback_and_observer():
    """The separation theorem: 4 poles at the bandwidth are the slowest."""
    found = certify(ARM, replace(SETTINGS, uncertainty=NONE))
    assert found.decay_rate == pytest.approx(SETTINGS.damping * BANDWIDTH, rel=0.02)
    assert found.margin > 0.35


def test_the_box_costs_margin_and_decay():
    nominal, whole = certify(ARM, replace(SETTINGS, uncertainty=NONE)), certify(ARM, SETTINGS)
    assert whole.margin < nominal.margin
    assert 3.0 < whole.decay_rate < nominal.decay_rate
    assert whole.worst != (1.0, 1.0, 1.0)


def test_all_arms_inside_the_box_are_better_than_the_certificate():
    found = certify(ARM, SETTINGS)
    frequencies = np.geomspace(0.1, np.pi * SETTINGS.rate, 200)
    random = np.random.default_rng(4)
    for _ in range(10):
        k, c, inertia = 1.0 + random.uniform(-1, 1, 3) * [0.25, 0.25, 0.1]
        loop = loop_with(stiffness=k, damping=c, inertia=inertia)
        assert -np.log(loop.radius) / SETTINGS.period >= found.decay_rate
        assert loop.margin(frequencies, SETTINGS.period) >= found.margin


def test_refuses_with_numbers_and_a_remedy():
    hasty = replace(SETTINGS, bandwidth=2.0 * BANDWIDTH, rate=200.0, delay=0.005)
    with pytest.raises(
        UncertifiedLoop, match='lower bandwidth to .* delay or uncertainty'
    ) as caught:
        certify(ARM, hasty)
    assert caught.value.margin < caught.value.bound == hasty.margin
    assert len(caught.value.factors) == 3
    named = certify(ARM, replace(hasty, bandwidth=caught.value.bandwidth))
    assert named.margin >= hasty.margin
    with pytest.raises(UncertifiedLoop):
        certify(ARM, replace(hasty, bandwidth=1.05 * named.bandwidth))


def test_a_relative_bandwidth_is_a_bound_up_to_which_the_fastest_loop_is_taken():
    """At 200 Hz the default one has half the margin that is asked for."""
    slow = replace(SETTINGS, rate=200.0, delay=0.005)
    found = certify(ARM, slow)
    assert 0.6 * BANDWIDTH < found.bandwidth < BANDWIDTH
    assert slow.margin <= found.margin < slow.margin + 0.02
    assert Tracker(ARM, slow).certificate == found
    with pytest.raises(UncertifiedLoop, match='lower delay or uncertainty'):
        certify(ARM, replace(slow, margin=0.8))


def test_later_than_the_certificate_says_some_arm_of_the_box_is_unstable():
    found = certify(ARM, SETTINGS)
    samples = round(found.late / SETTINGS.period)
    corners = [
        {'stiffness': k, 'damping': c, 'inertia': i}
        for k, c, i in product((0.75, 1.25), (0.75, 1.25), (0.9, 1.1))
    ]
    radii = [[loop_with(late, **arm).radius for arm in corners] for late in (samples, samples + 1)]
    assert max(radii[0]) < 1.0 <= max(radii[1])


def test_the_first_joints_are_certified_too():
    wide = replace(SETTINGS, uncertainty=Uncertainty(stiffness=0.0, damping=0.0, inertia=0.9))
    with pytest.raises(UncertifiedLoop) as caught:
        certify(ELBOW, wide)
    assert caught.value.factors[2] == pytest.approx(0.1)
    assert certify(ELBOW, SETTINGS).margin >= SETTINGS.margin


@pytest.mark.parametrize('late', [0, 3, 8])
def test_poles_tell_whether_the_simulated_loop_calms_down(late):
    """With samples of delay that the controller knows nothing of."""
    settings = replace(SETTINGS, delay=0.0, max_error=3.0, jump=10.0)
    model = last_links(ARM)
    is_stable = SampledLoop(model, model, settings, BANDWIDTH, late).radius < 1.0
    assert is_stable == (late < 8)
    loop = ClosedLoop(Tracker(ARM, settings), ARM, late=late, resolution=0.0)
    loop.run(0.01)
    loop.tracker.follow(motion_of(samples_of(final=[1e-9, 0.0])), loop.arm.time)
    loop.push = lambda time: 1e-3 if time < 0.05 else 0.0
    _, positions, _ = loop.run(2.0)
    moved, left = np.abs(positions[:300]).max(), np.abs(positions[-100:]).max()
    is_calm = loop.tracker.phase is Phase.TRACKING and left < 0.1 * moved
    assert is_calm == is_stable
