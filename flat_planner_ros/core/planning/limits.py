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

"""Limits of joints, and what of a plan goes beyond them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf

from flat_planner_ros.core.arm import FloatArray, InvalidRequest, locked
from flat_planner_ros.core.planning.certified_plan import Plan
from flat_planner_ros.core.planning.extrema import Extrema, extrema_of, Quantity
import numpy as np

ROUNDING = 1e-9
"""Excess that counts as rounding, relative to the limit; for positions also to 1 rad [-]."""

PEAK_OVER_MEAN = 693.0 / 256.0
"""Peak velocity of the polynomial law from rest to rest over its mean one [-]."""

FIELDS = ('position_min', 'position_max', 'velocity', 'effort')
"""Limits of a joint."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LimitUse:
    """
    How far a motion goes towards a limit, or beyond it.

    Attributes
    ----------
    joint
        Index of the joint in kinematic order, from 0.
    quantity
        What is limited.
    value, limit
        The extremum and what is allowed, both with their sign [rad, rad/s or N m].
    time
        From the start of the motion, when the value is attained [s].
    ratio
        How often the allowance is used up [-]: magnitude over limit; for positions, the excursion
        beyond both ends of the motion relative to the one that is allowed.

    """

    joint: int
    quantity: Quantity
    value: float
    limit: float
    time: float
    ratio: float

    @property
    def is_exceeded(self) -> bool:
        """Tell whether the motion goes beyond the limit."""
        return self.ratio > 1.0

    def sentence(self, name: str) -> str:
        """Return what happens to the joint of a name, with the numbers."""
        unit = self.quantity.unit
        return (
            f'the {self.quantity.value} of {name} reaches {self.value:.6g} {unit} at '
            f'{self.time:.4g} s, beyond the limit {self.limit:.6g} {unit}'
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class JointLimits:
    """
    What the joints may do; infinite where there is no limit.

    Attributes
    ----------
    position_min, position_max
        Range of each joint's angle, shape (n,) [rad].
    velocity
        Largest magnitude, above zero, shape (n,) [rad/s].
    effort
        Largest magnitude, zero or above, shape (n,) [N m].

    """

    position_min: FloatArray
    position_max: FloatArray
    velocity: FloatArray
    effort: FloatArray

    def __post_init__(self) -> None:
        """Refuse what no arm could obey, and lock copies."""
        for name in FIELDS:
            values = np.array(getattr(self, name), dtype=float)
            if values.ndim != 1 or np.isnan(values).any():
                raise InvalidRequest(f'limits.{name} must be a vector of numbers, got {values}')
            object.__setattr__(self, name, locked(values))
        sizes = {name: len(getattr(self, name)) for name in FIELDS}
        if len(set(sizes.values())) != 1:
            raise InvalidRequest(f'limits must be of the same joints, got {sizes}')
        limits = zip(*(getattr(self, name) for name in FIELDS), strict=True)
        for joint, (low, high, speed, effort) in enumerate(limits):
            if not (low <= high and low < inf and high > -inf):
                raise InvalidRequest(
                    f'joint {joint + 1} has no position within its limits: limits.position_min = '
                    f'{low:g} rad, limits.position_max = {high:g} rad'
                )
            if not speed > 0.0:
                raise InvalidRequest(
                    f'limits.velocity of joint {joint + 1} must be above 0, got {speed:g} rad/s'
                )
            if not effort >= 0.0:
                raise InvalidRequest(
                    f'limits.effort of joint {joint + 1} must not be negative, got {effort:g} N m'
                )

    @classmethod
    def of(cls, joints: int, **limits: FloatArray) -> 'JointLimits':
        """
        Return limits, none where not given.

        Parameters
        ----------
        joints
            Number of joints n.
        limits
            Any of the attributes, shape (n,).

        """
        unlimited = {name: np.full(joints, inf) for name in FIELDS}
        unlimited['position_min'] *= -1.0
        made = cls(**{**unlimited, **limits})
        if len(made.velocity) != joints:
            raise InvalidRequest(f'limits of {len(made.velocity)} joints for an arm of {joints}')
        return made

    def reaching(self, positions: FloatArray, tolerance: float) -> 'JointLimits':
        """
        Return these limits, widened so far that an arm just outside may move back inside.

        Parameters
        ----------
        positions
            Where it is, shape (n,) [rad].
        tolerance
            How far outside it may be [rad].

        """
        if Quantity.POSITION not in self.quantities:
            return self
        low, high = self.position_min, self.position_max
        if ((low <= positions) & (positions <= high)).all():
            return self
        near_low, near_high = positions >= low - tolerance, positions <= high + tolerance
        return replace(
            self,
            position_min=np.where(near_low, np.minimum(positions, low), low),
            position_max=np.where(near_high, np.maximum(positions, high), high),
        )

    @cached_property
    def quantities(self) -> tuple[Quantity, ...]:
        """Return what is limited at all."""
        finite = {
            Quantity.POSITION: np.isfinite(self.position_min) | np.isfinite(self.position_max),
            Quantity.VELOCITY: np.isfinite(self.velocity),
            Quantity.EFFORT: np.isfinite(self.effort),
        }
        return tuple(quantity for quantity, joints in finite.items() if joints.any())

    def least_duration(self, way: FloatArray) -> float:
        """
        Return the time below which a joint would have to be faster than it may [s].

        Parameters
        ----------
        way
            How far the joints go, shape (n,) [rad].

        """
        return float((np.abs(way) / self.velocity).max())

    def likely_duration(self, way: FloatArray) -> float:
        """Return the time in which the polynomial law just obeys the velocities [s]."""
        return PEAK_OVER_MEAN * self.least_duration(way)

    @property
    def bounds_duration(self) -> bool:
        """Tell whether anything keeps a motion from being arbitrarily short."""
        return bool(set(self.quantities) - {Quantity.POSITION})

    def pose_violation(self, positions: FloatArray) -> LimitUse | None:
        """Return the first joint whose angle in a pose at rest is not allowed, None if all are."""
        if Quantity.POSITION not in self.quantities:
            return None
        for joint, position in enumerate(positions.tolist()):
            low, high = float(self.position_min[joint]), float(self.position_max[joint])
            for limit, excess in ((low, low - position), (high, position - high)):
                if excess > ROUNDING * max(1.0, abs(limit)):
                    return LimitUse(
                        joint=joint,
                        quantity=Quantity.POSITION,
                        value=position,
                        limit=limit,
                        time=0.0,
                        ratio=inf,
                    )
        return None

    def worst(self, plan: Plan) -> LimitUse | None:
        """
        Return the limit of which a plan uses most at any time; None if none is finite.

        Unless it is exceeded, the plan obeys all limits.
        """
        return max(self.uses(plan), key=lambda use: use.ratio, default=None)

    def are_exceeded_by(self, plan: Plan) -> bool:
        """Tell whether a plan exceeds any limit at any time."""
        use = self.worst(plan)
        return use is not None and use.is_exceeded

    def at_ends(self, plan: Plan) -> LimitUse | None:
        """Return an effort beyond its limit at an end of a plan, which no duration changes."""
        for time in (0.0, plan.duration):
            efforts = plan.at(np.array([time])).efforts
            found = Extrema.of_samples(np.array([time]), efforts)
            for use in self._uses_of_magnitude(Quantity.EFFORT, found):
                if use.is_exceeded:
                    return use
        return None

    def uses(self, plan: Plan) -> list[LimitUse]:
        """Return how far a plan goes towards each finite limit, those within included."""
        quantities = self.quantities
        return self._uses(plan, extrema_of(plan, quantities)) if quantities else []

    def uses_at(self, plan: Plan, times: FloatArray) -> list[LimitUse]:
        """Return the same for some times [s] only: at most as much is used there."""
        samples = plan.at(times)
        found = [Extrema.of_samples(times, each.of(samples)) for each in self.quantities]
        return self._uses(plan, found)

    def _uses(self, plan: Plan, extrema: Sequence[Extrema]) -> list[LimitUse]:
        """Return the use of each finite limit, given the extrema of the limited quantities."""
        uses: list[LimitUse] = []
        for quantity, found in zip(self.quantities, extrema, strict=True):
            if quantity is Quantity.POSITION:
                uses += self._uses_of_position(plan, found)
            else:
                uses += self._uses_of_magnitude(quantity, found)
        return uses

    def _uses_of_position(self, plan: Plan, found: Extrema) -> list[LimitUse]:
        """Return how far positions go."""
        ends = plan.at(np.array([0.0, plan.request.duration])).positions
        uses = []
        for sign, limits, reached, base, times in (
            (-1.0, self.position_min, found.lowest, ends.min(axis=0), found.lowest_at),
            (1.0, self.position_max, found.highest, ends.max(axis=0), found.highest_at),
        ):
            for joint in np.flatnonzero(np.isfinite(limits)).tolist():
                limit, value = float(limits[joint]), float(reached[joint])
                slack = ROUNDING * max(1.0, abs(limit))
                allowed = sign * (limit - float(base[joint])) + slack
                excursion = max(0.0, sign * (value - float(base[joint])))
                uses.append(
                    LimitUse(
                        joint=joint,
                        quantity=Quantity.POSITION,
                        value=value,
                        limit=limit,
                        time=float(times[joint]),
                        ratio=excursion / allowed if allowed > 0.0 else inf,
                    )
                )
        return uses

    def _uses_of_magnitude(self, quantity: Quantity, found: Extrema) -> list[LimitUse]:
        """Return how far velocities or efforts go."""
        limits = self.velocity if quantity is Quantity.VELOCITY else self.effort
        uses = []
        for joint in np.flatnonzero(np.isfinite(limits)).tolist():
            low, high = float(found.lowest[joint]), float(found.highest[joint])
            is_low = -low > high
            value, times = (low, found.lowest_at) if is_low else (high, found.highest_at)
            limit = float(limits[joint])
            allowed = limit * (1.0 + ROUNDING)
            uses.append(
                LimitUse(
                    joint=joint,
                    quantity=quantity,
                    value=value,
                    limit=-limit if is_low else limit,
                    time=float(times[joint]),
                    ratio=abs(value) / allowed if allowed else (inf if value else 0.0),
                )
            )
        return uses
