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

"""A tracker for the model that the planner has adopted, made beside the executor."""

from threading import Thread

from flat_planner_ros.core.arm import FlatPlannerError, PlanarArm
from flat_planner_ros.core.tracking import Tracker, TrackerSettings


class TrackerRenewal:
    """
    Makes a tracker for another model, to take the place of the present one.

    Its certificate takes half a second, in which the arm must not be let go: it is computed in a
    thread of its own.

    Parameters
    ----------
    arm
        The model of the present tracker.
    settings
        Of the loop.

    """

    def __init__(self, arm: PlanarArm, settings: TrackerSettings) -> None:
        self._arm, self._settings = arm, settings
        self._worker: Thread | None = None
        self._made: Tracker | None = None
        self._is_wanted = False
        self._refusal = ''

    @property
    def arm(self) -> PlanarArm:
        """Return the model that was adopted last, the first one before."""
        return self._arm

    def adopt(self, arm: PlanarArm | None) -> None:
        """Take another model, if there is one."""
        if arm is not None:
            self._arm, self._is_wanted = arm, True
        if self._is_wanted and (self._worker is None or not self._worker.is_alive()):
            self._is_wanted = False
            self._worker = Thread(target=self._make, args=(self._arm,), daemon=True)
            self._worker.start()

    def take_refusal(self) -> str:
        """Return, once, why the last model is not followed; nothing if it is."""
        refusal, self._refusal = self._refusal, ''
        return refusal

    def renewed(self, tracker: Tracker, now: float) -> Tracker:
        """Return the tracker to go on with; the old one while a motion is under way."""
        made = self._made
        if made is None or tracker.is_moving(now):
            return tracker
        self._made = None
        made.continue_from(tracker)
        return made

    def _make(self, arm: PlanarArm) -> None:
        """Make a tracker; a loop that cannot be certified is not closed."""
        try:
            self._made = Tracker(arm, self._settings)
            self._arm = arm
        except FlatPlannerError as error:
            self._refusal = f"the planner's model is not followed: {error}"
