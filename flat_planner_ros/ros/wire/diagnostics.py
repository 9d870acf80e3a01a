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

"""Verdicts and reports as diagnostic messages: a sentence for people, pairs for tools."""

from collections.abc import Mapping, Sequence
from math import isfinite

from diagnostic_msgs.msg import DiagnosticStatus
from flat_planner_ros.core.arm import PlanarArm
from flat_planner_ros.core.monitor import (
    LastLinks,
    Level,
    ModelEstimate,
    StiffnessEstimate,
    VibrationReport,
)
from flat_planner_ros.core.planning import RequestRejected
from flat_planner_ros.core.session import Astray, Ended, Goal, Motion, Outcome, Shortfall
from flat_planner_ros.ros.wire.interfaces import (
    ERROR_CODES,
    REPORT_NAME,
    STATUS_NAME,
)
from flat_planner_ros.ros.wire.prediction_values import left_by_imbalance, residual_values
from flat_planner_ros.ros.wire.stamps import sec_and_nanosec
from flat_planner_ros.ros.wire.status_writer import array_bytes, Pair, Status
from flat_planner_ros.ros.wire.verdict_text import (
    clauses,
    clock_clause,
    list_text,
    precise,
    text_of,
)

LEVELS = {
    Level.OK: DiagnosticStatus.OK,
    Level.WARN: DiagnosticStatus.WARN,
    Level.ERROR: DiagnosticStatus.ERROR,
    Level.STALE: DiagnosticStatus.STALE,
}
"""Levels of a report as diagnostics state them."""

ENDINGS = {
    Outcome.FINISHED: 'has come to its end',
    Outcome.STOPPED: 'has been brought to rest on the way',
    Outcome.PREEMPTED: 'is replaced by a later goal',
    Outcome.FAILED: 'was not carried out',
}
"""Half a sentence on each end of a motion."""

MODEL_KEYS = {
    'both': 'model.inertia_star.both',
    'last': 'model.inertia_star.last',
    'stiffness': 'model.stiffness',
    'damping': 'model.damping',
    'viscous': 'model.viscous_friction',
    'coulomb': 'model.coulomb_friction',
}
"""Keys of `LastLinks` on the wire."""

Values = Mapping[str, float | int | str | None]
"""Keys and values of a status; None for what is not known."""


def array_of(status: Status, now: float) -> bytes:
    """Return a serialised message with one status, stamped now [s]."""
    return array_bytes(status, sec_and_nanosec(now))


def status_of(name: str, level: bytes, message: str, values: Values) -> Status:
    """Return a status; keys without a value are left out."""
    pairs = [Pair(key, text_of(value)) for key, value in values.items() if value is not None]
    return Status(name=name, level=level, message=message, values=pairs)


def accepted_status(
    motion: Motion,
    goal: Goal,
    joints: Sequence[str],
    planning_time: float,
    *,
    with_advice: bool = True,
    with_baselines: bool = False,
    doubt: str = '',
    built: PlanarArm | None = None,
) -> Status:
    """
    Return the verdict on a goal that became a motion.

    Parameters
    ----------
    motion, goal
        The motion, and the goal that asked for it.
    joints
        The arm's joints, whose order the plan's arrays follow.
    planning_time
        Time that planning took [s].
    with_advice, with_baselines
        Whether to say when more time pays, and what simpler methods would leave behind.
    doubt
        Why it may not be carried out, a clause; empty for no reason.
    built
        The arm with what it lacks of balance; None for a balanced one.

    """
    plan = motion.plan
    peaks = plan.peak_effort
    strongest = int(peaks.argmax())
    message = (
        f'plan {motion.plan_id}: {plan.options.strategy.value}, {plan.request.duration:g} s, '
        f'peak effort {peaks[strongest]:.4g} N m of {joints[strongest]}, '
        f'starts at {motion.start:.3f} s, in {motion.start - motion.planned_at:.3f} s'
    )
    imbalance = left_by_imbalance(motion, built)
    values: dict[str, float | int | str | None] = {
        **_motion_values(motion, 'ACCEPTED'),
        'duration_min': plan.duration if motion.is_shortest else None,
        'planning_time': planning_time,
        'swing': motion.swing,
        'boundary_residual': plan.boundary_residual,
        'optimality_residual': plan.optimality_residual,
        'cost': plan.cost_value,
        'duration_bound': plan.least_duration,
        'imbalance_residual': imbalance,
        **residual_values(motion, with_advice=with_advice, with_baselines=with_baselines),
    }
    for quantity in ('peak_effort', 'rms_effort', 'peak_velocity'):
        values.update(_joint_values(quantity, joints, getattr(plan, quantity).tolist()))
    if motion.swing is not None:
        message += f', from a swing of {motion.swing:.3g} rad'
    if imbalance is not None:
        message += f'; imbalance leaves about {imbalance:.2g} rad'
    level = DiagnosticStatus.OK
    if doubt:
        level = DiagnosticStatus.WARN
        message += f'; {doubt}'
    if motion.replaced_strategy is not None:
        level = DiagnosticStatus.WARN
        message += f'; not {motion.replaced_strategy.value}, which needs flat_model: exact'
    if motion.remarks:
        level = DiagnosticStatus.WARN
    message += clauses(motion)
    if motion.exceeded is not None:
        use = motion.exceeded
        name = joints[use.joint]
        level = DiagnosticStatus.WARN
        message += f'; stretched: as prescribed, {use.sentence(name)}'
        values.update(joint=name, value=use.value, limit=use.limit, time=use.time)
    return status_of(STATUS_NAME, level, message, {**values, **_goal_values(goal)})


def rejected_status(error: RequestRejected, goal: Goal | None) -> Status:
    """Return the verdict on a goal that breaks a rule; None for one that was not even read."""
    values: Values = {
        'state': 'REJECTED',
        'error_code': ERROR_CODES[error.reason],
        'error_name': error.reason.value,
        'joint': error.joint,
        'value': precise(error.value),
        'limit': precise(error.limit),
        'time': error.time,
        'duration_min': error.duration_min,
        **({} if goal is None else _goal_values(goal)),
    }
    return status_of(STATUS_NAME, DiagnosticStatus.ERROR, str(error), values)


def with_clock(status: Status, offset: float | None) -> Status:
    """Return a verdict that says how far ahead the stamps of joint states are [s], if notably."""
    clause = clock_clause(offset)
    if offset is None or not clause:
        return status
    status.message += f'; {clause}'
    status.values.append(Pair('clock_offset', text_of(offset)))
    if offset > 0.0 and status.level == DiagnosticStatus.OK:  # no network delivers ahead of time
        status.level = DiagnosticStatus.WARN
    return status


def ended_status(ended: Ended, remark: str = '') -> Status:
    """Return the notice that a motion has ended, and how; a remark is for those that failed."""
    motion, outcome, shortfall, said = ended
    message = f'plan {motion.plan_id} {ENDINGS[outcome]}'
    values = _motion_values(motion, outcome.value)
    if shortfall is None:
        message = '; '.join(filter(None, (message, said)))
        return status_of(STATUS_NAME, DiagnosticStatus.OK, message, values)
    message = '; '.join(filter(None, (f'{message}: {shortfall.message}', said, remark)))
    values = {**values, **_shortfall_values(shortfall)}
    return status_of(STATUS_NAME, DiagnosticStatus.ERROR, message, values)


def astray_status(astray: Astray) -> Status:
    """Return the notice that the arm has left the motion under way."""
    motion, shortfall = astray
    values = {**_motion_values(motion, 'ASTRAY'), **_shortfall_values(shortfall)}
    message = f'plan {motion.plan_id} is not followed: {shortfall.message}'
    return status_of(STATUS_NAME, DiagnosticStatus.WARN, message, values)


def report_status(report: VibrationReport) -> Status:
    """Return what a motion has left behind."""
    return status_of(REPORT_NAME, LEVELS[report.level], report.message, _report_values(report))


def monitor_status(
    report: VibrationReport | None, phase: str, dropped: int, clock_offset: float | None = None
) -> Status:
    """
    Return the present state of a monitor.

    Parameters
    ----------
    report
        The last one, ``None`` before the first.
    phase
        Event that the monitor is waiting for.
    dropped
        Number of unusable samples [-].
    clock_offset
        By how much the stamps of joint states are ahead of their arrival [s], ``None`` if unknown.

    """
    state: Values = {
        'phase': phase,
        'dropped_samples': dropped,
        'stamp_minus_arrival': clock_offset,
    }
    if report is None:
        message = f'{phase}: no motion has been judged yet'
        return status_of(REPORT_NAME, DiagnosticStatus.OK, message, state)
    message = f'{phase}; last motion: {report.message}'
    return status_of(
        REPORT_NAME, LEVELS[report.level], message, {**state, **_report_values(report)}
    )


def _report_values(report: VibrationReport) -> Values:
    """Return the numbers of a report."""
    seen = report.samples > 0
    return {
        'start_time': f'{report.start_time:.9f}',
        'end_time': f'{report.end_time:.9f}',
        'joint': report.joint,
        'amplitude': report.fit.amplitude,
        'peak_to_peak': report.fit.peak_to_peak,
        'frequency': report.fit.frequency,
        'frequency_expected': report.frequency_expected,
        'damping_ratio': report.fit.damping_ratio,
        'damping_expected': report.damping_expected,
        'settling_time': report.settling_time,
        'settled': report.is_settled if seen else None,
        'bias': report.fit.bias,
        **_joint_values('final_error', report.joint_names, report.final_error),
        'travel_ratio': None if report.course is None else report.course.ratio,
        **_joint_values('rms_effort', report.joint_names, report.rms_effort),
        'window': report.window if seen else None,
        'samples': report.samples,
        'fit_rms': report.fit.fit_rms,
        'clock_offset': report.clock_offset,
        'tracked': report.is_tracked or None,
        **_estimate_values(report.estimate),
        **_whole_values(report.model),
    }


def _estimate_values(estimate: StiffnessEstimate | None) -> Values:
    """Return an estimate that can be trusted, else nothing."""
    if estimate is None or not estimate.is_trustworthy or estimate.case is None:
        return {}
    return {
        'stiffness_estimate': estimate.stiffness,
        'stiffness_std': estimate.stiffness_std,
        'damping_estimate': estimate.damping,
        'damping_std': estimate.damping_std,
        'estimate_basis': estimate.case.value,
        'estimate_inertia': estimate.inertia,
    }


def _shortfall_values(shortfall: Shortfall) -> Values:
    """Return what an arm does instead of what is planned."""
    return {
        'error_code': ERROR_CODES[shortfall.reason],
        'error_name': shortfall.reason.value,
        'joint': shortfall.joint or None,
        'value': shortfall.value,
        'limit': shortfall.limit if shortfall.joint else None,
    }


def model_values(found: LastLinks, stds: LastLinks) -> Values:
    """Return a whole model with the standard errors that are finite."""
    values: dict[str, float | int | str | None] = {}
    for key, value, std in zip(MODEL_KEYS.values(), found, stds, strict=True):
        values |= {key: value, f'{key}_std': std if isfinite(std) else None}
    return values


def _whole_values(model: ModelEstimate | None) -> Values:
    """Return a whole model that can be trusted, else nothing."""
    if model is None or model.reason or model.values is None or model.stds is None:
        return {}
    return model_values(model.values, model.stds)


def _joint_values(quantity: str, joints: Sequence[str], values: Sequence[float | None]) -> Values:
    """Return a quantity of each joint, or of none."""
    if not values:
        return {}
    return {f'{quantity}.{j}': value for j, value in zip(joints, values, strict=True)}


def _motion_values(motion: Motion, state: str) -> Values:
    """Return the values that tell which motion a status is about."""
    options = motion.plan.options
    return {
        'plan_id': motion.plan_id,
        'state': state,
        'error_code': 0,
        'error_name': 'SUCCESSFUL',
        'strategy': options.strategy.value,
        'flat_model': options.flat_model.value,
        'duration': motion.plan.request.duration,
        'start_time': f'{motion.start:.9f}',
    }


def _goal_values(goal: Goal) -> Values:
    """Return the goal in brief: what it names, its final pose, its stamp."""
    final = goal.points[-1] if goal.points else None
    return {
        'goal.joint_names': list_text(goal.joint_names),
        'goal.positions': list_text(final.positions) if final else None,
        'goal.time_from_start': final.time if final else None,
        'goal.points': len(goal.points),
        'goal.stamp': 0.0 if goal.stamp is None else f'{goal.stamp:.9f}',
    }
