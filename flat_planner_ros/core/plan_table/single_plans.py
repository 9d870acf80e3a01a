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

"""Rows of a table that are planned one by one."""

from dataclasses import replace

from flat_planner_ros.core.arm import Drive, FloatArray
from flat_planner_ros.core.insensitive import Oscillator, OscillatorTable, residual_amplitude
from flat_planner_ros.core.planning import MotionRequest, Plan
import numpy as np

INTERVALS = 1000
"""Parts of a motion over which what drives it is taken to be linear, as by `residual_of_plan`."""


def request_of(start: FloatArray, distance: FloatArray, duration: float) -> MotionRequest:
    """
    Return the request of a motion from rest to rest.

    Parameters
    ----------
    start, distance
        Planned variables at the start and the way to go, shape (n - 1,) [rad].
    duration
        Length of the motion [s].

    """
    return MotionRequest(start=_joints(start), final=_joints(start + distance), duration=duration)


def _joints(planned: FloatArray) -> FloatArray:
    """Return the angles of an arm at rest, the inverse of `planned_at_rest`, shape (n,) [rad]."""
    first, others = planned[0], planned[1:]
    return np.concatenate([others, [first - others.sum(), 0.0]])


def figures_of(planned: Plan) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return RMS and peak of every effort [N m] and peak of every velocity [rad/s], (n,) each."""
    return planned.rms_effort, planned.peak_effort, planned.peak_velocity


def driving_signal(planned: Plan, intervals: int) -> FloatArray:
    """Return what drives link n-1 at even times: effort [N m] or velocity [rad/s], shape (m,)."""
    samples = planned.at(np.linspace(0.0, planned.duration, intervals + 1))
    if planned.options.drive is Drive.EFFORT:
        return samples.driving_effort
    return samples.driving_velocity


def residual_on(planned: Plan, factors: FloatArray) -> float:
    """
    Return the oscillation that a plan leaves on another arm [rad]; NaN where it has none.

    Parameters
    ----------
    planned
        A motion from rest.
    factors
        Of the other arm, as for `OscillatorTable.poles`, shape (3,) or (4,) [-].

    """
    drive = planned.options.drive
    oscillator = Oscillator.of(planned.problem.arm, drive)
    poles = OscillatorTable.of([oscillator], drive).poles(factors[None, None])[0]
    if not np.isfinite(poles.imag).all():
        return float('nan')
    if len(factors) > 3 and drive is Drive.EFFORT:
        oscillator = replace(oscillator, gain=oscillator.gain / float(factors[3]))
    signal = driving_signal(planned, INTERVALS)
    return float(residual_amplitude(oscillator, signal, planned.duration, poles)[0])
