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

"""What the motors of an arm apply: commanded effort, feedback, servos, limits, and the weight."""

from dataclasses import dataclass
from math import inf, pi

from flat_planner_ros.core.arm import (
    checked_array,
    Drive,
    FloatArray,
    InvalidCommand,
    InvalidModel,
    PlanarArm,
)
from flat_planner_ros.core.plant.effort_profile import check_bound, JointReference, MAX_EFFORT
import numpy as np
import numpy.typing as npt

STIFFEST = 0.5
"""Rate at which an ideal servo removes the error of the integration, in terms of the step [-]."""


@dataclass(frozen=True, kw_only=True)
class Servo:
    """
    Servos that make the actuated joints follow positions, whatever effort it takes.

    Attributes
    ----------
    bandwidth
        Of the critically damped second order in which a joint follows its reference [Hz]; 0 for
        an ideal servo, whose joints are where they should be.
    step
        Integration step of the arm [s].

    Raises
    ------
    InvalidModel
        If the bandwidth has no meaning, or the steps are too long for it.

    """

    bandwidth: float = 0.0
    step: float = 1e-3

    def __post_init__(self) -> None:
        """Refuse what could not be integrated."""
        most = STIFFEST / (2.0 * pi * self.step)
        if not 0.0 <= self.bandwidth <= most:
            raise InvalidModel(
                f'servo.bandwidth must be in [0, {most:.4g}] Hz with steps of {self.step:g} s, '
                f'got {self.bandwidth:g} Hz: take shorter steps, or 0 for an ideal servo'
            )

    def acceleration(self, reference: JointReference, q: FloatArray, dq: FloatArray) -> FloatArray:
        """Return what the servos give their joints, shape (n-1,) [rad/s^2]."""
        error, rate = reference.position - q[:-1], dq[:-1]
        if self.bandwidth > 0.0:
            own = 2.0 * pi * self.bandwidth
            return own**2 * error - 2.0 * own * rate
        own = STIFFEST / self.step
        lag = reference.velocity - rate
        return reference.acceleration + own**2 * error + 2.0 * own * lag


@dataclass(frozen=True, kw_only=True)
class DriveSettings:
    """
    What the motors of an arm are and do.

    Attributes
    ----------
    drive
        What a command's points are: efforts, or positions that servos follow.
    servo_bandwidth
        Of those servos [Hz], 0 for ideal ones.
    saturation
        Largest effort of each motor, n-1 of them [N m]; None if unlimited.
    feedback_p, feedback_d
        Gains on position and velocity errors, n-1 each [N m/rad], [N m s/rad]; None for none.
        They act where a command has positions.

    """

    drive: Drive = Drive.EFFORT
    servo_bandwidth: float = 0.0
    saturation: tuple[float, ...] | None = None
    feedback_p: tuple[float, ...] | None = None
    feedback_d: tuple[float, ...] | None = None


class Drives:
    """
    The motors of the actuated joints, and whoever pushes the arm besides.

    Where nothing is commanded they carry the weight of the arm, as the brakes or the gravity
    compensation of a real one do; that is nothing in a horizontal plane.

    Parameters
    ----------
    arm
        What they move.
    settings
        What they are.
    step
        Integration step of the arm [s].

    Raises
    ------
    InvalidModel
        If a number has no meaning.

    """

    def __init__(self, arm: PlanarArm, settings: DriveSettings, step: float) -> None:
        """Apply nothing but what carries the weight."""
        motors = arm.n - 1
        self._saturation = _per_motor('saturation', settings.saturation, motors, inf, 'N m')
        self._feedback_p = _per_motor('feedback_p', settings.feedback_p, motors, 0.0, 'N m/rad')
        self._feedback_d = _per_motor('feedback_d', settings.feedback_d, motors, 0.0, 'N m s/rad')
        self._is_limited = bool(np.isfinite(self._saturation).any())
        self.has_feedback = bool(self._feedback_p.any() or self._feedback_d.any())
        self.servo: Servo | None = None
        """What follows positions in the place of efforts and feedback, if anything does."""
        if settings.drive is Drive.POSITION:
            self.servo = Servo(bandwidth=settings.servo_bandwidth, step=step)
        self.arm = arm
        """What they move; may be replaced."""
        self._push, self._pushed_until = np.zeros(arm.n), -inf
        nothing, missing = np.zeros(motors), np.full(motors, np.nan)
        self.idle = JointReference(nothing, missing, missing, missing)
        """What stands for no command; its arrays are known by being these very ones."""

    @property
    def follows_positions(self) -> bool:
        """Whether the positions of a command matter."""
        return self.has_feedback or self.servo is not None

    def is_open_loop(self, now: float) -> bool:
        """Whether exactly the efforts that are commanded will act, from a time on [s]."""
        is_left_alone = now > self._pushed_until
        return is_left_alone and not (self.follows_positions or self._is_limited)

    def feed_forward(self, reference: JointReference, q: FloatArray) -> FloatArray:
        """Return what is applied without looking at errors, shape (n-1,) [N m]."""
        if self.arm.has_weight and reference.effort is self.idle.effort:
            return self.arm.gravity_effort(q)[:-1]
        return reference.effort

    def asked(self, reference: JointReference, q: FloatArray, dq: FloatArray) -> FloatArray:
        """
        Return feed-forward and feedback, before the motors' limits.

        Parameters
        ----------
        reference
            What is commanded.
        q, dq
            Joint angles [rad] and velocities [rad/s], shape (n,).

        Returns
        -------
        FloatArray
            Shape (n-1,) [N m].

        """
        if self.servo is not None:
            return self._effort_for(self.servo.acceleration(reference, q, dq), q, dq)
        effort = self.feed_forward(reference, q)
        if not self.has_feedback or reference.position is self.idle.position:
            return effort
        return (
            effort
            + self._feedback_p * (reference.position - q[:-1])
            + self._feedback_d * (reference.velocity - dq[:-1])
        )

    def rest_at(self, position: FloatArray) -> None:
        """Let servos hold these joint angles (n,) [rad] where nothing is commanded."""
        if self.servo is not None:
            nothing = np.zeros(self.arm.n - 1)
            self.idle = JointReference(nothing, position[:-1].copy(), nothing, nothing)

    def push(self, effort: npt.ArrayLike, until: float) -> None:
        """
        Let efforts from outside act on all joints.

        Parameters
        ----------
        effort
            Shape (n,) [N m].
        until
            Time from which they act no more [s].

        Raises
        ------
        InvalidCommand
            If they do not suit the arm.

        """
        shape = (self.arm.n,)
        pushed = checked_array('push', effort, 'N m', shape=shape, error=InvalidCommand)
        check_bound('push', pushed, MAX_EFFORT, 'N m')
        self._push, self._pushed_until = pushed, until

    def pushed(self, q: FloatArray, now: float) -> FloatArray | None:
        """Return what a push adds to the accelerations (n,) [rad/s^2] now [s], if one acts."""
        if now > self._pushed_until:
            return None
        mass = self.arm.mass_matrix(q)
        if self.servo is not None:
            # Servos hold their joints against any push; the last one gives way.
            return np.append(np.zeros(self.arm.n - 1), self._push[-1] / mass[-1, -1])
        return np.array(np.linalg.solve(mass, self._push), dtype=float)

    def _effort_for(self, acceleration: FloatArray, q: FloatArray, dq: FloatArray) -> FloatArray:
        """Return the effort under which the actuated joints accelerate so, the last one free."""
        arm = self.arm
        effort = arm.inverse_dynamics(q, dq, np.append(acceleration, 0.0))
        # What the passive joint's row lacks accelerates it, and pushes back through its column.
        column = arm.mass_matrix(q)[:, -1]
        pushed: FloatArray = effort[:-1] - column[:-1] * (effort[-1] / column[-1])
        return pushed

    def limited(self, effort: FloatArray) -> FloatArray:
        """Return what the motors can give, the very same array if that is all of it."""
        if not self._is_limited:
            return effort
        given = np.minimum(np.maximum(effort, -self._saturation), self._saturation)
        return effort if (given == effort).all() else given


def _per_motor(
    name: str, value: npt.ArrayLike | None, motors: int, default: float, unit: str
) -> FloatArray:
    """Return one non-negative number per motor."""
    array = np.full(motors, default) if value is None else np.array(value, dtype=float)
    if array.shape != (motors,):
        raise InvalidModel(f'{name} must have {motors} entries, got shape {array.shape}')
    if not (array >= 0.0).all():
        raise InvalidModel(f'{name} must be at least 0 {unit}, got {array}')
    return array
