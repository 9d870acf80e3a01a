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
Optimal path: the motion law of least cost through given values at given times.

Between via points it solves the Euler-Lagrange equation; at a via point everything is continuous
but the costate of the prescribed value (docs/derivation.md, section V).
"""

from dataclasses import dataclass
from functools import cache
from math import ceil, log2
from typing import NamedTuple

from flat_planner_ros.core.arm import checked_array, FloatArray, InvalidRequest, strict_arithmetic
from flat_planner_ros.core.motion_law.basis import CONDITIONS, SOLUTIONS
from flat_planner_ros.core.motion_law.continuity import Amplitudes, ContinuitySystem
from flat_planner_ros.core.motion_law.cost import QuadraticCost
from flat_planner_ros.core.motion_law.law import MAX_DERIVATIVE, PiecewiseLaw, SummedLaw
from flat_planner_ros.core.motion_law.segment_bases import segment_bases, SegmentBases
import numpy as np
from numpy.typing import NDArray

BoolArray = NDArray[np.bool_]

PROBES = 8
"""Even times at which each half of a segment is certified, besides those near its ends."""

MAX_DEPTH = 36
"""Most halvings of the distance to a segment's end at which it is certified."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PathConditions:
    """
    What a path goes through.

    Attributes
    ----------
    edges
        0, the times of the via points and the duration, strictly ascending, shape (p + 1,) [s].
    start
        Derivatives 0 to 5 of every planned variable at the start, shape (m, 6) [rad/s^k].
    values
        What every variable passes at the via points and, last, where it comes to rest, shape
        (m, p) [rad].
    relaxations
        At via points w + relaxation w' takes the value, for each variable, shape (m,) [s].

    """

    edges: FloatArray
    start: FloatArray
    values: FloatArray
    relaxations: FloatArray

    def __post_init__(self) -> None:
        """Refuse what no path could go through."""
        for name in ('edges', 'start', 'values', 'relaxations'):
            unit = 's' if name in ('edges', 'relaxations') else 'rad'
            array = checked_array(name, getattr(self, name), unit, error=InvalidRequest)
            object.__setattr__(self, name, array)
        variables, segments = self.values.shape
        shapes = self.edges.shape, self.start.shape, self.relaxations.shape
        if shapes != ((segments + 1,), (variables, CONDITIONS), (variables,)) or not segments:
            raise InvalidRequest(f'the shapes {shapes} do not fit values {self.values.shape}')
        if self.edges[0] != 0.0 or not (np.diff(self.edges) > 0.0).all():
            raise InvalidRequest(f'the times of a path must ascend from 0 s, got {self.edges}')


@dataclass(frozen=True, kw_only=True, eq=False)
class OptimalPath:
    """
    Laws of least cost and the proof of their quality.

    Attributes
    ----------
    laws
        One for each planned variable.
    cost_value
        Integral of Y^T Q Y over the motion, summed over the variables.
    time_slopes
        Derivatives of the cost with respect to the times of the via points, duration and values
        fixed ((V8) of docs/derivation.md), shape (p - 1,) [1/s].
    boundary_residual
        Largest miss of a prescribed derivative or value, jump of the derivatives 0 to 5, or last
        correction of a derivative, relative to that derivative's peak; at least the rounding of
        the times relative to the shortest segment [-].
    optimality_residual
        Largest residual of the Euler-Lagrange equation on a segment or of a natural condition,
        relative to its terms [-].

    """

    laws: tuple[PiecewiseLaw, ...]
    cost_value: float
    time_slopes: FloatArray
    boundary_residual: float
    optimality_residual: float


@strict_arithmetic()
def optimal_path(cost: QuadraticCost, path: PathConditions) -> OptimalPath:
    """
    Return the laws of least cost through a path, to be judged by their residuals.

    Raises
    ------
    UncertifiedPlan
        The conditions are singular in double precision.
    ArithmeticError
        The numbers leave double precision.

    """
    found = solved_path(cost, path)
    parts = [_certified(cost, path, found, variable) for variable in range(len(path.values))]
    # Times are rounded: a segment's length is known to this part of it, and slopes with it.
    rounding = float(np.finfo(float).eps * path.edges[-1] / (2.0 * found.halves.min()))
    return OptimalPath(
        laws=tuple(law for part in parts for law in part.laws),
        cost_value=sum(part.cost_value for part in parts),
        time_slopes=np.sum([part.time_slopes for part in parts], axis=0),
        boundary_residual=max(rounding, *(part.boundary_residual for part in parts)),
        optimality_residual=max(part.optimality_residual for part in parts),
    )


class PathSolution(NamedTuple):
    """
    Laws of least cost in terms of the solutions on every segment.

    Attributes
    ----------
    bases
        Solutions on all segments.
    halves
        Half the segments' lengths, shape (p,) [s].
    places
        Derivatives 0 to 11 of every solution at the start, in the middle and at the end of every
        segment, shape (3, p, 12, 12) [1/s^k].
    origins
        Value at the start of every segment, shape (m, p) [rad].
    steps
        Value at its end less that at its start, shape (m, p) [rad].
    amplitudes
        Of all solutions.
    systems
        The equations of each relaxation, and which variables have it, shape (m,).

    """

    bases: SegmentBases
    halves: FloatArray
    places: FloatArray
    origins: FloatArray
    steps: FloatArray
    amplitudes: Amplitudes
    systems: list[tuple[ContinuitySystem, BoolArray]]


def solved_path(cost: QuadraticCost, path: PathConditions) -> PathSolution:
    """Return the laws of least cost in terms of the solutions on every segment."""
    halves = 0.5 * np.diff(path.edges)
    unit = _unit(cost.characteristic())
    reference = cost.characteristic() * unit ** np.arange(SOLUTIONS, -1.0, -2.0)
    bases = segment_bases(reference, halves / unit)
    places = bases.places * (halves[:, None] ** -np.arange(float(SOLUTIONS)))[:, :, None]
    # Each segment counts from the value at its start: only steps enter the equations, and a short
    # segment far from zero loses no digits.
    origins = np.column_stack([path.start[:, 0], path.values[:, :-1]])
    steps = path.values - origins
    rates = bases.rates / halves[:, None]
    return PathSolution(
        bases, halves, places, origins, steps, *_amplitudes(places, rates, path, steps)
    )


def _certified(
    cost: QuadraticCost, path: PathConditions, found: PathSolution, variable: int
) -> OptimalPath:
    """Return one variable's law with its share of the cost and the residuals of its jets."""
    laws, jets = _laws(found, variable)
    coefficients = cost.characteristic()
    relaxation = float(path.relaxations[variable])
    peaks = _peaks(path.start[variable, 0], jets)
    if not peaks.max() < MAX_DERIVATIVE:
        raise OverflowError(f'derivatives exceed {MAX_DERIVATIVE:g}')
    # Constant along each segment: taken in its middle.
    costates = -jets[:, 1:-1:2, -1] @ coefficients[1:]
    ends = jets[:, :, :2].swapaxes(1, 2)  # (p, 2, 13)
    before = ends[:-1, 1]
    return OptimalPath(
        laws=(PiecewiseLaw(edges=path.edges, laws=laws),),
        cost_value=float(
            costates @ found.steps[variable]
            - share_of_start(cost, path.start[variable], jets[0, :, 0])
        ),
        time_slopes=2.0 * np.diff(costates) * (before[:, 1] + relaxation * before[:, 2]),
        boundary_residual=max(
            _relative(found.amplitudes.correction[:, variable], peaks[: CONDITIONS + 1]),
            _boundary_residual(path, variable, ends, peaks[:CONDITIONS]),
        ),
        optimality_residual=max(
            _natural_residual(relaxation, ends[1:, 0] - before, peaks),
            _stationarity_residual(coefficients, jets),
        ),
    )


def _unit(coefficients: FloatArray) -> float:
    """Return a unit of time, a power of two, in which the roots of an equation are of size 1."""
    sizes = np.abs(coefficients[-2::-1]).tolist()
    largest = max(size ** (0.5 / n) for n, size in enumerate(sizes, start=1))
    return 2.0 ** -round(log2(largest)) if largest else 1.0


def _amplitudes(
    places: FloatArray, rates: FloatArray, path: PathConditions, steps: FloatArray
) -> tuple[Amplitudes, list[tuple[ContinuitySystem, BoolArray]]]:
    """Return the amplitudes of all solutions; equal relaxations share one factorisation."""
    values = np.empty((len(rates), SOLUTIONS, len(steps)))
    correction = np.empty((CONDITIONS + 1, len(steps)))
    systems = []
    for relaxation in sorted(set(path.relaxations.tolist())):
        alike = path.relaxations == relaxation
        system = ContinuitySystem(places, rates, relaxation)
        found = system.solve(path.start[alike, 1:].T, steps[alike].T)
        values[:, :, alike] = found.values
        correction[:, alike] = found.correction
        systems.append((system, alike))
    return Amplitudes(values, correction), systems


def _laws(found: PathSolution, variable: int) -> tuple[tuple[SummedLaw, ...], FloatArray]:
    """
    Return one variable's laws, and derivatives 0 to 12 at both ends, at probes, in the middle.

    The probes crowd towards the ends as far as boundary layers can reach, shape (p, 13, m).
    """
    depth = min(MAX_DEPTH, ceil(log2(found.bases.rates[:, -1].max())) + 3)
    distances = _probes(depth)
    jets = np.empty((len(found.halves), SOLUTIONS + 1, distances.shape[1]))
    laws: dict[int, SummedLaw] = {}
    for group in found.bases.groups:
        sums = group.sums(found.amplitudes.values[group.segments, :, variable])
        jets[group.segments] = sums.at(distances)
        for index, total in zip(group.segments.tolist(), sums.singles(), strict=True):
            laws[index] = SummedLaw(
                duration=2.0 * float(found.halves[index]),
                total=total,
                offset=float(found.origins[variable, index]),
            )
    jets *= (found.halves[:, None] ** -np.arange(SOLUTIONS + 1.0))[:, :, None]
    jets[:, 0] += found.origins[variable, :, None]
    return tuple(laws[index] for index in range(len(laws))), jets


@cache
def _probes(depth: int) -> FloatArray:
    """Return x + 1 and 1 - x at both ends, at probes and in the middle, shape (2, m)."""
    near = _near(depth)
    after_start = np.concatenate([[0.0, 2.0], near, 2.0 - near, [1.0]])
    before_end = np.concatenate([[2.0, 0.0], 2.0 - near, near, [1.0]])
    return np.array([after_start, before_end])


@cache
def _near(depth: int) -> FloatArray:
    """Return normalised distances to an end within half a segment."""
    return np.union1d(0.5 ** np.arange(1.0, depth + 1.0), np.arange(1.0, PROBES) / PROBES)


def _boundary_residual(
    path: PathConditions, variable: int, ends: FloatArray, peaks: FloatArray
) -> float:
    """Return the largest miss of a prescribed quantity or jump up to the fifth derivative."""
    values = path.values[variable]
    rest = np.append(values[-1], np.zeros(CONDITIONS - 1))
    before = ends[:-1, 1]
    after = ends[1:, 0]
    misses = [ends[0, 0, :CONDITIONS] - path.start[variable], ends[-1, 1, :CONDITIONS] - rest]
    misses += list((after - before)[:, :CONDITIONS])
    missed = np.abs(misses).max(axis=0)
    for side in (before, after):
        passed = side[:, 0] + path.relaxations[variable] * side[:, 1] - values[:-1]
        missed[0] = max(missed[0], np.abs(passed).max(initial=0.0))
    return _relative(missed, peaks)


def _natural_residual(relaxation: float, jumps: FloatArray, peaks: FloatArray) -> float:
    """Return the largest jump at knots, (p - 1, 13), of what is continuous along the optimum."""
    largest = np.abs(jumps)[:, CONDITIONS : SOLUTIONS - 1].max(axis=0, initial=0.0)
    tied = jumps[:, SOLUTIONS - 2 : SOLUTIONS] @ [1.0, relaxation]
    largest[-1] = np.abs(tied).max(initial=0.0)
    sizes = peaks[CONDITIONS : SOLUTIONS - 1].copy()
    sizes[-1] += relaxation * peaks[SOLUTIONS - 1]
    return _relative(largest, sizes)


def _stationarity_residual(coefficients: FloatArray, jets: FloatArray) -> float:
    """Return the largest residual of the Euler-Lagrange equation on any segment, (p, 13, m)."""
    even = jets[:, 2::2]
    sizes = (np.abs(coefficients[1:]) @ np.abs(even)).max(axis=1)
    return _relative(np.abs(coefficients[1:] @ even).max(axis=1), sizes)


def _peaks(start: float, jets: FloatArray) -> FloatArray:
    """Return the largest magnitudes of all derivatives, the value's relative to the start."""
    highest, lowest = jets.max(axis=(0, 2)), jets.min(axis=(0, 2))
    highest[0] -= start
    lowest[0] -= start
    peaks: FloatArray = np.maximum(highest, -lowest)
    return peaks


def _relative(missed: FloatArray, sizes: FloatArray) -> float:
    """Return the largest miss relative to a size; where there is no motion none is expected."""
    return float((missed[missed > 0.0] / sizes[missed > 0.0]).max(initial=0.0))


def share_of_start(cost: QuadraticCost, start: FloatArray, jet: FloatArray) -> float:
    """
    Return what a moving start adds to the sum of costates times steps, with the opposite sign.

    Sum over i = 1 ... 5 of w^(i) times its costate (V2) of docs/derivation.md.

    Parameters
    ----------
    cost
        What is minimised.
    start
        Prescribed derivatives 0 to 5, shape (6,).
    jet
        Derivatives 0 to 10 of the law there, shape (11,) or more.

    """
    share = 0.0
    for i in np.flatnonzero(start[1:]).tolist():
        its_costate = sum(
            (-1.0) ** m * cost.matrix[i + 1 + m] @ jet[1 + m : 1 + m + CONDITIONS]
            for m in range(CONDITIONS - 1 - i)
        )
        share += its_costate * start[i + 1]
    return float(share)
