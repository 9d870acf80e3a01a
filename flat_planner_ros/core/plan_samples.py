"""Samples of a plan: joint motion and effort on a grid of times, each formed when asked for."""

from dataclasses import dataclass
from functools import cached_property

from flat_planner_ros.core.flatness import apply_row, FlatMap
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

FLAT_ORDERS = 6
"""Derivatives of the flat output in a plan, the value included."""

JOINT_ORDERS = 3
"""Position, velocity and acceleration."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanSamples:
    """
    A plan on a grid of times.

    Attributes
    ----------
    times
        From the start of the motion, shape (m,) [s].
    planned
        Derivatives 0 to 6 of the planned variable w, shape (7, m) [rad/s^k].
    torque
        Feed-forward effort of joint n-1, the last with a motor, shape (m,) [N m].
    flat_map
        From these to everything below.

    """

    times: FloatArray
    planned: FloatArray
    torque: FloatArray
    flat_map: FlatMap

    def __post_init__(self) -> None:
        """Lock the tables."""
        self.times.setflags(write=False)
        self.planned.setflags(write=False)
        self.torque.setflags(write=False)

    @property
    def positions(self) -> FloatArray:
        """Angles of all joints, shape (m, n) [rad]."""
        return self._joints[0]

    @property
    def velocities(self) -> FloatArray:
        """First derivatives of the positions, shape (m, n) [rad/s]."""
        return self._joints[1]

    @property
    def accelerations(self) -> FloatArray:
        """Second derivatives of the positions, shape (m, n) [rad/s^2]."""
        return self._joints[2]

    @cached_property
    def efforts(self) -> FloatArray:
        """Feed-forward effort of all joints, zero for the passive one, shape (m, n) [N m]."""
        efforts = np.zeros((len(self.times), 2))
        efforts[:, 0] = self.torque
        efforts.setflags(write=False)
        return efforts

    @cached_property
    def flat(self) -> FloatArray:
        """Derivatives 0 to 5 of every flat output, shape (n - 1, 6, m) [rad/s^k]."""
        flat = _derivatives(self.flat_map.output, self.planned, FLAT_ORDERS)[None]
        flat.setflags(write=False)
        return flat

    @cached_property
    def _joints(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return positions, velocities and accelerations."""
        passive = _derivatives(self.flat_map.deflection, self.planned, JOINT_ORDERS)
        joints = np.empty((JOINT_ORDERS, len(self.times), 2))
        np.subtract(self.flat[0, :JOINT_ORDERS], passive, out=joints[:, :, 0])
        joints[:, :, 1] = passive
        joints.setflags(write=False)
        positions, velocities, accelerations = joints
        return positions, velocities, accelerations


def _derivatives(row: FloatArray, jet: FloatArray, count: int) -> FloatArray:
    """Return the quantity of a row and its derivatives, shape (count, m)."""
    return np.array([apply_row(row, jet, order) for order in range(count)])
