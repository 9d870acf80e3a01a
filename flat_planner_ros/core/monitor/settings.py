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

"""What a monitor looks at, what it tolerates, and how severe its reports can be."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

from flat_planner_ros.core.arm import (
    check_number,
    InvalidRequest,
    JointStateRules,
    PlanarArm,
)
from flat_planner_ros.core.monitor.drift_settings import DriftSettings
from flat_planner_ros.core.monitor.identification import ActuatedJoints

UNITS = {
    'window': 's',
    'amplitude_ok': 'rad',
    'amplitude_error': 'rad',
    'final_ok': 'rad',
    'final_error': 'rad',
    'settling_band': 'rad',
    'timeout': 's',
}
"""Settings above 0, with their units."""


class Level(Enum):
    """Severity of a report."""

    OK = 'ok'
    WARN = 'warn'
    ERROR = 'error'
    STALE = 'stale'

    @staticmethod
    def worst(levels: Iterable['Level']) -> 'Level':
        """Return the most severe level, OK if there is none."""
        order = list(Level)
        return max(levels, key=order.index, default=Level.OK)


@dataclass(frozen=True, kw_only=True)
class MonitorSettings:
    """
    What a monitor looks at and what it tolerates.

    Attributes
    ----------
    window
        Time after the motion that is judged [s]; several periods.
    amplitude_ok, amplitude_error
        Largest amplitude that is fine, and largest that is no error [rad].
    final_ok, final_error
        Largest deviation of a joint from its goal after the motion that is fine, and largest that
        is no error [rad].
    settling_band
        Deviation from the final position that counts as settled [rad].
    timeout
        Silence after which the measurement is stale, and backward step of time from which the
        clock counts as reset [s].
    joint_states
        How they are read.
    expected_frequency
        Damped frequency expected of the oscillation [Hz], or ``None``.
    expected_damping_ratio
        Its damping ratio [-], or ``None``.
    arm
        Nominal model whose stiffness and damping are estimated, or ``None`` for no estimate.
    actuated_joints
        Whether the actuated joints are free or held after a motion.
    fits_model
        Whether the whole model of the last two links is fitted to each motion; takes a second or
        two of the processor.
    drift
        When the arm is said to age.

    """

    window: float = 3.0
    amplitude_ok: float = 5e-3
    amplitude_error: float = 5e-2
    final_ok: float = 1e-2
    final_error: float = 0.1
    settling_band: float = 5e-3
    timeout: float = 0.5
    joint_states: JointStateRules = JointStateRules()  # noqa: RUF009  A frozen value.
    expected_frequency: float | None = None
    expected_damping_ratio: float | None = None
    arm: PlanarArm | None = None
    actuated_joints: ActuatedJoints = ActuatedJoints.AUTO
    fits_model: bool = False
    drift: DriftSettings = DriftSettings()  # noqa: RUF009  A frozen value.

    def __post_init__(self) -> None:
        """Refuse settings without meaning."""
        for name, unit in UNITS.items():
            check_number(name, getattr(self, name), unit, above=0.0, error=InvalidRequest)
        for least, most in (('amplitude_ok', 'amplitude_error'), ('final_ok', 'final_error')):
            if not getattr(self, most) >= getattr(self, least):
                raise InvalidRequest(
                    f'{most} {getattr(self, most)} rad is below {least} {getattr(self, least)} rad'
                )
        frequency, ratio = self.expected_frequency, self.expected_damping_ratio
        if frequency is not None:
            check_number('expected_frequency', frequency, 'Hz', above=0.0, error=InvalidRequest)
        if ratio is not None and not 0.0 <= ratio < 1.0:
            raise InvalidRequest(f'expected damping ratio must be in [0, 1), got {ratio}')
