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

"""What a verdict predicts of a motion: values for tools, clauses for people."""

from flat_planner_ros.core.arm import InvalidRequest, PlanarArm
from flat_planner_ros.core.insensitive import imbalance_residual, PredictedResidual
from flat_planner_ros.core.planning import (
    baselines,
    duration_advice,
    residual_of_plan,
    time_advice,
)
from flat_planner_ros.core.session import Motion


def left_by_imbalance(motion: Motion, built: PlanarArm | None) -> float | None:
    """
    Return the oscillation that a motion leaves because the arm is not balanced [rad].

    Parameters
    ----------
    motion
        An accepted one.
    built
        The arm as it is built; None for the nominal one, of which nothing is known.

    """
    if built is None:
        return None
    samples, planned = motion.samples, motion.plan
    course = samples.positions, samples.velocities, samples.accelerations
    try:
        return imbalance_residual(
            built, planned.problem.arm, course, planned.duration, planned.options.drive
        )
    except InvalidRequest:
        return None  # an arm that does not oscillate


def residual_values(
    motion: Motion, *, with_advice: bool, with_baselines: bool
) -> dict[str, float | int | str | None]:
    """
    Return what a motion is predicted to leave behind, and what others would.

    Parameters
    ----------
    motion
        An accepted one.
    with_advice, with_baselines
        Whether to say when more time pays, and what simpler methods would leave behind.

    """
    try:
        residual = residual_of_plan(motion.plan, motion.samples)
    except InvalidRequest:
        return {}  # an arm that does not oscillate leaves nothing to predict
    values: dict[str, float | int | str | None] = {
        'predicted_residual': residual.nominal,
        'predicted_residual_worst': residual.worst,
        'predicted_residual_box': str(residual.box),
        'predicted_miss_worst': residual.miss or None,
        'advice': _advice(motion, residual) if with_advice else None,
    }
    if with_baselines:
        for point in baselines(motion.plan):
            values[f'baseline.{point.series}.rms_effort'] = point.rms_effort
            values[f'baseline.{point.series}.residual'] = point.nominal
            values[f'baseline.{point.series}.residual_worst'] = point.worst
    return values


def _advice(motion: Motion, residual: PredictedResidual) -> str | None:
    """Return in one line what would pay, None if nothing would."""
    lines = [duration_advice(motion.plan, residual)]
    if motion.is_shortest:
        lines.append(time_advice(motion.plan))
    return '; '.join(line for line in lines if line) or None
