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

"""Rows of the experiment that the tracker carries out."""

from typing import Any

from flat_planner_ros.core.monitor import PlannedMotion
from flat_planner_ros.figures.paper_example import DURATION, Recording, SEEN
from flat_planner_ros.ros.programs.paper_company import OURS
from flat_planner_ros.ros.programs.paper_experiment import Experimenter, NotPlayed
from flat_planner_ros.ros.wire import interfaces, stamps
import numpy as np
from std_srvs.srv import Trigger

LETTING_GO = 0.2
"""Simulated time from `~/release` until nothing moves the arm any more [s]."""

LONGEST = 0.012
"""Longest time for which an effort may stay the same in a valid run [s]: six samples."""


class TrackedExperimenter(Experimenter):
    """Talks to the four nodes."""

    nodes = (*OURS, interfaces.TRACKER)
    commanded = interfaces.TRACKER
    attempts = 2

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self._release = self.create_client(
            Trigger, interfaces.topic_of(interfaces.TRACKER, interfaces.RELEASE)
        )

    def wait_for_nodes(self) -> None:
        """Wait until the tracker answers, too."""
        super().wait_for_nodes()
        self._await(self._release.service_is_ready, 'the tracker does not answer')

    def _reset_arm(self) -> None:
        """Bring the arm back after the tracker has let it go."""
        self._call(self._release, Trigger.Request())
        since = self._time()
        self._await(lambda: self._time() > since + LETTING_GO, 'no joint states')
        super()._reset_arm()

    def _time(self) -> float:
        """Return the stamp of the last joint state, 0 before the first [s]."""
        return stamps.seconds(self._states[-1].header.stamp) if self._states else 0.0

    def _check(self, played: Recording, motion: PlannedMotion) -> None:
        """Refuse a run in which the loop was not closed all the time."""
        if played.times.size < 2 or played.times[-1] < DURATION + SEEN:
            raise NotPlayed('joint states were lost')
        # To the end, as the arm is held there; it settles after the motion.
        held = played.times >= 0.0
        times, efforts = played.times[held], played.efforts[held]
        is_new = np.append(True, np.diff(efforts) != 0.0)
        renewed = np.append(times[is_new], times[-1])
        if np.diff(renewed).max() > LONGEST:
            raise NotPlayed('the tracker was late')

    def _amplitude(self, status: Any, played: Recording) -> float:
        """Return the largest swing after the motion [rad]: what feedback damps has no envelope."""
        return float(np.abs(played.positions[played.times >= DURATION, 1]).max())
