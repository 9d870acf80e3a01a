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

"""Parameters of the monitor node."""

from math import pi

from flat_planner_ros.core.arm import Drive, PlanarArm
from flat_planner_ros.core.monitor import ActuatedJoints, DriftSettings, MonitorSettings
from flat_planner_ros.ros.parameters.arm_model import arm_of, MODEL_ROWS
from flat_planner_ros.ros.parameters.joint_states import JOINT_STATE_ROWS, joint_state_rules
from flat_planner_ros.ros.parameters.row import (
    InvalidParameter,
    Row,
    Values,
)

ROWS = [
    *MODEL_ROWS,
    Row(
        'window',
        MonitorSettings.window,
        's',
        'time after a motion that is judged, several periods of the oscillation',
        lower=0.1,
        upper=60.0,
    ),
    Row(
        'amplitude_ok',
        MonitorSettings.amplitude_ok,
        'rad',
        'largest amplitude at the end of a motion that is OK, above 0',
        lower=0.0,
    ),
    Row(
        'amplitude_error',
        MonitorSettings.amplitude_error,
        'rad',
        'largest amplitude that is no ERROR but a WARN',
        lower=0.0,
    ),
    Row(
        'final_ok',
        MonitorSettings.final_ok,
        'rad',
        'largest deviation of a joint from its goal after a motion that is OK, above 0',
        lower=0.0,
    ),
    Row(
        'final_error',
        MonitorSettings.final_error,
        'rad',
        'largest such deviation that is no ERROR but a WARN',
        lower=0.0,
    ),
    Row(
        'settling_band',
        MonitorSettings.settling_band,
        'rad',
        'deviation of the passive joint that counts as settled, above 0',
        lower=0.0,
    ),
    Row(
        'timeout',
        MonitorSettings.timeout,
        's',
        'silence after which joint states are stale',
        lower=0.01,
        upper=60.0,
    ),
    *JOINT_STATE_ROWS,
    Row(
        'actuated_joints',
        MonitorSettings.actuated_joints,
        '',
        'what the actuated joints do after a motion',
        'auto = seen from the samples',
    ),
    Row(
        'fit_model',
        MonitorSettings.fits_model,
        '',
        'estimate inertias, spring, damper and friction of the last two links from each motion',
        'needs measured efforts, and a second or two of the processor after each motion',
    ),
    Row(
        'drift.window',
        DriftSettings.window,
        '',
        'motions over which the estimates are watched for an arm that ages',
        lower=20,
        upper=10000,
    ),
    Row(
        'drift.false_alarms',
        DriftSettings.false_alarms,
        '',
        'share of the motions after which an arm that does not age is suspected at most',
        lower=1e-9,
        upper=0.1,
    ),
]
"""All parameters of the monitor node."""


def build(values: Values) -> MonitorSettings:
    """
    Return what the monitor looks at, tolerates and expects.

    Raises
    ------
    FlatPlannerError
        The values contradict each other, or the window cannot show the expected oscillation.

    """
    _, arm = arm_of(values)
    frequency, damping_ratio = _expected(arm, Drive(values['drive']))
    window = values['window']
    if frequency is not None and window * frequency < 1.0:
        raise InvalidParameter(
            f'window {window:g} s is shorter than one period of the expected oscillation, '
            f'{1.0 / frequency:.3g} s; give it several'
        )
    return MonitorSettings(
        window=window,
        amplitude_ok=values['amplitude_ok'],
        amplitude_error=values['amplitude_error'],
        final_ok=values['final_ok'],
        final_error=values['final_error'],
        settling_band=values['settling_band'],
        timeout=values['timeout'],
        joint_states=joint_state_rules(values),
        expected_frequency=frequency,
        expected_damping_ratio=damping_ratio,
        arm=arm,
        actuated_joints=ActuatedJoints(values['actuated_joints']),
        # A position drive has no say in the efforts: only ratios to the inertia I*_n are told.
        fits_model=values['fit_model'] and Drive(values['drive']) is Drive.EFFORT,
        drift=DriftSettings(
            window=values['drift.window'], false_alarms=values['drift.false_alarms']
        ),
    )


def _expected(arm: PlanarArm, drive: Drive) -> tuple[float | None, float | None]:
    """Return the damped frequency [Hz] and damping ratio [-], none if the arm does not swing."""
    mode = arm.natural_mode(held=drive is Drive.POSITION)
    if mode.damped_frequency == 0.0:
        return None, None
    return mode.damped_frequency / (2 * pi), mode.damping_ratio
