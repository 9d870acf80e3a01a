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

"""Time for a motion: as prescribed if the limits allow it, else refused, stretched or found."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum

from flat_planner_ros.core.arm import FloatArray, PlanarArm
from flat_planner_ros.core.planning.certified_plan import Plan
from flat_planner_ros.core.planning.extrema import Quantity
from flat_planner_ros.core.planning.limits import JointLimits, LimitUse
from flat_planner_ros.core.planning.planner import plan
from flat_planner_ros.core.planning.request import (
    MotionRequest,
    PlanningOptions,
    Reason,
    RequestRejected,
)
from flat_planner_ros.core.planning.shortest_duration import (
    IsOver,
    NoFeasibleDuration,
    shortest_plan,
)
from flat_planner_ros.core.planning.strategies import shortest_known

REASONS = {
    Quantity.POSITION: Reason.POSITION_LIMIT,
    Quantity.VELOCITY: Reason.VELOCITY_LIMIT,
    Quantity.EFFORT: Reason.EFFORT_LIMIT,
}
"""Why a request is rejected that exceeds a limit."""


class OnViolation(Enum):
    """What becomes of a motion whose prescribed duration is too short for the limits."""

    REJECT = 'reject'
    """Refused, with the shortest duration that is not."""

    SCALE = 'scale'
    """Stretched to that duration."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DurationRules:
    """
    Rules for durations.

    Attributes
    ----------
    joints
        Names in kinematic order.
    limits
        What the joints may do.
    on_violation
        What becomes of a prescribed duration that is too short.
    shortest, longest
        Range of durations [s].
    factor
        Duration of a motion without one, relative to the shortest, at least 1 [-].

    """

    joints: Sequence[str]
    limits: JointLimits
    on_violation: OnViolation
    shortest: float
    longest: float
    factor: float = 1.0

    def check_pose(self, which: str, positions: FloatArray) -> None:
        """
        Refuse a pose outside the position limits.

        Parameters
        ----------
        which
            Its name in the sentence.
        positions
            Angles at rest, shape (n,) [rad].

        """
        use = self.limits.pose_violation(positions)
        if use is None:
            return
        name = self.joints[use.joint]
        raise RequestRejected(
            Reason.POSITION_LIMIT,
            f'{which} position {use.value:.6g} rad of {name} is beyond its limit '
            f'{use.limit:.6g} rad',
            joint=name,
            value=use.value,
            limit=use.limit,
        )

    def plan_within(
        self,
        request: MotionRequest,
        arm: PlanarArm,
        options: PlanningOptions,
        *,
        is_prescribed: bool,
        first: float | None = None,
        is_over: IsOver | None = None,
    ) -> tuple[Plan, LimitUse | None]:
        """
        Return the plan of a motion within the limits, and what stretched it.

        Parameters
        ----------
        request, arm, options
            The motion, as for `plan`.
        is_prescribed
            Whether the request's duration is what is wanted; else `factor` times the shortest that
            obeys the limits is.
        first
            Where the search for the shortest starts [s], if something is known of it.
        is_over
            Tells when the search has to be content with a duration that obeys; None for never.
            A refusal has the shortest one all the same.

        Returns
        -------
        tuple[Plan, LimitUse | None]
            The plan obeys all limits. If it takes longer than prescribed, the limit that the
            prescribed duration would have exceeded; else None.

        Raises
        ------
        RequestRejected
            No duration obeys the limits, or the prescribed one does not.
        FlatPlannerError
            There is no plan of the prescribed duration, or of any.

        """

        def plan_of(time: float) -> Plan:
            return plan(request.stretched(time), arm, options)

        # Joint n-1 alone has an effort that a strategy may know how to bring to its limit.
        limit = float(self.limits.effort[-2])
        if not is_prescribed:
            bound = shortest_known(request, arm, options, limit)
            likely = first or self._likely(request)
            found = self._shortest(
                plan_of, self.shortest, bound=bound, first=likely, is_over=is_over
            )
            return self._gentle(plan_of, found), None
        prescribed = plan(request, arm, options)
        use = self.limits.worst(prescribed)
        if use is None or not use.is_exceeded:
            return prescribed, None
        scales = self.on_violation is OnViolation.SCALE
        # To stretch is to take longer, even if something shorter obeys as well.
        shortest = request.duration if scales else self.shortest
        bound = shortest_known(request, arm, options, limit)
        is_over = is_over if scales else None
        found = self._shortest(
            plan_of, shortest, use, bound, first=request.duration, is_over=is_over
        )
        if scales:
            return found, use
        remedy = f'the shortest feasible duration is {found.duration:.9g} s'
        raise self._rejection(use, f'{self._sentence(use)}; {remedy}', found.duration)

    def shortest_of(
        self,
        plan_of: Callable[[float], Plan],
        *,
        most: int,
        first: float | None = None,
        is_over: IsOver | None = None,
    ) -> Plan:
        """
        Return the shortest plan that obeys the limits.

        Parameters
        ----------
        plan_of
            Plan of a duration [s].
        most
            Durations that are tried, about.
        first, is_over
            As for `plan_within`.

        Raises
        ------
        RequestRejected
            None of them obeys.

        """
        return self._shortest(plan_of, self.shortest, most=most, first=first, is_over=is_over)

    def _gentle(self, plan_of: Callable[[float], Plan], shortest: Plan) -> Plan:
        """Return the plan that takes `factor` times the shortest, unless a limit forbids that."""
        duration = min(self.factor * shortest.duration, self.longest)
        if duration <= shortest.duration:
            return shortest
        slower = plan_of(duration)
        return shortest if self.limits.are_exceeded_by(slower) else slower

    def _likely(self, request: MotionRequest) -> float | None:
        """Return where the search for the shortest duration may start [s], None if unknown."""
        if request.start_jets is not None:
            return None
        return self.limits.likely_duration(request.final - request.start) or None

    def _shortest(
        self,
        plan_of: Callable[[float], Plan],
        shortest: float,
        exceeded: LimitUse | None = None,
        bound: float | None = None,
        first: float | None = None,
        most: int | None = None,
        is_over: IsOver | None = None,
    ) -> Plan:
        """Return the shortest plan, or reject by what a prescribed one, or the best, exceeds."""
        try:
            return shortest_plan(
                plan_of,
                self.limits,
                shortest=shortest,
                longest=self.longest,
                bound=bound,
                first=first,
                most=most,
                is_over=is_over,
            )
        except NoFeasibleDuration as error:
            if error.at_end:
                where = 'at the start' if error.use.time == 0.0 else 'at rest in the final pose'
                name = self.joints[error.use.joint]
                why = (
                    f'the effort of {name} {where} is {error.use.value:.6g} N m at any duration, '
                    f'beyond the limit {error.use.limit:.6g} N m'
                )
                raise self._rejection(error.use, why) from error
            if is_over is not None and is_over():
                raise RequestRejected(
                    Reason.BUSY,
                    f'no duration within the limits was found in the time until the start: with '
                    f'{error.duration:.4g} s, {self._sentence(error.use)}',
                ) from error
            why = '' if exceeded is None else f'{self._sentence(exceeded)}; '
            why += (
                f'no duration from {shortest:g} to {self.longest:g} s obeys the limits: with the '
                f'best, {error.duration:.4g} s, {self._sentence(error.use)}'
            )
            raise self._rejection(exceeded or error.use, why) from error

    def _sentence(self, use: LimitUse) -> str:
        """Return what happens to a joint."""
        return use.sentence(self.joints[use.joint])

    def _rejection(
        self, use: LimitUse, message: str, duration_min: float | None = None
    ) -> RequestRejected:
        """Return the refusal of a motion for a limit that it exceeds."""
        return RequestRejected(
            REASONS[use.quantity],
            message,
            joint=self.joints[use.joint],
            value=use.value,
            limit=use.limit,
            time=use.time,
            duration_min=duration_min,
        )
