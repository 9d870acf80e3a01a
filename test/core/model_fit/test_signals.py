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

"""What is made of a recording a few samples at a time is what is made of the whole of it."""

from flat_planner_ros.core.model_fit.measurements import encoder_step, moves_of
from flat_planner_ros.core.model_fit.signals import (
    AT_A_TIME,
    derivative,
    deviation_of,
    pieces,
    Smoothed,
)
import numpy as np
import pytest

RNG = np.random.default_rng(5)


@pytest.mark.parametrize('order', [0, 1, 2])
@pytest.mark.parametrize('width', [0.03, 0.11])
def test_derivatives_of_pieces_are_those_of_the_whole(order, width):
    times = np.cumsum(RNG.uniform(0.004, 0.006, 400))
    times[250:] += 0.7
    angles = np.column_stack((np.sin(3.0 * times), np.cos(times)))
    whole = derivative(times, angles, width, order)
    smoothed = Smoothed(times, angles, width, order)
    for size in (1, 7, 150):
        for first in range(0, 400, size):
            last = min(first + size, 400)
            assert smoothed(first, last) == pytest.approx(whole[first:last], rel=1e-9, abs=1e-9)


@pytest.mark.parametrize('order', [0, 1, 2])
def test_derivatives_of_smooth_angles_are_exact_up_to_their_fifth_one(order):
    times = np.linspace(0.0, 2.0, 401)
    found = derivative(times, np.sin(3.0 * times)[:, None], 0.05, order)[:, 0]
    exact = 3.0**order * np.sin(3.0 * times + 0.5 * np.pi * order)
    assert found == pytest.approx(exact, abs=1e-3)


def test_pieces_overlap_as_asked_and_leave_nothing_out():
    count = 2 * AT_A_TIME + 100
    found = list(pieces(3, count, overlap=6))
    assert found[0].start == 3
    assert found[-1].stop == count
    for before, after in zip(found, found[1:], strict=False):
        assert before.stop == after.start + 6


def test_a_deviation_of_parts_is_that_of_all():
    values = 3.0 + RNG.standard_normal((1000, 2))
    assert deviation_of(np.array_split(values, 7)) == pytest.approx(values.std(axis=0), rel=1e-12)


@pytest.mark.parametrize('bits', [12, 17])
def test_the_step_of_an_encoder_shows_over_many_pieces(bits):
    step = 2.0 * np.pi / 2**bits
    angle = np.linspace(-3.0, 3.0, 3 * AT_A_TIME) + 1e-3 * RNG.standard_normal(3 * AT_A_TIME)
    assert encoder_step(angle) == 0.0
    rounded = step * np.round(angle / step)
    assert encoder_step(rounded) == pytest.approx(step, rel=1e-6)
    # It stands where it stood, also from one piece to the next.
    moves = moves_of(rounded, step)
    place = rounded[0]
    for moved, value in zip(moves, rounded, strict=True):
        assert moved == (abs(value - place) > 1.001 * step)
        place = value if moved else place
