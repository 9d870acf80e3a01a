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
Equations of motion of a planar serial arm whose last joint is elastic and not actuated.

Absolute link angles make one constant matrix and one constant vector describe every such arm,
balanced or not (docs/derivation.md). This is the home of every formula of efforts and
accelerations.
"""

from functools import cached_property
from typing import TypeVar

from flat_planner_ros.core.arm.arrays import applied, FloatArray, last_of, solved, times_matrix
import numpy as np

Real = TypeVar('Real', float, FloatArray)

ROUNDING = 1e-15
"""Coupling of two links that is a rounded zero, relative to their own inertias [-]."""

COULOMB_VELOCITY = 1e-2
"""Joint velocity at which Coulomb friction has reached tanh(1) of its value [rad/s]."""


def coulomb_share(velocity: FloatArray) -> FloatArray:
    """Return the share of Coulomb friction that acts at joint velocities [rad/s], -1 to 1 [-]."""
    return np.tanh(velocity / COULOMB_VELOCITY)


class ArmDynamics:
    """
    Dynamics of an arm, of the constants that a `PlanarArm` has; abstract.

    With absolute link angles theta_i = q_1 + ... + q_i the kinetic energy is
    1/2 sum_ij h_ij cos(theta_i - theta_j) theta_i' theta_j' and the potential energy
    gravity * sum_i s_i sin(theta_i). Joint coordinates q follow from theta = S q, S a lower
    triangle of ones. Arrays of angles may have leading axes.
    """

    inertia: FloatArray
    static_moment: FloatArray
    stiffness: float
    damping: float
    gravity: float
    viscous_friction: FloatArray
    coulomb_friction: FloatArray

    @property
    def n(self) -> int:
        """Return the number of joints."""
        return self.static_moment.size

    def mass_matrix(self, q: FloatArray) -> FloatArray:
        """Return M(q) [kg m^2], shape (..., n, n), at joint angles q [rad], shape (..., n)."""
        return self._sum.T @ self._link_inertia(_apart(np.cumsum(q, axis=-1))) @ self._sum

    def coriolis(self, q: FloatArray, dq: FloatArray) -> FloatArray:
        """Return the Coriolis-centrifugal effort b [N m], shape (..., n), at q, dq [rad/s]."""
        return self._centrifugal(_apart(np.cumsum(q, axis=-1)), dq) @ self._sum

    def gravity_effort(self, q: FloatArray) -> FloatArray:
        """Return the effort g(q) that holds the arm against gravity [N m], shape (..., n)."""
        return self._weight(np.cumsum(q, axis=-1)) @ self._sum

    def friction(self, dq: FloatArray) -> FloatArray:
        """Return what friction takes from the actuated joints [N m], shape (..., n-1)."""
        motor = dq[..., :-1]
        return self.viscous_friction * motor + self.coulomb_friction * coulomb_share(motor)

    def passive_effort(self, q_n: Real, dq_n: Real) -> Real:
        """Return the effort of spring and damper -k q_n - c dq_n [N m]."""
        return -self.stiffness * q_n - self.damping * dq_n

    def inverse_dynamics(self, q: FloatArray, dq: FloatArray, ddq: FloatArray) -> FloatArray:
        """
        Return the generalised effort that a motion takes.

        Parameters
        ----------
        q, dq, ddq
            Joint angles [rad], velocities [rad/s], accelerations [rad/s^2], shape (..., n).

        Returns
        -------
        FloatArray
            Effort [N m], shape (..., n), friction included; 0 at the passive joint of any motion
            that motors at the other joints can bring about.

        """
        effort = self.rigid_effort(q, dq, ddq)
        effort[..., :-1] += self.friction(dq)
        effort[..., -1] -= self.passive_effort(q[..., -1], dq[..., -1])
        return effort

    def rigid_effort(self, q: FloatArray, dq: FloatArray, ddq: FloatArray) -> FloatArray:
        """Return the effort M ddq + b + g of a motion, without friction and spring, (..., n)."""
        theta = np.cumsum(q, axis=-1)
        cos, sin = np.cos(theta), np.sin(theta)
        along, across = np.cumsum(ddq, axis=-1), np.cumsum(dq, axis=-1) ** 2
        # cos and sin of differences by the addition theorems: in n angles, not in n^2 differences.
        on_links = cos * ((cos * along - sin * across) @ self.inertia + self._static_load)
        on_links += sin * ((sin * along + cos * across) @ self.inertia)
        effort: FloatArray = on_links @ self._sum
        return effort

    def forward_dynamics(self, q: FloatArray, dq: FloatArray, effort: FloatArray) -> FloatArray:
        """
        Return the joint accelerations under motor efforts.

        Parameters
        ----------
        q, dq
            Joint angles [rad] and velocities [rad/s], shape (..., n).
        effort
            Effort of the actuated joints [N m], shape (..., n-1).

        Returns
        -------
        FloatArray
            Accelerations [rad/s^2], shape (..., n).

        """
        net = np.empty(q.shape)
        net[..., :-1] = effort
        net[..., -1] = self.passive_effort(last_of(q), last_of(dq))
        if self._has_friction:
            net[..., :-1] -= self.friction(dq)
        if self._inverse_mass is not None:
            if self.has_weight:
                net -= self.gravity_effort(q)
            return times_matrix(net, self._inverse_mass)
        theta = q.cumsum(axis=-1)
        apart = _apart(theta)
        load = times_matrix(net, self._difference) - self._centrifugal(apart, dq)
        if self.has_weight:
            load -= self._weight(theta)
        return times_matrix(solved(self._link_inertia(apart), load), self._difference.T)

    def energy(self, q: FloatArray, dq: FloatArray) -> FloatArray:
        """Return kinetic, gravitational and elastic energy together [J], shape (...)."""
        theta, rate = np.cumsum(q, axis=-1), np.cumsum(dq, axis=-1)
        momentum = applied(self._link_inertia(_apart(theta)), rate)
        weight = self.gravity * self.static_moment * np.sin(theta)
        links: FloatArray = np.sum(rate * momentum / 2 + weight, axis=-1)
        return links - q[..., -1] * self.passive_effort(q[..., -1], np.zeros_like(links)) / 2

    def _link_inertia(self, apart: FloatArray) -> FloatArray:
        """Return H(theta), shape (..., n, n)."""
        return self.inertia * np.cos(apart)

    def _centrifugal(self, apart: FloatArray, dq: FloatArray) -> FloatArray:
        """Return the centrifugal effort on each link, shape (..., n)."""
        return applied(self.inertia * np.sin(apart), dq.cumsum(axis=-1) ** 2)

    def _weight(self, theta: FloatArray) -> FloatArray:
        """Return the effort that holds each link against gravity, shape (..., n)."""
        return self._static_load * np.cos(theta)

    @cached_property
    def _sum(self) -> FloatArray:
        """S: absolute link angles are S q, joint efforts are S^T times link efforts."""
        return np.tri(self.n)

    @cached_property
    def _difference(self) -> FloatArray:
        """Inverse of S."""
        return np.eye(self.n) - np.eye(self.n, k=-1)

    @cached_property
    def _inverse_mass(self) -> FloatArray | None:
        """Inverse of M where no link is coupled to another, so that M is constant."""
        own = np.sqrt(np.diag(self.inertia))
        coupling = np.triu(np.abs(self.inertia), k=1)
        if (coupling > ROUNDING * np.outer(own, own)).any():
            return None
        return self._difference @ np.diag(own**-2) @ self._difference.T

    @cached_property
    def _static_load(self) -> FloatArray:
        """Effort that holds each link when it points along x, shape (n,) [N m]."""
        return self.gravity * self.static_moment

    @cached_property
    def _has_friction(self) -> bool:
        return bool(self.viscous_friction.any() or self.coulomb_friction.any())

    @cached_property
    def is_linear(self) -> bool:
        """Whether accelerations are linear in angles, velocities and efforts."""
        is_dry = bool(self.coulomb_friction.any())
        return self._inverse_mass is not None and not self.has_weight and not is_dry

    @cached_property
    def has_weight(self) -> bool:
        """Whether gravity moves the arm, so that it takes efforts to keep it at rest."""
        return self.gravity != 0.0 and bool(self.static_moment.any())


def _apart(theta: FloatArray) -> FloatArray:
    """Return theta_i - theta_j, shape (..., n, n)."""
    return theta[..., :, None] - theta[..., None, :]
