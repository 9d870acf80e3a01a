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

"""Few points of a motion carry all of it, where cubics join them."""

from flat_planner_ros.core import MotionRequest, plan, PlanningOptions, Strategy
from flat_planner_ros.core.arm import sparse_rows
import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline


@pytest.mark.parametrize('tolerance', [1e-4, 1e-6])
@pytest.mark.parametrize('strategy', [Strategy.POLYNOMIAL, Strategy.MIN_CONTROL_EFFORT])
def test_what_is_kept_gives_back_the_law_between_its_samples(paper_arm, strategy, tolerance):
    request = MotionRequest(start=(0.0, 0.0), final=(np.pi, 0.0), duration=1.0)
    planned = plan(request, paper_arm, PlanningOptions(strategy=strategy))
    samples = planned.sample(0.005)
    rows = sparse_rows(samples.times, samples.positions, samples.velocities, tolerance)
    assert rows[0] == 0
    assert rows[-1] == len(samples.times) - 1
    assert len(rows) < (70 if tolerance < 1e-5 else 25)
    spline = CubicHermiteSpline(
        samples.times[rows], samples.positions[rows], samples.velocities[rows]
    )
    fine = planned.sample(0.00025)
    error = np.abs(spline(fine.times) - fine.positions).max()
    assert 0.2 * tolerance < error <= tolerance


def test_what_no_cubic_gives_back_is_kept():
    times = np.linspace(0.0, 1.0, 50)
    positions = np.random.default_rng(1).standard_normal((50, 2))
    rows = sparse_rows(times, positions, 0.0 * positions, 1e-6)
    assert rows.tolist() == list(range(50))


@pytest.mark.parametrize('count', [1, 2, 3])
def test_short_motions_keep_their_ends(count):
    table = np.zeros((count, 2))
    rows = sparse_rows(np.arange(float(count)), table, table, 1e-6)
    assert rows.tolist() == sorted({0, count - 1})
