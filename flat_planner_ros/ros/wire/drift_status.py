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

"""How an arm ages, as a diagnostic message."""

from collections.abc import Sequence

from diagnostic_msgs.msg import DiagnosticStatus
from flat_planner_ros.core.monitor import ParameterDrift
from flat_planner_ros.ros.wire.diagnostics import MODEL_KEYS, status_of
from flat_planner_ros.ros.wire.interfaces import DRIFT_NAME
from flat_planner_ros.ros.wire.status_writer import Status


def drift_status(drifts: Sequence[ParameterDrift]) -> Status:
    """Return what of an arm wanders, by its estimates after at least 20 motions."""
    noticed = [drift for drift in drifts if drift.is_noticed]
    values: dict[str, float | int | str | None] = {
        'motions': max(drift.motions for drift in drifts),
        'drifting': ', '.join(map(_key, noticed)) or None,
    }
    for drift in drifts:
        key = _key(drift)
        values |= {
            key: drift.value,
            f'{key}_change': drift.change,
            f'{key}_rate': drift.rate,
            f'{key}_rate_std': drift.rate_std,
        }
    if not noticed:
        message = f'no parameter wanders, as far as {values["motions"]} motions tell'
        return status_of(DRIFT_NAME, DiagnosticStatus.OK, message, values)
    message = 'the arm ages: ' + '; '.join(drift.text for drift in noticed)
    return status_of(DRIFT_NAME, DiagnosticStatus.WARN, message, values)


def _key(drift: ParameterDrift) -> str:
    """Return the key of a parameter, as in reports where it is there."""
    return MODEL_KEYS.get(drift.name, drift.name)
