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

"""Motions of least peak effort, and the shortest within a peak."""

from dataclasses import replace
from functools import lru_cache
from math import factorial, inf, log, sqrt

from flat_planner_ros.core.arm import Drive, FloatArray, PlanarArm
from flat_planner_ros.core.peak.driven_mode import DrivenMode
from flat_planner_ros.core.peak.problem import PeakMotion, PeakProblem, START_ORDERS, STRIDE
from flat_planner_ros.core.peak.settings import PeakSettings
import numpy as np

MOTIONS_KEPT = 64
"""Solved motions that are remembered."""

MARGIN = 1e-5
"""Share by which the shortest duration exceeds the bound that was met, for rounding [-]."""

ANCHOR_RATIO = 1.05
"""Ratio of the peaks whose shortest durations are remembered, to start from [-]."""

DIGITS = 9
"""Significant digits of the durations tried: as many as are reported."""

MAX_STEPS = 20
"""Programmes on the way to the shortest duration; three or four are usual."""


def peak_motion(
    arm: PlanarArm,
    duration: float,
    settings: PeakSettings,
    distance: float,
    drive: Drive = Drive.EFFORT,
) -> PeakMotion:
    """
    Return the motion of least peak from rest to rest over 1 rad, for use over a distance.

    Parameters
    ----------
    arm
        Nominal model; must be flat.
    duration
        Length of the motion [s].
    settings
        How steep, how fast and how robust it may be.
    distance
        Of the planned variable; only bounds on rate and velocity depend on it [rad].
    drive
        What moves joint n-1.

    Raises
    ------
    OutOfReach
        No motion meets the bounds on rate and velocity.
    InvalidRequest
        The passive joint does not oscillate.
    NotFlat
        The arm is not flat.

    """
    reach = 1.0 if settings.is_homogeneous else abs(distance)
    return _from_rest(arm, duration, settings, reach, drive)


@lru_cache(maxsize=MOTIONS_KEPT)
def _from_rest(
    arm: PlanarArm, duration: float, settings: PeakSettings, distance: float, drive: Drive
) -> PeakMotion:
    """Return the motion over 1 rad; arms count as equal if identical."""
    start = np.zeros(START_ORDERS)
    start[0] = -0.5
    return PeakProblem(
        mode=DrivenMode.of(arm, drive),
        duration=duration,
        settings=settings,
        start=start,
        final=0.5,
        distance=distance,
    ).motion_within_velocity()


def check_peak(arm: PlanarArm, drive: Drive = Drive.EFFORT) -> None:
    """
    Refuse an arm for which no motion of least peak can be planned.

    Raises
    ------
    InvalidRequest
        The passive joint does not oscillate.
    NotFlat
        The arm is not flat.

    """
    DrivenMode.of(arm, drive)


def peak_motion_from(
    arm: PlanarArm,
    duration: float,
    settings: PeakSettings,
    start: FloatArray,
    final: float | None,
    drive: Drive = Drive.EFFORT,
) -> PeakMotion:
    """
    Return the motion of least peak from a start in motion to rest.

    Parameters
    ----------
    arm, duration, settings, drive
        As for `peak_motion`; such a motion is not made insensitive.
    start
        Derivatives 0 to 4 of the planned variable, or more, shape (5,) [rad/s^k].
    final
        The planned variable at rest at the end [rad]; None for where the peak is least.

    Raises
    ------
    OutOfReach, InvalidRequest, NotFlat
        As for `peak_motion`.

    """
    return _problem_from(arm, duration, settings, start, final, drive).motion_within_velocity()


def _problem_from(
    arm: PlanarArm,
    duration: float,
    settings: PeakSettings,
    start: FloatArray,
    final: float | None,
    drive: Drive,
) -> PeakProblem:
    """Return the problem of a motion from a start in motion."""
    way = np.array(start[:START_ORDERS])
    place = float(way[0]) if final is None else float(final)
    # Counted from the end, so that a distant place costs no digits of a short way.
    way[0] -= place
    return PeakProblem(
        mode=DrivenMode.of(arm, drive),
        duration=duration,
        settings=replace(settings, insensitive=False),
        start=way,
        final=None if final is None else 0.0,
        distance=1.0,
        place=place,
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
        As for `peak_motion_from`; bounds on rate and velocity are left out.
    peak
        Largest magnitude of the drive, above that at the start.

    References
    ----------
    (B9) of docs/derivation.md.

    """
    plain = replace(settings, effort_rate=0.0, velocity=inf)
    wanted = (1.0 - MARGIN) * peak
    problem = _problem_from(arm, 1.0, plain, start, final, drive)
    duration = _rigid_duration(
        float(problem.state.sigma), float(problem.state.sigma_rate), problem.mode.gain * wanted
    )
    for _ in range(MAX_STEPS):
        duration = float(f'{duration:.{DIGITS}g}')
        found = replace(problem, duration=duration).motion()
        if abs(found.inner_peak / wanted - 1.0) < MARGIN:
            break
        # A little further, so that the last step, too short as every one, ends within.
        least = duration * (1.0 + MARGIN) if found.inner_peak > wanted else 0.0
        duration = max(found.next_duration(wanted), least)
    return duration


def _rigid_duration(way: float, velocity: float, acceleration: float) -> float:
    """Return the least time to rest at 0 within an acceleration, as if the links were rigid."""
    stopping = velocity * abs(velocity) / (2.0 * acceleration)
    sign = 1.0 if way + stopping > 0.0 else -1.0
    turn = sqrt(0.5 * velocity**2 + sign * way * acceleration)
    return max((sign * velocity + 2.0 * turn) / acceleration, abs(velocity) / acceleration)


def shortest_peak_duration(
    arm: PlanarArm,
    settings: PeakSettings,
    distance: float,
    peak: float,
    drive: Drive = Drive.EFFORT,
) -> float:
    """
    Return the shortest duration from rest to rest within a peak; bounds aside, a little less.

    Parameters
    ----------
    arm, settings, distance, drive
        As for `peak_motion`, the distance above zero; bounds on rate and velocity are left out.
    peak
        Largest magnitude of the drive, above zero.

    References
    ----------
    (B8) of docs/derivation.md: Newton's method, the switching function being the slope.

    """
    plain = replace(settings, effort_rate=0.0, velocity=inf)
    wanted = (1.0 - MARGIN) * peak / abs(distance)
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
        found = _from_rest(arm, duration, settings, 1.0, drive)
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
