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

"""A simulated arm in time with a clock: even samples, bounded catching up, nothing hidden."""

from dataclasses import dataclass, replace
from math import floor

from flat_planner_ros.core.arm import InvalidCommand, InvalidModel
from flat_planner_ros.core.plant.effort_profile import EffortProfile
from flat_planner_ros.core.plant.settings import Sensor, SimulationSettings
from flat_planner_ros.core.plant.simulation import GRID_TOLERANCE, SimulatedArm
from flat_planner_ros.core.plant.states import ArmState
import numpy as np
import numpy.typing as npt

MAX_CATCH_UP = 1.0
"""
Longest lag behind a clock that is made up for by integration [s], in a few per cent of that time.

A longer one means a suspended machine or a clock that was set, not a busy processor.
"""

MAX_BACKWARD = 0.1
"""Step back of a clock up to which the arm waits for it [s]; beyond, the clock was set back."""

BATCH = 0.05
"""Longest simulated time per call of an arm that leads the clock [s]: commands wait no longer."""

MIN_CALL_RATE = 100.0
"""Least rate at which an arm is told to go on, however rarely it is sampled [Hz]."""

FREE_CALL_RATE = 1e4
"""The same for as fast as it can [Hz]: always due, in turns with other callbacks."""

FAR_AHEAD = 600.0
"""Time to its start from which a command looks as if it came by another clock [s]."""


@dataclass(kw_only=True)
class Incidents:
    """
    What went wrong while an arm kept in time, since it was last told.

    Attributes
    ----------
    skipped, has_dropped
        Time that passed without the arm [s]; whether a command was dropped there.
    set_back, behind
        Time by which the clock was set back, and by which an arm that leads is too slow [s].
    broken
        Silence that ended a stream of efforts [s], 0 without any.

    """

    skipped: float = 0.0
    has_dropped: bool = False
    set_back: float = 0.0
    behind: float = 0.0
    broken: float = 0.0

    def sentences(self, simulated: SimulatedArm) -> list[str]:
        """Return a sentence each, those of the arm itself first; its clipped steps count anew."""
        told = []
        if simulated.fault:
            told.append(f'the arm has been stopped until it is reset: {simulated.fault}')
        clipped = simulated.take_clipped_steps()
        if clipped:
            told.append(f'effort clipped by the saturation in {clipped} steps')
        if self.broken:
            told.append(
                f'the stream of efforts broke, none came for {self.broken:g} s: nothing is '
                'applied any more'
            )
        if self.skipped:
            command = '; its command was dropped' if self.has_dropped else ''
            told.append(
                f'{self.skipped:.3f} s skipped to keep up with the clock: the arm stood still'
                f'{command}'
            )
        if self.set_back:
            told.append(
                f'the clock was set back by {self.set_back:.3f} s: the arm kept its state, its '
                'command was dropped'
            )
        if self.behind:
            told.append(
                f'the simulated time is {self.behind:.3f} s behind its real_time_factor: this '
                'machine is too slow or busy'
            )
        return told


class PacedArm:
    """
    A simulated arm that keeps in time with a clock and shows itself at even times.

    Samples lie on a grid, one every 1/rate, however irregularly the clock is read. Either the
    clock is somebody else's, and the arm follows it, or the arm's own time leads.

    An arm that follows makes up for a lag by integrating it. A lag beyond MAX_CATCH_UP is
    skipped: the arm stands still in it, as if the world had been stopped, and keeps position and
    velocity; a command that has begun by then is dropped, since a part of it is lost. A clock that
    was set back takes the arm's time with it, and the command is dropped, lest it is played twice.
    Nothing is applied where a command was dropped.

    Parameters
    ----------
    settings
        What is simulated.
    time
        Time at the start [s]; by default that at which the arm is first told to follow.

    Raises
    ------
    InvalidModel
        If a number has no meaning.

    """

    def __init__(self, settings: SimulationSettings, time: float | None = None) -> None:
        self._settings = settings
        self._per_sample = settings.steps_per_sample
        self._simulated = SimulatedArm(
            settings.arm,
            position=settings.position,
            step=settings.true_step,
            drives=settings.drives,
        )
        self._sensor = Sensor(settings.sensing)
        # The arm's own time starts at 0, where floating-point numbers resolve it best.
        self._has_begun = time is not None
        self._offset = 0.0 if time is None else time
        self._sampled = 0
        self._profile: EffortProfile | None = None
        self._wall: float | None = None
        self._debt = 0.0
        self._incidents = Incidents()

    @property
    def settings(self) -> SimulationSettings:
        """Return the settings; with another arm or other sensors they may change at any time."""
        return self._settings

    @settings.setter
    def settings(self, settings: SimulationSettings) -> None:
        """Go on with another arm or other sensors, from the same state."""
        kept = replace(
            settings,
            arm=self._settings.arm,
            sensing=self._settings.sensing,
            start_tolerance=self._settings.start_tolerance,
            input_timeout=self._settings.input_timeout,
        )
        if kept != self._settings:
            raise InvalidModel('only the arm, sensors and tolerances may change while it moves')
        self._simulated.arm = settings.arm
        if settings.sensing != self._settings.sensing:
            self._sensor = Sensor(settings.sensing)
        self._settings = settings

    @property
    def time(self) -> float:
        """
        Return the present simulated time [s].

        Raises
        ------
        InvalidCommand
            If the clock to follow has not begun.

        """
        if not self._has_begun:
            raise InvalidCommand('there is no time yet: the clock has not begun')
        return self._offset + self._simulated.time

    def command(self, profile: EffortProfile) -> str:
        """
        Play a command in the place of the present one.

        Parameters
        ----------
        profile
            As in SimulatedArm.command.

        Returns
        -------
        str
            What is strange about the command though it is played, or nothing.

        Raises
        ------
        InvalidCommand
            If it has ended, was overtaken, does not suit the arm or is elsewhere by now, or if the
            arm has been stopped. The present command then goes on.

        """
        now = self.time
        if profile.end <= now:
            raise InvalidCommand(
                f'it ended at {profile.end:.6f} s, {now - profile.end:.3f} s before the present '
                f'{now:.6f} s'
            )
        self._refuse_overtaken(profile, now)
        self._refuse_jump(profile, now)
        ahead = profile.start - now
        is_cut = ahead < -self._simulated.step and profile.differs(self._profile, now)
        self._play(profile)
        if is_cut:
            return f'it arrived {-1e3 * ahead:.1f} ms after its start; that part is left out'
        if ahead > FAR_AHEAD:
            return (
                f'it starts in {ahead:.0f} s only, at {profile.start:.3f} s; do the sender and '
                'the arm go by the same clock (use_sim_time)?'
            )
        return ''

    def hold(self, effort: npt.ArrayLike) -> None:
        """
        Apply an effort until the next one comes, for the settings' input_timeout at most.

        Parameters
        ----------
        effort
            Shape (n-1,) [N m].

        Raises
        ------
        InvalidCommand
            As of SimulatedArm.hold.

        """
        self._simulated.hold(effort, self._simulated.time + self._settings.input_timeout)
        self._profile = None

    def push(self, effort: npt.ArrayLike) -> None:
        """Let efforts of all joints (n,) [N m] act besides, for input_timeout at most."""
        self._simulated.push(effort, self._simulated.time + self._settings.input_timeout)

    def reset(self) -> None:
        """Rest at the initial position without a command; time goes on."""
        self._simulated.reset(self._settings.position)
        self._profile = None

    def follow(self, now: float) -> list[ArmState]:
        """
        Go on to the present of somebody else's clock.

        Parameters
        ----------
        now
            Its time [s]; it has not begun before it is above 0.

        Returns
        -------
        list
            What the sensors show at the sampling times passed.

        """
        if now <= 0.0:
            return []
        if not self._has_begun:
            # Half a period of margin, so that a reading a little early does not miss its sample.
            self._has_begun, self._offset = True, now - 0.5 / self._settings.rate
        lag = now - self.time
        if lag > MAX_CATCH_UP:
            self._skip(floor(lag * self._settings.rate) / self._settings.rate)
        elif lag < -MAX_BACKWARD:
            self._incidents.set_back -= lag
            self._offset += lag
            self.drop()
        return self._advance(now - self._offset)

    def lead(self, wall: float, factor: float) -> list[ArmState]:
        """
        Go on with the arm's own time.

        Parameters
        ----------
        wall
            Time of a steady clock [s].
        factor
            Simulated seconds per second of that clock [-]; 0 for as fast as it can. What cannot
            be kept up is given up: the simulated time runs slower then.

        Returns
        -------
        list
            As of `follow`.

        """
        elapsed = 0.0 if self._wall is None else wall - self._wall
        self._wall = wall
        if factor == 0.0:
            self._debt = 0.0
            return self._advance(self._simulated.time + BATCH)
        self._debt += factor * elapsed
        before = self._simulated.time
        samples = self._advance(before + min(self._debt, BATCH))
        self._debt -= self._simulated.time - before
        limit = max(BATCH, factor * MAX_CATCH_UP)
        if self._debt > limit:
            self._incidents.behind += self._debt - limit
            self._debt = limit
        return samples

    def call_rate(self, factor: float) -> float:
        """Return how often per second `follow` (factor 1) or `lead` are to be called [Hz]."""
        if factor == 0.0:
            return FREE_CALL_RATE
        # Twice as often as a leading arm needs, so that it can make up for a pause.
        return max(self._settings.rate, MIN_CALL_RATE, 2.0 * factor / BATCH)

    def take_warnings(self) -> list[str]:
        """Return what went wrong since this was last asked, a sentence each."""
        incidents = self._incidents
        self._incidents = Incidents()
        return incidents.sentences(self._simulated)

    def _advance(self, until: float) -> list[ArmState]:
        """Integrate in whole steps to an own time of the arm [s]; return the samples passed."""
        target = floor(until / self._simulated.step + GRID_TOLERANCE)
        step, begun = self._simulated.step, self._sampled
        self._sampled = max(begun, target // self._per_sample + 1)
        due = [index * self._per_sample * step for index in range(begun, self._sampled)]
        passed = self._simulated.advance_through(due, target * step)
        samples = [
            self._sensor.measure(ArmState(self._offset + time, *seen)) for time, *seen in passed
        ]
        if self._simulated.take_expired():
            self._incidents.broken = self._settings.input_timeout
        return samples

    def _play(self, profile: EffortProfile) -> None:
        """Play a command that is stamped in the time outside."""
        shifted = replace(profile, start=profile.start - self._offset)
        self._simulated.command(shifted, self._simulated.time)
        self._profile = profile

    def _refuse_overtaken(self, profile: EffortProfile, now: float) -> None:
        """Refuse a command that was made before the running one and arrives after it."""
        running = self._profile
        # One that has not begun may well be replaced by an earlier one.
        if running is not None and profile.start < running.start <= now < running.end:
            raise InvalidCommand(
                f'it was overtaken: it starts {running.start - profile.start:.6f} s before the '
                'running one'
            )

    def _refuse_jump(self, profile: EffortProfile, now: float) -> None:
        """Refuse a command that asks the arm to be elsewhere than it is or has been sent."""
        if profile.positions is None:
            return
        wanted, arm = profile.reference(now).position, self._simulated.position[:-1]
        distances = [np.abs(wanted - arm)]
        running = self._profile
        if running is not None and running.positions is not None and now < running.end:
            # A command that continues the running one does so from where that one is by now,
            # however far from there efforts alone have brought the arm.
            distances.append(np.abs(wanted - running.reference(now).position))
        tolerance = self._settings.start_tolerance
        if min(distance.max() for distance in distances) <= tolerance:
            return
        joint = int(np.argmax(distances[0]))
        raise InvalidCommand(
            f'joint {joint + 1} should be at {wanted[joint]:.4g} rad by now, but is at '
            f'{arm[joint]:.4g} rad, {distances[0][joint]:.3g} rad away, more than the tolerance '
            f'{tolerance:g} rad'
        )

    def drop(self) -> None:
        """Apply nothing any more."""
        self._simulated.release()
        self._profile = None

    def _skip(self, lag: float) -> None:
        """Let a time [s] pass without the arm."""
        self._offset += lag
        self._incidents.skipped += lag
        profile = self._profile
        if profile is not None and self.time < profile.start:
            self._play(profile)  # at the same time outside, another one inside
            return
        if profile is not None and self.time - lag < profile.end:
            self._incidents.has_dropped = True
        self.drop()
