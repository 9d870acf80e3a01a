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

"""What a vibration monitor tolerates, and its report."""

from dataclasses import dataclass
from enum import Enum
from math import isfinite

from flat_planner_ros.core.arm import InvalidRequest, PlanarArm
from flat_planner_ros.core.monitor.identification import ActuatedJoints, StiffnessEstimate
from flat_planner_ros.core.monitor.oscillation import OscillationFit


class Level(Enum):
    """Severity of a report."""

    OK = 'ok'
    WARN = 'warn'
    ERROR = 'error'
    STALE = 'stale'


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
    settling_band
        Deviation from the final position that counts as settled [rad].
    timeout
        Silence after which the measurement is stale, and backward step of time from which the
        clock counts as reset [s].
    expected_frequency
        Damped frequency expected of the oscillation [Hz], or ``None``.
    expected_damping_ratio
        Its damping ratio [-], or ``None``.
    arm
        Nominal model whose stiffness and damping are estimated, or ``None`` for no estimate.
    actuated_joints
        Whether the actuated joints are free or held after a motion.

    """

    window: float = 3.0
    amplitude_ok: float = 5e-3
    amplitude_error: float = 5e-2
    settling_band: float = 5e-3
    timeout: float = 0.5
    expected_frequency: float | None = None
    expected_damping_ratio: float | None = None
    arm: PlanarArm | None = None
    actuated_joints: ActuatedJoints = ActuatedJoints.AUTO

    def __post_init__(self) -> None:
        """Refuse settings without meaning."""
        for name in ('window', 'amplitude_ok', 'settling_band', 'timeout'):
            value = getattr(self, name)
            if not (isfinite(value) and value > 0.0):
                raise InvalidRequest(f'{name} must be positive and finite, got {value}')
        if not self.amplitude_error >= self.amplitude_ok:
            raise InvalidRequest(
                f'amplitude_error {self.amplitude_error} rad is below amplitude_ok '
                f'{self.amplitude_ok} rad'
            )
        frequency, ratio = self.expected_frequency, self.expected_damping_ratio
        if frequency is not None and not (isfinite(frequency) and frequency > 0.0):
            raise InvalidRequest(f'expected frequency must be positive, got {frequency} Hz')
        if ratio is not None and not 0.0 <= ratio < 1.0:
            raise InvalidRequest(f'expected damping ratio must be in [0, 1), got {ratio}')


@dataclass(frozen=True, kw_only=True, eq=False)
class VibrationReport:
    """
    What a motion left behind; a value that cannot be computed is ``None``.

    Attributes
    ----------
    level
        Verdict on the amplitude; at least ``WARN`` if there is none.
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

    @property
    def amplitude(self) -> float | None:
        """Return the envelope of the oscillation at T [rad]."""
        return self.fit.amplitude

    @property
    def peak_to_peak(self) -> float | None:
        """Return the swing of the passive joint over the window [rad]."""
        return self.fit.peak_to_peak

    @property
    def frequency(self) -> float | None:
        """Return the damped frequency [Hz]."""
        return self.fit.frequency

    @property
    def damping_ratio(self) -> float | None:
        """Return the damping ratio [-]."""
        return self.fit.damping_ratio

    @property
    def bias(self) -> float | None:
        """Return the middle of the oscillation minus the final position [rad]."""
        return self.fit.bias

    @property
    def fit_rms(self) -> float | None:
        """Return what the fit leaves [rad]."""
        return self.fit.fit_rms

    @property
    def settled(self) -> bool:
        """Return whether the passive joint came to rest within the window."""
        return self.settling_time is not None
