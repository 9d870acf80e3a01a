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

"""What was measured of an arm, and what can be said of it without any model."""

from dataclasses import dataclass
from math import comb, sqrt

from flat_planner_ros.core.arm import FloatArray, InvalidRequest
from flat_planner_ros.core.model_fit.signals import pieces, stretches
import numpy as np
import numpy.typing as npt

FEWEST_SAMPLES = 50
"""Fewest samples from which a model can be fitted [-]."""

DIFFERENCE_ORDER = 6
"""Order of the differences that show the noise: a motion of 2 Hz at 50 Hz adds 1e-5 of itself."""

WHOLE = 1e-3
"""Largest distance of a measured angle from a whole number of encoder steps [-]."""

MANY_LEVELS = 4096
"""Levels among which an encoder of 24 bits would have shown two neighbours [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Measurements:
    """
    Joint angles and efforts of an arm at the same times.

    Attributes
    ----------
    times
        Ascending, shape (m,) [s]; they may be uneven and have gaps.
    positions
        Joint angles, shape (m, n) [rad].
    efforts
        Efforts of the actuated joints, shape (m, n-1) [N m].
    are_held
        Whether each effort is held until the next one, which begins to act at a time between two
        samples that nobody knows: those of a feedback, as the tracker's.

    Raises
    ------
    InvalidRequest
        The shapes do not fit, the times do not increase, or a number is missing.

    """

    times: FloatArray
    positions: FloatArray
    efforts: FloatArray
    are_held: bool = False

    def __post_init__(self) -> None:
        """Refuse what tells nothing, and lock the arrays."""
        for name in ('times', 'positions', 'efforts'):
            array = np.array(getattr(self, name), dtype=float)
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        m, n = self.times.size, self.positions.shape[-1]
        shapes = self.times.shape, self.positions.shape, self.efforts.shape
        if shapes != ((m,), (m, n), (m, n - 1)):
            raise InvalidRequest(
                f'times, positions and efforts must be (m,), (m, n) and (m, n-1), got {shapes}'
            )
        if m < FEWEST_SAMPLES:
            raise InvalidRequest(f'{m} samples tell no model, {FEWEST_SAMPLES} are the fewest')
        if not all(np.isfinite(a).all() for a in (self.times, self.positions, self.efforts)):
            raise InvalidRequest('times, positions and efforts must be finite')
        if (np.diff(self.times) <= 0.0).any():
            i = int(np.argmax(np.diff(self.times) <= 0.0))
            raise InvalidRequest(
                f'times must increase, got {self.times[i]:.9g} s then {self.times[i + 1]:.9g} s'
            )

    @property
    def joints(self) -> int:
        """Return the number n of joints."""
        return int(self.positions.shape[1])

    @property
    def period(self) -> float:
        """Return the usual time between two samples [s]."""
        return float(np.median(np.diff(self.times)))


def noise_of(measurements: Measurements) -> FloatArray:
    """Return the spread of noise and rounding in each smooth joint angle, shape (n,) [rad]."""
    times, positions = measurements.times, measurements.positions
    gain = sqrt(comb(2 * DIFFERENCE_ORDER, DIFFERENCE_ORDER))
    power, count = np.zeros(measurements.joints), 0
    for first, last in stretches(times, measurements.period):
        for piece in pieces(first, last, DIFFERENCE_ORDER):
            differences = np.diff(positions[piece], DIFFERENCE_ORDER, axis=0)
            power += (differences**2).sum(axis=0)
        count += max(last - first - DIFFERENCE_ORDER, 0)
    if not count:
        raise InvalidRequest('the measurements have no stretch without gaps')
    rounding = np.array([encoder_step(column) for column in positions.T]) / sqrt(12.0)
    white = np.sqrt(power / count) / gain
    found: FloatArray = np.maximum(white, rounding)
    return found


def moves_of(angle: FloatArray, step: float) -> npt.NDArray[np.bool_]:
    """
    Return where an encoder is more than a step from where it stood, shape (m,).

    Its error is one and the same until then, give or take the noise.

    Parameters
    ----------
    angle
        Measured, shape (m,) [rad].
    step
        Of the encoder, 0 without one [rad].

    """
    moves = np.ones(angle.size, dtype=bool)
    place, bound = float(angle[0]), (1.0 + WHOLE) * step
    for piece in pieces(0, angle.size):
        for index, value in enumerate(angle[piece].tolist(), piece.start):
            moves[index] = abs(value - place) > bound
            if moves[index]:
                place = value
    return moves


def encoder_step(angle: FloatArray) -> float:
    """Return the step of the encoder of which all angles are multiples, 0 if there is none."""
    levels = np.empty(0)
    for piece in pieces(0, angle.size):
        levels = np.unique(np.append(levels, angle[piece]))
        # What is no encoder has as many levels as samples.
        if levels.size > MANY_LEVELS and not _even_step(levels):
            return 0.0
    return 0.0 if levels.size in (1, angle.size) else _even_step(levels)


def _even_step(levels: FloatArray) -> float:
    """Return the step of which all differences of ascending levels are multiples, 0 for none."""
    differences = np.diff(levels)
    step = float(differences.min())
    steps = differences / step
    return step if float(np.abs(steps - np.round(steps)).max()) < WHOLE else 0.0
