"""What is asked of the planner: a motion from rest to rest, and what it minimises."""

from dataclasses import dataclass
from math import isfinite

from flat_planner_ros.core.cost import Strategy
from flat_planner_ros.core.errors import InvalidRequest
from flat_planner_ros.core.flatness import FlatModel
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


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

    def __post_init__(self) -> None:
        """Lock a copy of the matrix."""
        if self.custom is not None:
            custom = np.array(self.custom, dtype=float)
            custom.setflags(write=False)
            object.__setattr__(self, 'custom', custom)
