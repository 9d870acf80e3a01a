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

"""Turns of wrapped encoders: counted where an arm turns, not where it is put elsewhere."""

from math import inf, nan, pi

from flat_planner_ros.core.arm import JointSample, SampleTable, TurnCounter
import numpy as np
import pytest


def wrapped(angles):
    """Return angles within +-pi, as an encoder shows them."""
    return (np.asarray(angles, dtype=float) + pi) % (2.0 * pi) - pi


def sample(time, positions, velocities=None):
    """Return a measured state."""
    return JointSample(
        time=time,
        positions=np.array(positions, dtype=float),
        velocities=None if velocities is None else np.array(velocities, dtype=float),
    )


def unwrapped(counter, *samples):
    """Return the angles that a counter makes of samples."""
    return np.array([counter.unwrapped(s).positions for s in samples])


@pytest.mark.parametrize('infinite', [inf, -inf])
def test_an_infinite_angle_is_none(infinite):
    """First, between others or twice in a row: what is finite is counted from what was finite."""
    counter = TurnCounter()
    counter.unwrapped(sample(0.0, [infinite]))
    counter.align(np.array([2.0 * pi + 3.1]))
    assert not counter.turns.any()
    angles = [3.1, infinite, infinite, -3.1, -3.0]
    found = unwrapped(counter, *(sample(0.005 * k, [q]) for k, q in enumerate(angles, start=1)))
    assert found[[0, 3, 4], 0] == pytest.approx([2.0 * pi + 3.1, 4.0 * pi - 3.1, 4.0 * pi - 3.0])
    assert np.isinf(found[1:3]).all()
    table = SampleTable(
        times=np.array([0.03, 0.035]), positions=np.full((2, 1), infinite), velocities=None
    )
    assert counter.unwrapped_table(table) is None


@pytest.mark.parametrize('period', [0.001, 0.01, 0.1])
@pytest.mark.parametrize('knows_velocity', [True, False])
def test_turns_are_counted_in_both_directions(period, knows_velocity):
    times = np.arange(0.0, 4.0, period)
    angles = np.stack([9.0 * np.sin(1.5 * times), -20.0 * np.sin(0.7 * times)], axis=1)
    rates = np.stack([13.5 * np.cos(1.5 * times), -14.0 * np.cos(0.7 * times)], axis=1)
    known = rates if knows_velocity else [None] * len(times)
    rows = zip(times, wrapped(angles), known, strict=True)
    counter = TurnCounter()
    found = unwrapped(counter, *(sample(*row) for row in rows))
    assert found == pytest.approx(angles, abs=1e-12)
    assert np.abs(counter.turns).max() > 0


def test_an_encoder_that_flickers_at_pi_stands_still():
    rng = np.random.default_rng(5)
    angles = pi + 1e-3 * rng.standard_normal(200)
    shown = wrapped(angles)
    assert {-1.0, 1.0} <= set(np.sign(shown))
    counter = TurnCounter()
    samples = [sample(0.005 * k, [q], [0.0]) for k, q in enumerate([3.1, *shown])]
    assert unwrapped(counter, *samples)[1:, 0] == pytest.approx(angles, abs=1e-12)


def whole(angles):
    """Return angles within 0 ... 2 pi, as an encoder shows them."""
    return np.asarray(angles, dtype=float) % (2.0 * pi)


@pytest.mark.parametrize('knows_velocity', [True, False])
def test_turns_of_an_encoder_from_zero_to_two_pi_are_counted_in_both_directions(knows_velocity):
    times = np.arange(0.0, 4.0, 0.005)
    angles = 4.0 + 9.0 * np.sin(1.5 * times)[:, None]
    rates = 13.5 * np.cos(1.5 * times)[:, None] if knows_velocity else [None] * len(times)
    counter = TurnCounter()
    rows = zip(times, whole(angles), rates, strict=True)
    assert unwrapped(counter, *(sample(*row) for row in rows)) == pytest.approx(angles, abs=1e-12)
    assert counter.range_of(0) == '0 to 2 pi'


def test_such_an_encoder_that_flickers_at_zero_stands_still():
    rng = np.random.default_rng(5)
    shown = whole(1e-3 * rng.standard_normal(200))
    assert np.ptp(shown) > 6.0
    counter = TurnCounter()
    samples = [sample(0.005 * k, [q], [0.0]) for k, q in enumerate([0.001, *shown])]
    assert np.abs(unwrapped(counter, *samples)).max() < 5e-3


@pytest.mark.parametrize(
    ('before', 'after'),
    [(3.0, -0.3), (1.75, -1.75), (2.9, -2.9), (2 * pi, 0.0), (7.0, 0.7), (3.5, -2.7)],
)
def test_an_arm_that_is_put_elsewhere_has_not_turned(before, after):
    first, last = sample(0.0, [before], [0.0]), sample(0.005, [after], [0.0])
    counter = TurnCounter()
    counter.unwrapped(first)
    assert counter.unwrapped(last) is last


def test_an_encoder_of_many_turns_is_left_alone():
    counter = TurnCounter()
    for k in range(100):
        state = sample(0.005 * k, [0.1 * k, -0.1 * k], [20.0, -20.0])
        assert counter.unwrapped(state) is state


def test_a_turn_over_an_unknown_angle_is_counted():
    counter = TurnCounter()
    found = unwrapped(
        counter,
        *(sample(0.005 * k, [q, 0.0]) for k, q in enumerate([3.1, nan, nan, -3.1, -3.0])),
    )
    assert np.isnan(found[1:3, 0]).all()
    assert found[3:, 0] == pytest.approx([2 * pi - 3.1, 2 * pi - 3.0])
    assert not found[:, 1].any()


@pytest.mark.parametrize('is_heard_before', [True, False])
def test_a_pose_tells_the_turns_of_before(is_heard_before):
    counter = TurnCounter()
    if is_heard_before:
        counter.unwrapped(sample(0.0, [-3.1, 0.0, 1.0]))
    # Joint 1 one turn on, joint 2 elsewhere, joint 3 as it is.
    counter.align(np.array([2 * pi - 3.0, 3.0, 1.1]))
    (found,) = unwrapped(counter, sample(0.005, [-3.05, 0.0, 1.0]))
    assert found == pytest.approx([2 * pi - 3.05, 0.0, 1.0])


def test_a_pose_tells_the_turn_of_an_encoder_from_zero_to_two_pi():
    counter = TurnCounter()
    counter.align(np.array([-0.1]))
    found = unwrapped(counter, *(sample(0.005 * k, [q]) for k, q in enumerate(whole([-0.1, 0.1]))))
    assert found[:, 0] == pytest.approx([-0.1, 0.1])
    assert counter.range_of(0) == '0 to 2 pi'


def test_a_pose_may_be_known_of_some_joints_only():
    counter = TurnCounter()
    counter.align(np.array([nan, 0.0]))
    shown = [[6.2, 6.28], [6.2, 0.001]]
    found = unwrapped(counter, *(sample(0.005 * k, q, [0.0, 0.0]) for k, q in enumerate(shown)))
    assert found == pytest.approx(np.array([[6.2, 6.28 - 2 * pi], [6.2, 0.001]]))


@pytest.mark.parametrize('velocity', [None, 1.7e308])
def test_the_largest_numbers_are_no_turns(velocity):
    """A damaged message may hold any number: its difference from the next need not be finite."""
    counter = TurnCounter()
    angles = [3.1, 1.7e308, -1.7e308, 1.7e308, -3.1]
    known = None if velocity is None else [velocity]
    samples = [sample(0.005 * k, [q], known) for k, q in enumerate(angles)]
    assert unwrapped(counter, *samples)[:, 0].tolist() == angles
    table = SampleTable(times=np.array([0.03, 0.035]), positions=np.array([[1.7e308], [-1.7e308]]))
    assert counter.unwrapped_table(table) is None
