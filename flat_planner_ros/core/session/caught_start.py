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

"""Start of a motion that catches an arm in motion, from what is measured."""

from math import isfinite, log, tau
from typing import NamedTuple

from flat_planner_ros.core.arm import Drive, FloatArray, JointSample, NaturalMode
from flat_planner_ros.core.session.recent_states import Inputs, RecentStates
from flat_planner_ros.core.session.settings import SessionSettings
from flat_planner_ros.core.session.timeline import Motion, Timeline
import numpy as np

DERIVATIVE_STEP = 1e-4
"""Half of the time over which the input's derivative is taken [s]."""


class Swing(NamedTuple):
    """
    What an arm in motion does.

    Attributes
    ----------
    amplitude
        Of the passive joint [rad].
    rest
        Pose that the arm swings about, shape (n,) [rad].
    drift
        Velocity of that pose, shape (n,) [rad/s].

    """

    amplitude: float
    rest: FloatArray
    drift: FloatArray


class MeasuredStart(NamedTuple):
    """
    A start in motion, from what is measured.

    Attributes
    ----------
    pose
        Shape (n,) [rad].
    jets
        Derivatives 0 to 5 of the planned variables, shape (n - 1, 6) [rad/s^k].
    swing
        What the arm does.

    """

    pose: FloatArray
    jets: FloatArray
    swing: Swing


def swing_time(settings: SessionSettings) -> float:
    """Return how long the arm takes to swing once; no state is carried on for longer [s]."""
    return tau / _mode(settings).frequency


def measured_start(
    settings: SessionSettings, recent: RecentStates, timeline: Timeline, time: float
) -> MeasuredStart | None:
    """
    Return where the arm will be at a time, by what is measured and what is planned until then.

    None where too little has been measured.

    Parameters
    ----------
    settings
        With the arm and its drive.
    recent
        What was measured.
    timeline
        What is planned.
    time
        Of the start, absolute [s].

    """
    # Imported here: see `RecentStates.estimate`.
    from flat_planner_ros.core.tracking import moving_start

    arm, drive = settings.arm, settings.options.drive
    inputs = Inputs(arm, drive, timeline.known)
    found = recent.estimate(arm, inputs, time)
    if found is None:
        return None
    running = timeline.at(time)
    if running is not None and not running.start <= time < running.end:
        running = None
    positions, velocities = found.positions, found.velocities
    if inputs.is_held:
        # A servo goes where it is told to: what it shows besides is noise and its own lag.
        _take_actuated(positions, velocities, running, time)
    step = DERIVATIVE_STEP
    before, acts, after = inputs.at(time + step * np.array([-1.0, 0.0, 1.0]))[:, 0]
    slope = (after - before) / (2.0 * step) if running else 0.0
    start = moving_start(
        arm, positions, velocities, 0.0, held=inputs.is_held, inputs=(acts, slope)
    )
    if running is not None:
        planned = running.reference(time).planned
        start.jets[1:, 2:] = planned[1:, 2 : start.jets.shape[1], 0]
    velocity = found.links[3, 0] / _mode(settings).frequency
    amplitude = float(np.hypot(positions[-1], velocity))
    return MeasuredStart(positions, start.jets, Swing(amplitude, start.rest, start.drift))


def _take_actuated(
    positions: FloatArray, velocities: FloatArray, running: Motion | None, time: float
) -> None:
    """Set the actuated joints to what is planned, or to rest."""
    velocities[:-1] = 0.0
    if running is not None:
        planned = running.reference(time)
        positions[:-1] = planned.positions[0, :-1]
        velocities[:-1] = planned.velocities[0, :-1]


def is_moving(settings: SessionSettings, timeline: Timeline, recent: RecentStates) -> bool:
    """Tell whether the arm, which was measured, moves."""
    measured = recent.last
    if measured is None:
        return False
    speeds = [] if measured.velocities is None else measured.velocities.tolist()
    if not speeds or not all(map(isfinite, speeds)):
        inputs = Inputs(settings.arm, settings.options.drive, timeline.known)
        found = recent.estimate(settings.arm, inputs, measured.time)
        speeds = [] if found is None else found.velocities.tolist()
    limit = settings.velocity_tolerance
    is_off = abs(float(measured.positions[-1])) > settings.position_tolerance
    return is_off or any(abs(speed) > limit for speed in speeds)


def is_driven(settings: SessionSettings, measured: JointSample) -> bool:
    """
    Tell whether joint n-1 is moved by someone else, by what is measured.

    Its effort is more than the spring gives at the tolerance of a start, or its servo moves.
    """
    if settings.options.drive is Drive.POSITION:
        shown, limit = measured.velocities, settings.velocity_tolerance
    else:
        shown = measured.efforts
        limit = settings.arm.stiffness * settings.position_tolerance
    return shown is not None and bool(abs(shown[-2]) > limit)


def patience(settings: SessionSettings, swing: float) -> str:
    """Return in words how long a swing [rad] lasts by itself."""
    mode = _mode(settings)
    rest = settings.position_tolerance
    if swing <= rest:
        return ''
    words = f'; the passive joint swings by {swing:.3g} rad'
    if mode.decay_rate <= 0.0:
        return f'{words}, and goes on: more time, or higher limits, would do'
    left = log(swing / rest) / mode.decay_rate
    return f'{words}: more time, higher limits or {left:.3g} s of waiting would do'


def _mode(settings: SessionSettings) -> NaturalMode:
    """Return the free oscillation under the arm's drive."""
    return settings.arm.natural_mode(held=settings.options.drive is Drive.POSITION)
