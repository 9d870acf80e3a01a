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

"""What a motion will tell of the model before it is carried out, and whether it kept that."""

from dataclasses import dataclass
from math import pi

from flat_planner_ros.core.arm import FloatArray, PlanarArm
from flat_planner_ros.core.model_fit.last_links import (
    COULOMB,
    Forcing,
    NAMES,
    STATES,
    step_for,
    Steps,
    trajectories,
)
from flat_planner_ros.core.model_fit.measurements import Measurements
from flat_planner_ros.core.model_fit.observation import noise_of_links, observed_of, SEGMENT
from flat_planner_ros.core.model_fit.refinement import linearised
from flat_planner_ros.core.model_fit.scales import scales_of, vector_of
from flat_planner_ros.core.model_fit.signals import segments_of
from flat_planner_ros.core.model_fit.simulation import CHANNELS, first_starts, Observed
import numpy as np


@dataclass(frozen=True, kw_only=True, eq=False)
class ForeseenMotion:
    """
    Motion of the last two links as a model has it, from rest with all joints before at rest.

    Attributes
    ----------
    times
        Even, shape (m,) [s].
    states
        Angle of link n-1, that of the passive joint and their rates, shape (m, 4) [rad], [rad/s].
    effort
        Of joint n-1, linear between the times, shape (m,) [N m].

    """

    times: FloatArray
    states: FloatArray
    effort: FloatArray


def foresee(
    arm: PlanarArm,
    times: FloatArray,
    effort: FloatArray,
    refinement: float = 1.0,
    base: FloatArray | None = None,
) -> ForeseenMotion:
    """
    Return the motion that an effort makes, from zero angles at rest.

    Parameters
    ----------
    arm
        The model.
    times
        Even, shape (m,) [s].
    effort
        Of joint n-1 at these times, shape (m,) [N m].
    refinement
        By which the steps of the integration are divided [-].
    base
        Velocity of link n-2 at these times, shape (m,) [rad/s]; at rest if there is none.

    """
    model = vector_of(arm)[None]
    moved = np.zeros(times.size) if base is None else base
    period = float(times[1] - times[0])
    has_friction = bool(model[0, COULOMB])
    longest = step_for(model[0], has_friction) / refinement
    parts = int(np.ceil(period / longest))
    grid = times[0] + np.arange(2 * parts * (times.size - 1) + 1) * period / (2 * parts)
    forcing = Forcing(
        effort=np.interp(grid, times, effort)[:, None, None],
        variant=np.zeros(1, dtype=np.intp),
        base=np.interp(grid, times, moved)[:, None, None],
    )
    steps = Steps.of(model, period / parts, has_friction=has_friction)
    states = trajectories(steps, np.zeros((1, STATES, 1)), forcing)[::parts, 0, :, 0]
    return ForeseenMotion(times=times, states=states, effort=effort)


def information(
    arm: PlanarArm, motion: ForeseenMotion, noise: FloatArray, refinement: float = 1.0
) -> tuple[FloatArray, FloatArray]:
    """
    Return the Fisher information that a recording of a motion will hold, and the scales.

    Parameters
    ----------
    arm
        The model that is taken for true.
    motion
        As `foresee` has it for this model.
    noise
        Standard deviation of the angle of link n-1 and of the passive joint, shape (2,) [rad].
    refinement
        By which the steps of the integration are divided [-].

    Returns
    -------
    tuple[FloatArray, FloatArray]
        Information about `last_links.NAMES`, shape (8, 8), the starts of the segments being
        unknown as they are in a fit; and how far each may reasonably be off, shape (8,).

    Notes
    -----
    The sum of the sensitivities' products over the noise's variance (Ljung, System Identification,
    1999, 7.4); of white noise, so that errors that are alike from sample to sample come on top.

    """
    period = float(motion.times[1] - motion.times[0])
    segments = segments_of(motion.times, period, SEGMENT * _free_period(arm))
    observed = Observed(
        times=motion.times,
        angles=motion.states[:, :CHANNELS],
        rates=motion.states[[first for first, _ in segments], CHANNELS:],
        rate_spread=float(motion.states[:, CHANNELS].std()),
        effort=motion.effort,
        base=np.zeros(motion.times.size),
        moves=np.ones((motion.times.size, CHANNELS), dtype=bool),
        rounding=np.zeros(CHANNELS),
        segments=segments,
        straightness=1.0,
        refinement=refinement,
    )
    model = vector_of(arm)
    scales = scales_of(observed, model)
    every = range(len(NAMES))
    around = linearised(observed, model, first_starts(observed), every, scales, noise)
    return around.normal.sum(axis=0), scales


def misprediction(arm: PlanarArm, measurements: Measurements) -> FloatArray:
    """
    Return how far a model is from what was measured, relative to the motion.

    Parameters
    ----------
    arm
        The model.
    measurements
        With the efforts that acted.

    Returns
    -------
    FloatArray
        Root mean square of simulated less measured angles, less that of the noise, over that of
        the motion, of link n-1 and of the passive joint, shape (2,) [-].

    """
    observed = observed_of(measurements, _free_period(arm))
    model, starts, ones = vector_of(arm), first_starts(observed), np.ones(CHANNELS)
    around = linearised(observed, model, starts, (), scales_of(observed, model), ones)
    left = around.power / around.samples
    wrong = np.sqrt(np.maximum(left - noise_of_links(measurements) ** 2, 0.0))
    motion = observed.angles.std(axis=0)
    result: FloatArray = wrong / np.maximum(motion, np.finfo(float).tiny)
    return result


def _free_period(arm: PlanarArm) -> float:
    """Return the period of the free passive joint [s]."""
    return float(2 * pi / arm.natural_mode().frequency)
