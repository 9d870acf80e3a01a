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

"""Motions of least peak effort."""

from functools import lru_cache

from flat_planner_ros.core.arm import Drive, FloatArray, PlanarArm
from flat_planner_ros.core.insensitive import Oscillator
from flat_planner_ros.core.peak.driven_mode import DrivenMode
from flat_planner_ros.core.peak.problem import PeakMotion, PeakProblem, START_ORDERS
from flat_planner_ros.core.peak.settings import PeakSettings
from flat_planner_ros.core.peak.within_bounds import motion_within
import numpy as np

MOTIONS_KEPT = 64
"""Solved motions that are remembered."""


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
    return _kept(arm, duration, settings, reach, drive)


@lru_cache(maxsize=MOTIONS_KEPT)
def _kept(
    arm: PlanarArm, duration: float, settings: PeakSettings, distance: float, drive: Drive
) -> PeakMotion:
    """Return the motion over 1 rad; arms count as equal if identical."""
    start = np.zeros(START_ORDERS)
    start[0] = -0.5
    problem = PeakProblem(
        mode=DrivenMode.of(arm, drive),
        duration=duration,
        settings=settings,
        start=start,
        final=0.5,
        distance=distance,
    )
    return motion_within(problem, Oscillator.of(arm, drive))


def check_peak(arm: PlanarArm, settings: PeakSettings, drive: Drive = Drive.EFFORT) -> None:
    """
    Refuse an arm for which no motion of least peak can be planned.

    Parameters
    ----------
    arm, settings, drive
        As for `peak_motion`.

    Raises
    ------
    InvalidRequest
        The passive joint does not oscillate, or not on all arms whose residual is bounded.
    NotFlat
        The arm is not flat.

    """
    DrivenMode.of(arm, drive)
    if settings.max_residual > 0.0:
        Oscillator.of(arm, drive).edges(settings.box, duration=1.0)


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
        As for `peak_motion`; only the stiffness may differ for a motion to be insensitive.
    start
        Derivatives 0 to 4 of the planned variable, or more, shape (5,) [rad/s^k].
    final
        The planned variable at rest at the end [rad]; None for where the peak is least.

    Raises
    ------
    OutOfReach, InvalidRequest, NotFlat
        As for `peak_motion`.

    """
    problem = problem_from(arm, duration, settings, start, final, drive)
    return motion_within(problem, Oscillator.of(arm, drive))


def problem_from(
    arm: PlanarArm,
    duration: float,
    settings: PeakSettings,
    start: FloatArray,
    final: float | None,
    drive: Drive,
) -> PeakProblem:
    """Return the problem of a motion from a start in motion, without bounds yet."""
    way = np.array(start[:START_ORDERS])
    place = float(way[0]) if final is None else float(final)
    # Counted from the end, so that a distant place costs no digits of a short way.
    way[0] -= place
    return PeakProblem(
        mode=DrivenMode.of(arm, drive),
        duration=duration,
        settings=settings,
        start=way,
        final=None if final is None else 0.0,
        distance=1.0,
        place=place,
    )
