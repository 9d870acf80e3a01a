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

"""The simplex method for the least sum of magnitudes, against HiGHS."""

from flat_planner_ros.core.peak.least_sum import least_sum
from flat_planner_ros.core.peak.programme import PeakProgramme
import numpy as np
import pytest
from scipy.optimize import linprog


def by_highs(rows, target):
    """Return the largest y with A v = b y and |v| <= 1."""
    size = rows.shape[1]
    found = linprog(
        np.append(np.zeros(size), -1.0),
        A_eq=np.column_stack([rows, -target]),
        b_eq=np.zeros(len(rows)),
        bounds=[(-1.0, 1.0)] * size + [(0.0, None)],
    )
    return found.x[-1]


def check(rows, target):
    """Check that both programmes are solved, each by the definition of the other."""
    found = least_sum(rows, target)
    assert target @ found.multipliers == pytest.approx(1.0, rel=1e-9)
    assert np.abs(found.multipliers @ rows).sum() == pytest.approx(found.gain, rel=1e-9)
    assert np.abs(found.values).max() < 1.0 + 1e-9
    np.testing.assert_allclose(rows @ found.values, target * found.gain, atol=1e-9 * found.gain)
    return found.gain


@pytest.mark.parametrize('count', [2, 3, 4, 6])
def test_agrees_with_a_general_solver(count):
    rng = np.random.default_rng(count)
    for size in (count + 1, 18, 50, 300):
        rows = np.linalg.qr(rng.normal(size=(size, count)))[0].T
        target = rng.normal(size=count)
        assert check(rows, target) == pytest.approx(by_highs(rows, target), rel=1e-7)


@pytest.mark.parametrize('size', [48, 49, 50, 51])
def test_ends_where_zeros_come_in_pairs(size):
    # Even and odd rows: a switch in the middle is a zero of more coefficients than it needs.
    t = np.linspace(-1.0, 1.0, size)
    columns = np.column_stack([np.ones(size), t, np.cos(5.0 * t), np.sin(5.0 * t)])
    rows = np.linalg.qr(columns)[0].T
    for target in np.eye(4):
        assert check(rows, target) == pytest.approx(by_highs(rows, target), rel=1e-7)


def test_where_it_goes_round_the_general_solver_takes_over():
    rows = np.repeat(np.random.default_rng(1).normal(size=(3, 6)), 8, axis=1)
    target = np.array([1.0, -2.0, 0.5])
    programme = PeakProgramme(
        rows=rows,
        target=target,
        caps=np.empty((0, 48)),
        cap_target=np.empty(0),
        cap_limits=np.empty(0),
    )
    found = programme.solve()
    peak = np.abs(found.coefficients).max()
    np.testing.assert_allclose(rows @ found.coefficients, target, atol=1e-12)
    assert peak == pytest.approx(1.0 / by_highs(rows, target), rel=1e-9)
    assert found.proven_peak == pytest.approx(peak, rel=1e-9)
