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

"""What goes wrong while a simulated arm keeps in time, in numbers and in sentences."""

from dataclasses import dataclass

from flat_planner_ros.core.plant.simulation import SimulatedArm


@dataclass(kw_only=True)
class Troubles:
    """
    What went wrong since it was last told.

    Attributes
    ----------
    skipped
        Time that passed without the arm [s].
    has_dropped
        Whether a command was dropped there.
    set_back
        Time by which the clock was set back [s].
    behind
        Time by which an arm that leads is too slow [s].
    broken
        Silence that ended a stream of efforts [s], 0 without any.

    """

    skipped: float = 0.0
    has_dropped: bool = False
    set_back: float = 0.0
    behind: float = 0.0
    broken: float = 0.0

    def sentences(self, simulated: SimulatedArm) -> list[str]:
        """Return a sentence each, those of the arm itself first; its clipped steps count anew."""
        troubles = []
        if simulated.fault:
            troubles.append(f'the arm has been stopped until it is reset: {simulated.fault}')
        clipped = simulated.take_clipped_steps()
        if clipped:
            troubles.append(f'effort clipped by the saturation in {clipped} steps')
        if self.broken:
            troubles.append(
                f'the stream of efforts broke, none came for {self.broken:g} s: nothing is '
                'applied any more'
            )
        if self.skipped:
            command = '; its command was dropped' if self.has_dropped else ''
            troubles.append(
                f'{self.skipped:.3f} s skipped to keep up with the clock: the arm stood still'
                f'{command}'
            )
        if self.set_back:
            troubles.append(
                f'the clock was set back by {self.set_back:.3f} s: the arm kept its state, its '
                'command was dropped'
            )
        if self.behind:
            troubles.append(
                f'the simulated time is {self.behind:.3f} s behind its real_time_factor: this '
                'machine is too slow or busy'
            )
        return troubles
