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

"""Covariances of what is told well, and of what is told only together or not at all."""

from flat_planner_ros.core.model_fit.correlation import products
from flat_planner_ros.core.model_fit.judgement import correlation_lengths, covariance
from flat_planner_ros.core.model_fit.refinement import Linearisation
import numpy as np
import pytest

SAMPLES = 50


def around(columns, rng):
    """Return a linearisation with sensitivities (samples, P) of both channels and white noise."""
    left = rng.standard_normal((SAMPLES, 2))
    scores = columns * left[:, :1]
    return Linearisation(
        cost=1.0,
        gradient=np.zeros((2, columns.shape[1])),
        normal=np.stack((columns.T @ columns, columns.T @ columns)),
        scatter=scores.T @ scores,
        rounding=np.zeros((columns.shape[1],) * 2),
        samples=SAMPLES,
        products=products(left, SAMPLES // 4),
        residuals=[],
        corrections=[],
    )


@pytest.mark.parametrize('size', [1e3, 1e6, 1e9, 1e12])
def test_parameters_told_only_together_have_large_variances_above_zero(size):
    for seed in range(25):
        rng = np.random.default_rng(seed)
        columns = size * np.outer(rng.standard_normal(SAMPLES), rng.standard_normal(4))
        variances = np.diag(covariance(around(columns, rng), np.ones(4)))
        assert (variances > 1e4).all()


@pytest.mark.parametrize('apart', [1.0, 1e-3, 1e-6])
def test_of_what_is_told_the_covariance_is_that_of_weighted_least_squares(apart):
    rng = np.random.default_rng(1)
    columns = 1e3 * rng.standard_normal((SAMPLES, 3))
    columns[:, 1] = columns[:, 0] + apart * columns[:, 1]
    here = around(columns, rng)._replace(scatter=np.zeros((3, 3)))
    scales = np.array([1.0, 10.0, 1e-2])
    slopes = np.vstack((columns, columns)) * scales
    # Second route: orthogonal triangles instead of normal equations.
    inverse = np.linalg.inv(np.linalg.qr(slopes)[1])
    expected = np.mean(correlation_lengths(here)) * inverse @ inverse.T
    assert np.diag(covariance(here, scales)) == pytest.approx(np.diag(expected), rel=1e-2)


def test_without_parameters_there_is_no_covariance():
    rng = np.random.default_rng(2)
    assert covariance(around(np.zeros((SAMPLES, 0)), rng), np.zeros(0)).shape == (0, 0)


def test_products_of_neighbours_are_sums_over_what_overlaps():
    values = np.random.default_rng(3).standard_normal((SAMPLES, 2))
    found = products(values, 7)
    for lag in range(7):
        expected = (values[lag:] * values[: SAMPLES - lag]).sum(axis=0)
        assert found[:, lag] == pytest.approx(expected, rel=1e-12, abs=1e-12)
