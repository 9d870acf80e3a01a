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

"""How efforts go between samples is found, and what may be wrong with them, and no more."""

from math import pi

from flat_planner_ros.core.arm import PlanarArm
from flat_planner_ros.core.model_fit.doubts import Change
from flat_planner_ros.core.model_fit.last_fit import fit_last_links
import numpy as np
import pytest
from recorded_arm import recorded

BELIEVED = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
TRUE = BELIEVED.with_last_links(
    inertia_star=(7e-4, 3e-5), stiffness=2.7e-3, damping=2.5e-5, viscous=2e-4, coulomb=5e-4
)


@pytest.mark.parametrize(('rate', 'straightness'), [(200.0, 1.0), (50.0, 1 / 16)])
def test_how_straight_efforts_go_between_samples_is_found(rate, straightness):
    """
    The command goes straight from point to point, 200 of them in a second.

    With every fourth sampled a parabola is 1/16 of the way from arc to chord; cubics err, too.
    """
    seen = recorded(TRUE, BELIEVED, rate=rate, goals=(pi, 0.5 * pi), until=3.1)
    fit = fit_last_links(seen, BELIEVED, with_imbalance=False)
    assert fit.observed.straightness == pytest.approx(straightness, abs=0.03)
    assert fit.found.parameters[:4] == pytest.approx([7e-4, 3e-5, 2.7e-3, 2.5e-5], rel=2e-3)


def changes(*residuals):
    """Return changes of residuals (m, 2) of a model whose one parameter adds 1 to all."""
    arrays = np.array(residuals, dtype=float)
    products = np.einsum('imc,jmc->cij', arrays, arrays)
    count = arrays.shape[1]
    normal = np.full((2, 1, 1), float(count))
    return [
        Change(share, products, count, array.sum(axis=0)[:, None], normal)
        for share, array in zip(np.eye(len(arrays)), arrays, strict=True)
    ]


def test_what_another_change_explains_is_left_out():
    residuals = np.array([[1.0, 0.0], [2.0, 1.0]]), np.array([[1.0, 1.0], [0.0, 0.0]])
    first, second, none = changes(*residuals, np.zeros((2, 2)))
    rest = first.besides(second)
    left = residuals[0] - 0.5 * residuals[1]
    assert rest.along(second).sum() == pytest.approx(0.0, abs=1e-15)
    assert rest.power == pytest.approx((left**2).sum(axis=0))
    assert rest.on_residuals == pytest.approx((left * residuals[0]).sum(axis=0))
    assert rest.gradient == pytest.approx(left.sum(axis=0)[:, None])
    assert first.besides(none).power == pytest.approx(first.power)


def test_a_step_leaves_what_no_parameter_explains():
    residuals = np.array([[1.0, 0.0], [2.0, 1.0]])
    (wrong,) = changes(residuals)
    step = wrong.step(np.array([3.0]))
    assert step == pytest.approx([-residuals.mean()])
    assert wrong.left(step) == pytest.approx(((residuals + step) ** 2).mean(axis=0))


@pytest.mark.parametrize(('ratio', 'growth'), [(1.0, 4.0), (6.0, 6.0), (50.0, 8.0)])
def test_changes_grow_with_the_spacing_by_the_second_to_third_power(ratio, growth):
    residuals = np.array([[1.0, 0.0], [2.0, 1.0]])
    finer, coarser, none = changes(residuals, ratio * residuals, np.zeros((2, 2)))
    assert coarser.growth_from(finer) == pytest.approx(growth)
    assert finer.growth_from(none) == 4.0
