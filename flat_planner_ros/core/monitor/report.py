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

"""The report on what a motion leaves behind."""

from dataclasses import dataclass, replace
from math import sqrt

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.monitor.clipping import clipped_remark
from flat_planner_ros.core.monitor.course import compare, Course, judge_arrival
from flat_planner_ros.core.monitor.doubtful_samples import doubt_of_times, seen_oscillation
from flat_planner_ros.core.monitor.feedback_times import FeedbackTimes
from flat_planner_ros.core.monitor.identification import identify, StiffnessEstimate
from flat_planner_ros.core.monitor.model_estimate import estimate_model, ModelEstimate
from flat_planner_ros.core.monitor.motion_record import Measured, PlannedMotion
from flat_planner_ros.core.monitor.oscillation import OscillationFit
from flat_planner_ros.core.monitor.settings import Level, MonitorSettings
from flat_planner_ros.core.monitor.stamp_offset import SampleClock
import numpy as np

EFFORT_GAP = 0.1
"""Longest hole in the measured efforts that their RMS forgives, relative to the motion [-]."""

WINDOW_GAP = 0.1
"""Longest delay of the first sample after the motion left unsaid, relative to the window [-]."""

RELEASE = 0.1
"""Time after the motion that feedback has to let go of the arm, relative to the window [-]."""

DAMPED = 'feedback damps what is left: it is not the free oscillation of the arm'
"""Why nothing of the arm is told by an oscillation."""

TRACKED = 'carried out with feedback'
"""What is said of such motions."""


@dataclass(frozen=True, kw_only=True, eq=False)
class VibrationReport:
    """
    What a motion left behind; a value that cannot be computed is ``None``.

    Attributes
    ----------
    level
        Verdict on the amplitude, at least ``WARN`` if there is none, and on the arrival.
    message
        The verdict in one sentence, with the reasons for what is missing.
    start_time, end_time
        Start and end T of the motion [s].
    joint
        Name of the passive joint, which is judged.
    fit
        Oscillation of its measured minus its final position: amplitude at T, frequency, ...
    frequency_expected, damping_expected
        Damped frequency [Hz] and damping ratio [-] expected.
    settling_time
        Time after T from which every sample of the passive joint is within the settling band
        about its final position [s], 0 if all are. ``None`` if not settled: the last sample is
        outside, or less than half a period has been seen inside.
    joint_names
        Names of all joints, length n.
    final_error
        Time mean of measured minus final position of each joint over the last whole period of
        the window, or all of it if no period is known [rad], length n; empty without samples.
    rms_effort
        Time root mean square of each joint's measured effort over the motion [N m], length n.
    window
        Time from T to the last sample used [s].
    samples
        Number of samples in the window [-].
    estimate
        Stiffness and damping of the passive joint, ``None`` without a model to compare with.
    model
        All that moves the last two links, ``None`` unless it is asked for.
    course
        How the motion was carried out, ``None`` if too little of it was seen.
    clock_offset
        By how much the stamps of the samples were ahead of the plan's clock [s], ``None`` if they
        were not.
    is_tracked
        Whether feedback moved the arm.

    """

    level: Level
    message: str
    start_time: float
    end_time: float
    joint: str
    fit: OscillationFit
    frequency_expected: float | None
    damping_expected: float | None
    settling_time: float | None
    joint_names: tuple[str, ...]
    final_error: tuple[float, ...]
    rms_effort: tuple[float | None, ...]
    window: float
    samples: int
    estimate: StiffnessEstimate | None = None
    course: Course | None = None
    clock_offset: float | None = None
    model: ModelEstimate | None = None
    is_tracked: bool = False

    @property
    def is_settled(self) -> bool:
        """Return whether the passive joint came to rest within the window."""
        return self.settling_time is not None


WHOLE_PERIOD = 0.98
"""Part of a period that counts as one [-]."""


def assess(
    motion: PlannedMotion,
    settings: MonitorSettings,
    measured: Measured,
    until: float,
    clock: SampleClock,
    *,
    feedback: FeedbackTimes,
    cause: str = '',
    stale: bool = False,
) -> VibrationReport:
    """
    Judge what a motion left behind.

    Parameters
    ----------
    motion
        The motion.
    settings
        Window, tolerances and expectations.
    measured
        What was measured from the start of the motion on.
    until
        Time at which the window is cut at the latest [s].
    clock
        Of the samples.
    feedback
        When it acted.
    cause
        Why it is cut, if it is.
    stale
        Whether the samples have stopped coming.

    Returns
    -------
    VibrationReport
        The verdict.

    """
    until = min(until, motion.end + settings.window)
    last = motion.end + settings.window  # of the plan's clock, as feedback is
    is_tracked = feedback.has_acted(motion.start, last)
    is_damped = feedback.has_acted(motion.end + RELEASE * settings.window, last)
    # What the model expects is the free arm's.
    judged = settings
    if is_damped:
        judged = replace(settings, expected_frequency=None, expected_damping_ratio=None)
    course = compare(motion, *measured.positions(motion.start, until))
    # All that follows is about the time at which the arm did it, not about what was planned.
    done = clock.carried_out(motion, course)
    times, rows = measured.positions(done.end, until)
    errors = rows - motion.final
    doubt = _doubt(course, clock) or doubt_of_times(times)
    foreign = ''
    if doubt:
        fit = OscillationFit(samples=times.size, reason=doubt)
    else:
        fit, foreign = seen_oscillation(times, errors[:, -1], done.end, judged)
    if is_damped:
        estimate = None if settings.arm is None else StiffnessEstimate(reason=DAMPED)
    else:
        estimate = _estimate(times - done.end, errors, fit, settings)
    motors = measured.motors.between(done.start, until)
    model = _model(done, motors, settings, doubt, is_tracked=is_tracked)
    frequency = fit.frequency or settings.expected_frequency
    settling = _settling_time(times - done.end, errors[:, -1], settings.settling_band, frequency)
    window = float(times[-1]) - done.end if times.size else 0.0
    period = 1.0 / frequency if frequency else window
    final_error = _time_mean(times, errors, done.end + window - period)
    missed = _missed(final_error, fit, is_whole=window >= WHOLE_PERIOD * period)
    arrival = judge_arrival(motion, missed, clock.own(course), settings)
    rms = tuple(
        _rms_effort(*measured.efforts.between(done.start, done.end), joint, done)
        for joint in range(len(motion.joint_names))
    )
    late = float(times[0]) - done.end if times.size else 0.0
    clipped = clipped_remark(done, *measured.efforts.between(done.start, done.end))
    # Nothing seen is said once, not once for every number that is missing.
    remarks: tuple[str, ...] = (cause or fit.reason,)
    if times.size:
        remarks = (
            cause,
            fit.reason,
            f'first sample {late:.3g} s after the motion'
            if late > WINDOW_GAP * settings.window
            else '',
            _settling_remark(settling, settings.settling_band),
            _effort_remark(motion.joint_names, rms),
            _estimate_remark(estimate, fit),
            model.text if model else '',
        )
    severity = Level.worst(
        (arrival.level, _level(fit, settings), Level.WARN if foreign or clipped else Level.OK)
    )
    said = clock.remark(course), arrival.remark, clipped, foreign, TRACKED if is_tracked else ''
    sentence = (*said, _verdict(fit, judged), *remarks)
    return VibrationReport(
        level=Level.STALE if stale else severity,
        message='; '.join(filter(None, sentence)),
        start_time=motion.start,
        end_time=motion.end,
        joint=motion.joint_names[-1],
        fit=fit,
        frequency_expected=judged.expected_frequency,
        damping_expected=judged.expected_damping_ratio,
        settling_time=settling,
        joint_names=motion.joint_names,
        final_error=final_error,
        rms_effort=rms,
        window=window,
        samples=times.size,
        estimate=estimate,
        course=course,
        clock_offset=clock.ahead(course) if clock.is_other(course) else None,
        model=model,
        is_tracked=is_tracked,
    )


def _doubt(course: Course | None, clock: SampleClock) -> str:
    """Return why no number can be had of what is left, if so."""
    if course is not None and course.is_in_degrees:
        return 'the unit of the joint states is doubtful'
    if clock.is_doubtful(course):
        return 'the motion does not show when it ended by the clock of the joint states'
    return ''


def _estimate(
    elapsed: FloatArray, errors: FloatArray, fit: OscillationFit, settings: MonitorSettings
) -> StiffnessEstimate | None:
    """Return stiffness and damping if there is a model of the joints that are planned."""
    arm, joints = settings.arm, errors.shape[1]
    if arm is None:
        return None
    if joints != arm.n:
        return StiffnessEstimate(reason=f'the plan has {joints} joints, the model {arm.n}')
    return identify(elapsed, errors, fit, arm, settings.actuated_joints)


def _model(
    motion: PlannedMotion,
    seen: tuple[FloatArray, FloatArray],
    settings: MonitorSettings,
    doubt: str,
    *,
    is_tracked: bool,
) -> ModelEstimate | None:
    """Return the whole model if it is asked for and the joints are the model's."""
    arm, joints = settings.arm, len(motion.joint_names)
    if arm is None or not settings.fits_model or joints != arm.n:
        return None
    if doubt:
        return ModelEstimate(reason=doubt)
    times, rows = seen
    angles, efforts = np.hsplit(rows, 2)
    return estimate_model(times - motion.start, angles, efforts, arm, are_held=is_tracked)


def _missed(
    final_error: tuple[float, ...], fit: OscillationFit, *, is_whole: bool
) -> tuple[float, ...]:
    """Return how far the joints are off their goals [rad], of the passive one its middle."""
    # It decays while it swings, so that its mean is not zero; less than a period says nothing.
    middle = (fit.bias,) if is_whole and fit.bias is not None else ()
    return final_error[:-1] + middle


def _settling_time(
    elapsed: FloatArray, errors: FloatArray, band: float, frequency: float | None
) -> float | None:
    """Return when the errors stay within the band, seen for half a period at least."""
    outside = np.flatnonzero(np.abs(errors) > band)
    first = int(outside[-1]) + 1 if outside.size else 0
    if first >= elapsed.size:
        return None
    if frequency is not None and elapsed[-1] - elapsed[first] < 0.5 / frequency:
        return None
    return float(elapsed[first]) if first else 0.0


def _time_mean(times: FloatArray, rows: FloatArray, start: float) -> tuple[float, ...]:
    """Return each column's mean from start to the last sample, linear between samples."""
    if times.size == 0:
        return ()
    start = max(start, float(times[0]))
    if start == times[-1]:
        return tuple(map(float, rows[-1]))
    grid = np.concatenate(([start], times[times > start]))
    span = grid[-1] - start
    return tuple(_integral(np.interp(grid, times, column), grid) / span for column in rows.T)


def _rms_effort(
    times: FloatArray, efforts: FloatArray, joint: int, motion: PlannedMotion
) -> float | None:
    """Return the time RMS of a joint's effort, or None if the samples have a hole."""
    known = np.isfinite(efforts[:, joint])
    duration = motion.end - motion.start
    ends = np.array((motion.start, motion.end))
    gaps = np.diff(np.concatenate((ends[:1], times[known], ends[1:])))
    if not known.any() or gaps.max() > EFFORT_GAP * duration:
        return None
    grid = np.unique(np.concatenate((ends, times[known])))
    squares = np.interp(grid, times[known], efforts[known, joint] ** 2)
    return sqrt(_integral(squares, grid) / duration) if duration > 0.0 else None


def _integral(values: FloatArray, grid: FloatArray) -> float:
    """Return the integral of samples that are joined linearly."""
    from scipy.integrate import trapezoid  # here: slow to import, and only needed for a report

    return float(trapezoid(values, grid))


def _level(fit: OscillationFit, settings: MonitorSettings) -> Level:
    """Return the verdict; half the swing stands in for a missing amplitude."""
    if fit.amplitude is None:
        swing = (fit.peak_to_peak or 0.0) / 2
        return Level.ERROR if swing > settings.amplitude_error else Level.WARN
    if fit.amplitude <= settings.amplitude_ok:
        return Level.OK
    return Level.WARN if fit.amplitude <= settings.amplitude_error else Level.ERROR


def _verdict(fit: OscillationFit, settings: MonitorSettings) -> str:
    """Return the amplitude against its bounds, with frequency and damping if known."""
    if fit.amplitude is None:
        swing = f', swing {fit.peak_to_peak:.3g} rad' if fit.peak_to_peak is not None else ''
        return f'amplitude unknown{swing}'
    if fit.amplitude <= settings.amplitude_ok:
        comparison = f'within {settings.amplitude_ok:.3g} rad'
    else:
        error = fit.amplitude > settings.amplitude_error
        bound = settings.amplitude_error if error else settings.amplitude_ok
        comparison = f'above {bound:.3g} rad'
    text = f'amplitude {fit.amplitude:.3g} rad {comparison}'
    expectations: tuple[tuple[str, float | None, float | None, str], ...] = (
        ('frequency', fit.frequency, settings.expected_frequency, ' Hz'),
        ('damping ratio', fit.damping_ratio, settings.expected_damping_ratio, ''),
    )
    for name, value, expected, unit in expectations:
        if value is not None:
            text += f', {name} {value:.4g}{unit}'
            text += f' (expected {expected:.4g})' if expected is not None else ''
    return text


def _settling_remark(settling: float | None, band: float) -> str:
    """Return whether and when the joint settled."""
    if settling is None:
        return f'not settled within {band:.3g} rad'
    return f'settled within {band:.3g} rad after {settling:.3g} s'


def _effort_remark(names: tuple[str, ...], rms: tuple[float | None, ...]) -> str:
    """Return whose effort was not measured throughout, if anyone's."""
    unknown = ', '.join(name for name, value in zip(names, rms, strict=True) if value is None)
    return f'effort of {unknown} not measured throughout the motion' if unknown else ''


def _estimate_remark(estimate: StiffnessEstimate | None, fit: OscillationFit) -> str:
    """Return stiffness and damping, or why they are not estimated unless that has been said."""
    if estimate is None:
        return ''
    if not estimate.is_trustworthy or estimate.case is None:
        reason = '' if fit.reason == estimate.reason else f' ({estimate.reason})'
        return f'stiffness and damping not estimated{reason}'
    return (
        f'stiffness {estimate.stiffness:.6g} ± {estimate.stiffness_std:.2g} N m/rad and damping '
        f'{estimate.damping:.4g} ± {estimate.damping_std:.2g} N m s/rad, estimated with the '
        f'actuated joints {estimate.case.value}, on trust in {estimate.inertia:.3g} kg m^2: what '
        'swings tells ratios to that inertia alone'
    )
