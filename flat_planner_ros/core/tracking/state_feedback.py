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

"""Feedback of all states: efforts from an estimate and where the joints should be."""

from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray, PlanarArm
from flat_planner_ros.core.tracking.arm_observer import (
    all_joints,
    ArmObserver,
    Estimate,
    links_of,
)
from flat_planner_ros.core.tracking.chain import Chain, last_links, linearised_joint
from flat_planner_ros.core.tracking.gains import feedback_gain
from flat_planner_ros.core.tracking.settings import TrackerSettings
from flat_planner_ros.core.tracking.tracked_motion import Reference, TrackedMotion
import numpy as np


class Command(NamedTuple):
    """
    What the motors are to apply.

    Attributes
    ----------
    efforts
        Within their limits, shape (n-1,) [N m].
    is_clipped
        Whether more was asked for.
    errors
        Angles of all joints but n-1, in the place of which link n-1 stands, from the plan,
        shape (n,) [rad].

    """

    efforts: FloatArray
    is_clipped: bool
    errors: FloatArray

    @property
    def error(self) -> float:
        """Return the largest distance of an angle from the plan [rad]."""
        return float(np.abs(self.errors).max())


class StateFeedback:
    """
    One constant gain for the last two links, computed torque with one for each joint before them.

    The planned effort follows from the planned motion and the model, whose friction is known.

    Parameters
    ----------
    arm
        The model; must be flat.
    settings
        Bandwidths, rate and limits.

    Raises
    ------
    NotFlat
        The arm does not meet the flatness condition.
    InvalidRequest
        The bandwidth or the damping is too low for a regulator, or the limits are another arm's.

    """

    def __init__(self, arm: PlanarArm, settings: TrackerSettings) -> None:
        """Compute the gains once; they hold in any pose."""
        bandwidth, period = settings.bandwidth_of(arm), settings.period
        self.observer = ArmObserver(arm, period, settings.observer_ratio * bandwidth)
        self._arm, self._period = arm, period
        self._chain = last_links(arm)
        self._links_gain, self._joint_gain = (
            feedback_gain(chain, period, bandwidth, settings.damping)
            for chain in (self._chain, linearised_joint())
        )
        self._limit = settings.limits_of(arm)

    def command(self, time: float, motion: TrackedMotion) -> Command:
        """
        Return what to apply, and note that it is applied.

        Parameters
        ----------
        time
            When it will act, for a period [s].
        motion
            What is planned.

        """
        planned, middle = motion.at(time), motion.at(time + self._period / 2)
        state = self.observer.predicted(time)
        effort = self._effort(state, planned, middle)
        accelerations = self._accelerations(state, planned, middle)
        friction = self._arm.friction(middle.velocities)
        asked = friction + self._all_efforts(state, effort, accelerations)
        given = np.minimum(np.maximum(asked, -self._limit), self._limit)
        is_clipped = bool((given != asked).any())
        if is_clipped:
            accelerations = self.observer.accelerations(state, given - friction)
        self.observer.note(time, float(given[-1] - friction[-1]), accelerations)
        return Command(given, is_clipped, _errors(state, planned))

    def _effort(self, state: Estimate, planned: Reference, middle: Reference) -> float:
        """Return the effort of joint n-1 without friction [N m]."""
        ahead = feed_forward(self._chain, links_state(middle), middle.accelerations[:-1].sum())
        return float(
            links_effort(self._links_gain, state.links[:, 0], links_state(planned), ahead)
        )

    def _accelerations(self, state: Estimate, planned: Reference, middle: Reference) -> FloatArray:
        """Return the accelerations of the joints before the last two, (n-2,) [rad/s^2]."""
        wanted = np.array([planned.positions[:-2], planned.velocities[:-2]])
        added = -self._joint_gain.dot(state.joints[:-1] - wanted) - state.joints[-1]
        accelerations: FloatArray = middle.accelerations[:-2] + added
        return accelerations

    def _all_efforts(
        self, state: Estimate, effort: float, accelerations: FloatArray
    ) -> FloatArray:
        """Return efforts for that of joint n-1 and the accelerations before it, (n-1,) [N m]."""
        if self._arm.n == 2:
            return np.array([effort])
        links, chain = state.links[:, 0], self._chain
        rates = chain.dynamics[2:] @ links[:4] + chain.input_effect[2:] * (effort + links[4])
        rigid = self._arm.rigid_effort(
            state.positions, state.velocities, all_joints(accelerations, rates)
        )
        return np.append(rigid[:-2], effort)


def distance(state: Estimate, planned: Reference) -> float:
    """Return the largest distance of a joint or of link n-1 from where it should be [rad]."""
    return float(np.abs(_errors(state, planned)).max())


def _errors(state: Estimate, planned: Reference) -> FloatArray:
    """Return by how much the angles are beside where they should be, shape (n,) [rad]."""
    wanted = np.append(planned.positions[:-2], links_of(planned.positions))
    return state.angles - wanted


def links_state(reference: Reference) -> FloatArray:
    """Return the state of the last two links, shape (4,)."""
    return np.concatenate([links_of(reference.positions), links_of(reference.velocities)])[:, 0]


def feed_forward(chain: Chain, links: FloatArray, acceleration: float | FloatArray) -> FloatArray:
    """
    Return the effort of joint n-1 that a planned motion takes [N m].

    Parameters
    ----------
    chain
        The last two links.
    links
        Their planned states, shape (4, ...).
    acceleration
        Of link n-1, shape (...) [rad/s^2].

    """
    own = chain.dynamics[2].dot(links)
    effort: FloatArray = (acceleration - own) / chain.input_effect[2]
    return effort


def links_effort(
    gain: FloatArray, state: FloatArray, wanted: FloatArray, ahead: FloatArray
) -> FloatArray:
    """
    Return the effort of joint n-1 without friction [N m], for one arm or many, shape (...).

    Parameters
    ----------
    gain
        Of the state, shape (4,).
    state, wanted
        Of the last two links: estimate with its disturbance, shape (5, ...), and plan, (4, ...).
    ahead
        Its feed-forward, shape (...) [N m].

    """
    effort: FloatArray = ahead - gain.dot(state[:-1] - wanted) - state[-1]
    return effort
