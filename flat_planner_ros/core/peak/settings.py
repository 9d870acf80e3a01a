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

"""What a motion of least peak effort is free to do."""

from dataclasses import dataclass, field, replace
from math import inf, isfinite

from flat_planner_ros.core.arm import InvalidRequest
from flat_planner_ros.core.insensitive import UncertaintyBox

MIN_INTERVALS = 16
"""Fewest spline intervals of an effort: conditions and steps at both ends leave it room."""

MAX_INTERVALS = 256
"""Most of them: the time is then within 0.3 % of that of any effort, and hardly falls further."""


@dataclass(frozen=True, kw_only=True)
class PeakSettings:
    """
    How steep and how robust the effort of least peak is, and how fast the joint may turn.

    Attributes
    ----------
    intervals
        Of the quadratic spline that the effort follows. The effort goes from one peak to the
        other within one or two of them: more come nearer to the least time, and are steeper.
    effort_rate
        Largest rate of the effort [N m/s], of a servo's acceleration [rad/s^3]; 0 for what the
        intervals allow.
    velocity
        Largest velocity of link n-1 in absolute angle [rad/s]; it has three phases where a long
        motion reaches it.
    insensitive
        Whether small errors of the stiffness and the damping shall leave next to nothing, to
        first order; from a start in motion those of the stiffness.
    max_residual
        Residual that may be left on any arm of the box [rad]; 0 for whatever is left.
    box
        What may differ from the model.

    """

    intervals: int = 48
    effort_rate: float = 0.0
    velocity: float = inf
    insensitive: bool = False
    max_residual: float = 0.0
    box: UncertaintyBox = field(default_factory=UncertaintyBox)

    def __post_init__(self) -> None:
        """Refuse what no motion could obey."""
        if not MIN_INTERVALS <= self.intervals <= MAX_INTERVALS:
            raise InvalidRequest(
                f'peak.intervals must be in [{MIN_INTERVALS}, {MAX_INTERVALS}], got '
                f'{self.intervals}'
            )
        if not (isfinite(self.effort_rate) and self.effort_rate >= 0.0):
            raise InvalidRequest(f'peak.effort_rate must be 0 or more, got {self.effort_rate:g}')
        if not (isfinite(self.max_residual) and self.max_residual >= 0.0):
            raise InvalidRequest(f'peak.max_residual must be 0 or more, got {self.max_residual:g}')
        if not self.velocity > 0.0:
            raise InvalidRequest(f'the largest velocity must be above 0, got {self.velocity:g}')

    @property
    def is_homogeneous(self) -> bool:
        """Whether the motion over any distance is the one over 1 rad, scaled."""
        return self.effort_rate == 0.0 and self.velocity == inf and self.max_residual == 0.0

    @property
    def unbounded(self) -> 'PeakSettings':
        """Return the same without bounds on more than the peak."""
        return replace(self, effort_rate=0.0, velocity=inf, max_residual=0.0)
