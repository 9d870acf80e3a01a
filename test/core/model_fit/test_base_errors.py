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

"""Errors of the velocity of link n-2: as large as noise makes them, where friction turns."""

from flat_planner_ros.core.model_fit.base_errors import base_errors_of, BaseErrors, Smoothing
from flat_planner_ros.core.model_fit.signals import derivative, Segment
import numpy as np
import pytest

TIMES = np.linspace(0.0, 1.0, 201)
NOISE, SPAN = 2e-4, 0.08
SMOOTHING = Smoothing(NOISE, SPAN), Smoothing(NOISE, 1.6 * SPAN)


def expected(turning, change=0.0):
    """Return what is to be expected of one segment."""
    changes = np.full(TIMES.size, change)
    return base_errors_of(TIMES, turning, changes, [Segment(0, TIMES.size)], SMOOTHING)


def test_the_covariance_is_that_of_smoothed_noise():
    """Second route: the spread of many velocities of a link that stands still."""
    errors = expected(0.0 * TIMES)
    nodes, root = errors.nodes[0], errors.roots[0]
    angles = NOISE * np.random.default_rng(1).standard_normal((TIMES.size, 4000))
    rates = derivative(TIMES, angles, SPAN, 1)
    inside = (nodes > SPAN) & (nodes < 1.0 - SPAN)
    seen = np.cov([np.interp(nodes[inside], TIMES, rate) for rate in rates.T], rowvar=False)
    stated = (root @ root.T)[np.ix_(inside, inside)]
    assert stated == pytest.approx(seen, abs=0.1 * seen.max())


def test_a_bias_that_noise_does_not_explain_is_expected_again():
    change = 0.03
    quiet, biased = (
        np.diag(each.roots[0] @ each.roots[0].T)
        for each in (expected(0.0 * TIMES), expected(0.0 * TIMES, change))
    )
    assert np.sqrt(biased - quiet) == pytest.approx(change / 0.6, rel=0.05)


def test_errors_count_where_friction_turns_alone():
    assert expected(np.ones(TIMES.size)) is None
    errors = expected(TIMES - 0.5)
    assert np.abs(errors.nodes[0] - 0.5).max() < 0.04 + 2 * errors.spacing


def test_errors_go_straight_from_node_to_node():
    errors = BaseErrors(np.array([[0.1, 0.2, np.inf]]), np.eye(3)[None], 0.1)
    values = np.array([[1.0, 3.0, 9.0]])
    grid = np.array([[0.0], [0.05], [0.1], [0.15], [0.2], [0.3], [0.5]])
    expected_of = [0.0, 0.5, 1.0, 2.0, 3.0, 0.0, 0.0]
    assert errors.near(grid).between(values)[:, 0] == pytest.approx(expected_of)
    for first in range(1, grid.size):
        near = errors.near(grid[first:])
        assert near.between(values)[:, 0] == pytest.approx(expected_of[first:])


def test_the_last_error_counts_once():
    errors = BaseErrors(np.array([[0.1, 0.2]]), np.eye(2)[None], 0.1)
    grid = np.array([[0.2], [0.25], [0.3]])
    shown = errors.near(grid).between(np.array([[1.0, 3.0]]))
    assert shown[:, 0] == pytest.approx([3.0, 1.5, 0.0])


def test_what_nodes_did_before_acts_through_the_state():
    errors = BaseErrors(np.array([[0.1, 0.2, 0.3]]), np.eye(3)[None], 0.1)
    near = errors.near(np.array([[0.21], [0.25], [0.29]]))
    assert near.first.tolist() == [1]
    assert near.shares.shape == (3, 1, 2)
    found, carried = np.arange(9.0).reshape(3, 3), np.arange(6.0).reshape(3, 2)
    expected_of = found.copy()
    expected_of[:, 1:] += carried
    near.add(found, carried, 0)
    assert found == pytest.approx(expected_of)
