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

"""How insensitive a motion shall be: what is uncertain, and effort against the residual."""

from dataclasses import dataclass, field
from enum import Enum
from math import isfinite
from typing import NamedTuple

from flat_planner_ros.core.arm import InvalidRequest

MAX_HALF_WIDTH = 0.9
"""Widest uncertainty of a parameter, as a share of its nominal value [-]."""

MAX_PAYLOAD = 100.0
"""Largest payload, as a share of the last link's inertia [-]."""

DEFAULT_WEIGHT = 700.0
"""Weight where nothing is chosen: a residual of 1/700 of the way costs as much as all effort."""

MAX_INSENSITIVITY = 1e5
"""Largest weight: beyond, the effort is that of the smallest residual anyway."""

MIN_MODES, MAX_MODES = 6, 48
"""Range of the number of free coefficients of the law."""


class Range(NamedTuple):
    """Smallest and largest factor on a nominal value [-]."""

    low: float
    high: float


@dataclass(frozen=True, kw_only=True)
class UncertaintyBox:
    """
    Range of the true stiffness, damping and inertia of the last link about the nominal ones.

    Attributes
    ----------
    stiffness, damping, inertia
        Half-widths as shares of the nominal values [-].
    payload
        What the last link may carry, from the least to the most, as shares of its nominal inertia
        about joint n; it adds to the inertia's half-width [-].

    """

    stiffness: float = 0.1
    damping: float = 0.1
    inertia: float = 0.0
    payload: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        """Refuse a box that reaches arms without a spring or a last link."""
        for name in ('stiffness', 'damping', 'inertia'):
            width = getattr(self, name)
            if not 0.0 <= width <= MAX_HALF_WIDTH:
                raise InvalidRequest(
                    f'half-width of the {name} is {width:g}, outside [0, {MAX_HALF_WIDTH:g}]'
                )
        least, most = self.payload
        if not (self.ranges[2].low >= 1.0 - MAX_HALF_WIDTH and least <= most <= MAX_PAYLOAD):
            raise InvalidRequest(
                f"payload from {least:g} to {most:g} of the last link's inertia, with a "
                f'half-width of {self.inertia:g}: the first must not exceed the second, nor this '
                f'{MAX_PAYLOAD:g}, and {1.0 - MAX_HALF_WIDTH:.2g} of the inertia must be left'
            )

    def __str__(self) -> str:
        """Return the box in words."""
        text = f'stiffness +-{100.0 * self.stiffness:g} %, damping +-{100.0 * self.damping:g} %'
        low, high = (100.0 * (factor - 1.0) for factor in self.ranges[2])
        if low == high == 0.0:
            return text
        return f'{text}, inertia of the last link {low:+.3g} to {high:+.3g} %'

    @property
    def ranges(self) -> tuple[Range, Range, Range]:
        """Factors on stiffness, damping and the last link's inertia."""
        least, most = self.payload
        return (
            Range(1.0 - self.stiffness, 1.0 + self.stiffness),
            Range(1.0 - self.damping, 1.0 + self.damping),
            Range(1.0 + least - self.inertia, 1.0 + most + self.inertia),
        )


class Nominal(Enum):
    """What a motion leaves on the planner's own model."""

    EXACT = 'exact'
    """Nothing."""

    FREE = 'free'
    """Up to as much as on the worst arm of the box, which takes less effort."""


class Criterion(Enum):
    """Which residual over the box is weighed against the effort."""

    WORST = 'worst'
    """The largest: a minimax problem, solved by reweighting."""

    MEAN = 'mean'
    """The root mean square: one linear system."""


@dataclass(frozen=True, kw_only=True)
class Insensitivity:
    """
    What the strategy `insensitive` minimises.

    At most one of `weight`, `max_effort_rms` and `max_residual` is above 0; with none of them the
    weight is `DEFAULT_WEIGHT`.

    Attributes
    ----------
    box
        What is uncertain.
    nominal
        What may be left on the nominal arm.
    criterion
        Largest or mean residual.
    weight
        A residual of distance / weight costs as much as the least effort of any motion [-].
    max_effort_rms
        Effort of joint n-1 that the motion may take; the residual is as small as that allows
        [N m].
    max_residual
        Residual over the box that the motion may leave; the effort is as small as that allows
        [rad].
    modes
        Number of free coefficients: more come nearer to the least effort, and make the effort
        steeper at both ends.

    """

    box: UncertaintyBox = field(default_factory=UncertaintyBox)
    nominal: Nominal = Nominal.EXACT
    criterion: Criterion = Criterion.WORST
    weight: float = 0.0
    max_effort_rms: float = 0.0
    max_residual: float = 0.0
    modes: int = 16

    def __post_init__(self) -> None:
        """Refuse what contradicts itself."""
        chosen = []
        for name in ('weight', 'max_effort_rms', 'max_residual'):
            value = getattr(self, name)
            if not (isfinite(value) and value >= 0.0):
                raise InvalidRequest(f'insensitivity.{name} must be 0 or more, got {value:g}')
            if value > 0.0:
                chosen.append(f'{name} = {value:g}')
        if len(chosen) > 1:
            raise InvalidRequest(
                f'insensitivity is chosen by one of weight, max_effort_rms and max_residual, got '
                f'{" and ".join(chosen)}: set the others to 0'
            )
        if self.weight > MAX_INSENSITIVITY:
            raise InvalidRequest(
                f'insensitivity.weight must be at most {MAX_INSENSITIVITY:g}, got {self.weight:g}'
            )
        if not MIN_MODES <= self.modes <= MAX_MODES:
            raise InvalidRequest(
                f'insensitivity.modes must be in [{MIN_MODES}, {MAX_MODES}], got {self.modes}'
            )

    @property
    def is_bounded(self) -> bool:
        """Whether effort or residual has a bound, from which the weight follows."""
        return self.max_effort_rms > 0.0 or self.max_residual > 0.0
