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

"""True dynamics of an arm under a stamped effort command."""

from collections.abc import Sequence
from math import floor, inf, sqrt

from flat_planner_ros.core.arm import (
    check_number,
    checked_array,
    FloatArray,
    InvalidCommand,
    InvalidModel,
    PlanarArm,
)
from flat_planner_ros.core.plant.drives import Drives, DriveSettings
from flat_planner_ros.core.plant.effort_profile import (
    check_bound,
    EffortProfile,
    JointReference,
    MAX_EFFORT,
    MAX_VELOCITY,
)
from flat_planner_ros.core.plant.states import ArmState, PassedStates
from flat_planner_ros.core.plant.steps import linear_steps, runge_kutta
import numpy as np
import numpy.typing as npt

GRID_TOLERANCE = 1e-6
"""A grid time ahead of the present by less counts as reached, relative to the step [-]."""

MAX_SPEED = 10 * MAX_VELOCITY
"""Joint velocity beyond which an arm is stopped: efforts, gains or steps make no sense [rad/s]."""

UNLIMITED = DriveSettings()
"""Motors that give every effort that is commanded."""


class SimulatedArm:
    """
    The true arm: its full dynamics, integrated in fixed Runge-Kutta steps of fourth order.

    Time lies on a grid: the start plus a whole number of steps, so that it never drifts. An arm
    that runs away, beyond MAX_SPEED, is stopped where it is until it is reset. An arm that gravity
    would move has brakes: it stands while there is no command, and until its first one starts.
    After the last point of a command its motors carry its weight where it is, and nothing else.

    Parameters
    ----------
    arm
        The arm as it is, not as a planner believes it to be.
    position
        Joint angles at rest, shape (n,) [rad]; zeros by default.
    time
        Time at the start [s].
    step
        Integration step [s].
    drives
        What its motors are; by default they give every effort that is commanded.

    Raises
    ------
    InvalidModel
        If a number has no meaning.

    """

    def __init__(
        self,
        arm: PlanarArm,
        *,
        position: npt.ArrayLike | None = None,
        time: float = 0.0,
        step: float = 1e-3,
        drives: DriveSettings = UNLIMITED,
    ) -> None:
        """Stand still at the position."""
        check_number('step', step, 's', above=0.0)
        check_number('time', time, 's')
        self._drives = Drives(arm, drives, step)
        self._origin, self._step = float(time), float(step)
        self._count = 0
        self._clipped_steps = 0
        self._is_clipped = False
        self._profile: EffortProfile | None = None
        self.reset(np.zeros(arm.n) if position is None else position)

    @property
    def arm(self) -> PlanarArm:
        """Return the arm; another with as many joints may take its place between steps."""
        return self._drives.arm

    @arm.setter
    def arm(self, arm: PlanarArm) -> None:
        if arm.n != self.arm.n:
            raise InvalidModel(f'the arm must keep {self.arm.n} joints, got {arm.n}')
        self._drives.arm = arm

    @property
    def step(self) -> float:
        """Return the integration step [s]."""
        return self._step

    @property
    def time(self) -> float:
        """Return the simulated time [s]."""
        return self._origin + self._count * self._step

    @property
    def position(self) -> FloatArray:
        """Return a copy of the joint angles, shape (n,) [rad]."""
        return self._position.copy()

    @property
    def velocity(self) -> FloatArray:
        """Return a copy of the joint velocities, shape (n,) [rad/s]."""
        return self._velocity.copy()

    @property
    def applied_effort(self) -> FloatArray:
        """Return what acts now: motors after feedback and limit, then the spring (n,) [N m]."""
        q, dq, drives = self._position, self._velocity, self._drives
        given = drives.limited(drives.asked(self._reference(self.time), q, dq))
        return np.append(given, self.arm.passive_effort(q[-1], dq[-1]))

    @property
    def state(self) -> ArmState:
        """Return time, position, velocity and applied effort."""
        return ArmState(self.time, self.position, self.velocity, self.applied_effort)

    @property
    def fault(self) -> str:
        """Return why the arm has been stopped and what it did, nothing while it has not."""
        return self._fault

    def take_clipped_steps(self) -> int:
        """Return how many steps had an effort clipped since this was last asked."""
        count = self._clipped_steps
        self._clipped_steps = 0
        return count

    def command(self, profile: EffortProfile, now: float) -> None:
        """
        Play a profile in the place of the present command.

        Parameters
        ----------
        profile
            The command; past points are skipped, and a start in the future is approached linearly
            from the effort that is commanded now.
        now
            Absolute time at which it was received [s].

        Raises
        ------
        InvalidCommand
            If it has ended already or does not suit the arm, or if the arm has been stopped. The
            present command then goes on.

        """
        self._refuse_if_stopped()
        motors = self.arm.n - 1
        if profile.motors != motors:
            raise InvalidCommand(f'the arm has {motors} motors, the command {profile.motors}')
        if profile.end <= self.time:
            raise InvalidCommand(
                f'the command ended at {profile.end:.6f} s, before the present {self.time:.6f} s'
            )
        drives, present = self._drives, self._reference(now)
        if drives.follows_positions and profile.positions is None:
            raise InvalidCommand('feedback or a servo needs a command with positions')
        if profile.efforts[-1].any() and not self.arm.has_weight:
            # Nobody could know when to let go, and a ramp to zero would be another motion.
            raise InvalidCommand(
                f'the last effort must be 0 N m, got {profile.efforts[-1]}: the arm has no weight '
                'that it could hold'
            )
        # What holds an arm up before the start is where it is, not what a model says of it.
        is_carried = self.arm.has_weight and present.effort is drives.idle.effort
        self._idle_until = profile.start + float(profile.times[0]) if is_carried else -inf
        if self._is_braked:
            self._braked_until = profile.start
        self._profile = profile.taken_over(now, drives.feed_forward(present, self._position))
        self._held = drives.idle
        self._held_until = inf

    def hold(self, effort: npt.ArrayLike, until: float = inf) -> None:
        """
        Apply a constant effort, open loop, in the place of the present command.

        Parameters
        ----------
        effort
            Shape (n-1,) [N m].
        until
            Absolute time from which nothing is applied any more [s].

        Raises
        ------
        InvalidCommand
            If it does not suit the arm, or if the arm has been stopped. What is applied at
            present then goes on.

        """
        self._refuse_if_stopped()
        if self._drives.servo is not None:
            raise InvalidCommand('a servo follows positions, it takes no efforts')
        shape = (self.arm.n - 1,)
        held = checked_array('effort', effort, 'N m', shape=shape, error=InvalidCommand)
        check_bound('effort', held, MAX_EFFORT, 'N m')
        self._profile = None
        self._braked_until = -inf
        self._held = self._drives.idle._replace(effort=held)
        self._held_until = until

    def push(self, effort: npt.ArrayLike, until: float) -> None:
        """Let efforts (n,) [N m] act besides, until a time [s]; see `Drives.push`."""
        self._drives.push(effort, until)

    def release(self) -> None:
        """Apply nothing until the next command; an arm with weight stands by its brakes."""
        self._profile = None
        self._idle_until = -inf
        self._braked_until = -inf
        self._drives.rest_at(self._position)
        self._held = self._drives.idle
        self._held_until = inf
        if self.arm.has_weight:
            self._braked_until = inf
            self._velocity = np.zeros(self.arm.n)

    def take_expired(self) -> bool:
        """Return whether a held effort other than zero has ended, and forget that it has."""
        if self.time < self._held_until - GRID_TOLERANCE * self._step:
            return False
        was_applied = bool(self._held.effort.any())
        self.release()
        return was_applied

    def reset(self, position: npt.ArrayLike) -> None:
        """Rest at joint angles (n,) [rad] without a command; time goes on."""
        self._position = checked_array('position', position, 'rad', shape=(self.arm.n,))
        self._velocity = np.zeros(self.arm.n)
        self._fault = ''
        self.push(np.zeros(self.arm.n), -inf)
        self.release()

    def advance(self, until: float) -> int:
        """Integrate to the last grid time that is not after `until` [s]; return the steps."""
        steps = self._steps_until(until)
        if self._take_linear_steps(steps) is not None:
            return steps
        target = self._count + steps
        reference = self._reference(self.time)
        for _ in range(steps):
            if self._fault:
                self._count = target
                break
            reference = self._advance_once(reference)
        return steps

    def advance_through(self, times: Sequence[float], until: float) -> list[ArmState]:
        """
        Integrate as `advance` does; return the states on the way.

        Parameters
        ----------
        times
            When states are wanted, in order, from the present on and not after `until` [s].
        until
            Absolute time [s].

        """
        rows = [self._steps_until(time) for time in times]
        first, passed = self._count, self._take_linear_steps(self._steps_until(until))
        if passed is not None:
            return [passed.state(self._origin + (first + row) * self._step, row) for row in rows]
        states = []
        for time in times:
            self.advance(time)
            states.append(self.state)
        self.advance(until)
        return states

    def _steps_until(self, until: float) -> int:
        """Return how many steps there are to the last grid time not after another time [s]."""
        target = floor((until - self._origin) / self._step + GRID_TOLERANCE)
        return max(0, target - self._count)

    def _take_linear_steps(self, steps: int) -> PassedStates | None:
        """Take steps as products; None, and none is taken, where they are not that simple."""
        is_simple = self._drives.is_open_loop(self.time) and self._braked_until == -inf
        linear = linear_steps(self.arm, self._step) if is_simple and not self._fault else None
        if linear is None or not steps:
            return None
        halves: FloatArray = np.arange(0.0, steps + 0.25, 0.5)
        times = self._origin + (self._count + halves) * self._step
        efforts, n = self._efforts(times), self.arm.n
        with np.errstate(over='ignore', invalid='ignore'):  # of an arm that runs away
            states = linear.states(np.concatenate([self._position, self._velocity]), efforts)
        velocities = states[:, n:]
        if not (np.abs(velocities) < MAX_SPEED / sqrt(n)).all():  # nor is NaN below
            return None
        self._count += steps
        self._position, self._velocity = states[-1, :n], velocities[-1]
        return PassedStates(self.arm, states[:, :n], velocities, efforts[::2])

    def _efforts(self, times: FloatArray) -> FloatArray:
        """Return what is commanded at absolute times (m,) [s], shape (m, n-1) [N m]."""
        profile, idle = self._profile, self._drives.idle.effort
        if profile is None:
            return np.where((times < self._held_until)[:, None], self._held.effort, idle)
        efforts = profile.efforts_at(times)
        efforts[(times < self._idle_until) | (times > profile.end)] = idle
        return efforts

    @property
    def _is_braked(self) -> bool:
        """Whether brakes hold the arm in the step from now on."""
        return self.time < self._braked_until - GRID_TOLERANCE * self._step

    def _advance_once(self, start: JointReference) -> JointReference:
        """Take one step; return the reference at its end, where the next step starts."""
        if self._braked_until != -inf:
            if self._is_braked:
                self._count += 1
                return self._reference(self.time)
            self._braked_until = -inf
        h, q, dq = self._step, self._position, self._velocity
        middle = self._reference(self._origin + (self._count + 0.5) * h)
        self._count += 1
        end = self._reference(self.time)
        self._is_clipped = False
        position, velocity = runge_kutta(self._acceleration, h, q, dq, (start, middle, end))
        if not velocity.dot(velocity) < MAX_SPEED**2:  # nor is NaN below
            self._stop(velocity)
            return end
        self._position, self._velocity = position, velocity
        if self._is_clipped:
            self._clipped_steps += 1
        return end

    def _stop(self, velocity: FloatArray) -> None:
        """Stand still where the arm is, because of velocities (n,) [rad/s] without sense."""
        worst = int(np.argmax(np.abs(velocity)))
        self._fault = (
            f'joint {worst + 1} would have reached {velocity[worst]:.3g} rad/s at {self.time:.3f} '
            f's, beyond {MAX_SPEED:g} rad/s: the efforts, or the friction and gains for steps of '
            f'{self._step:g} s, are too large'
        )
        self._velocity = np.zeros(self.arm.n)
        self.release()

    def _refuse_if_stopped(self) -> None:
        """Let only a reset move an arm that has run away."""
        if self._fault:
            raise InvalidCommand(f'the arm has been stopped until it is reset: {self._fault}')

    def _acceleration(
        self, reference: JointReference, q: FloatArray, dq: FloatArray
    ) -> FloatArray:
        """Return joint accelerations, shape (n,) [rad/s^2]."""
        asked = self._drives.asked(reference, q, dq)
        given = self._drives.limited(asked)
        self._is_clipped = self._is_clipped or given is not asked
        pushed, moved = self._drives.pushed(q, self.time), self.arm.forward_dynamics(q, dq, given)
        return moved if pushed is None else moved + pushed

    def _reference(self, t: float) -> JointReference:
        """Return what is commanded at an absolute time [s]."""
        profile, idle = self._profile, self._drives.idle
        if profile is None:
            return self._held if t < self._held_until else idle
        is_idle = t < self._idle_until or t > profile.end
        if self._drives.follows_positions:
            reference = profile.reference(t)
            return reference._replace(effort=idle.effort) if is_idle else reference
        return idle if is_idle else idle._replace(effort=profile.effort(t))
