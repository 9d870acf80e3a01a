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

"""The first guess from pieces of a recording is that from the whole of it."""

from math import pi

from flat_planner_ros.core.arm import coulomb_share, PlanarArm
from flat_planner_ros.core.model_fit.last_links import BOTH, COULOMB, DELAY, LAST, VISCOUS
from flat_planner_ros.core.model_fit.weak_form import (
    AT_A_TIME,
    LinkSignals,
    OVERLAP,
    weak_guess,
    WINDOW,
    Windows,
)
import numpy as np
import pytest
from recorded_arm import recorded

ARM = PlanarArm.reduced(
    inertia_star=(7e-4, 3e-5),
    stiffness=3e-3,
    damping=2e-5,
    viscous_friction=[2e-4],
    coulomb_friction=[5e-4],
)
PERIOD = 0.6


@pytest.mark.parametrize('samples', [500, 497, 33, 32, 20])
def test_windows_are_weighted_sums_around_every_few_samples(samples):
    times, signal = 0.005 * np.arange(samples), np.random.default_rng(1).standard_normal(samples)
    windows = Windows(times, 0.16)
    half = 16
    around = np.polynomial.Polynomial([1.0, 0.0, -1.0]) ** 4
    places = np.arange(-half, half + 1) / half
    firsts = range(0, samples - 2 * half, 2 * half // OVERLAP)
    for order in range(3):
        weights = (-1) ** order * around.deriv(order)(places) / (half * 0.005) ** order
        weights /= around(places).sum()
        expected = [weights @ signal[first : first + places.size] for first in firsts]
        assert windows.samples == places.size
        assert windows(signal, order) == pytest.approx(np.array(expected), rel=1e-9, abs=1e-9)


def test_the_guess_is_that_of_all_rows_at_once():
    seen = recorded(ARM, ARM, noise=1e-4, goals=(pi, 0.5 * pi), until=3.1)
    # Late by three samples, and again and again until there is more than one piece.
    link, passive = np.tile(seen.positions.T[:, 3:], 18)
    effort = np.tile(seen.efforts[:-3, 0], 18)
    times = 0.005 * np.arange(link.size)
    rate = np.gradient(link, times)
    signals = LinkSignals(times, link, passive, rate, effort)
    asked = []

    def piece(first, last):
        asked.append(last - first)
        return LinkSignals(*(each[first:last] for each in signals))

    guess = weak_guess(piece, times.size, PERIOD)
    windows = Windows(times, WINDOW * PERIOD)
    assert max(asked) < 0.8 * times.size
    assert len(windows(link)) > AT_A_TIME
    shift = round(guess[DELAY] / 0.005)
    late = np.concatenate((np.full(shift, effort[0]), effort))[: effort.size]
    columns = windows(link, 2), windows(link + passive, 2), windows(rate)
    matrix = np.column_stack((*columns, windows(coulomb_share(rate))))
    inner, last, viscous, coulomb = np.linalg.lstsq(matrix, windows(late), rcond=None)[0]
    expected = [inner + last, last, viscous, coulomb]
    assert guess[[BOTH, LAST, VISCOUS, COULOMB]] == pytest.approx(expected, rel=1e-6)
