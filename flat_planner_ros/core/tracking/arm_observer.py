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

"""Estimate of an arm's whole state from its joint angles and the efforts that act on it."""

from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray, JointSample, PlanarArm, UNUSABLE
from flat_planner_ros.core.tracking.chain import last_links, linearised_joint
from flat_planner_ros.core.tracking.observer import Observer
import numpy as np


class Estimate(NamedTuple):
    """
    State of an arm, and what disturbs it.

    Attributes
    ----------
    links
        theta_(n-1), q_n, their rates and the disturbance of joint n-1, shape (5, 1) [rad],
        [rad/s], [N m].
    joints
        q_1 ... q_(n-2), their rates and disturbances, shape (3, n-2) [rad], [rad/s], [rad/s^2].

    """

    links: FloatArray
    joints: FloatArray

    @property
    def angles(self) -> FloatArray:
        """Return q_1 ... q_(n-2), theta_(n-1) and q_n, shape (n,) [rad]."""
        return np.concatenate([self.joints[0], self.links[:2, 0]])

    @property
    def positions(self) -> FloatArray:
        """Return the joint angles, shape (n,) [rad]."""
        return all_joints(self.joints[0], self.links[:2, 0])

    @property
    def velocities(self) -> FloatArray:
        """Return the joint velocities, shape (n,) [rad/s]."""
        return all_joints(self.joints[1], self.links[2:4, 0])


class ArmObserver:
    """
    Observer of an arm in any pose, with constant gains.

    Parameters
    ----------
    arm
        The model; must be flat.
    period
        Usual time between two samples [s].
    bandwidth
        Of the estimate [rad/s].
    held
        Whether a stiff position servo moves joint n-1: what acts on the last two links, and
        disturbs them, is then the acceleration of link n-1 [rad/s^2], not an effort.

    Raises
    ------
    NotFlat
        The arm does not meet the flatness condition.

    """

    def __init__(
        self, arm: PlanarArm, period: float, bandwidth: float, *, held: bool = False
    ) -> None:
        """Rest at zero."""
        self._arm = arm
        self._links = Observer(last_links(arm, held=held), period, bandwidth)
        self._joints = Observer(linearised_joint(), period, bandwidth, arm.n - 2)

    def restart(self, sample: JointSample) -> None:
        """Take a sample for the truth; at rest, unless it has velocities."""
        q, dq = sample.positions, sample.velocities
        if dq is None or not (np.abs(dq) < UNUSABLE).all():
            dq = np.zeros(q.size)
        self._links.restart(sample.time, links_of(q), links_of(dq))
        self._joints.restart(sample.time, q[None, :-2], dq[None, :-2])

    def continue_from(self, other: 'ArmObserver') -> None:
        """Take over the estimate of another one, of the same joints."""
        self._links.continue_from(other._links)
        self._joints.continue_from(other._joints)

    def forget_disturbances(self) -> None:
        """Start the estimates of the disturbances anew."""
        self._links.forget_disturbance()
        self._joints.forget_disturbance()

    def correct(self, sample: JointSample) -> float:
        """Take in the angles of a sample; return the largest unexpected change [rad]."""
        links = self._links.correct(sample.time, links_of(sample.positions))
        joints = self._joints.correct(sample.time, sample.positions[None, :-2])
        return float(max(np.abs(links).max(), np.abs(joints).max(initial=0.0)))

    def predicted(self, time: float) -> Estimate:
        """Return what will be at a time [s], under the inputs noted."""
        return Estimate(self._links.predicted(time), self._joints.predicted(time))

    def note(self, time: float, driving: float, accelerations: FloatArray) -> None:
        """
        Note what acts from a time [s] on.

        Parameters
        ----------
        time
            When it begins to act [s].
        driving
            Effort of joint n-1, without its friction [N m], or acceleration of link n-1 if that
            is held.
        accelerations
            Of the joints before it, shape (n-2,) [rad/s^2].

        """
        self._links.apply(time, np.array([driving]))
        self._joints.apply(time, accelerations)

    def note_efforts(self, time: float, efforts: FloatArray) -> None:
        """Note efforts (n-1,) [N m], their friction included, that act from a time [s] on."""
        state = self.predicted(time)
        net = efforts - self._arm.friction(state.velocities)
        self.note(time, float(net[-1]), self.accelerations(state, net))

    def accelerations(self, state: Estimate, net: FloatArray) -> FloatArray:
        """Return what efforts (n-1,) [N m] without friction do to the first joints, (n-2,)."""
        if self._arm.n == 2:
            return np.zeros(0)
        velocities = state.velocities
        efforts = net + self._arm.friction(velocities)
        return self._arm.forward_dynamics(state.positions, velocities, efforts)[:-2]


def links_of(joints: FloatArray) -> FloatArray:
    """Return theta_(n-1) and q_n, or their rates, of all joints', shape (2, 1)."""
    return np.array([[joints[:-1].sum()], [joints[-1]]])


def all_joints(first: FloatArray, links: FloatArray) -> FloatArray:
    """Return all joints' angles of the first ones', theta_(n-1) and q_n, shape (n,)."""
    return np.concatenate([first, [links[0] - first.sum(), links[1]]])
