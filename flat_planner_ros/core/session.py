"""Session of a planner: goals and measurements in, motions out, in the order of time."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from math import inf

from flat_planner_ros.core.arm import PlanarArm
from flat_planner_ros.core.errors import InvalidRequest, UncertifiedPlan
from flat_planner_ros.core.goal import Goal, Reason, RequestRejected, rest_target
from flat_planner_ros.core.limits import JointLimits, LimitUse
from flat_planner_ros.core.motion_record import JointSample
from flat_planner_ros.core.planning import MotionRequest, Plan, plan, PlanningOptions, PlanSamples
from flat_planner_ros.core.timing import OnViolation, Timing
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


LONGEST_FOUND = 3600.0
"""Longest duration that is looked for where the settings name none [s]."""


class StartSource(Enum):
    """Where the start of a motion is taken from."""

    AUTO = 'auto'
    """The measured state, as long as no motion is spliced into a running one."""

    MEASURED = 'measured'
    """The measured state of the actuated joints, the elastic one relaxed."""

    REFERENCE = 'reference'
    """The end of the last motion, checked against a measured state if there is one."""

    PARAMETER = 'parameter'
    """A given position, checked against a measured state if there is one."""


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
    period
        Spacing of a motion's samples [s].
    default_duration
        Duration of goals without times [s]; 0 for the shortest within the limits.
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
    measurement_timeout
        Age from which a measurement is stale [s].
    start_delay
        From accepting a goal without a stamp to its start [s].
    execute
        Whether motions are carried out; if not, none keeps the session busy.

    """

    joints: tuple[str, ...]
    arm: PlanarArm
    options: PlanningOptions
    period: float = 0.005
    default_duration: float = 0.0
    min_duration: float = 0.0
    max_duration: float = inf
    limits: JointLimits | None = None
    on_violation: OnViolation = OnViolation.REJECT
    start_source: StartSource = StartSource.AUTO
    start_position: tuple[float, ...] = ()
    position_tolerance: float = 0.01
    velocity_tolerance: float = 0.1
    measurement_timeout: float = 0.5
    start_delay: float = 0.05
    execute: bool = True

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


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """
    A plan with its place in time.

    Attributes
    ----------
    plan_id
        Counts the accepted goals from 1.
    plan
        What is carried out.
    samples
        The plan on the command's grid.
    start
        Absolute time of its start [s].
    planned_at
        Absolute time at which it was accepted [s].
    duration_min
        Shortest duration within the limits, where it was looked for [s].
    exceeded
        What the prescribed duration would have exceeded, if the motion was stretched.

    """

    plan_id: int
    plan: Plan
    samples: PlanSamples
    start: float
    planned_at: float
    duration_min: float | None = None
    exceeded: LimitUse | None = None

    @property
    def end(self) -> float:
        """Return the absolute time of its end [s]."""
        return self.start + self.plan.request.duration

    def reference(self, now: float) -> PlanSamples:
        """Return what is planned at an absolute time, at rest before and after; one sample."""
        elapsed = min(max(now - self.start, 0.0), self.plan.request.duration)
        return self.plan.at(np.array([elapsed]))


class PlannerSession:
    """
    Answer goals with motions, one motion at a time.

    Parameters
    ----------
    settings
        Valid for the goals to come.

    """

    def __init__(self, settings: SessionSettings) -> None:
        """Start at rest, without a measurement."""
        self.settings = settings
        self._measured: JointSample | None = None
        self._motion: Motion | None = None
        self._running = False
        self._is_prompt = False
        self._count = 0
        self._last_goal: Goal | None = None

    @property
    def motion(self) -> Motion | None:
        """Return the motion accepted last."""
        return self._motion

    @property
    def last_goal(self) -> Goal:
        """
        Return the goal accepted last, to be started as soon as possible.

        Raises
        ------
        RequestRejected
            There has been none.

        """
        if self._last_goal is None:
            raise RequestRejected(Reason.EMPTY_GOAL, 'no goal has been accepted yet')
        return self._last_goal

    def measure(self, sample: JointSample) -> None:
        """Take the measured state, in the order of the session's joints."""
        self._measured = sample

    def submit(self, goal: Goal, now: float) -> Motion:
        """
        Return the motion that answers a goal.

        Parameters
        ----------
        goal
            The request.
        now
            Present time [s].

        Raises
        ------
        RequestRejected
            The goal breaks a rule; the running motion is untouched.
        FlatPlannerError
            The settings allow no plan.

        """
        settings = self.settings
        if now <= 0.0:
            raise RequestRejected(
                Reason.START_STATE_UNKNOWN,
                'there is no time yet: use_sim_time is set, but no /clock has been received',
            )
        target = rest_target(goal, settings.joints)
        duration = self._checked_duration(target.duration)
        start_time = self._start_time(goal, now)
        self._refuse_if_busy(now)
        start, final = np.array(self._start(now)), np.array(target.positions)
        timing = self._timing(start)
        timing.check_pose('the start', start)
        timing.check_pose('the final', final)

        def plan_of(duration: float) -> Plan:
            request = MotionRequest(start=start, final=final, duration=duration)
            return plan(request, settings.arm, settings.options)

        try:
            timed = timing.timed(plan_of, duration)
        except UncertifiedPlan as error:
            raise RequestRejected(
                Reason.ILL_CONDITIONED,
                f'no plan to the promised accuracy: {error}; use a longer duration or '
                f'smaller weights',
                value=error.residual,
                limit=error.tolerance,
            ) from error
        samples = timed.plan.sample(settings.period)
        self._count += 1
        self._motion = Motion(
            plan_id=self._count,
            plan=timed.plan,
            samples=samples,
            start=start_time,
            planned_at=now,
            duration_min=timed.duration_min,
            exceeded=timed.exceeded,
        )
        self._last_goal = Goal(joint_names=goal.joint_names, points=goal.points)
        self._is_prompt = goal.stamp is None
        self._running = settings.execute
        return self._motion

    def launched(self, now: float) -> Motion:
        """
        Return the motion accepted last, ready to be sent.

        Planning takes time: a motion that starts as soon as possible starts start_delay from now.
        """
        motion = self._motion
        if motion is None:
            raise RequestRejected(Reason.EMPTY_GOAL, 'no goal has been accepted yet')
        if self._is_prompt:
            self._motion = motion = replace(motion, start=now + self.settings.start_delay)
        return motion

    def finished(self, now: float) -> Motion | None:
        """Return the running motion once, at the first call after its end."""
        if self._motion is None or not self._running or now < self._motion.end:
            return None
        self._running = False
        return self._motion

    def _timing(self, start: FloatArray) -> Timing:
        """Return the rules for the duration of a motion from a pose."""
        settings = self.settings
        limits = settings.limits or JointLimits.of(settings.arm.n)
        return Timing(
            joints=settings.joints,
            limits=limits.reaching(start, settings.position_tolerance),
            on_violation=settings.on_violation,
            # A motion shorter than the spacing of its samples would be none.
            shortest=max(settings.min_duration, settings.period),
            longest=min(settings.max_duration, LONGEST_FOUND),
        )

    def _checked_duration(self, prescribed: float | None) -> float | None:
        """Return the duration of a goal, within its range; None for an automatic one."""
        settings = self.settings
        duration = settings.default_duration if prescribed is None else prescribed
        if duration == 0.0:
            if settings.limits is None or not settings.limits.bound_duration:
                raise RequestRejected(
                    Reason.DURATION_OUT_OF_RANGE,
                    'the goal prescribes no duration, and no limit of a velocity or an effort '
                    'makes one the shortest: set time_from_start in the goal, or one of the '
                    'parameters duration.default, limits.velocity and limits.effort',
                )
            return None
        if not settings.min_duration <= duration <= settings.max_duration:
            below = duration < settings.min_duration
            limit = settings.min_duration if below else settings.max_duration
            raise RequestRejected(
                Reason.DURATION_OUT_OF_RANGE,
                f'duration {duration:g} s is outside [{settings.min_duration:g}, '
                f'{settings.max_duration:g}] s',
                value=duration,
                limit=limit,
            )
        return duration

    def _start_time(self, goal: Goal, now: float) -> float:
        """Return the absolute time at which a goal's motion starts."""
        if goal.stamp is None:
            return now + self.settings.start_delay
        if goal.stamp < now:
            raise RequestRejected(
                Reason.OLD_HEADER_TIMESTAMP,
                f'the stamp {goal.stamp:.3f} s lies {now - goal.stamp:.3f} s in the past; 0 means '
                f'as soon as possible',
                value=goal.stamp,
                limit=now,
            )
        return goal.stamp

    def _refuse_if_busy(self, now: float) -> None:
        """Let the running motion, or one that waits for its start, come to its end first."""
        if self._motion is None or not self._running or now >= self._motion.end:
            return
        remaining = self._motion.end - now
        raise RequestRejected(
            Reason.BUSY,
            f'motion {self._motion.plan_id} ends in {remaining:.3f} s; re-planning in motion is '
            f'not available in this version',
            value=now,
            limit=self._motion.end,
        )

    def _start(self, now: float) -> Sequence[float]:
        """Return the start of a motion, checked against what is measured."""
        settings = self.settings
        source = settings.start_source
        if source in (StartSource.AUTO, StartSource.MEASURED):
            measured = self._fresh_measurement(now)
            planned = [*measured.positions[:-1].tolist(), 0.0]
        else:
            if source is StartSource.PARAMETER:
                planned = list(settings.start_position)
            elif self._motion is not None:
                planned = self._motion.plan.request.final.tolist()
            else:
                raise RequestRejected(
                    Reason.START_STATE_UNKNOWN,
                    'start.source is reference, but there has been no motion yet',
                )
            if self._measured is None:
                return planned
            measured = self._fresh_measurement(now)
        self._check_at_rest(measured, planned)
        return planned

    def _fresh_measurement(self, now: float) -> JointSample:
        """Return the measured state unless there is none, or only an old one."""
        if self._measured is None:
            raise RequestRejected(
                Reason.START_STATE_UNKNOWN, 'no joint state of this arm has been received yet'
            )
        age, limit = now - self._measured.time, self.settings.measurement_timeout
        if not -limit <= age <= limit:
            raise RequestRejected(
                Reason.START_STATE_STALE,
                f'the last joint state is {age:.3f} s old, more than {limit:g} s'
                if age > 0.0
                else f'the last joint state is stamped {-age:.3f} s ahead of the present: do the '
                f'planner and its source go by the same clock (use_sim_time)?',
                value=age,
                limit=limit,
            )
        return self._measured

    def _check_at_rest(self, measured: JointSample, planned: Sequence[float]) -> None:
        """Refuse to start from another place, or while the arm still moves."""
        settings = self.settings
        nothing = np.full(len(planned), np.nan)
        velocities = nothing if measured.velocities is None else measured.velocities
        for name, position, velocity, start in zip(
            settings.joints, measured.positions, velocities, planned, strict=True
        ):
            # Written so that a NaN position is refused and a NaN velocity is not.
            if not abs(position - start) <= settings.position_tolerance:
                raise RequestRejected(
                    Reason.START_STATE_MISMATCH,
                    f'{name} is measured at {position:.4g} rad, not at the start {start:.4g} rad '
                    f'(tolerance {settings.position_tolerance:g} rad)',
                    joint=name,
                    value=float(position),
                    limit=settings.position_tolerance,
                )
            if abs(velocity) > settings.velocity_tolerance:
                raise RequestRejected(
                    Reason.NOT_AT_REST,
                    f'{name} moves at {velocity:.4g} rad/s, more than '
                    f'{settings.velocity_tolerance:g} rad/s',
                    joint=name,
                    value=float(velocity),
                    limit=settings.velocity_tolerance,
                )
