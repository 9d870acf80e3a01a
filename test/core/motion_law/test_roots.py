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

"""Characteristic roots: prescribed ones come back, as clusters that rebuild the polynomial."""

from flat_planner_ros.core.motion_law.roots import Spectrum
import numpy as np
import pytest

EXACT = {
    'zero': [0, 0, 0, 0, 0, 0],
    'separate': [0, 900, 2500, 4900, -40000, -90000],
    'spread over twenty orders': [0, 1e-10, 1e-5, 1.0, 1e5, 1e10],
    'complex, spread': [0, 0, 3e-9 + 4e-9j, 3e-9 - 4e-9j, -3e10 + 4e10j, -3e10 - 4e10j],
    'imaginary double': [0, 0, 0, 0, -400, -400],
    'two imaginary doubles': [0, 0, -10000, -10000, -90000, -90000],
    'imaginary quadruple': [0, 0, -625, -625, -625, -625],
    'real double': [0, 0, 0, 0, 400, 400],
    'real triple': [0, 0, 0, 900, 900, 900],
    'real quintuple': [0, 900, 900, 900, 900, 900],
    'complex double': [0, 0, 300 + 400j, 300 - 400j, 300 + 400j, 300 - 400j],
    'small enough for the centre': [0, 1, 2, -1, 0.5 + 1j, 0.5 - 1j],
    'half in the centre': [0, 1, -2, 3600, -1600 + 100j, -1600 - 100j],
    'near the real axis': [0, 0, 0, 0, 2500 + 1e-3j, 2500 - 1e-3j],
    'near the imaginary axis': [0, 0, 0, 0, -2500 + 1e-3j, -2500 - 1e-3j],
    # Linked across the real axis, not the imaginary one, though Re z is negative on the whole.
    'real, wider than its distance from zero': [
        0,
        14.2,
        4.7 + 15.1j,
        4.7 - 15.1j,
        -13.9 + 29.9j,
        -13.9 - 29.9j,
    ],
    'min potential energy': [0, 0, *(6.0e4 * np.exp(1j * np.pi * np.array([1, 3, 5, 7]) / 4))],
}
"""Roots z = beta^2 in normalised time."""

BACKWARD = 3e-14
"""Allowed error of a rebuilt coefficient, relative to the same sum over the roots' moduli [-]."""


def coefficients_of(oracle, squares):
    """Return the coefficients of the prescribed roots, each rounded once."""
    return np.array([float(a) for a in oracle.polynomial([(z, 1) for z in squares])])


def clustered(gap):
    """Return roots in groups a relative gap apart: real, complex, mirrored in an axis."""
    real = [2500.0 * (1.0 + j * gap) for j in range(3)]
    pair = [-900.0 + 900.0j * gap, -900.0 - 900.0j * gap]
    return [0.0, *real, *pair]


def rebuilt(mp, found):
    """Return the even polynomial of degree twelve that clusters describe, ascending in D."""

    def shifted(cluster, sign, is_conjugate):
        """Return the factor in D, with its roots mirrored."""
        factor = [mp.mpc(complex(c)) for c in cluster.factor]
        centre = mp.mpc(complex(cluster.centre))
        if is_conjugate:
            factor, centre = [mp.conj(c) for c in factor], mp.conj(centre)
        result = [mp.mpc(0)]
        for c in factor:  # Horner: result * (sign D - centre) + c
            up = [mp.mpc(0), *(sign * a for a in result)]
            down = [centre * a for a in result] + [mp.mpc(0)]
            result = [a - b for a, b in zip(up, down, strict=True)]
            result[0] += c
        # p(-D) has the sign of its degree.
        return [sign ** (len(factor) - 1) * a for a in result[: len(factor)]]

    total = [mp.mpc(1)]
    for cluster in found:
        kinds = [(1, False)]
        if cluster.centre != 0.0:
            kinds.append((-1, False))
            if cluster.centre.imag != 0.0 and cluster.centre.real != 0.0:
                kinds += [(1, True), (-1, True)]
        for kind in kinds:
            factor = shifted(cluster, *kind)
            product = [mp.mpc(0)] * (len(total) + len(factor) - 1)
            for i, a in enumerate(total):
                for j, b in enumerate(factor):
                    product[i + j] += a * b
            total = product
    return total


def count(found):
    """Return how many of the twelve roots clusters stand for."""
    total = 0
    for cluster in found:
        images = 1
        images *= 2 if cluster.centre != 0.0 else 1
        images *= 2 if cluster.centre.real != 0.0 and cluster.centre.imag != 0.0 else 1
        total += images * (len(cluster.factor) - 1)
    return total


def check(oracle, found, coefficients, squares, tolerance=BACKWARD):
    """Assert what holds of every answer; return the backward error."""
    assert count(found) == 12
    assert found[0].centre == 0.0
    assert all(c.centre.real >= 0.0 and c.centre.imag >= 0.0 for c in found)
    for cluster in found:
        assert cluster.factor[0] == 1.0
        roots = np.roots(cluster.factor)
        size = np.abs(cluster.factor)
        order = np.arange(len(size))
        if cluster.centre.imag == 0.0:  # closed under conjugation
            assert (np.abs(cluster.factor.imag) <= 1e-13 * size.max()).all()
        elif cluster.centre.real == 0.0:  # closed under D -> -conj(D)
            expected = (-1.0) ** order * cluster.factor.conj()
            np.testing.assert_allclose(cluster.factor, expected, rtol=0, atol=1e-13 * size.max())
        else:
            assert (cluster.centre.real + roots.real > 0.0).all()
            assert (cluster.centre.imag + roots.imag > 0.0).all()
    with oracle.mp.workdps(60):
        total = rebuilt(oracle.mp, found)
        scale = oracle.polynomial([(-abs(z), 1) for z in squares])
        assert len(total) == 13
        worst = 0.0
        for k, size in enumerate(scale):
            error = abs(total[2 * k] - coefficients[k])
            assert error <= tolerance * size
            worst = max(worst, float(error / size) if size else 0.0)
        # Of the odd coefficients each is bounded by its even neighbours.
        for k in range(6):
            bound = oracle.mp.sqrt(scale[k] * scale[k + 1])
            assert abs(total[2 * k + 1]) <= tolerance * bound
    return worst


@pytest.mark.parametrize('name', EXACT)
def test_prescribed_roots_rebuild_the_polynomial(oracle, name):
    squares = [complex(z) for z in EXACT[name]]
    coefficients = coefficients_of(oracle, squares)
    check(oracle, Spectrum(coefficients).clusters(), coefficients, squares)


@pytest.mark.parametrize('exponent', range(3, 10))
def test_near_roots_share_a_well_conditioned_factor(oracle, exponent):
    """Roots 1e-3 to 1e-9 apart are off by as much, but not their factor."""
    squares = clustered(10.0**-exponent)
    coefficients = coefficients_of(oracle, squares)
    found = Spectrum(coefficients).clusters()
    check(oracle, found, coefficients, squares)
    assert sorted(len(c.factor) - 1 for c in found) == [2, 2, 3]
    assert sorted((c.centre.real > 0.0, c.centre.imag > 0.0) for c in found) == [
        (False, False),
        (False, True),
        (True, False),
    ]


@pytest.mark.parametrize('exponent', [4, 7, 10])
def test_a_near_complex_pair_shares_a_factor(oracle, exponent):
    gap = 10.0**-exponent
    first, second = 300.0 + 400.0j, (300.0 + 400.0j) * (1.0 + gap)
    squares = [0.0, 0.0, first, first.conjugate(), second, second.conjugate()]
    coefficients = coefficients_of(oracle, squares)
    found = Spectrum(coefficients).clusters()
    check(oracle, found, coefficients, squares)
    assert [len(c.factor) - 1 for c in found] == [4, 2]


def test_random_roots_rebuild_the_polynomial(oracle):
    """Zeros, real and complex roots, alone and in groups, over twenty orders of magnitude."""
    rng = np.random.default_rng(1)
    checked = 0
    for _ in range(150):
        squares = [0.0]
        while len(squares) < 6:
            modulus = 10.0 ** rng.uniform(-10, 10)
            copies = int(rng.integers(1, 4))
            spread = rng.choice([0.0, 1e-8, 1e-4, 1e-1])
            for _ in range(copies):
                near = modulus * (1.0 + spread * rng.normal())
                room = 6 - len(squares)
                kind = rng.integers(0, 4)
                if room >= 2 and kind < 2:
                    z = near * np.exp(1j * np.pi * rng.choice([0.3, 0.5, 0.8, rng.uniform()]))
                    squares += [complex(z), complex(z).conjugate()]
                elif room >= 1:
                    squares.append(complex(near * (1.0 if kind == 2 else rng.choice([-1.0, 1.0]))))
        coefficients = coefficients_of(oracle, squares)
        check(oracle, Spectrum(coefficients).clusters(), coefficients, squares)
        checked += 1
    assert checked == 150


def test_separate_roots_are_accurate_on_their_own_scale(oracle):
    """Each of five roots spread over twenty orders is right to the last digits."""
    rng = np.random.default_rng(2)
    checked = 0
    for _ in range(40):
        exponents = np.sort(rng.choice(np.arange(1, 10), 5, replace=False))
        squares = 16.0 * 10.0 ** (2.0 * exponents)
        coefficients = coefficients_of(oracle, [0.0, *squares])
        found = Spectrum(coefficients).clusters()
        centres = sorted(c.centre.real + np.roots(c.factor).real.sum() for c in found[1:])
        np.testing.assert_allclose(centres, np.sqrt(squares), rtol=1e-14)
        checked += len(centres)
    assert checked == 200


def test_far_roots_are_not_linked(oracle):
    """A cluster is small: its power series would not converge otherwise."""
    for squares in EXACT.values():
        for cluster in Spectrum(coefficients_of(oracle, squares)).clusters():
            distances = np.abs(np.roots(cluster.factor))
            assert (distances <= 15.0 + 0.7 * cluster.centre.real).all()


@pytest.mark.parametrize('name', EXACT)
def test_clusters_of_another_unit_of_time(oracle, name):
    """Multiplied roots form the clusters of the equation that has them, grouped alike."""
    squares = [complex(z) for z in EXACT[name]]
    spectrum = Spectrum(coefficients_of(oracle, squares))
    scales = np.array([0.01, 0.3, 1.0, 4.0, 50.0])
    for scale, grouping in zip(scales.tolist(), spectrum.groupings(scales), strict=True):
        multiplied = [scale**2 * z for z in squares]
        found = spectrum.grouped(grouping, scale)
        check(oracle, found, coefficients_of(oracle, multiplied), multiplied)
        expected = Spectrum(coefficients_of(oracle, multiplied)).clusters()
        sizes = sorted(len(cluster.factor) for cluster in found)
        assert sizes == sorted(len(cluster.factor) for cluster in expected)
