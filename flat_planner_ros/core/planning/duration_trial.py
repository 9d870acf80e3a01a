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

"""Trials of a search for the shortest duration: what is known of a duration that was tried."""

from dataclasses import dataclass
from math import exp, inf, log

from flat_planner_ros.core.planning.certified_plan import Plan
from flat_planner_ros.core.planning.extrema import Quantity
from flat_planner_ros.core.planning.limits import JointLimits, LimitUse

HOPELESS = 100.0
"""Use of a limit of velocity or effort beyond which no shorter duration is tried [-]."""

LOG_MAX = 700.0
"""Logarithm of a duration that is still in double precision."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Trial:
    """
    A duration that was tried.

    Attributes
    ----------
    duration
        What was tried [s].
    plan
        Motion of that duration; None where there is no certified one.
    worst
        The limit of which that uses most; None where nothing is known.
    ratio
        Use of that limit [-].
    estimate
        Duration at which all limits would just be obeyed if peaks were powers of it [s].
    is_sampled
        Whether the use is that at some times only, at most the true one.
    is_sharp
        Whether it is close to the true one: the times of the peaks are known.

    """

    duration: float
    plan: Plan | None
    worst: LimitUse | None
    ratio: float
    estimate: float
    is_sampled: bool = False
    is_sharp: bool = True

    @property
    def obeys(self) -> bool:
        """Tell whether the motion obeys all limits."""
        return self.ratio <= 1.0 and not self.is_sampled

    @property
    def starts_in_motion(self) -> bool:
        """Tell whether the motion starts in motion."""
        return self.plan is not None and self.plan.request.start_jets is not None

    @property
    def is_hopeless(self) -> bool:
        """Tell whether nothing faster will obey: from rest it moves as far in less time."""
        if self.plan is None or self.worst is None or self.worst.quantity is Quantity.POSITION:
            return False
        return not self.starts_in_motion and self.ratio > HOPELESS

    def least_duration(self, limits: JointLimits) -> float:
        """Return the time below which the way from rest is too far for a joint's velocity [s]."""
        if self.plan is None or self.starts_in_motion:
            return 0.0
        request = self.plan.request
        return limits.least_duration(request.final - request.start)


def duration_of(trial: Trial) -> float:
    """Return the duration of a trial [s]."""
    return trial.duration


def root_of(first: Trial, second: Trial) -> float:
    """Return the logarithm of the duration at which a line through two trials is at the limit."""
    rise = log(second.ratio) - log(first.ratio)
    if rise == 0.0:
        return inf
    start = log(first.duration)
    return start - log(first.ratio) / rise * (log(second.duration) - start)


def line_root(first: Trial, second: Trial) -> float:
    """Return the same as a duration, that of the second trial where there is no line [s]."""
    if first is second or not 0.0 < first.ratio * second.ratio < inf:
        return second.duration
    root = root_of(first, second)
    return exp(root) if root < LOG_MAX else inf
