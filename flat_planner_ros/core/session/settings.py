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

"""Settings of a planning session: the arm, what is minimised, and what is accepted."""

from dataclasses import dataclass
from enum import Enum
from functools import cache

from flat_planner_ros.core.arm import FloatArray, InvalidRequest, PlanarArm
from flat_planner_ros.core.planning import (
    DurationRules,
    JointLimits,
    OnViolation,
    PlanningOptions,
    Reason,
    RequestRejected,
)
import numpy as np

LONGEST_FOUND = 3600.0
"""Longest duration that is looked for where the settings name none [s]."""


class StartSource(Enum):
    """Where the start of a motion is taken from."""

    AUTO = 'auto'
    """The measured state, unless another motion is under way or waits for its start."""

    MEASURED = 'measured'
    """The measured state of the actuated joints, the passive one relaxed."""

    REFERENCE = 'reference'
    """The end of the last motion, checked against a measured state if there is one."""

    PARAMETER = 'parameter'
    """A given position, checked against a measured state if there is one."""


class WhenMoving(Enum):
    """What becomes of a goal while the arm moves though nothing is planned."""

    CATCH = 'catch'
    """Its motion starts in motion: from the measured state, as it will be then."""

    REFUSE = 'refuse'
    """It is refused."""


class ReplanFrom(Enum):
    """Where a motion starts that takes over from another."""

    REFERENCE = 'reference'
    """Where the arm is planned to be."""

    MEASURED = 'measured'
    """Where it will be by what is measured."""


class SettlePose(Enum):
    """Where an arm in motion is brought to rest."""

    HERE = 'here'
    """Where it would swing out."""

    LAST_GOAL = 'last_goal'
    """In the pose of the last goal."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SessionSettings:
    """
    Everything a session needs to know; may be replaced between goals.

    Attributes
    ----------
    joints
        Names in kinematic order, the passive one last.
    arm, options
        Nominal model and what is minimised.
    built
        The arm as it is built, nearly balanced; None for the nominal one.
    period
        Spacing of a motion's samples [s].
    default_duration
        Duration of goals without times [s]; 0 for the shortest within the limits.
    duration_factor
        Duration of a goal that leaves it open, relative to the shortest within the limits, at
        least 1 [-].
    min_duration, max_duration
        Range of durations that are accepted [s].
    limits
        What the joints may do; None where nothing is limited.
    on_violation
        What becomes of durations that are too short for them.
    start_source
        Where motions start.
    start_position
        Start for the source `parameter`, shape (n,) [rad].
    position_tolerance, velocity_tolerance
        Largest deviation of a measured start from rest at the planned one [rad, rad/s].
    joint_state_timeout
        Age from which a measured state is stale [s].
    start_wait
        Time that a goal may wait for the first measured state [s]; 0 for none.
    when_moving
        What becomes of goals while the arm moves though nothing is planned.
    far_ahead
        Time to its start from which a goal's stamp looks as if it came by another clock [s].
    start_delay
        From accepting a goal without a stamp to its start, at rest [s]; 0 for as long as commands
        need, judged by the age of joint states on arrival. The lookahead then is not shorter.
    lookahead
        From accepting a goal to its start while the arm moves, or another motion waits [s].
    replan_from
        Where a motion starts that takes over from another.
    settle_pose
        Where `settle` brings the arm to rest.
    replan_tolerance
        Largest distance of a measured actuated joint from what was planned for that time at which
        another motion may take over [rad]; 0 for any.
    finish_tolerance
        Distance of every actuated joint from the end of a motion within which it is there [rad];
        0 for any: ends are said by the plan alone.
    finish_patience
        Time that the arm may take to be there at rest [s].
    is_stamped
        Whether the executor plays a command at its stamp; if it plays on arrival, no motion can
        take over from another.
    execute
        Whether motions are carried out; if not, none keeps the session busy.
    awaits_answer
        Whether the controller says itself how a command has ended, which belongs to the end.

    """

    joints: tuple[str, ...]
    arm: PlanarArm
    options: PlanningOptions
    built: PlanarArm | None = None
    period: float = 0.005
    default_duration: float = 0.0
    duration_factor: float = 1.0
    min_duration: float = 0.05
    max_duration: float = 600.0
    limits: JointLimits | None = None
    on_violation: OnViolation = OnViolation.REJECT
    start_source: StartSource = StartSource.AUTO
    start_position: tuple[float, ...] = ()
    position_tolerance: float = 0.01
    velocity_tolerance: float = 0.1
    joint_state_timeout: float = 0.5
    start_wait: float = 2.0
    when_moving: WhenMoving = WhenMoving.CATCH
    far_ahead: float = 60.0
    start_delay: float = 0.05
    lookahead: float = 0.1
    replan_from: ReplanFrom = ReplanFrom.REFERENCE
    settle_pose: SettlePose = SettlePose.HERE
    replan_tolerance: float = 0.5
    finish_tolerance: float = 0.1
    finish_patience: float = 1.0
    is_stamped: bool = True
    execute: bool = True
    awaits_answer: bool = False

    def __post_init__(self) -> None:
        """Refuse settings that contradict each other."""
        if len(self.joints) != self.arm.n:
            raise InvalidRequest(
                f'{len(self.joints)} joint names for an arm of {self.arm.n} joints'
            )
        if len(set(self.joints)) != len(self.joints):
            raise InvalidRequest(f'joint names must differ, got {", ".join(self.joints)}')
        if self.max_duration < self.min_duration:
            raise InvalidRequest(
                f'duration.max = {self.max_duration:g} s is below duration.min = '
                f'{self.min_duration:g} s'
            )
        if self.limits is not None and len(self.limits.velocity) != self.arm.n:
            raise InvalidRequest(
                f'limits of {len(self.limits.velocity)} joints for an arm of {self.arm.n} joints'
            )
        if self.start_source is StartSource.PARAMETER:
            if len(self.start_position) != self.arm.n:
                raise InvalidRequest(
                    f'start.position needs {self.arm.n} angles, got {len(self.start_position)}'
                )
            if self.start_position[-1] != 0.0:
                raise InvalidRequest(
                    f'start.position of the passive joint must be 0 rad, got '
                    f'{self.start_position[-1]:g} rad'
                )

    def checked_duration(self, prescribed: float | None) -> float | None:
        """
        Return the duration of a goal, within its range; None for an automatic one.

        Parameters
        ----------
        prescribed
            By the goal [s]; None where it leaves the choice to the planner.

        Raises
        ------
        RequestRejected
            It is outside the range, or nothing makes one the shortest.

        """
        duration = self.default_duration if prescribed is None else prescribed
        if duration == 0.0:
            if self.limits is None or not self.limits.bounds_duration:
                raise RequestRejected(
                    Reason.DURATION_OUT_OF_RANGE,
                    'the goal prescribes no duration, and no limit of a velocity or an effort '
                    'makes one the shortest: set time_from_start in the goal, or one of the '
                    'parameters duration.default, limits.velocity and limits.effort',
                )
            return None
        if not self.min_duration <= duration <= self.max_duration:
            below = duration < self.min_duration
            limit = self.min_duration if below else self.max_duration
            raise RequestRejected(
                Reason.DURATION_OUT_OF_RANGE,
                f'duration {duration:g} s is {"below" if below else "above"} duration.'
                f'{"min" if below else "max"} = {limit:g} s',
                value=duration,
                limit=limit,
            )
        return duration

    def duration_rules(self, start: FloatArray) -> DurationRules:
        """
        Return the rules for the duration of a motion.

        Parameters
        ----------
        start
            Pose that it starts from, shape (n,) [rad].

        """
        limits = self.limits
        if limits is not None:
            limits = limits.reaching(start, self.position_tolerance)
        return DurationRules(
            joints=self.joints,
            limits=limits or _no_limits(self.arm.n),
            on_violation=self.on_violation,
            # A motion shorter than the spacing of its samples would be none.
            shortest=max(self.min_duration, self.period),
            longest=min(self.max_duration, LONGEST_FOUND),
            factor=self.duration_factor,
        )

    def has_position_limits(self, joint: int) -> bool:
        """Tell whether the angle of a joint, counted from 0, has a limit on both sides."""
        limits = self.limits
        return limits is not None and bool(
            np.isfinite([limits.position_min[joint], limits.position_max[joint]]).all()
        )


@cache
def _no_limits(joints: int) -> JointLimits:
    """Return the limits of joints that have none."""
    return JointLimits.of(joints)
