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

"""
The paper's numerical example: its strategies, its scenarios and the numbers that it prints.

`BEYOND` adds what the paper does not have: a plant that is 10 % softer, too, three methods, and
feedback on arms that differ further.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from flat_planner_ros.core.arm import Drive, FloatArray
import numpy as np

GOAL_ANGLE = np.pi
"""Final angle of joint 1 [rad]; the arm starts at 0."""

DURATION = 1.0
"""Duration of every motion [s]."""


class Scenario(NamedTuple):
    """
    One of the scenarios.

    Attributes
    ----------
    number
        Number in the paper, which has three.
    title
        Difference from the others in words.
    damping_factor
        Damping known to the planner over the arm's nominal one [-].
    stiffness_scale, damping_scale
        The plant's stiffness and damping over the nominal ones [-].
    inertia_scale
        The plant's inertias over the nominal ones [-].
    viscous_friction, coulomb_friction
        Of the plant's joint 1, not in the model [N m s/rad], [N m].

    """

    number: int
    title: str
    damping_factor: float
    stiffness_scale: float
    damping_scale: float
    inertia_scale: float = 1.0
    viscous_friction: float = 0.0
    coulomb_friction: float = 0.0


SCENARIOS = (
    Scenario(1, 'no damping', 0.0, 1.0, 0.0),
    Scenario(2, 'damping', 1.0, 1.0, 1.0),
    Scenario(3, 'stiffness and damping +10 % in the plant', 1.0, 1.1, 1.1),
)

SOFTER = Scenario(4, 'stiffness and damping -10 % in the plant', 1.0, 0.9, 0.9)
"""The other side of scenario 3, and the worse one."""

FURTHER = (
    Scenario(5, 'stiffness and damping +25 % in the plant', 1.0, 1.25, 1.25),
    Scenario(6, 'stiffness and damping -25 % in the plant', 1.0, 0.75, 0.75),
    Scenario(7, 'inertias +10 % in the plant', 1.0, 1.0, 1.0, inertia_scale=1.1),
    Scenario(8, 'inertias -10 % in the plant', 1.0, 1.0, 1.0, inertia_scale=0.9),
    Scenario(
        9, 'friction in the plant', 1.0, 1.0, 1.0, viscous_friction=2e-4, coulomb_friction=5e-4
    ),
)
"""Arms that are carried on with feedback alone."""

STRATEGIES = ('polynomial', 'min_control_effort', 'min_potential_energy')
"""In the order of the paper's table, named as the planner's parameter `strategy`."""


WEIGHTS = {'weights.r': 150.0, 'weights.p': 17.0}
"""The paper's weights of effort and potential energy."""


class Method(NamedTuple):
    """
    One way to plan the motion.

    Attributes
    ----------
    name
        Name in the table.
    parameters : Mapping[str, str | float]
        Values of the planner's parameters.
    learns
        Whether the row is the second of two motions, after the estimate from the first has been
        adopted.
    is_tracked
        Whether the tracker carries the motion out.

    """

    name: str
    parameters: Mapping[str, str | float]
    learns: bool = False
    is_tracked: bool = False


def _method(name: str, strategy: str, flat_model: str, learns: bool = False) -> Method:
    """Return a method."""
    parameters: dict[str, str | float] = {'strategy': strategy, 'flat_model': flat_model}
    return Method(name, MappingProxyType(parameters | WEIGHTS), learns)


METHODS = tuple(_method(strategy, strategy, 'approximate') for strategy in STRATEGIES)
"""The methods of the paper."""

EXACT = _method('exact', 'min_control_effort', 'exact')
INSENSITIVE = _method('insensitive', 'insensitive', 'exact')
SELF_TUNED = _method('self-tuned, 2nd move', 'min_control_effort', 'exact', learns=True)
TRACKED = EXACT._replace(name='tracked', is_tracked=True)

CASES = tuple((scenario, method) for scenario in SCENARIOS for method in METHODS)
"""The rows of the paper's table."""

BEYOND = (
    *CASES[:6],
    *((SCENARIOS[1], method) for method in (EXACT, INSENSITIVE)),
    *CASES[6:],
    *((SCENARIOS[2], method) for method in (EXACT, INSENSITIVE, SELF_TUNED)),
    *((SOFTER, method) for method in (*METHODS, EXACT, INSENSITIVE, SELF_TUNED)),
    *((scenario, TRACKED) for scenario in (*SCENARIOS[1:], SOFTER, *FURTHER)),
)
"""The rows of the paper's table and those that it does not have."""

PRINTED = {
    (1, 'polynomial'): (0.0074, 0.0),
    (1, 'min_control_effort'): (0.0069, 0.0),
    (1, 'min_potential_energy'): (0.0087, 0.0),
    (2, 'polynomial'): (0.0068, 0.0045),
    (2, 'min_control_effort'): (0.0064, 0.0036),
    (2, 'min_potential_energy'): (0.0079, 0.003),
    (3, 'polynomial'): (0.0068, 0.099),
    (3, 'min_control_effort'): (0.0064, 0.077),
    (3, 'min_potential_energy'): (0.0079, 0.062),
}
"""The paper's table: RMS effort [N m] and amplitude at the end [rad] by scenario and strategy."""


BAND = 5e-3
"""Swing and distance from the goal below which an arm has settled [rad]."""

SEEN = 0.3
"""Time for which it has to be seen so [s]: half a swing and more."""


class Recording(NamedTuple):
    """
    What the plant did in one run, on the time axis of the motion.

    Attributes
    ----------
    times
        Times from the start of the motion, shape (m,) [s].
    positions
        Positions of both joints, shape (m, 2) [rad].
    efforts
        Efforts that joint 1 was given or its servo needed, shape (m,) [N m].

    """

    times: FloatArray
    positions: FloatArray
    efforts: FloatArray


class Result(NamedTuple):
    """
    One row of the table.

    Attributes
    ----------
    scenario, strategy
        Scenario of the run, and the name of its method.
    rms_effort
        Time-RMS of the planned effort of joint 1 [N m].
    amplitude
        Envelope of the residual oscillation of joint 2 at the end of the motion [rad].
    recording
        The motion.
    drive
        What moved joint 1.
    peak_ratio
        Largest effort of joint 1 over the largest that was planned [-].

    """

    scenario: Scenario
    strategy: str
    rms_effort: float
    amplitude: float
    recording: Recording
    drive: Drive = Drive.EFFORT
    peak_ratio: float = 1.0

    @property
    def miss(self) -> float:
        """Return the distance of joint 1 from its goal at the end of the motion [rad]."""
        return float(self._after()[1][0, 0])

    @property
    def settling_time(self) -> float | None:
        """Return the time after the motion until all stays within `BAND` [s]."""
        times, errors = self._after()
        off = np.flatnonzero((errors > BAND).any(axis=1))
        if not off.size:
            return 0.0
        return float(times[off[-1]]) if times[-1] - times[off[-1]] > SEEN else None

    def _after(self) -> tuple[FloatArray, FloatArray]:
        """Return times after the motion [s], and how far both joints are off [rad]."""
        after = self.recording.times >= DURATION
        errors = np.abs(self.recording.positions[after] - np.array((GOAL_ANGLE, 0.0)))
        return self.recording.times[after] - DURATION, errors

    @property
    def printed(self) -> tuple[float, float] | None:
        """Return the paper's RMS effort [N m] and amplitude [rad], None where it has none."""
        if self.drive is Drive.POSITION:
            return None
        return PRINTED.get((self.scenario.number, self.strategy))
