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

"""Shortest durations within a peak, by Newton's method: dual values tell which is next."""

from collections.abc import Callable
from functools import lru_cache
from math import factorial, inf, log, pi, sqrt

from flat_planner_ros.core.arm import Drive, FloatArray, OutOfReach, PlanarArm
from flat_planner_ros.core.insensitive import Oscillator
from flat_planner_ros.core.peak.bracket import between, Tried
from flat_planner_ros.core.peak.driven_mode import DrivenMode
from flat_planner_ros.core.peak.motion import MOTIONS_KEPT, peak_motion, problem_from
from flat_planner_ros.core.peak.problem import PeakMotion, STRIDE
from flat_planner_ros.core.peak.settings import PeakSettings
from flat_planner_ros.core.peak.within_bounds import motion_within

MARGIN = 1e-5
"""Share by which the shortest duration exceeds the bound that was met, for rounding [-]."""

BOUND_MARGIN = 1e-3
"""The same for the peak of motions with bounds on more: it falls steeply with the duration."""

QUARTER_TURN = 0.5 * pi
"""Phase of the oscillation in a step from a duration in which no motion keeps its bounds [rad]."""

WIDTH = 2e-4
"""Distance of two durations, one too short, at which the other one is taken [-]."""

ANCHOR_RATIO = 1.05
"""Ratio of the peaks whose shortest durations are remembered, to start from [-]."""

DIGITS = 9
"""Significant digits of the durations tried: as many as are reported."""

MAX_STEPS = 20
"""Programmes on the way to the shortest duration; three or four are usual."""


def shortest_peak_duration(
    arm: PlanarArm,
    settings: PeakSettings,
    distance: float,
    peak: float,
    drive: Drive = Drive.EFFORT,
) -> float:
    """
    Return the shortest duration from rest to rest within a peak.

    Parameters
    ----------
    arm, settings, distance, drive
        As for `peak_motion`, the distance above zero.
    peak
        Largest magnitude of the drive, above zero.

    References
    ----------
    (B8) of docs/derivation.md: Newton's method, the switching function being the slope.

    """
    way = abs(distance)
    plain = _shortest_unbounded(arm, settings, way, peak, drive)
    if settings.is_homogeneous:
        return plain
    first = max(plain, _three_phases(arm, settings, way, peak, drive, plain))
    return _shortest_within(
        lambda duration: peak_motion(arm, duration, settings, way, drive),
        first,
        (1.0 - BOUND_MARGIN) * peak / way,
        QUARTER_TURN / DrivenMode.of(arm, drive).frequency,
        is_least=first == plain,
    )


def shortest_peak_duration_from(
    arm: PlanarArm,
    settings: PeakSettings,
    start: FloatArray,
    final: float,
    peak: float,
    drive: Drive = Drive.EFFORT,
) -> float:
    """
    Return the shortest duration from a start in motion to rest within a peak.

    From below: the dual values of a duration that is too short rule out all up to the next one.

    Parameters
    ----------
    arm, settings, start, final, drive
        As for `peak_motion_from`.
    peak
        Largest magnitude of the drive, above that at the start.

    References
    ----------
    (B9) of docs/derivation.md.

    """
    wanted = (1.0 - MARGIN) * peak
    problem = problem_from(arm, 1.0, settings, start, final, drive)
    duration = _rigid_duration(
        float(problem.state.sigma), float(problem.state.sigma_rate), problem.mode.gain * wanted
    )
    for _ in range(MAX_STEPS):
        duration = float(f'{duration:.{DIGITS}g}')
        found = problem.lasting(duration).motion()
        if abs(found.inner_peak / wanted - 1.0) < MARGIN:
            break
        # A little further, so that the last step, too short as every one, ends within.
        least = duration * (1.0 + MARGIN) if found.inner_peak > wanted else 0.0
        duration = max(found.next_duration(wanted), least)
    if settings.is_homogeneous:
        return duration
    oscillator = Oscillator.of(arm, drive)
    # Little is gained on the way at full speed by a start in motion.
    first = max(duration, abs(float(problem.state.sigma)) / settings.velocity)
    return _shortest_within(
        lambda tried: motion_within(problem.lasting(tried), oscillator),
        first,
        (1.0 - BOUND_MARGIN) * peak,
        QUARTER_TURN / problem.mode.frequency,
        is_least=first == duration,
    )


def _shortest_within(
    motion: Callable[[float], PeakMotion],
    first: float,
    peak: float,
    stride: float,
    *,
    is_least: bool,
) -> float:
    """
    Return the shortest duration of motions with bounds within a peak.

    Parameters
    ----------
    motion
        That of a duration.
    first
        A guess.
    peak
        Largest magnitude of the drive without its value at the start.
    stride
        Step from a duration in which there is no motion within the bounds [s].
    is_least
        Whether no duration below the guess will do.

    """
    low, high = Tried(0.0, inf), Tried(inf, 0.0)
    duration = first
    for _ in range(MAX_STEPS):
        duration = float(f'{duration:.{DIGITS}g}')
        try:
            share = motion(duration).inner_peak / peak
        except OutOfReach:
            share = inf
        if abs(share - 1.0) < BOUND_MARGIN or (share < 1.0 and is_least and duration <= first):
            return duration
        if share > 1.0:
            low = Tried(duration, share)
        else:
            high = Tried(duration, share)
        # Where a rate alone decides, peaks below the wanted one begin with a jump.
        if high.duration < (1.0 + WIDTH) * low.duration:
            break
        duration = between(low, high, stride)
    return duration if high.duration == inf else high.duration


def _rigid_duration(way: float, velocity: float, acceleration: float) -> float:
    """Return the least time to rest at 0 within an acceleration, as if the links were rigid."""
    stopping = velocity * abs(velocity) / (2.0 * acceleration)
    sign = 1.0 if way + stopping > 0.0 else -1.0
    turn = sqrt(0.5 * velocity**2 + sign * way * acceleration)
    return max((sign * velocity + 2.0 * turn) / acceleration, abs(velocity) / acceleration)


def _three_phases(
    arm: PlanarArm,
    settings: PeakSettings,
    distance: float,
    peak: float,
    drive: Drive,
    plain: float,
) -> float:
    """Return about how long it takes at the largest velocity where the peak alone takes less."""
    reached = distance * peak_motion(arm, plain, settings.unbounded, 1.0, drive).peak_velocity
    if reached <= settings.velocity:
        return plain
    # Ways of speeding up and slowing down go with the square of the velocity.
    short = distance * (settings.velocity / reached) ** 2
    ramps = _shortest_unbounded(arm, settings, short, peak, drive)
    # No link comes to full speed without a swing in less than half a turn of it.
    half_turn = 2.0 * QUARTER_TURN / DrivenMode.of(arm, drive).frequency
    full_speed = distance / settings.velocity
    return max(full_speed - short / settings.velocity + ramps, full_speed + half_turn)


def _shortest_unbounded(
    arm: PlanarArm, settings: PeakSettings, distance: float, peak: float, drive: Drive
) -> float:
    """Return the shortest duration from rest, a little less, without further bounds."""
    plain = settings.unbounded
    wanted = (1.0 - MARGIN) * peak / distance
    # Solved once for all wishes near it: what comes next is one or two steps away.
    near = ANCHOR_RATIO ** round(log(wanted) / log(ANCHOR_RATIO))
    return _shortest(arm, plain, wanted, _anchor(arm, plain, near, drive), drive, MARGIN)


@lru_cache(maxsize=MOTIONS_KEPT)
def _anchor(arm: PlanarArm, settings: PeakSettings, peak: float, drive: Drive) -> float:
    """Return the shortest duration over 1 rad within a peak, roughly."""
    guess = _first_guess(DrivenMode.of(arm, drive), peak, settings.insensitive)
    return _shortest(arm, settings, peak, guess, drive, ANCHOR_RATIO - 1.0)


def _shortest(
    arm: PlanarArm,
    settings: PeakSettings,
    peak: float,
    duration: float,
    drive: Drive,
    tolerance: float,
) -> float:
    """Return the shortest duration over 1 rad within a peak, searched for from a guess."""
    for _ in range(MAX_STEPS):
        # Rounded, so that the usual text of the duration is exactly it.
        duration = float(f'{duration:.{DIGITS}g}')
        found = peak_motion(arm, duration, settings, 1.0, drive)
        if abs(found.peak / peak - 1.0) < tolerance:
            break
        # What the spline lacks of the best of all drives hardly changes with the duration.
        sought = found.target * found.peak / found.least_peak
        duration = found.switching.shortest_duration(sought, peak, STRIDE * duration)
    return duration


def _first_guess(mode: DrivenMode, peak: float, is_insensitive: bool) -> float:
    """Return the longest of the durations with a stiff spring, with a soft one, and a second."""
    orders = (2, 4, 6) if is_insensitive else (2, 4)
    # An r-fold integrator over 1 takes 2^(2r-2) (r-1)! / T^r; each half turn adds two integrals.
    guesses = [
        2.0 ** (2 * r - 2) * factorial(r - 1) / (mode.gain * mode.frequency ** (r - 2) * peak)
        for r in orders
    ]
    return max(float(guess ** (1.0 / r)) for guess, r in zip(guesses, orders, strict=True))
