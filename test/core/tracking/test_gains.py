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

"""Gains against the poles that they promise, and against other routes to the same regulator."""

from core.conftest import ARM
from flat_planner_ros.core.arm import InvalidRequest
from flat_planner_ros.core.tracking.chain import last_links, linearised_joint
from flat_planner_ros.core.tracking.gains import (
    feedback_gain,
    observer_gain,
    regulator,
    weighted_output,
)
import numpy as np
import pytest

FREE = ARM.natural_mode().frequency
CHAINS = {'links': last_links(ARM), 'joint': linearised_joint()}


def poles(matrix, period):
    """Return the poles of a sampled system as those of a continuous one [1/s]."""
    return np.log(np.linalg.eigvals(matrix) + 0j) / period


@pytest.mark.parametrize('name', CHAINS)
@pytest.mark.parametrize('damping', [0.72, 1.0])
@pytest.mark.parametrize('ratio', [0.6, 1.0, 2.0])
def test_poles_are_at_the_bandwidth_and_the_damping(name, damping, ratio):
    chain, period, bandwidth = CHAINS[name], 2e-4, ratio * FREE
    gain = feedback_gain(chain, period, bandwidth, damping)
    flow, effect = chain.over(period)
    m = chain.order
    found = poles(flow[:m, :m] - np.outer(effect[:m], gain), period)
    # Sampling moves poles that coincide by its root: they are compared as a polynomial.
    pair = [1.0, 2 * damping * bandwidth, bandwidth**2]
    wanted = np.ones(1)
    for _ in range(m // 2):
        wanted = np.polymul(wanted, pair)
    np.testing.assert_allclose(np.poly(found).real, wanted, rtol=5e-3)


@pytest.mark.parametrize('name', CHAINS)
def test_the_weights_explain_the_poles(name):
    """Kalman's equation at frequencies that the factorisation has not seen."""
    chain, bandwidth, damping = CHAINS[name], 1.3 * FREE, 0.8
    row = chain.input_row / chain.input_row[-1]
    output = weighted_output(chain.input_row, bandwidth, damping)
    for frequency in (0.3, 5.0, 17.0, 200.0):
        s = 1j * frequency
        wanted = abs(s**2 + 2 * damping * bandwidth * s + bandwidth**2) ** (chain.order)
        own, weighed = (abs(np.polyval(polynomial[::-1], s)) ** 2 for polynomial in (row, output))
        assert own + weighed == pytest.approx(wanted, rel=1e-9)


def test_no_other_gain_costs_less():
    chain, period = CHAINS['links'], 2e-3
    flow, effect = (part[:4] for part in chain.over(period))
    flow, weight = flow[:, :4], np.diag([1.0, 2.0, 0.1, 0.3])
    best = regulator(flow, effect, weight, 3e3)

    def cost(gain):
        state, total = np.array([0.1, 0.3, 0.0, 1.0]), 0.0
        for _ in range(3000):
            effort = -gain @ state
            total += state @ weight @ state + 3e3 * effort**2
            state = flow @ state + effect * effort
        return total

    least, random = cost(best), np.random.default_rng(1)
    for _ in range(8):
        assert cost(best * (1 + 0.05 * random.normal(size=4))) > least


def test_gains_are_those_of_python_control():
    control = pytest.importorskip('control')
    chain = CHAINS['links']
    flow, effect = (part[:4] for part in chain.over(2e-3))
    weight = np.diag([1.0, 2.0, 0.1, 0.3])
    theirs, _, _ = control.dlqr(flow[:, :4], effect[:, None], weight, np.array([[3e3]]))
    ours = regulator(flow[:, :4], effect, weight, 3e3)
    np.testing.assert_allclose(ours, theirs[0], rtol=1e-8)


@pytest.mark.parametrize(('ratio', 'damping'), [(0.4, 0.8), (1.5, 0.6)])
def test_refuses_what_no_cost_leads_to(ratio, damping):
    with pytest.raises(InvalidRequest, match='raise bandwidth or damping'):
        feedback_gain(CHAINS['links'], 2e-3, ratio * FREE, damping)


def test_the_observer_is_the_limit_of_a_kalman_filter():
    """The covariance, propagated sample by sample, ends at the gain of the Riccati equation."""
    chain, period, bandwidth = CHAINS['links'], 2e-3, 60.0
    flow, _ = chain.over(period)
    inertia = 1.0 / chain.input_effect[2]
    noise = np.diag([0.0, 0.0, *[bandwidth**4] * 2, (inertia * bandwidth**3) ** 2]) * period
    shown, spread = np.eye(5)[:2], np.eye(5)
    for _ in range(400):
        gain = spread @ shown.T @ np.linalg.inv(shown @ spread @ shown.T + np.eye(2) / period)
        spread = (np.eye(5) - gain @ shown) @ spread
        spread = flow @ spread @ flow.T + noise
    found = observer_gain(chain, period, bandwidth)
    np.testing.assert_allclose(found, gain, rtol=1e-6, atol=1e-9 * np.abs(gain).max())


def test_the_observer_has_its_bandwidth():
    """Of one joint: the spectral factor of the noise, |P|^2 = w^6 + b^4 w^2 + b^6."""
    chain, period, bandwidth = CHAINS['joint'], 1e-4, 50.0
    flow, _ = chain.over(period)
    gain = observer_gain(chain, period, bandwidth)
    found = np.poly(poles(flow - flow @ gain @ np.eye(3)[:1], period))
    for w in (0.1, 20.0, 50.0, 90.0):
        expected = w**6 + bandwidth**4 * w**2 + bandwidth**6
        assert abs(np.polyval(found, 1j * w)) ** 2 == pytest.approx(expected, rel=0.02)
