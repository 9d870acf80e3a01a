"""Plan: a goal turned into a certified motion law, joint motion and feed-forward effort."""

from dataclasses import dataclass
from functools import cached_property
from math import ceil, isfinite, log2

from flat_planner_ros.core.arm import PlanarArm
from flat_planner_ros.core.cost import QuadraticCost, Strategy, strategy_cost
from flat_planner_ros.core.errors import InvalidRequest, UncertifiedPlan
from flat_planner_ros.core.extremal import (
    CONDITIONS,
    conserved_momentum,
    euler_lagrange_residual,
    extremal,
    Jets,
)
from flat_planner_ros.core.flatness import apply_row, flat_map, FlatMap, FlatModel
from flat_planner_ros.core.motion_law import MotionLaw
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

BOUNDARY_TOLERANCE = 1e-9
"""Largest miss of an accepted law at its ends, relative to that derivative's peak [-]."""

OPTIMALITY_TOLERANCE = 1e-9
"""Largest Euler-Lagrange residual of an accepted law, relative to the sum of its terms [-]."""

JET_ORDER = 6
"""Highest derivative of the planned variable that joint motions and the flat plan need."""

PROBES = 17
"""Evenly spaced times at which a law is certified, besides those near its ends."""

PROBE_DEPTH = 36
"""Halvings of the distance to either end at which a law is certified."""

NODES_PER_PANEL = 16
"""Gauss-Legendre nodes on each panel of the quadrature of the effort."""

MIN_PANELS = 16
"""Panels of the quadrature over a motion whose law is slow throughout."""

RADIANS_PER_PANEL = 8.0
"""Most that a mode turns or decays on one panel; sixteen nodes then miss 1e-11 of its square."""

NEGLIGIBLE_DECAY = 18.0
"""Natural logarithm of the decay from which the square of a mode adds nothing to an integral."""

SPACING_TOLERANCE = 1e-9
"""Excess of a grid's spacing over the period that is forgiven as roundoff [-]."""

MAX_PANELS = 4096
"""Bound on the panels, reached by some thousand oscillations within one motion."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionRequest:
    """
    Motion from rest to rest.

    Attributes
    ----------
    start, final
        Joint angles at both ends, the elastic joint relaxed, shape (n,) [rad].
    duration
        Time to go from one to the other [s].

    """

    start: FloatArray
    final: FloatArray
    duration: float

    def __post_init__(self) -> None:
        """Refuse what no plan could answer."""
        for name in ('start', 'final'):
            angles = np.array(getattr(self, name), dtype=float)
            if angles.ndim != 1 or not np.isfinite(angles).all():
                raise InvalidRequest(f'{name} angles must be a finite vector, got {angles}')
            angles.setflags(write=False)
            object.__setattr__(self, name, angles)
        if len(self.start) != len(self.final):
            raise InvalidRequest(
                f'start has {len(self.start)} joints, final has {len(self.final)}'
            )
        if not (isfinite(self.duration) and self.duration > 0.0):
            raise InvalidRequest(f'duration must be positive and finite, got {self.duration} s')


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanningOptions:
    """
    What is minimised and how the arm's damping is modelled.

    Attributes
    ----------
    strategy
        Which cost.
    r, p
        Weights of effort and potential energy, as in `strategy_cost`.
    custom
        Q of the strategy `custom`, shape (6, 6).
    flat_model
        Treatment of the damping of the elastic joint.

    """

    strategy: Strategy = Strategy.POLYNOMIAL
    r: float = 150.0
    p: float = 17.0
    custom: FloatArray | None = None
    flat_model: FlatModel = FlatModel.APPROXIMATE


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanSamples:
    """
    A plan on a grid of times.

    Attributes
    ----------
    times
        From the start of the motion, shape (m,) [s].
    positions, velocities, accelerations
        Of all joints, shape (m, n) [rad, rad/s, rad/s^2].
    efforts
        Feed-forward, zero for the passive joint, shape (m, n) [N m].
    flat
        Derivatives 0 to 5 of every flat output, shape (n - 1, 6, m) [rad/s^k].

    """

    times: FloatArray
    positions: FloatArray
    velocities: FloatArray
    accelerations: FloatArray
    efforts: FloatArray
    flat: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Plan:
    """
    A motion from rest to rest and the proof of its quality.

    Attributes
    ----------
    request, options
        What was asked for.
    cost
        What was minimised.
    flat_map
        From the planned variable to the joints.
    law
        The planned variable w over time.
    boundary_residual
        Largest miss at the ends, relative to each derivative's peak [-].
    optimality_residual
        Largest Euler-Lagrange residual relative to its terms [-].
    cost_value
        Integral of Y^T Q Y over the motion.

    """

    request: MotionRequest
    options: PlanningOptions
    cost: QuadraticCost
    flat_map: FlatMap
    law: MotionLaw
    boundary_residual: float
    optimality_residual: float
    cost_value: float

    def sample(self, period: float) -> PlanSamples:
        """
        Return the plan on an even grid that contains both ends.

        Parameters
        ----------
        period
            Largest spacing [s].

        """
        intervals = max(1, ceil(self.request.duration / period - SPACING_TOLERANCE))
        return self.at(np.linspace(0.0, self.request.duration, intervals + 1))

    def at(self, times: FloatArray) -> PlanSamples:
        """
        Return the plan at given times.

        Parameters
        ----------
        times
            From the start of the motion, clipped to it, shape (m,) [s].

        """
        duration = self.request.duration
        jet = self.law.jet(np.clip(times, 0.0, duration), JET_ORDER)
        _pin_ends(jet, times, self.request)
        angle = np.array([apply_row(self.flat_map.output, jet, k) for k in range(CONDITIONS)])
        passive = np.array([apply_row(self.flat_map.deflection, jet, k) for k in range(3)])
        joints = np.stack([angle[:3] - passive, passive], axis=-1)
        effort = apply_row(self.flat_map.effort, jet)
        return PlanSamples(
            times=times,
            positions=joints[0],
            velocities=joints[1],
            accelerations=joints[2],
            efforts=np.stack([effort, np.zeros_like(effort)], axis=-1),
            flat=angle[None],
        )

    @cached_property
    def rms_effort(self) -> FloatArray:
        """Root mean square of every joint's effort over the motion, shape (n,) [N m]."""
        weights = self._quadrature[1]
        mean_square = weights @ self._fine.efforts**2 / self.request.duration
        rms: FloatArray = np.sqrt(mean_square)
        return rms

    @cached_property
    def peak_effort(self) -> FloatArray:
        """Largest magnitude of every joint's effort, shape (n,) [N m]."""
        peak: FloatArray = np.abs(self._fine.efforts).max(axis=0)
        return peak

    @cached_property
    def peak_velocity(self) -> FloatArray:
        """Largest magnitude of every joint's velocity, shape (n,) [rad/s]."""
        peak: FloatArray = np.abs(self._fine.velocities).max(axis=0)
        return peak

    @cached_property
    def _quadrature(self) -> tuple[FloatArray, FloatArray]:
        """Return nodes and weights that resolve the law's boundary layers and oscillations."""
        return _graded_quadrature(self.law)

    @cached_property
    def _fine(self) -> PlanSamples:
        """Return the plan at the nodes of the quadrature."""
        return self.at(self._quadrature[0])


def plan(request: MotionRequest, arm: PlanarArm, options: PlanningOptions) -> Plan:
    """
    Return the optimal motion from rest to rest.

    Parameters
    ----------
    request
        Where from, where to, how long.
    arm
        Nominal model; must be flat and have two joints.
    options
        Strategy, weights and flat model.

    Raises
    ------
    InvalidRequest
        The request does not fit the arm.
    InvalidCost
        The weights define no admissible cost.
    NotFlat
        The arm does not meet the flatness condition.
    UncertifiedPlan
        The law cannot be computed to the promised accuracy in double precision.

    """
    if arm.n != 2 or len(request.start) != arm.n:
        raise InvalidRequest(
            f'planning needs two joints, the arm has {arm.n} and the request {len(request.start)}'
        )
    for name, angles in (('start', request.start), ('final', request.final)):
        if angles[-1] != 0.0:
            raise InvalidRequest(f'{name} angle of the elastic joint is {angles[-1]:g} rad, not 0')
    mapping = flat_map(arm, options.flat_model)
    cost = strategy_cost(
        options.strategy, mapping, r=options.r, p=options.p, custom=options.custom
    )
    coefficients = cost.characteristic()
    rest = np.zeros(CONDITIONS - 1)
    jets = Jets(
        start=np.concatenate([[request.start.sum()], rest]),
        end=np.concatenate([[request.final.sum()], rest]),
    )
    law = extremal(coefficients, request.duration, jets)
    times = _probes(request.duration)
    boundary = _boundary_residual(law, jets, times)
    _certify('boundary residual', boundary, BOUNDARY_TOLERANCE)
    optimality = euler_lagrange_residual(coefficients, law, times)
    _certify('optimality residual', optimality, OPTIMALITY_TOLERANCE)
    momentum = conserved_momentum(coefficients, law, np.array([0.5 * request.duration]))
    distance = jets.end[0] - jets.start[0]
    return Plan(
        request=request,
        options=options,
        cost=cost,
        flat_map=mapping,
        law=law,
        boundary_residual=boundary,
        optimality_residual=optimality,
        cost_value=float(distance * momentum[0]),
    )


def _certify(quantity: str, residual: float, tolerance: float) -> None:
    """Refuse a residual above its tolerance, or none at all (NaN)."""
    if not residual <= tolerance:
        raise UncertifiedPlan(quantity, residual, tolerance)


def _probes(duration: float) -> FloatArray:
    """Return times that crowd towards both ends as fast as boundary layers can."""
    layers = 0.5 ** np.arange(1.0, PROBE_DEPTH + 1.0)
    inner = np.linspace(0.0, 1.0, PROBES)
    return duration * np.unique(np.concatenate([inner, layers, 1.0 - layers]))


def _boundary_residual(law: MotionLaw, jets: Jets, times: FloatArray) -> float:
    """Return the largest miss at the ends, relative to each derivative's peak over the times."""
    jet = law.jet(times, CONDITIONS - 1)
    jet[0] -= jets.start[0]
    expected = jets.end.copy()
    expected[0] -= jets.start[0]
    miss = np.maximum(np.abs(jet[:, 0]), np.abs(jet[:, -1] - expected))
    peak = np.abs(jet).max(axis=1)
    if not np.isfinite(peak).all():
        return float('inf')
    return float(np.max(np.divide(miss, peak, out=np.zeros_like(miss), where=peak > 0.0)))


def _pin_ends(jet: FloatArray, times: FloatArray, request: MotionRequest) -> None:
    """Set the certified ends to their exact values: an executor compares them with zero."""
    for reached, angles in (
        (times <= 0.0, request.start),
        (times >= request.duration, request.final),
    ):
        jet[:CONDITIONS, reached] = 0.0
        jet[0, reached] = angles.sum()


def _graded_quadrature(law: MotionLaw) -> tuple[FloatArray, FloatArray]:
    """Return Gauss-Legendre nodes [s] and weights [s] on panels as fine as the law needs."""
    rates = np.array([mode.rate for mode in law.modes])
    depth = ceil(log2(np.abs(rates).max() + 1.0)) + 2
    layers = 0.5 ** np.arange(1.0, depth + 1.0)
    inner = np.linspace(0.0, 1.0, MIN_PANELS + 1)
    edges = np.unique(np.concatenate([inner, layers, 1.0 - layers]))
    # A mode may oscillate many times within its layer: split panels that it still reaches.
    depths = 2.0 * np.minimum(edges[:-1], 1.0 - edges[1:])
    is_alive = np.outer(depths, np.abs(rates.real)) < NEGLIGIBLE_DECAY
    turns = 2.0 * np.diff(edges) * (is_alive * np.abs(rates)).max(axis=1)
    parts = 1.0 + np.floor(turns / RADIANS_PER_PANEL)
    counts = np.ceil(parts * min(1.0, MAX_PANELS / parts.sum())).astype(int)
    widths = np.repeat(np.diff(edges) / counts, counts)
    starts = np.cumsum(widths) - widths
    nodes, weights = np.polynomial.legendre.leggauss(NODES_PER_PANEL)
    times = starts[:, None] + widths[:, None] * 0.5 * (nodes + 1.0)
    scale = law.duration
    return scale * times.ravel(), scale * (0.5 * widths[:, None] * weights).ravel()
