"""A simulated arm in time with a clock: even samples, bounded catching up, nothing hidden."""

from dataclasses import dataclass, field, replace
from math import ceil, floor, isfinite

from flat_planner_ros.core.arm import PlanarArm
from flat_planner_ros.core.effort_profile import EffortProfile
from flat_planner_ros.core.errors import InvalidCommand, InvalidModel
from flat_planner_ros.core.sensing import Sensing, Sensor
from flat_planner_ros.core.simulation import ArmState, GRID_TOLERANCE, SimulatedArm
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


@dataclass(frozen=True, kw_only=True)
class SimulationSettings:
    """
    What is simulated, and how it is sampled.

    Attributes
    ----------
    arm
        The arm as it is.
    position
        Joint angles at rest at the start and after a reset [rad].
    rate
        Samples per second of simulated time [Hz].
    step
        Longest integration step [s]; the step taken divides the time between samples.
    saturation, feedback_p, feedback_d
        As in SimulatedArm.
    sensing
        Imperfections of the sensors.

    """

    arm: PlanarArm
    position: tuple[float, ...]
    rate: float = 200.0
    step: float = 1e-3
    saturation: tuple[float, ...] | None = None
    feedback_p: tuple[float, ...] | None = None
    feedback_d: tuple[float, ...] | None = None
    sensing: Sensing = field(default_factory=Sensing)

    def __post_init__(self) -> None:
        """Refuse times without meaning."""
        for name, unit in {'rate': 'Hz', 'step': 's'}.items():
            value = getattr(self, name)
            if not (isfinite(value) and value > 0.0):
                raise InvalidModel(f'{name} must be finite and above 0 {unit}, got {value}')

    @property
    def steps_per_sample(self) -> int:
        """Return the number of integration steps from one sample to the next."""
        return max(1, ceil(1.0 / (self.rate * self.step) - GRID_TOLERANCE))


class PacedArm:
    """
    A simulated arm that keeps in time with a clock and shows itself at even times.

    Samples lie on a grid, one every 1/rate, however irregularly the clock is read. Either the
    clock is somebody else's, and the arm follows it, or the arm's own time leads.

    An arm that follows makes up for a lag by integrating it. A lag beyond MAX_CATCH_UP is
    skipped: the arm stands still in it, as if the world had been stopped, and keeps position and
    velocity; its command goes on by time, the part in between is lost. A clock that was set back
    takes the arm's time with it, and the command is dropped, lest it is played twice.

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
        """Stand still."""
        self._settings = settings
        self._per_sample = settings.steps_per_sample
        self._simulated = SimulatedArm(
            settings.arm,
            position=settings.position,
            step=1.0 / (settings.rate * self._per_sample),
            saturation=settings.saturation,
            feedback_p=settings.feedback_p,
            feedback_d=settings.feedback_d,
        )
        self._sensor = Sensor(settings.sensing)
        # The arm's own time starts at 0, where floating-point numbers resolve it best.
        self._has_begun = time is not None
        self._offset = 0.0 if time is None else time
        self._sampled = 0
        self._profile: EffortProfile | None = None
        self._wall: float | None = None
        self._debt = 0.0
        self._skipped = self._lost = self._set_back = 0.0

    @property
    def settings(self) -> SimulationSettings:
        """Return the settings; with another arm or other sensors they may change at any time."""
        return self._settings

    @settings.setter
    def settings(self, settings: SimulationSettings) -> None:
        """Go on with another arm or other sensors, from the same state."""
        kept = replace(settings, arm=self._settings.arm, sensing=self._settings.sensing)
        if kept != self._settings:
            raise InvalidModel('only the arm and its sensors may change while it moves')
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
            If it has ended or does not suit the arm. The present command then goes on.

        """
        now = self.time
        if profile.end <= now:
            raise InvalidCommand(
                f'it ended at {profile.end:.6f} s, {now - profile.end:.3f} s before the present '
                f'{now:.6f} s'
            )
        self._play(profile)
        ahead = profile.start - now
        if ahead < -self._simulated.step:
            return f'it arrived {-1e3 * ahead:.1f} ms after its start; that part is left out'
        if ahead > FAR_AHEAD:
            return (
                f'it starts in {ahead:.0f} s only, at {profile.start:.3f} s; do the sender and '
                'the arm go by the same clock (use_sim_time)?'
            )
        return ''

    def hold(self, effort: npt.ArrayLike) -> None:
        """Apply a constant effort, shape (n-1,) [N m], until the next command."""
        self._simulated.hold(effort)
        self._profile = None

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
            self._set_back -= lag
            self._offset += lag
            self._drop()
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
            self._lost, self._debt = self._lost + self._debt - limit, limit
        return samples

    def call_rate(self, factor: float) -> float:
        """Return how often per second `follow` (factor 1) or `lead` are to be called [Hz]."""
        if factor == 0.0:
            return FREE_CALL_RATE
        # Twice as often as a leading arm needs, so that it can make up for a pause.
        return max(self._settings.rate, MIN_CALL_RATE, 2.0 * factor / BATCH)

    def take_troubles(self) -> list[str]:
        """Return what went wrong since this was last asked, a sentence each."""
        clipped = self._simulated.take_clipped_steps()
        troubles = []
        if clipped:
            troubles.append(f'effort clipped by the saturation in {clipped} steps')
        if self._skipped:
            troubles.append(
                f'{self._skipped:.3f} s skipped to keep up with the clock: the arm stood still, '
                'its command went on'
            )
        if self._set_back:
            troubles.append(
                f'the clock was set back by {self._set_back:.3f} s: the arm kept its state, its '
                'command was dropped'
            )
        if self._lost:
            troubles.append(
                f'the simulated time is {self._lost:.3f} s behind its real_time_factor: this '
                'machine is too slow or busy'
            )
        self._skipped = self._lost = self._set_back = 0.0
        return troubles

    def _advance(self, until: float) -> list[ArmState]:
        """Integrate in whole steps to an own time of the arm [s]; return the samples passed."""
        target = floor(until / self._simulated.step + GRID_TOLERANCE)
        samples = []
        while (due := self._sampled * self._per_sample) <= target:
            self._simulated.advance(due * self._simulated.step)
            samples.append(self._sample())
            self._sampled += 1
        self._simulated.advance(target * self._simulated.step)
        return samples

    def _sample(self) -> ArmState:
        """Return what the sensors show now."""
        state = self._simulated.state
        return self._sensor.measure(state._replace(time=self.time))

    def _play(self, profile: EffortProfile) -> None:
        """Play a command that is stamped in the time outside."""
        shifted = replace(profile, start=profile.start - self._offset)
        self._simulated.command(shifted, self._simulated.time)
        self._profile = profile

    def _drop(self) -> None:
        """Apply nothing any more."""
        self.hold([0.0] * (self._settings.arm.n - 1))

    def _skip(self, lag: float) -> None:
        """Let a time [s] pass without the arm."""
        self._offset += lag
        self._skipped += lag
        if self._profile is None:
            return
        try:
            self._play(self._profile)
        except InvalidCommand:  # it has ended meanwhile
            self._drop()
