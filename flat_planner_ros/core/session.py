"""Session of a planner: goals and measurements in, motions out, in the order of time."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from math import inf
from typing import NamedTuple

from flat_planner_ros.core.arm import PlanarArm
from flat_planner_ros.core.errors import InvalidRequest, OutOfReach, UncertifiedPlan
from flat_planner_ros.core.goal import Goal, Reason, RequestRejected, rest_target, RestTarget
from flat_planner_ros.core.limits import JointLimits
from flat_planner_ros.core.motion_record import JointSample
from flat_planner_ros.core.plan_samples import PlanSamples
from flat_planner_ros.core.planning import MotionRequest, plan, PlanningOptions, ViaPoint
from flat_planner_ros.core.request import planned_at_rest
from flat_planner_ros.core.solutions import CONDITIONS
from flat_planner_ros.core.stopping import stop_plan
from flat_planner_ros.core.timeline import Motion, Timeline, Track
from flat_planner_ros.core.timing import OnViolation, TimedPlan, Timing
from flat_planner_ros.core.via_times import with_via_times
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

Clock = Callable[[], float]

LONGEST_FOUND = 3600.0
"""Longest duration that is looked for where the settings name none [s]."""

HANDOVER = 0.25
"""Part of the lookahead that is left for a command to reach its executor [-]."""


NOMINAL_DURATION = 1.0
"""Duration of a request before its own is found [s]."""


class StartSource(Enum):
    """Where the start of a motion is taken from."""

    AUTO = 'auto'
    """The measured state, unless another motion is under way or waits for its start."""

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
        From accepting a goal without a stamp to its start, at rest [s].
    lookahead
        The same while another motion is under way or waits for its start [s].
    is_stamped
        Whether the executor plays a command at its stamp; if it plays on arrival, no motion can
        take over from another.
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
    lookahead: float = 0.1
    is_stamped: bool = True
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


class Outcome(Enum):
    """How an accepted goal ended."""

    FINISHED = 'FINISHED'
    """At its final pose."""

    STOPPED = 'STOPPED'
    """At rest on the way."""

    PREEMPTED = 'PREEMPTED'
    """Replaced by another goal."""


class Ended(NamedTuple):
    """A motion that has ended, and how."""

    motion: Motion
    outcome: Outcome


class Origin(NamedTuple):
    """
    Where a motion starts.

    Attributes
    ----------
    time
        Absolute [s].
    pose
        Angles of all joints, shape (n,) [rad].
    jets
        Derivatives 0 to 5 of the planned variables where the arm is planned to move then, shape
        (n - 1, 6) [rad/s^k]; None at rest.
    before
        The motion in force then, if one is.

    """

    time: float
    pose: FloatArray
    jets: FloatArray | None = None
    before: Motion | None = None


class PlannerSession:
    """
    Answer goals with motions; a new one replaces what was planned from its start on.

    Parameters
    ----------
    settings
        Valid for the goals to come.

    """

    def __init__(self, settings: SessionSettings) -> None:
        """Start at rest, without a measurement."""
        self.settings = settings
        self._measured: JointSample | None = None
        self._timeline = Timeline()
        self._motion: Motion | None = None
        self._ended: list[Ended] = []
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
        """Take the measured state, in the order of the session's joints, unless it comes late."""
        age = 0.0 if self._measured is None else self._measured.time - sample.time
        # Far back is no late message, but a clock that was set back.
        if not 0.0 < age <= self.settings.measurement_timeout:
            self._measured = sample

    def submit(self, goal: Goal, now: float, clock: Clock | None = None) -> Motion:
        """
        Return the motion that answers a goal.

        Parameters
        ----------
        goal
            The request.
        now
            Present time [s].
        clock
            Tells the time after planning, which decides when the motion can start; None if
            planning is to take no time.

        Raises
        ------
        RequestRejected
            The goal breaks a rule; all that is planned already is untouched.
        FlatPlannerError
            The settings allow no plan.

        """
        _check_time(now)
        settings = self.settings
        target = rest_target(goal, settings.joints)
        duration = self._checked_duration(target.duration)
        origin = self._origin(goal.stamp, now)
        timed = self._planned(origin, target, duration)
        motion = Motion(
            plan_id=self._count + 1,
            plan=timed.plan,
            samples=timed.plan.sample(settings.period),
            start=origin.time,
            planned_at=now,
            duration_min=timed.duration_min,
            exceeded=timed.exceeded,
        )
        motion = self._launched(motion, origin, goal.stamp, clock)
        self._last_goal = Goal(joint_names=goal.joint_names, points=goal.points)
        return motion

    def stop(self, now: float, clock: Clock | None = None) -> Motion | None:
        """
        Return the motion that brings the arm to rest early, None if nothing is under way.

        Parameters
        ----------
        now, clock
            As for `submit`.

        Raises
        ------
        RequestRejected
            The arm cannot be brought to rest any sooner; all that is planned is untouched.

        """
        _check_time(now)
        if not self._timeline.is_busy(now):
            return None
        origin = self._origin(None, now)
        running = origin.before
        if running is None or running.stops or (origin.jets is None and now >= running.start):
            raise RequestRejected(
                Reason.BUSY, 'the arm comes to rest within replan.lookahead as it is'
            )
        limits = self._timing(origin.pose).limits
        remaining = running.end - origin.time
        planned = stop_plan(running.plan, origin.pose, origin.jets, remaining, limits)
        motion = Motion(
            plan_id=running.plan_id,
            plan=planned,
            samples=planned.sample(self.settings.period),
            start=origin.time,
            planned_at=now,
            stops=True,
        )
        return self._launched(motion, origin, None, clock)

    def ended(self, now: float) -> list[Ended]:
        """Return, once, the motions that have come to an end or been replaced."""
        ended = [
            Ended(motion, Outcome.STOPPED if motion.stops else Outcome.FINISHED)
            for motion in self._timeline.motions
            if motion.cut is None and motion.end <= now
        ]
        ended += self._ended
        self._ended = []
        self._timeline = self._timeline.after(now)
        return ended

    def track(self, now: float) -> Track:
        """Return all that is still to be carried out, as an executor is to be sent it."""
        if self.settings.execute or self._motion is None:
            return self._timeline.track(now)
        return Timeline([self._motion]).track(now)

    def moves(self, since: float, until: float) -> bool:
        """Tell whether any motion is planned for part of a time [s]."""
        return self._timeline.moves(since, until)

    def reference(self, now: float) -> PlanSamples | None:
        """Return what is planned for the present, at rest before and after; one sample."""
        motion = self._timeline.at(now) or self._motion
        return None if motion is None else motion.reference(now)

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

    def _planned(self, origin: Origin, target: RestTarget, duration: float | None) -> TimedPlan:
        """Return a plan within the limits that is good to the promised accuracy."""
        arm, options = self.settings.arm, self.settings.options
        if origin.jets is not None and origin.before is not None:
            # What the arm is planned to do then is said in terms of the model it was planned with.
            arm = origin.before.plan.task.arm
            options = replace(options, flat_model=origin.before.plan.options.flat_model)

        timing = self._timing(origin.pose)
        timing.check_pose('the start', origin.pose)
        for index, point in enumerate(target.via):
            timing.check_pose(f'via point {index}', np.array(point.positions))
        timing.check_pose('the final', np.array(target.positions))

        def timed(request: MotionRequest) -> TimedPlan:
            return timing.timed(lambda time: plan(request.stretched(time), arm, options), duration)

        request = _request(target, origin, duration or NOMINAL_DURATION)
        try:
            if not target.chooses_times:
                return timed(request)
            found = timed(with_via_times(request, arm, options))
            if duration is not None:
                return found
            # The best shares of the time depend on the time, if little.
            return timed(with_via_times(found.plan.request, arm, options))
        except InvalidRequest as error:
            raise RequestRejected(Reason.INVALID_GOAL, str(error)) from error
        except OutOfReach as error:
            raise RequestRejected(
                Reason.SOLVER_FAILED, str(error), value=error.value, limit=error.limit
            ) from error
        except UncertifiedPlan as error:
            raise RequestRejected(
                Reason.ILL_CONDITIONED,
                f'no plan to the promised accuracy: {error}; use a longer duration or '
                f'smaller weights',
                value=error.residual,
                limit=error.tolerance,
            ) from error

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

    def _launched(
        self, motion: Motion, origin: Origin, stamp: float | None, clock: Clock | None
    ) -> Motion:
        """Return a motion with its place in time, which it takes unless planning took too long."""
        settings = self.settings
        now = motion.planned_at if clock is None else clock()
        if origin.before is None:
            if stamp is None:
                motion = replace(motion, start=now + settings.start_delay)
            elif stamp < now:
                raise _too_late(stamp, now)
        elif origin.time - now < HANDOVER * settings.lookahead and clock is not None:
            raise RequestRejected(
                Reason.BUSY,
                f'planning took {now - motion.planned_at:.3f} s, too long for a start in motion '
                f'{settings.lookahead:g} s ahead (replan.lookahead); the motion goes on',
                value=now - motion.planned_at,
                limit=(1.0 - HANDOVER) * settings.lookahead,
            )
        if settings.execute:
            for old in self._timeline.replaced(motion.start):
                if not (motion.stops and old.plan_id == motion.plan_id):
                    self._ended.append(Ended(old, Outcome.PREEMPTED))
            self._timeline = self._timeline.with_motion(motion)
        self._count = motion.plan_id if not motion.stops else self._count
        self._motion = motion
        return motion

    def _origin(self, stamp: float | None, now: float) -> Origin:
        """Return where a motion starts."""
        settings = self.settings
        if stamp is not None and stamp < now:
            raise _too_late(stamp, now)
        if not self._timeline.is_busy(now):
            time = now + settings.start_delay if stamp is None else stamp
            return Origin(time, np.array(self._start(now)))
        if not settings.is_stamped:
            raise RequestRejected(
                Reason.BUSY,
                'another motion is under way; none can take over from it as commands have no '
                'stamp (command.stamp)',
            )
        soonest = now + settings.lookahead
        time = self._timeline.seam(soonest) if stamp is None else stamp
        before = self._timeline.at(time)
        if before is None:  # is_busy says otherwise
            raise RequestRejected(Reason.INTERNAL, 'there is no motion to start from')
        elapsed = time - before.start
        if elapsed <= 0.0:
            return Origin(time, before.plan.request.start, before=before)
        if time >= before.end:
            return Origin(time, before.plan.request.final, before=before)
        if time < soonest:
            raise RequestRejected(
                Reason.OLD_HEADER_TIMESTAMP,
                f'motion {before.plan_id} is under way: another one can take over from '
                f'{soonest:.3f} s on (replan.lookahead), not at {time:.3f} s',
                value=time,
                limit=soonest,
            )
        times = np.array([elapsed])
        return Origin(
            time,
            before.plan.at(times).positions[0],
            before.plan.jets(times)[:, :CONDITIONS, 0],
            before,
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


def _check_time(now: float) -> None:
    """Refuse to plan before there is a time."""
    if now <= 0.0:
        raise RequestRejected(
            Reason.START_STATE_UNKNOWN,
            'there is no time yet: use_sim_time is set, but no /clock has been received',
        )


def _request(target: RestTarget, origin: Origin, duration: float) -> MotionRequest:
    """Return what is asked of a plan; via times that are to be chosen are even for now."""
    count = len(target.via) + 1
    via = tuple(
        ViaPoint(
            time=duration * index / count if point.time is None else point.time,
            values=np.array(planned_at_rest(np.array(point.positions))),
        )
        for index, point in enumerate(target.via, start=1)
    )
    return MotionRequest(
        start=origin.pose,
        final=np.array(target.positions),
        duration=duration,
        via=via,
        start_jets=origin.jets,
    )


def _too_late(stamp: float, now: float) -> RequestRejected:
    """Return the refusal of a start in the past."""
    return RequestRejected(
        Reason.OLD_HEADER_TIMESTAMP,
        f'the stamp {stamp:.3f} s lies {now - stamp:.3f} s in the past; 0 means as soon as '
        f'possible',
        value=stamp,
        limit=now,
    )
