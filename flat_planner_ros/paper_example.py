"""The paper's numerical example: its strategies, its scenarios and the numbers that it prints."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

GOAL_ANGLE = np.pi
"""Final angle of joint 1 [rad]; the arm starts at 0."""

DURATION = 1.0
"""Duration of every motion [s]."""


class Scenario(NamedTuple):
    """
    One of the three scenarios.

    Attributes
    ----------
    number
        As in the paper.
    title
        What distinguishes it.
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

STRATEGIES = ('polynomial', 'min_control_effort', 'min_potential_energy')
"""In the order of the paper's table, named as the planner's parameter `strategy`."""

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
        From the start of the motion, shape (m,) [s].
    positions
        Of both joints, shape (m, 2) [rad].
    efforts
        Of joint 1, shape (m,) [N m].

    """

    times: NDArray[np.float64]
    positions: NDArray[np.float64]
    efforts: NDArray[np.float64]


class Result(NamedTuple):
    """
    One row of the table.

    Attributes
    ----------
    scenario, strategy
        Which run.
    rms_effort
        Time-RMS of the planned effort of joint 1 [N m].
    amplitude
        Envelope of the residual oscillation of joint 2 at the end of the motion [rad].
    recording
        The motion.

    """

    scenario: Scenario
    strategy: str
    rms_effort: float
    amplitude: float
    recording: Recording

    @property
    def printed(self) -> tuple[float, float]:
        """Return the paper's RMS effort [N m] and amplitude [rad]."""
        return PRINTED[self.scenario.number, self.strategy]
