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

"""Trackers of one model side by side, each with a motion of its own, as long as all goes well."""

from collections.abc import Sequence
from dataclasses import replace

from flat_planner_ros.core.arm import FloatArray, InvalidRequest, PlanarArm
from flat_planner_ros.core.tracking.certificate import certify
from flat_planner_ros.core.tracking.chain import last_links
from flat_planner_ros.core.tracking.gains import feedback_gain
from flat_planner_ros.core.tracking.observer import Observer
from flat_planner_ros.core.tracking.settings import TrackerSettings
from flat_planner_ros.core.tracking.state_feedback import feed_forward, links_effort
from flat_planner_ros.core.tracking.tracked_motion import TrackedMotion
from flat_planner_ros.core.tracking.watches import GrowthWatch
import numpy as np
from numpy.typing import NDArray


class TrackerStack:
    """
    What `Tracker` says to many arms of two joints with one model, whose samples come together.

    It does not give up: `has_left` tells for which arms a tracker would have done, or would have
    met a limit of its effort. What it says of those means nothing from then on.

    Parameters
    ----------
    arm
        The model, with two joints; must be flat.
    settings
        The loop; a motion's end is held.

    Raises
    ------
    UncertifiedLoop
        The loop would not be stable enough for all arms of the box of uncertainty.
    NotFlat, InvalidRequest
        There is no such loop.

    """

    def __init__(self, arm: PlanarArm, settings: TrackerSettings) -> None:
        """Compute and certify the gains."""
        if arm.n != 2 or not settings.hold:
            raise InvalidRequest(
                'trackers side by side are for two joints and hold what they reach; got '
                f'{arm.n} joints, hold {settings.hold}'
            )
        settings = replace(settings, bandwidth=certify(arm, settings).bandwidth)
        bandwidth, period = settings.bandwidth, settings.period
        self._arm, self._settings, self._chain = arm, settings, last_links(arm)
        self._gain = feedback_gain(self._chain, period, bandwidth, settings.damping)
        self._observer = Observer(self._chain, period, settings.observer_ratio * bandwidth)
        self._limit = float(settings.limits_of(arm)[-1])

    def begin(self, motions: Sequence[TrackedMotion], samples: int) -> None:
        """
        Begin motions from rest.

        Parameters
        ----------
        motions
            One for each of m arms, which start at time 0.
        samples
            How many will be heard.

        """
        period, count = self._settings.period, len(motions)
        times = period * np.arange(float(samples)) + self._settings.delay
        self._wanted = np.empty((samples, 4, count))
        self._ahead, self._friction = np.empty((2, samples, count))
        for column, motion in enumerate(motions):
            planned, middle = motion.through(times), motion.through(times + period / 2)
            self._wanted[:, :, column] = np.hstack([planned.positions, planned.velocities])
            links = np.hstack([middle.positions, middle.velocities])
            acceleration = middle.accelerations[:, 0]
            self._ahead[:, column] = feed_forward(self._chain, links.T, acceleration)
            self._friction[:, column] = self._arm.friction(middle.velocities)[:, 0]
        starts = np.column_stack([motion.at(0.0).positions for motion in motions])
        self._observer.restart(-period, starts, np.zeros_like(starts))
        self._growth, self._heard = GrowthWatch(2 * count), 0
        self.has_left = np.zeros(count, dtype=bool)

    def hear(self, angles: FloatArray) -> FloatArray:
        """
        Take in the next samples, a period after the last ones and the first ones at time 0.

        Parameters
        ----------
        angles
            Shape (2, m) [rad].

        Returns
        -------
        FloatArray
            Efforts of joint 1, shape (m,) [N m], to act the loop's delay later.

        """
        settings, index = self._settings, self._heard
        time = index * settings.period
        surprise = self._observer.correct(time, angles)
        if index == 0:
            self._observer.forget_disturbance()
        acts = time + settings.delay
        state, wanted = self._observer.predicted(acts), self._wanted[index]
        friction = self._friction[index]
        asked = friction + links_effort(self._gain, state, wanted, self._ahead[index])
        given: FloatArray = np.minimum(np.maximum(asked, -self._limit), self._limit)
        self._observer.apply(acts, given - friction)
        self._heard += 1
        self._watch(surprise, state[:2] - wanted[:2], given != asked)
        return given

    def _watch(
        self, surprise: FloatArray, errors: FloatArray, is_clipped: NDArray[np.bool_]
    ) -> None:
        """Note where a tracker by itself would do something else."""
        settings = self._settings
        self._growth.note(errors.ravel())
        grown = self._growth.has_grown.reshape(errors.shape)
        far = settings.jump if self._heard == 1 else settings.max_error
        # Nor is NaN below.
        near = (np.abs(surprise) <= settings.jump) & (np.abs(errors) <= far)
        wrong = np.asarray(~near) | grown
        self.has_left |= wrong.any(axis=0) | is_clipped
