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

"""Solutions of an equation, one parity at a time, fitted to derivatives at the end."""

from collections.abc import Sequence
from functools import lru_cache

from flat_planner_ros.core.arm import ComplexArray, FloatArray, UncertifiedPlan
from flat_planner_ros.core.motion_law.basis import block_of, combined, row_factors
from flat_planner_ros.core.motion_law.roots import Cluster
from flat_planner_ros.core.motion_law.spectra import known_spectrum
from flat_planner_ros.core.motion_law.term_sum import plain_factors, term_sum, TermSum
from flat_planner_ros.core.motion_law.terms import Term
import numpy as np

RESIDUAL_STEPS = 1
"""Corrections of the solved boundary conditions by their own residual."""

SOLVERS_KEPT = 16
"""Equations, and parities of their laws, whose conditions' matrices are remembered."""


class BoundarySolver:
    """
    Fits the solutions of one parity to derivatives at x = 1; the matrix is inverted once.

    Parameters
    ----------
    found
        Clusters of the equation's roots.
    parity
        1 for the even solutions, -1 for the odd ones.

    Attributes
    ----------
    rates : ComplexArray
        Rates of the solutions, without mirror images, shape (m,) [-].

    Raises
    ------
    UncertifiedPlan
        The conditions are singular in double precision.

    """

    def __init__(self, found: Sequence[Cluster], parity: float) -> None:
        """Scale the conditions' matrix and invert it."""
        ordered = sorted(found, key=lambda cluster: abs(cluster.centre))
        blocks = [block_of(cluster, parity) for cluster in ordered]
        columns = [column for block in blocks for column in block.columns]
        self._parity = parity
        self._solutions = [block.solutions for block in blocks]
        self._powers = blocks[0].powers
        self.rates: ComplexArray = np.array([each.rate for each in self._solutions])
        self._rows = row_factors([b.growth for b in blocks for _ in b.columns])
        self._matrix = (self._rows * np.array(columns)).T
        try:
            self._inverse = np.linalg.inv(self._matrix)
        except np.linalg.LinAlgError as error:
            raise UncertifiedPlan('boundary residual', np.inf, 0.0) from error

    def terms(self, target: FloatArray) -> list[Term]:
        """Return the terms of the combination of solutions that meets derivatives 0 to 5."""
        terms = []
        for term in combined(self._solutions, self._amplitudes(target).tolist()):
            terms.append(term)
            if term.origin != 0:  # else it is symmetric by itself
                terms.append(term.mirrored(self._parity))
        return terms

    def total(self, target: FloatArray) -> TermSum:
        """Return the sum of these terms, ready for evaluation."""
        others = self._solutions[1:]
        if self._powers is None or any(each.series is not None for each in others):
            return term_sum(self.terms(target))
        # No roots but zero have company: exponentials, with a mirror image each, and powers.
        amplitudes = self._amplitudes(target)
        count, orders, terms = self._powers.shape
        powers = amplitudes[:count] @ self._powers.reshape(count, orders * terms)
        exponentials = combined(others, amplitudes[count:].tolist())
        at_end = np.array([term.coefficients for term in exponentials], dtype=complex)
        decays = self.rates[1:]
        factors = plain_factors(
            decays, at_end.reshape(-1, 1) * [self._parity, 1.0], powers.reshape(orders, terms)
        )
        return TermSum(decays=decays, factors=factors, others=())

    def _amplitudes(self, target: FloatArray) -> FloatArray:
        """Return the factors of the solutions that meet derivatives 0 to 5."""
        target = self._rows * target
        amplitudes: FloatArray = self._inverse @ target
        for _ in range(RESIDUAL_STEPS):
            amplitudes += self._inverse @ (target - self._matrix @ amplitudes)
        return amplitudes


@lru_cache(maxsize=SOLVERS_KEPT)
def boundary_solver(equation: bytes, half: float, parity: float) -> BoundarySolver:
    """
    Return the solver of an equation in normalised time.

    Parameters
    ----------
    equation
        The bytes of its coefficients a_0 ... a_6 in physical time.
    half
        Half of the duration [s].
    parity
        1 for the even solutions, -1 for the odd ones.

    """
    return BoundarySolver(_clusters(equation, half), parity)


@lru_cache(maxsize=SOLVERS_KEPT)
def _clusters(equation: bytes, half: float) -> Sequence[Cluster]:
    """Return the clusters of its roots, which both parities share."""
    return known_spectrum(equation).clusters(half)
