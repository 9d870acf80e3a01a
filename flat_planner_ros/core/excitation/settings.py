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

"""What motions that tell a model may do, and how much they are to tell."""

from dataclasses import dataclass

from flat_planner_ros.core.arm import check_number, FloatArray, InvalidRequest
from flat_planner_ros.core.planning import JointLimits
import numpy as np

GROWTH = 2.0
"""How much larger a motion may be than one that was as predicted [-]."""

PLAUSIBLE = 5.0
"""Largest factor between inertias or stiffness found and believed, either way [-]."""

HALF_RANGE = 1.5
"""How far joint n-1 may turn from where it starts, where no limit says so [rad]."""

DEFLECTION = 0.5
"""How far the passive joint may be bent, where no limit says so [rad]."""


@dataclass(frozen=True, kw_only=True)
class ExcitationSettings:
    """
    How motions that tell a model are chosen.

    Attributes
    ----------
    accuracy
        Standard error at which a parameter is certain, relative to its scale [-].
    noise
        Standard deviation of the measured angles, until they have told it [rad].
    first_share
        Share of effort limit and range that the first motion may use [-].
    agreement
        Misprediction of a motion, relative to it, up to which the next may be larger [-].
    most_motions
        Motions after which it ends in any case.
    most_attempts
        Motions of one size that may be mispredicted before it gives up.
    rest
        Time that is recorded after each motion, in free periods [-].

    """

    accuracy: float = 0.01
    noise: float = 1e-4
    first_share: float = 0.1
    agreement: float = 0.2
    most_motions: int = 12
    most_attempts: int = 3
    rest: float = 2.0

    def __post_init__(self) -> None:
        """Refuse settings without meaning."""
        for name, unit in {'accuracy': '', 'noise': 'rad', 'agreement': '', 'rest': ''}.items():
            check_number(name, getattr(self, name), unit, above=0.0, error=InvalidRequest)
        if not 0.0 < self.first_share <= 1.0:
            raise InvalidRequest(f'first_share must be in (0, 1], got {self.first_share}')
        for name in ('most_motions', 'most_attempts'):
            if getattr(self, name) < 1:
                raise InvalidRequest(f'{name} must be at least 1, got {getattr(self, name)}')


@dataclass(frozen=True, kw_only=True)
class JointRoom:
    """
    Where one of the first joints may be, and what its motor may give.

    Attributes
    ----------
    low, high
        Range [rad].
    velocity
        Largest speed [rad/s].
    effort
        Largest effort [N m].

    """

    low: float
    high: float
    velocity: float
    effort: float


@dataclass(frozen=True, kw_only=True)
class Room:
    """
    Where the joints may be, and what their motors may give.

    Attributes
    ----------
    low, high
        Range of joint n-1 [rad].
    passive_low, passive_high
        Range of the passive joint [rad].
    velocity, passive_velocity
        Largest speeds of both [rad/s].
    effort
        Largest effort of joint n-1 [N m].
    firsts
        Of each of the first n-2 joints; empty where they are not moved.

    """

    low: float
    high: float
    passive_low: float
    passive_high: float
    velocity: float
    passive_velocity: float
    effort: float
    firsts: tuple[JointRoom, ...] = ()

    @property
    def efforts(self) -> FloatArray:
        """Return the largest effort of each joint that is moved, joint n-1 last [N m]."""
        return np.array([*(joint.effort for joint in self.firsts), self.effort])

    @property
    def ranges(self) -> tuple[tuple[float, float], ...]:
        """Return lowest and highest angle of each joint that is moved and of the passive one."""
        firsts = ((joint.low, joint.high) for joint in self.firsts)
        return *firsts, (self.low, self.high), (self.passive_low, self.passive_high)

    @classmethod
    def within(
        cls, limits: JointLimits, here: float | FloatArray, half_range: float = HALF_RANGE
    ) -> 'Room':
        """
        Return the room that limits leave.

        Parameters
        ----------
        limits
            What the joints may do.
        here
            Joint angles at the start, shape (n,), or that of joint n-1 alone, which leaves the
            first joints where they are [rad]. They are left there, too, unless all their efforts
            are limited.
        half_range
            How far each joint may turn from there, within its limits [rad].

        Raises
        ------
        InvalidRequest
            The effort of joint n-1 is not limited, or a joint is outside its limits.

        """
        n = limits.effort.size
        pose = np.array(here, dtype=float)
        last = float(pose) if pose.ndim == 0 else float(pose[-2])
        effort = float(limits.effort[-2])
        if not (np.isfinite(effort) and effort > 0.0):
            raise InvalidRequest(
                f'joint n-1 needs a finite limits.effort above 0, got {effort:g} N m: how far '
                'a rough model may be tried depends on it'
            )
        low, high = _range(limits, n - 2, last, half_range, 'joint n-1')
        firsts: tuple[JointRoom, ...] = ()
        if pose.ndim and (np.isfinite(limits.effort[:-2]) & (limits.effort[:-2] > 0.0)).all():
            firsts = tuple(
                JointRoom(
                    low=around[0],
                    high=around[1],
                    velocity=float(limits.velocity[i]),
                    effort=float(limits.effort[i]),
                )
                for i in range(n - 2)
                for around in [_range(limits, i, float(pose[i]), half_range, f'joint {i + 1}')]
            )
        return cls(
            low=low,
            high=high,
            passive_low=max(-DEFLECTION, float(limits.position_min[-1])),
            passive_high=min(DEFLECTION, float(limits.position_max[-1])),
            velocity=float(limits.velocity[-2]),
            passive_velocity=float(limits.velocity[-1]),
            effort=effort,
            firsts=firsts,
        )


def _range(
    limits: JointLimits, index: int, here: float, half_range: float, name: str
) -> tuple[float, float]:
    """Return lowest and highest angle of a joint [rad]."""
    low = max(here - half_range, float(limits.position_min[index]))
    high = min(here + half_range, float(limits.position_max[index]))
    if not low < here < high:
        raise InvalidRequest(
            f'{name} is at {here:.4g} rad, not inside its limits {low:.4g} to {high:.4g} '
            'rad: move it there first'
        )
    return low, high
