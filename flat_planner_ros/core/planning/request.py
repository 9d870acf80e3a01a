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

"""What is asked of the planner, a motion that ends at rest; what it minimises; its refusal."""

from dataclasses import dataclass, field, KW_ONLY, replace
from enum import Enum
from functools import cached_property
from math import isfinite

from flat_planner_ros.core.arm import (
    checked_array,
    Drive,
    FlatMap,
    FlatModel,
    FlatPlannerError,
    FloatArray,
    InvalidRequest,
    locked,
    PlanarArm,
)
from flat_planner_ros.core.insensitive import Insensitivity
from flat_planner_ros.core.motion_law import (
    CONDITIONS,
    fixed_cost,
    QuadraticCost,
    Strategy,
    strategy_cost,
)
from flat_planner_ros.core.peak import PeakSettings
from flat_planner_ros.core.planning.cost_weights import (
    check_one_form,
    check_weight,
    MAX_RELATIVE_WEIGHT,
    MAX_WEIGHT,
    paper_weights,
    PaperWeights,
)
import numpy as np


@dataclass(frozen=True, kw_only=True, eq=False)
class ViaPoint:
    """
    Values that the flat outputs take on the way.

    Attributes
    ----------
    time
        From the start of the motion [s].
    values
        Flat outputs y1 ... y_(n-1), shape (n - 1,) [rad].

    """

    time: float
    values: FloatArray

    def __post_init__(self) -> None:
        """Refuse what is no place in a motion."""
        object.__setattr__(self, 'values', _angles('via', self.values))
        if not (isfinite(self.time) and self.time > 0.0):
            raise InvalidRequest(f'a via point needs a time above 0 s, got {self.time} s')


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionRequest:
    """
    Motion from rest, or from the midst of another motion, to rest.

    Attributes
    ----------
    start, final
        Joint angles at both ends, the passive joint relaxed, shape (n,) [rad].
    duration
        Time to go from one to the other [s].
    via
        Points to pass, in the order of time, before the end.
    start_jets
        Derivatives 0 to 5 of the planned variables at the start, where the arm moves already,
        shape (n - 1, 6) [rad/s^k]; they take the place of `start`. None for a start at rest.

    """

    start: FloatArray
    final: FloatArray
    duration: float
    via: tuple[ViaPoint, ...] = ()
    start_jets: FloatArray | None = None

    def __post_init__(self) -> None:
        """Refuse what no plan could answer."""
        for name in ('start', 'final'):
            object.__setattr__(self, name, _angles(name, getattr(self, name)))
        if len(self.start) != len(self.final):
            raise InvalidRequest(
                f'start has {len(self.start)} joints, final has {len(self.final)}'
            )
        if not (isfinite(self.duration) and self.duration > 0.0):
            raise InvalidRequest(f'duration must be positive and finite, got {self.duration} s')
        if self.via:
            self._check_via()
        if self.start_jets is not None:
            self._check_start_jets()

    def stretched(self, duration: float) -> 'MotionRequest':
        """
        Return the same motion in another time, each via point at the same share of it.

        The start keeps its derivatives: it is a state, not a part of the motion to be stretched.
        """
        if duration == self.duration:
            return self
        share = duration / self.duration
        via = tuple(ViaPoint(time=share * point.time, values=point.values) for point in self.via)
        return replace(self, duration=duration, via=via)

    def _check_via(self) -> None:
        """Refuse via points of another arm, or out of order."""
        previous = 0.0
        for index, point in enumerate(self.via):
            if len(point.values) != len(self.final) - 1:
                raise InvalidRequest(
                    f'via point {index} has {len(point.values)} values for '
                    f'{len(self.final) - 1} flat outputs'
                )
            if not previous < point.time < self.duration:
                raise InvalidRequest(
                    f'via point {index} at {point.time:g} s must lie after {previous:g} s and '
                    f'before the end at {self.duration:g} s'
                )
            previous = point.time

    def _check_start_jets(self) -> None:
        """Refuse jets that are not finite, or those of another arm, and lock a copy."""
        shape = (len(self.final) - 1, CONDITIONS)
        jets = checked_array(
            'start_jets', np.array(self.start_jets), 'rad/s^k', shape=shape, error=InvalidRequest
        )
        object.__setattr__(self, 'start_jets', jets)


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanningOptions:
    """
    What is minimised and how the arm is modelled.

    Attributes
    ----------
    strategy
        Which cost, or which law of its own.
    effort_weight, energy_weight
        Weights of effort and potential energy, relative to the arm's own oscillation [-]; None
        for those of the paper on its arm.
    r, p
        The same as the paper has them, which take their place, as in `strategy_cost`.
    custom
        Q of the strategy `custom`, shape (6, 6).
    flat_model
        Treatment of the damping of the passive joint.
    compensate_friction
        Whether the efforts include what the motors' friction takes, as the model has it.
    insensitivity
        Uncertainty of the model, and what the strategy `insensitive` makes of it.
    peak
        How steep, fast and robust the strategy `min_peak_effort` is.
    drive
        What moves joint n-1, on which depends what an arm other than the model does.

    """

    strategy: Strategy = Strategy.MIN_CONTROL_EFFORT
    effort_weight: float | None = None
    energy_weight: float | None = None
    r: float | None = None
    p: float | None = None
    custom: FloatArray | None = None
    flat_model: FlatModel = FlatModel.EXACT
    compensate_friction: bool = False
    insensitivity: Insensitivity = field(default_factory=Insensitivity)
    peak: PeakSettings = field(default_factory=PeakSettings)
    drive: Drive = Drive.EFFORT

    def __post_init__(self) -> None:
        """Refuse weights out of range or in two forms, and lock a copy of the matrix."""
        for name, relative, paper_name, own in (
            ('effort', self.effort_weight, 'r', self.r),
            ('energy', self.energy_weight, 'p', self.p),
        ):
            check_weight(name, relative, MAX_RELATIVE_WEIGHT)
            check_weight(paper_name, own, MAX_WEIGHT)
            check_one_form(name, relative, paper_name, own)
        if self.custom is not None:
            custom = np.array(self.custom, dtype=float)
            object.__setattr__(self, 'custom', locked(custom))

    def weights(self, arm: PlanarArm) -> PaperWeights:
        """Return r and p for a flat arm, whichever form the weights are given in."""
        return paper_weights(
            arm, effort=self.effort_weight, energy=self.energy_weight, r=self.r, p=self.p
        )

    def cost(self, arm: PlanarArm, mapping: FlatMap) -> QuadraticCost:
        """
        Return what is minimised for a flat arm and its flat map.

        Raises
        ------
        InvalidCost
            The weights define no admissible cost.

        """
        if not self.strategy.squares:
            return self._fixed_cost
        r, p = self.weights(arm)
        return strategy_cost(self.strategy, mapping, r=r, p=p)

    @cached_property
    def _fixed_cost(self) -> QuadraticCost:
        """Cost of a strategy that weighs nothing of an arm, checked once for all arms."""
        return fixed_cost(self.strategy, self.custom)


class Reason(Enum):
    """Why a request is rejected or fails; the names are those of the ROS interface."""

    INVALID_GOAL = 'INVALID_GOAL'
    INVALID_JOINTS = 'INVALID_JOINTS'
    OLD_HEADER_TIMESTAMP = 'OLD_HEADER_TIMESTAMP'
    EMPTY_GOAL = 'EMPTY_GOAL'
    NON_FINITE = 'NON_FINITE'
    SIZE_MISMATCH = 'SIZE_MISMATCH'
    TIME_NOT_INCREASING = 'TIME_NOT_INCREASING'
    NONZERO_END_STATE = 'NONZERO_END_STATE'
    PASSIVE_JOINT_NOT_ZERO = 'PASSIVE_JOINT_NOT_ZERO'
    EFFORT_NOT_ALLOWED = 'EFFORT_NOT_ALLOWED'
    POSITION_LIMIT = 'POSITION_LIMIT'
    VELOCITY_LIMIT = 'VELOCITY_LIMIT'
    EFFORT_LIMIT = 'EFFORT_LIMIT'
    DURATION_OUT_OF_RANGE = 'DURATION_OUT_OF_RANGE'
    START_STATE_UNKNOWN = 'START_STATE_UNKNOWN'
    START_STATE_STALE = 'START_STATE_STALE'
    START_STATE_MISMATCH = 'START_STATE_MISMATCH'
    NOT_AT_REST = 'NOT_AT_REST'
    CLOCK_JUMPED = 'CLOCK_JUMPED'
    CONTROLLER_FAILED = 'CONTROLLER_FAILED'
    SOLVER_FAILED = 'SOLVER_FAILED'
    ILL_CONDITIONED = 'ILL_CONDITIONED'
    BUSY = 'BUSY'
    PATH_TOLERANCE_VIOLATED = 'PATH_TOLERANCE_VIOLATED'
    GOAL_TOLERANCE_VIOLATED = 'GOAL_TOLERANCE_VIOLATED'
    INTERNAL = 'INTERNAL'


@dataclass(eq=False, repr=False)
class RequestRejected(FlatPlannerError):
    """
    A request that is answered with a refusal.

    Attributes
    ----------
    reason
        The rule that it breaks.
    message
        Sentence for people, with the numbers.
    joint
        The joint concerned, if one is.
    value, limit
        What was found and what is allowed, in SI units, where the rule has numbers.
    time
        Where in the motion [s], if it matters.
    duration_min
        Shortest duration that would be accepted, where that is the remedy [s].

    """

    reason: Reason
    message: str
    _: KW_ONLY
    joint: str | None = None
    value: float | None = None
    limit: float | None = None
    time: float | None = None
    duration_min: float | None = None

    def __post_init__(self) -> None:
        """Say the sentence as every exception does."""
        super().__init__(self.message)


def planned_at_rest(angles: FloatArray) -> tuple[float, ...]:
    """
    Return the planned variables, which are the flat outputs, of an arm at rest.

    Parameters
    ----------
    angles
        Angles of all joints, shape (n,) [rad].

    Returns
    -------
    tuple[float, ...]
        The last link's absolute angle and q_1 ... q_(n-2), n - 1 numbers [rad].

    """
    joints = angles.tolist()
    return (float(sum(joints)), *joints[:-2])


def _angles(name: str, values: FloatArray) -> FloatArray:
    """Return a locked copy of a finite vector."""
    angles = np.array(values, dtype=float)
    if angles.ndim != 1 or not all(map(isfinite, angles.tolist())):
        raise InvalidRequest(f'{name} angles must be a finite vector, got {angles}')
    return locked(angles)
