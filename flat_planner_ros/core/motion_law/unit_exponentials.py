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

"""
Unit motions of many equations at once, as exponentials and a few powers.

They are what `unit_motion` finds where each root is a cluster of its own, in arrays, for motions
whose roots are too fast for a series. Roots that are close to each other cost digits here; the
certificate tells whether enough are left.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

from flat_planner_ros.core.arm import ComplexArray, FloatArray, locked
from flat_planner_ros.core.motion_law.basis import CONDITIONS, SOLUTIONS
from flat_planner_ros.core.motion_law.certificate import probes, UNIT_ENDS
from flat_planner_ros.core.motion_law.extremal import Mean
from flat_planner_ros.core.motion_law.law import gauss_panel, JET_ORDER
from flat_planner_ros.core.motion_law.octaves import octaves, octaves_for
from flat_planner_ros.core.motion_law.simple_roots import SimpleRoots
from flat_planner_ros.core.motion_law.term_sum import grid_blocks, split_parts, VANISHING
from flat_planner_ros.core.motion_law.terms import series_derivatives
from flat_planner_ros.core.motion_law.transforms import exponential_transform, power_transform
from flat_planner_ros.core.motion_law.unit_motions import (
    Certificates,
    IntArray,
    mirrored_grid,
    Nodes,
)
import numpy as np

TABLES_KEPT = 16
"""Tables of powers that are remembered."""


@lru_cache(maxsize=TABLES_KEPT)
def _power_derivatives(count: int) -> FloatArray:
    """Return coefficients of the derivatives 0 to 12 of x, x^3, ..., (count, powers, 13)."""
    return locked(series_derivatives(np.eye(2 * count)[1::2], SOLUTIONS))


def _powers_at_end(count: int) -> FloatArray:
    """Return derivatives 0 to 5 of x, x^3, ... at x = 1, shape (count, 6)."""
    ends: FloatArray = _power_derivatives(count).sum(axis=1)[:, :CONDITIONS]
    return ends


@lru_cache(maxsize=TABLES_KEPT)
def _powers_at_probes(count: int) -> FloatArray:
    """Return derivatives 0 to 12 of x, x^3, ... at the times of the certificate, (count, 13 m)."""
    after_start, before_end = probes()
    x = 0.5 * (after_start - before_end)
    powers = x[:, None] ** np.arange(2.0 * count)
    table = np.einsum('cdk,md->ckm', _power_derivatives(count), powers)
    return locked(table.reshape(count, -1))


@dataclass(frozen=True, kw_only=True, eq=False)
class UnitExponentials:
    """
    Unit motions with equally many exponentials and powers.

    The law is sum_i Re A_i (exp(-d_i (1 - x)) - exp(-d_i (1 + x))) + sum_j c_j x^(2 j + 1).

    Attributes
    ----------
    decays, amplitudes
        d and A, shape (p, m).
    powers
        c, shape (p, q).
    certificates
        Quality, cost and ends.

    """

    decays: ComplexArray
    amplitudes: ComplexArray
    powers: FloatArray
    certificates: Certificates

    @classmethod
    def of(cls, coefficients: FloatArray, roots: SimpleRoots) -> 'UnitExponentials':
        """
        Return the unit motions of equations.

        Parameters
        ----------
        coefficients
            a_0 ... a_6 in normalised time, shape (p, 7) [-].
        roots
            Of these equations.

        Raises
        ------
        numpy.linalg.LinAlgError
            An equation is singular in double precision.

        """
        decays, zeros = roots.decays, roots.zeros
        solution = _at_rest(decays, zeros)
        powers, pairs = solution[:, :zeros], roots.pairs
        amplitudes: ComplexArray = solution[:, zeros : zeros + decays.shape[1]].astype(complex)
        amplitudes[:, :pairs] -= 1j * solution[:, zeros + decays.shape[1] :]
        order = np.arange(SOLUTIONS + 1)
        growing = amplitudes[:, None] * decays[:, None] ** order[:, None]
        falling = -((-1.0) ** order)[:, None] * growing
        with np.errstate(under='ignore'):
            fall = np.exp(-decays[:, None, :, None] * probes()[:, None])
        jets = _real_sum(np.stack([falling, growing], axis=2), fall)
        jets += (powers @ _powers_at_probes(zeros)).reshape(jets.shape)
        return cls(
            decays=decays,
            amplitudes=amplitudes,
            powers=powers,
            certificates=Certificates.of(coefficients, jets),
        )

    def chosen(self, rows: IntArray) -> 'UnitExponentials':
        """Return some of the motions."""
        return UnitExponentials(
            decays=self.decays[rows],
            amplitudes=self.amplitudes[rows],
            powers=self.powers[rows],
            certificates=self.certificates.chosen(rows),
        )

    def means(self, rows: FloatArray) -> Mean:
        """Return mean squares and peaks, as `UnitMotion.mean`, rows of shape (p, m, 7)."""
        square, peak = np.zeros((2, *rows.shape[:2]))
        for places, weights, halves in self.at_nodes(rows):
            square[places] += 0.5 * sum(half**2 @ weights for half in halves)
            for half in halves:
                peak[places] = np.maximum(peak[places], np.abs(half).max(axis=2))
        return Mean(square, peak)

    def at_nodes(self, rows: FloatArray) -> Iterator[Nodes]:
        """Return combinations of derivatives at nodes of a quadrature, octave by octave."""
        finenesses = octaves_for(self.decays)
        for fineness in np.unique(finenesses, axis=0).tolist():
            places = np.flatnonzero((finenesses == fineness).all(axis=1))
            some = self.chosen(places)
            for weights, halves in some._on_octaves(rows[places], *fineness):
                yield Nodes(places, weights, halves)

    def on_even_grid(self, rows: FloatArray, intervals: int) -> FloatArray:
        """Return combinations of derivatives at even times, as `UnitSeries.on_even_grid`."""
        size, places, x = grid_blocks(intervals)
        fine = _exponentials(self.decays, places[:size])
        coarse = _exponentials(self.decays, places[size:].reshape(2, -1))
        left, right = self._combined(rows).halves(fine, coarse, x)
        odd, even = 0.5 * (left - right), 0.5 * (left + right)
        return mirrored_grid(odd, even, rows, self.certificates, intervals)

    def transform(self, poles: ComplexArray) -> ComplexArray:
        """Return the integral of w' exp(z (1 - x)) for each z, as `UnitSeries.transform`."""
        result = power_transform(self.powers, poles)
        result += exponential_transform(self.decays, self.decays * self.amplitudes, poles)
        return result

    def _on_octaves(
        self, rows: FloatArray, depth: int, parts: int
    ) -> Iterator[tuple[FloatArray, tuple[FloatArray, FloatArray]]]:
        """Return weights, and combinations of derivatives in both halves, octave by octave."""
        combined = self._combined(rows)
        nodes, _ = gauss_panel()
        fine = None
        for width, starts, weights in octaves(depth, parts):
            # Twice as wide an octave has the squares of the exponentials.
            fine = _exponentials(self.decays, width * nodes) if fine is None else fine * fine
            coarse = _exponentials(self.decays, np.array([starts, 2.0 - width - starts]))
            x = (starts[:, None] + width * nodes).ravel() - 1.0
            yield weights, combined.halves(fine, coarse, x)

    def _combined(self, rows: FloatArray) -> '_Combined':
        """Return combinations of derivatives, rows of shape (p, r, 7)."""
        order = np.arange(JET_ORDER + 1.0)
        derivatives = self.amplitudes[:, None] * self.decays[:, None] ** order[:, None]
        table = _power_derivatives(self.powers.shape[1])[..., : JET_ORDER + 1]
        series = (self.powers @ table.reshape(len(table), -1)).reshape(
            len(rows), -1, JET_ORDER + 1
        )
        return _Combined(
            growing=rows @ derivatives,
            falling=-(rows * (-1.0) ** order) @ derivatives,
            series=rows @ series.swapaxes(1, 2),
        )


class _Combined(NamedTuple):
    """
    Combinations of derivatives of some motions.

    Attributes
    ----------
    growing, falling
        Factors of exp(-d_i (1 - x)) and exp(-d_i (1 + x)), shape (p, r, m).
    series
        Factors of ascending powers of x, shape (p, r, q).

    """

    growing: ComplexArray
    falling: ComplexArray
    series: FloatArray

    def halves(
        self, fine: ComplexArray, coarse: ComplexArray, x: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """
        Return the combinations in the first half of the motions, and at the mirrored places.

        Parameters
        ----------
        fine
            Exponentials of the places in a block, symmetric in it, shape (p, m, size).
        coarse
            Those of the blocks' first places from the start and of their last ones from the end,
            shape (p, m, 2, blocks).
        x
            The places, of which the last block may have too many, shape (places,).

        """
        count, decays, size = fine.shape
        combinations, blocks = self.growing.shape[1], coarse.shape[3]
        basis = np.empty((count, 2, decays, 2, size))
        split_parts(fine, basis[:, 0])
        basis[:, 1] = basis[:, 0, ..., ::-1]
        weights = np.empty((count, 2, combinations, blocks, 2, decays), dtype=complex)
        for side in range(2):
            block = coarse[:, None, :, side].swapaxes(2, 3)
            near, far = (self.falling, self.growing)[:: 1 - 2 * side]
            np.multiply(near[:, :, None], block, out=weights[:, 0, :, :, side])
            np.multiply(far[:, :, None], block, out=weights[:, 1, :, :, side])
        left_factors = weights.view(float).reshape(count, -1, 4 * decays)
        product = left_factors @ basis.reshape(count, 4 * decays, size)
        both = product.reshape(count, 2, combinations, blocks * size)[..., : len(x)]
        powers = x ** np.arange(self.series.shape[2])[:, None]
        even, odd = (self.series[..., k::2] @ powers[k::2] for k in range(2))
        left, right = both[:, 0], both[:, 1]
        left += even
        left += odd
        right += even
        right -= odd
        return left, right


def _at_rest(decays: ComplexArray, zeros: int) -> FloatArray:
    """Return the powers' factors, then the exponentials' real and imaginary ones, (p, 6)."""
    order = np.arange(CONDITIONS)
    growth = decays[..., None] ** order
    with np.errstate(under='ignore'):
        image = np.exp(-2.0 * decays)[..., None]
    values = growth * (1.0 - (-1.0) ** order * image)
    pairs = CONDITIONS - zeros - decays.shape[1]
    powers = np.broadcast_to(_powers_at_end(zeros), (len(decays), zeros, CONDITIONS))
    columns = np.concatenate([powers, values.real, values[:, :pairs].imag], axis=1)
    sizes = np.abs(decays)
    rates = np.concatenate([np.ones((len(decays), zeros)), sizes, sizes[:, :pairs]], axis=1)
    rates = np.sort(np.maximum(rates, 1.0), axis=1)
    # As `row_factors` has them.
    factors = np.ones_like(rates)
    np.cumprod((rates[:, :-1] * rates[:, 1:]) ** -0.5, axis=1, out=factors[:, 1:])
    matrix = (columns * factors[:, None]).swapaxes(1, 2)
    target = factors * UNIT_ENDS[:, 1]
    inverse = np.linalg.inv(matrix)
    solution: FloatArray = inverse @ target[..., None]
    solution += inverse @ (target[..., None] - matrix @ solution)
    return np.asarray(solution[..., 0])


def _exponentials(decays: ComplexArray, places: FloatArray) -> ComplexArray:
    """Return exp(-d u), zero where next to nothing is left, shape (p, m) + that of the places."""
    exponents = np.multiply.outer(-decays, places)
    with np.errstate(under='ignore'):
        fall: ComplexArray = np.exp(exponents)
    # Else products of them would be too small for full precision, which is slow.
    fall[exponents.real < -VANISHING] = 0.0
    return fall


def _real_sum(factors: ComplexArray, values: ComplexArray) -> FloatArray:
    """Return Re of the sums of products over two axes, (p, k, 2, m) and (p, 2, m, places)."""
    count, orders = factors.shape[:2]
    basis = np.empty((*values.shape[:3], 2, values.shape[3]))
    split_parts(values, basis)
    parts = factors.view(float).reshape(count, orders, -1)
    result: FloatArray = parts @ basis.reshape(count, -1, values.shape[3])
    return result
