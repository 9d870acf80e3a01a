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
    roots = 0.02 * np.random.default_rng(1).standard_normal((2, 4, 4))
    roots[1, 3:] = roots[1, :, 3:] = 0.0
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
        base_errors=BaseErrors(nodes, roots, 0.1),
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
        return list(seen_with_slopes(observed, slice(0, 2), model[None], changed))

    shown = played(unknowns)
    slopes = [np.concatenate((each.by_start, each.by_errors), axis=-1) for each in shown]
    for column, nudge in enumerate(NUDGE * np.eye(observed.unknowns)):
        each = slopes, played(unknowns + nudge), played(unknowns - nudge)
        for own, above, below in zip(*each, strict=True):
            expected = (above.angles - below.angles) / (2 * NUDGE)
            bound = 1e-5 * max(1e-3, np.abs(expected).max())
            # Nodes that a segment has not do nothing.
            found = own[..., column] if column < own.shape[-1] else 0.0
            assert found == pytest.approx(expected, abs=bound)


@pytest.mark.parametrize('coulomb', [0.0, 5e-4])
@pytest.mark.parametrize('coupling', [None, 2e-6])
def test_changes_of_the_model_are_those_of_other_models(coulomb, coupling):
    observed = observed_arm()
    model = MODEL.copy()
    model[5] = coulomb
    scales = np.abs(MODEL) + 1e-9
    if coupling is not None:
        turning = np.random.default_rng(3).uniform(-20.0, 20.0, (2 * SAMPLES, 2))
        observed = replace(observed, turning=turning)
        model, scales = np.append(model, coupling), np.append(scales, 1e-5)
    unknowns = np.random.default_rng(2).uniform(-0.5, 0.5, (2, observed.unknowns))

    def played(models):
        return list(seen_with_slopes(observed, slice(0, 2), models, unknowns))

    nudges = 1e-4 * np.diag(scales)
    shown = played(np.vstack((model, model + nudges)))
    for column, nudge in enumerate(nudges):
        # The other row keeps Coulomb friction, and with it the steps, in both.
        above, below = (
            played(np.vstack((model + side * nudge, model + nudges[5]))) for side in (1.0, -1.0)
        )
        for each in zip(shown, above, below, strict=True):
            own, more, less = each
            expected = (more.angles - less.angles) / 2
            bound = 1e-3 * np.abs(expected).max()
            assert np.abs(expected).max() > 0.0
            assert own.by_model[..., column] == pytest.approx(expected, abs=bound)
