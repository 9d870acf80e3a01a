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

"""Motion laws against the same functions differentiated in multiple precision."""

from flat_planner_ros.core.motion_law.law import SummedLaw
from flat_planner_ros.core.motion_law.term_sum import term_sum
from flat_planner_ros.core.motion_law.terms import Term
import numpy as np
import pytest

KINDS = {
    'constant': (0j, 0, 1),
    'power series about the middle': (0j, 0, 12),
    'growing': (7.5 + 0j, 1, 1),
    'decaying': (-7.5 + 0j, -1, 1),
    'growing, times powers': (6.0 + 0j, 1, 4),
    'decaying, times powers': (-6.0 + 0j, -1, 4),
    'oscillating': (9.0j, 0, 1),
    'oscillating, times powers': (9.0j, 0, 3),
    'growing oscillation': (4.0 + 11.0j, 1, 1),
    'decaying oscillation': (-4.0 + 11.0j, -1, 1),
    'growing oscillation, times powers': (4.0 + 11.0j, 1, 3),
    'slow exponential about the middle': (0.3 - 0.2j, 0, 5),
}
"""Rate, origin and number of coefficients of every kind of term."""

TOP = 7
"""Highest derivative compared."""


@pytest.fixture
def mp():
    """Return mpmath in many digits."""
    mpmath = pytest.importorskip('mpmath')
    with mpmath.workdps(80):
        yield mpmath


def random_term(rng, kind):
    """Return a term of a kind with random coefficients, complex unless the rate is zero."""
    rate, origin, count = KINDS[kind]
    coefficients = rng.normal(size=count) + 1j * rng.normal(size=count)
    return Term(rate=rate, origin=origin, coefficients=tuple(coefficients.tolist()))


def law_of(duration, *terms):
    """Return the sum of terms over a duration."""
    return SummedLaw(duration=duration, total=term_sum(terms))


def exact(mp, duration, terms, t, order):
    """Return the derivatives of a sum by numerical differentiation in many digits."""
    half = mp.mpf(duration) / 2

    def value(time):
        x = time / half - 1
        total = mp.mpf(0)
        for term in terms:
            u = x - term.origin
            powers = sum(mp.mpmathify(complex(c)) * u**k for k, c in enumerate(term.coefficients))
            total += mp.re(powers * mp.exp(mp.mpmathify(term.rate) * u))
        return total

    return np.array([[float(d) for d in mp.diffs(value, mp.mpf(s), order)] for s in t]).T


@pytest.mark.parametrize('kind', KINDS)
def test_every_derivative_of_every_kind(mp, kind):
    rng = np.random.default_rng(list(KINDS).index(kind))
    for duration in (0.05, 3.0):
        term = random_term(rng, kind)
        times = np.array([0.0, 0.21, 0.5, 0.83, 1.0]) * duration
        expected = exact(mp, duration, [term], times, TOP)
        found = law_of(duration, term).jet(times, TOP)
        assert found.shape == expected.shape == (TOP + 1, 5)
        scale = np.abs(expected).max(axis=1, keepdims=True)
        assert (np.abs(found - expected) <= 2e-13 * scale).all()


def test_a_law_is_the_sum_of_its_terms(mp):
    rng = np.random.default_rng(20)
    terms = [random_term(rng, kind) for kind in KINDS]
    law = law_of(1.7, *terms)
    times = np.array([0.0, 0.3, 1.1, 1.7])
    expected = exact(mp, 1.7, terms, times, TOP)
    scale = np.abs(expected).max(axis=1, keepdims=True)
    assert (np.abs(law.jet(times, TOP) - expected) <= 2e-13 * scale).all()
    for order in range(TOP + 1):
        # Products of other shapes may round the last bit in another way.
        expected = law.jet(times, TOP)[: order + 1]
        np.testing.assert_allclose(law.jet(times, order), expected, rtol=4e-16)


@pytest.mark.parametrize('rate', [1e3, 1e6, 1e9, 1e12])
@pytest.mark.parametrize('wave', [0.0, 0.4])
def test_boundary_layers_are_resolved_at_either_end(mp, rate, wave):
    """Relative to the local envelope, however thin the layer is against the motion."""
    rng = np.random.default_rng(21)
    duration = 3.0
    depth = rng.uniform(0.01, 30.0, 12) / rate * duration / 2.0
    fast = complex(rate, rate * wave)
    for origin, times in ((1, duration - depth), (-1, depth)):
        amplitude = np.array([complex(*rng.normal(size=2))])
        term = Term(rate=origin * fast, origin=origin, coefficients=tuple(amplitude))
        law = law_of(duration, term)
        # Near the end, times are numbers far coarser than depth: the law is at these numbers.
        distance = [(mp.mpf(duration) - mp.mpf(t)) if origin > 0 else mp.mpf(t) for t in times]
        found = law.jet(times, 3)
        for k, u in enumerate(distance):
            x = 2 * u / duration
            value = mp.mpmathify(amplitude[0]) * mp.exp(-mp.mpmathify(fast) * x)
            per_second = mp.mpmathify(origin * fast) * 2 / duration
            for order in range(4):
                expected = value * per_second**order
                miss = abs(found[order, k] - mp.re(expected))
                assert miss <= 1e-13 * abs(expected)


def test_nothing_overflows_and_far_layers_vanish():
    growing = Term(rate=1e9 + 0j, origin=1, coefficients=(1.0 + 0j,))
    law = law_of(2.0, growing, growing.mirrored(-1.0))
    with np.errstate(over='raise', invalid='raise'):
        found = law.jet(np.array([0.0, 0.5, 1.0, 1.5, 2.0]), 12)
    np.testing.assert_array_equal(found[0], [-1.0, 0.0, 0.0, 0.0, 1.0])
    assert found[12, -1] == pytest.approx(1e108)


@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_mirrored_is_the_function_run_backwards(kind, sign):
    rng = np.random.default_rng(22)
    term = random_term(rng, kind)
    x = np.linspace(-1.0, 1.0, 11)
    alternating = sign * (-1.0) ** np.arange(TOP + 1)[:, None]
    places = np.array([1.0 + x, 1.0 - x])
    expected = alternating * term_sum([term]).at(places[::-1], TOP)
    found = term_sum([term.mirrored(sign)]).at(places, TOP)
    scale = np.abs(expected).max(axis=1, keepdims=True)
    assert (np.abs(found - expected) <= 1e-13 * scale).all()


def test_transformed_scales_every_derivative_and_offsets_the_value():
    rng = np.random.default_rng(23)
    law = law_of(0.7, *(random_term(rng, kind) for kind in KINDS))
    times = np.linspace(0.0, 0.7, 15)
    before = law.jet(times, TOP)
    found = law.transformed(-2.5, 40.0).jet(times, TOP)
    expected = -2.5 * before
    expected[0] += 40.0
    scale = np.abs(expected).max(axis=1, keepdims=True)
    assert (np.abs(found - expected) <= 1e-13 * scale).all()
    np.testing.assert_array_equal(law.jet(times, TOP), before)


def test_a_single_time_is_a_vector_of_one():
    law = law_of(2.0, Term(rate=0j, origin=0, coefficients=(1.0 + 0j, 3.0 + 0j)))
    np.testing.assert_allclose(law.jet(1.5, 0), [[2.5]], rtol=1e-15)
    assert law.jet(1.5, 2).shape == (3, 1)
