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

"""Estimates of an arm's model between the nodes: as reported, and as adopted."""

from collections.abc import Mapping
from dataclasses import replace
from math import inf

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from flat_planner_ros.core.arm import InvalidRequest, PlanarArm
from flat_planner_ros.core.monitor import (
    ActuatedJoints,
    Adoption,
    Estimate,
    LastLinks,
    ReportedEstimate,
    ReportedModel,
)
from flat_planner_ros.ros.wire.diagnostics import MODEL_KEYS, model_values, status_of
from flat_planner_ros.ros.wire.interfaces import MODEL_NAME, REPORT_NAME
from flat_planner_ros.ros.wire.status_writer import Status

MOTION = 'motion'
"""Basis of an estimate from a whole motion."""


def adopted_status(adoption: Adoption) -> Status:
    """Return the notice that the nominal model has changed."""
    estimate, former, arm = adoption.estimate, adoption.former, adoption.arm
    message = (
        f'stiffness {former.stiffness:.6g} -> {arm.stiffness:.6g} N m/rad, damping '
        f'{former.damping:.4g} -> {arm.damping:.4g} N m s/rad, estimated after the motion that '
        f'started at {estimate.start_time:.3f} s'
    )
    if isinstance(estimate, ReportedModel):
        before, now = former.inertia_star, arm.inertia_star
        message += (
            f'; inertias {before.both:.6g} -> {now.both:.6g} and {before.last:.6g} -> '
            f'{now.last:.6g} kg m^2'
        )
    values: dict[str, float | int | str | None] = {
        'state': 'ADOPTED',
        'stiffness': arm.stiffness,
        'stiffness_std': _std_of(estimate, 'stiffness'),
        'stiffness_former': former.stiffness,
        'damping': arm.damping,
        'damping_std': _std_of(estimate, 'damping'),
        'damping_former': former.damping,
        'estimate_basis': MOTION if isinstance(estimate, ReportedModel) else estimate.case.value,
        'start_time': f'{estimate.start_time:.9f}',
    }
    if isinstance(estimate, ReportedModel):
        values.update(model_values(LastLinks.of(arm), estimate.stds))
    return status_of(MODEL_NAME, DiagnosticStatus.OK, message, values)


def _std_of(estimate: Estimate, name: str) -> float:
    """Return the standard error of stiffness or damping."""
    if isinstance(estimate, ReportedModel):
        return float(getattr(estimate.stds, name))
    return float(getattr(estimate, f'{name}_std'))


def reported_estimate(msg: DiagnosticArray) -> Estimate | None:
    """
    Return the estimate in a monitor's report, of the whole model if there is one, None if not any.

    Raises
    ------
    InvalidRequest
        The report has an estimate that cannot be read.

    """
    for status in msg.status:
        values = {pair.key: pair.value for pair in status.values}
        if status.name != REPORT_NAME:
            continue
        try:
            if MODEL_KEYS['stiffness'] in values:
                return _reported_model(values)
            if 'stiffness_estimate' not in values:
                continue
            return ReportedEstimate(
                start_time=float(values['start_time']),
                joint=values['joint'],
                stiffness=float(values['stiffness_estimate']),
                stiffness_std=float(values['stiffness_std']),
                damping=float(values['damping_estimate']),
                damping_std=float(values['damping_std']),
                case=ActuatedJoints(values['estimate_basis']),
                inertia=float(values['estimate_inertia']),
            )
        except (KeyError, ValueError) as error:
            raise InvalidRequest(f'estimate with missing or unreadable {error}') from error
    return None


def _reported_model(values: Mapping[str, str]) -> ReportedModel:
    """Return the estimate of the whole model in the values of a report."""
    return ReportedModel(
        start_time=float(values['start_time']),
        joint=values['joint'],
        values=_last_links(values),
        stds=LastLinks(*(float(values.get(f'{key}_std', inf)) for key in MODEL_KEYS.values())),
    )


def _last_links(values: Mapping[str, str]) -> LastLinks:
    """Return the values of a whole model."""
    return LastLinks(*(float(values[key]) for key in MODEL_KEYS.values()))


def adopted_arm(msg: DiagnosticArray, arm: PlanarArm) -> PlanarArm | None:
    """
    Return an arm with what a planner has adopted, None if the message is of goals.

    Raises
    ------
    InvalidRequest
        The values cannot be read.

    """
    adopted = None
    for status in msg.status:
        if status.name == MODEL_NAME:
            values = {pair.key: pair.value for pair in status.values}
            try:
                adopted = replace(
                    arm,
                    stiffness=float(values['stiffness']),
                    damping=float(values['damping']),
                )
                if MODEL_KEYS['stiffness'] in values:
                    adopted = _last_links(values).applied_to(arm)
            except (KeyError, ValueError) as error:
                raise InvalidRequest(
                    f'adopted model with missing or unreadable {error}'
                ) from error
    return adopted
