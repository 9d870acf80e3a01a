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

`BEYOND` adds what the paper does not have: a plant that is 10 % softer, too, and three methods.
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

    """

    number: int
    title: str
    damping_factor: float
    stiffness_scale: float
    damping_scale: float


SCENARIOS = (
    Scenario(1, 'no damping', 0.0, 1.0, 0.0),
    Scenario(2, 'damping', 1.0, 1.0, 1.0),
    Scenario(3, 'stiffness and damping +10 % in the plant', 1.0, 1.1, 1.1),
)

SOFTER = Scenario(4, 'stiffness and damping -10 % in the plant', 1.0, 0.9, 0.9)
"""The other side of scenario 3, and the worse one."""

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

    """

    name: str
    parameters: Mapping[str, str | float]
    learns: bool = False


def _method(name: str, strategy: str, flat_model: str, learns: bool = False) -> Method:
    """Return a method."""
    parameters: dict[str, str | float] = {'strategy': strategy, 'flat_model': flat_model}
    return Method(name, MappingProxyType(parameters | WEIGHTS), learns)


METHODS = tuple(_method(strategy, strategy, 'approximate') for strategy in STRATEGIES)
"""The methods of the paper."""

EXACT = _method('exact', 'min_control_effort', 'exact')
INSENSITIVE = _method('insensitive', 'insensitive', 'exact')
SELF_TUNED = _method('self-tuned, 2nd move', 'min_control_effort', 'exact', learns=True)

CASES = tuple((scenario, method) for scenario in SCENARIOS for method in METHODS)
"""The rows of the paper's table."""

BEYOND = (
    *CASES[:6],
    *((SCENARIOS[1], method) for method in (EXACT, INSENSITIVE)),
    *CASES[6:],
    *((SCENARIOS[2], method) for method in (EXACT, INSENSITIVE, SELF_TUNED)),
    *((SOFTER, method) for method in (*METHODS, EXACT, INSENSITIVE, SELF_TUNED)),
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

    """

    scenario: Scenario
    strategy: str
    rms_effort: float
    amplitude: float
    recording: Recording
    drive: Drive = Drive.EFFORT

    @property
    def printed(self) -> tuple[float, float] | None:
        """Return the paper's RMS effort [N m] and amplitude [rad], None where it has none."""
        if self.drive is Drive.POSITION:
            return None
        return PRINTED.get((self.scenario.number, self.strategy))
