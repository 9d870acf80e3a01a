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

"""What the tracker is told: the loop, its bandwidths, and when it gives up."""

from dataclasses import dataclass
from math import inf, isfinite

from flat_planner_ros.core.arm import FloatArray, InvalidRequest, PlanarArm
import numpy as np


@dataclass(frozen=True, kw_only=True)
class Uncertainty:
    """
    Half-widths of the box of arms that the loop is certified for, as shares of the model's [-].

    Attributes
    ----------
    stiffness, damping
        Of the passive joint.
    inertia
        Of all masses together.
    samples
        By which an effort may act later than the loop knows; not a share but a number.

    """

    stiffness: float = 0.25
    damping: float = 0.25
    inertia: float = 0.1
    samples: int = 1

    def __post_init__(self) -> None:
        """Refuse boxes that hold no arms."""
        for name in ('stiffness', 'damping', 'inertia'):
            value = getattr(self, name)
            if not 0.0 <= value < 1.0:
                raise InvalidRequest(f'uncertainty of {name} must be from 0 to 1, got {value}')
        if self.samples < 0:
            raise InvalidRequest(f'samples must be at least 0, got {self.samples}')


@dataclass(frozen=True, kw_only=True)
class TrackerSettings:
    """
    The loop, its bandwidths, and when it gives up.

    Attributes
    ----------
    rate
        Joint samples, and efforts, per second [Hz].
    delay
        From the moment an effort is computed until it acts [s].
    bandwidth
        Frequency of the closed loop's poles [rad/s]; 0 for one by `relative_bandwidth`.
    relative_bandwidth
        The same in terms of the free oscillation's frequency, or less where the margin asks for a
        slower loop [-].
    damping
        Damping ratio of these poles [-], at least 0.71.
    observer_ratio
        Bandwidth of the observer in terms of the loop's [-].
    uncertainty
        Arms for which the loop must be stable.
    margin
        Least distance of the loop's frequency response from -1 for all of them [-].
    effort_limit
        Largest effort of each actuated joint [N m], one number for all or one for each.
    timeout
        Age of the joint samples at which it gives up [s].
    max_age
        Age of the joint samples on average, when they are used, at which it gives up [s]; 0 for as
        late as efforts may act by the certificate.
    jump
        Difference of a sample from what was expected at which it gives up [rad].
    max_error
        Distance from the plan at which it gives up [rad].
    saturation_timeout
        Time for which an effort may be at its limit [s].
    ramp
        Time in which the effort goes to zero after that [s].
    hold
        Whether the final pose is held after a motion; otherwise the effort goes to zero.

    """

    rate: float = 500.0
    delay: float = 0.001
    bandwidth: float = 0.0
    relative_bandwidth: float = 1.5
    damping: float = 0.75
    observer_ratio: float = 4.0
    uncertainty: Uncertainty = Uncertainty()
    margin: float = 0.2
    effort_limit: tuple[float, ...] = (inf,)
    timeout: float = 0.05
    max_age: float = 0.0
    jump: float = 0.2
    max_error: float = 1.0
    saturation_timeout: float = 0.5
    ramp: float = 0.1
    hold: bool = True

    def __post_init__(self) -> None:
        """Refuse numbers without meaning."""
        for name in ('rate', 'relative_bandwidth', 'damping', 'observer_ratio'):
            self._check(name, isfinite(getattr(self, name)) and getattr(self, name) > 0.0, '> 0')
        for name in ('timeout', 'jump', 'max_error', 'saturation_timeout'):
            self._check(name, getattr(self, name) > 0.0, '> 0')
        for name in ('delay', 'bandwidth', 'max_age', 'ramp'):
            self._check(name, 0.0 <= getattr(self, name) < inf, '>= 0 and finite')
        self._check('margin', 0.0 < self.margin < 1.0, 'between 0 and 1')
        self._check('effort_limit', all(limit > 0.0 for limit in self.effort_limit), '> 0')

    @property
    def period(self) -> float:
        """Return the time between two samples [s]."""
        return 1.0 / self.rate

    def bandwidth_of(self, arm: PlanarArm) -> float:
        """Return the largest frequency of the closed loop's poles for an arm [rad/s]."""
        return self.bandwidth or self.relative_bandwidth * arm.natural_mode().frequency

    def limits_of(self, arm: PlanarArm) -> FloatArray:
        """Return the largest effort of each actuated joint, shape (n-1,) [N m]."""
        limits, motors = np.array(self.effort_limit), arm.n - 1
        if limits.size not in (1, motors):
            raise InvalidRequest(
                f'effort_limit must have 1 or {motors} entries, got {limits.size}'
            )
        return np.full(motors, limits)

    def _check(self, name: str, is_met: bool, rule: str) -> None:
        """Refuse a setting that breaks its rule."""
        if not is_met:
            raise InvalidRequest(f'{name} must be {rule}, got {getattr(self, name)}')
