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

"""Derivatives that are carried along with a motion are those of the motion."""

from dataclasses import replace

from flat_planner_ros.core.model_fit.base_errors import BaseErrors
from flat_planner_ros.core.model_fit.signals import Segment
from flat_planner_ros.core.model_fit.simulation import Observed, seen_with_slopes
import numpy as np
import pytest

MODEL = np.array([7e-4, 1e-4, 8e-3, 6e-5, 2e-4, 5e-4, 0.01, 0.002])
NUDGE = 1e-5
SAMPLES = 240


def observed_arm():
    """Return two segments of an arm whose joint n-1 turns back several times in each."""
    times = np.arange(2 * SAMPLES) * 0.005
    nodes = np.array([[0.1, 0.2, 0.3, 0.9], [1.3, 1.4, 2.0, np.inf]])
    rng = np.random.default_rng(1)
    return Observed(
        times=times,
        angles=np.zeros((times.size, 2)),
        rates=np.zeros((2, 2)),
        rate_spread=1.0,
        effort=3e-3 * np.sin(9.0 * times),
        base=0.3 * np.cos(4.0 * times),
        moves=np.ones((times.size, 2), dtype=bool),
        rounding=np.zeros(2),
        segments=[Segment(0, SAMPLES), Segment(SAMPLES, 2 * SAMPLES)],
        base_errors=BaseErrors(nodes, 0.02 * rng.standard_normal((2, 4, 4)), 0.1),
    )


@pytest.mark.parametrize('coulomb', [0.0, 5e-4])
@pytest.mark.parametrize('has_errors', [False, True])
def test_slopes_are_those_of_difference_quotients(coulomb, has_errors):
    observed = observed_arm()
    if not has_errors:
        observed = replace(observed, base_errors=None)
    model = MODEL.copy()
    model[5] = coulomb
    unknowns = np.random.default_rng(2).uniform(-0.5, 0.5, (2, observed.unknowns))

    def played(changed):
        return seen_with_slopes(observed, slice(0, 2), model[None], changed)

    for column, nudge in enumerate(NUDGE * np.eye(observed.unknowns)):
        each = played(unknowns), played(unknowns + nudge), played(unknowns - nudge)
        for (_, slopes), (above, _), (below, _) in zip(*each, strict=True):
            expected = (above - below)[..., 0] / (2 * NUDGE)
            bound = 1e-5 * max(1e-3, np.abs(expected).max())
            assert slopes[..., column] == pytest.approx(expected, abs=bound)
