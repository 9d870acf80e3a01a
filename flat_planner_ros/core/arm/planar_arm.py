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
Dynamics of a planar serial arm whose last joint is elastic and not actuated.

The absolute link angles make one constant matrix and one constant vector describe every such arm,
balanced or not (docs/derivation.md).
"""

from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from math import sqrt
from typing import NamedTuple, TypeVar

from flat_planner_ros.core.arm.arrays import applied, FloatArray, last_of, solved, times_matrix
from flat_planner_ros.core.arm.errors import InvalidModel, NotFlat
from flat_planner_ros.core.arm.links import (
    chain_load,
    check_definite,
    check_realizable,
    checked_links,
    checked_vector,
    per_motor,
)
import numpy as np
import numpy.typing as npt

Real = TypeVar('Real', float, FloatArray)

BALANCE_TOLERANCE = 1e-6
"""Largest static moment of a balanced link, relative to sqrt(carried mass * inertia) [-]."""

ROUNDING = 1e-15
"""Coupling of two links that is a rounded zero, relative to their own inertias [-]."""

COULOMB_VELOCITY = 1e-2
"""Joint velocity at which Coulomb friction has reached tanh(1) of its value [rad/s]."""


class InertiaStar(NamedTuple):
    """
    The two constants of a flat arm's mass matrix.

    Attributes
    ----------
    both
        Inertia of links n-1 and n about joint n-1, I*_{n-1} [kg m^2].
    last
        Inertia of link n about joint n, I*_n [kg m^2].

    """

    both: float
    last: float


class Drive(Enum):
    """What moves joint n-1; the resonance of the passive joint depends on it."""

    EFFORT = 'effort'
    """An effort: the joint is free to give way, and free after a motion."""

    POSITION = 'position'
    """A servo that is stiff enough to follow planned angles whatever the passive joint does."""


class NaturalMode(NamedTuple):
    """
    Free oscillation of the passive joint.

    Attributes
    ----------
    frequency
        Undamped angular frequency omega [rad/s].
    damping_ratio
        Fraction zeta of critical damping [-].

    """

    frequency: float
    damping_ratio: float

    @property
    def decay_rate(self) -> float:
        """Return zeta * omega, the rate at which the envelope decays [1/s]."""
        return self.damping_ratio * self.frequency

    @property
    def damped_frequency(self) -> float:
        """Return the angular frequency that is seen, 0 without oscillation [rad/s]."""
        return self.frequency * sqrt(max(0.0, 1.0 - self.damping_ratio**2))


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanarArm:
    """
    Planar serial arm of n >= 2 links whose last joint is elastic and not actuated.

    It is kept in absolute link angles theta_i = q_1 + ... + q_i, where the dynamics of any planar
    chain have constant coefficients h and s: kinetic energy 1/2 sum_ij h_ij cos(theta_i - theta_j)
    theta_i' theta_j' and potential energy gravity * sum_i s_i sin(theta_i). Joint coordinates q
    follow from theta = S q, S a lower triangle of ones. Arrays of angles may have leading axes.

    Attributes
    ----------
    inertia
        Coefficients h, shape (n, n) [kg m^2].
    static_moment
        First moments s of what each link carries about its joint, shape (n,) [kg m].
    carried_mass
        Mass of each link and of all that rides on it, shape (n,) [kg].
    stiffness, damping
        Spring k [N m/rad] and damper c [N m s/rad] of the passive joint.
    gravity
        Gravity along -y [m/s^2]; 0 for a horizontal plane.
    viscous_friction, coulomb_friction
        Friction of the actuated joints, shape (n-1,) [N m s/rad] and [N m].

    """

    inertia: FloatArray
    static_moment: FloatArray
    carried_mass: FloatArray
    stiffness: float
    damping: float
    gravity: float
    viscous_friction: FloatArray
    coulomb_friction: FloatArray

    def __post_init__(self) -> None:
        """Refuse what is no physical arm and lock the arrays."""
        inertia = np.array(self.inertia, dtype=float, order='C')
        n = inertia.shape[0] if inertia.ndim else 0
        if n < 2 or inertia.shape != (n, n):
            raise InvalidModel(f'inertia must be (n, n) with n >= 2, got shape {inertia.shape}')
        check_definite(inertia)
        inertia = inertia + (inertia.T - inertia) / 2  # the sum of both may overflow
        inertia.setflags(write=False)
        fields = {
            'inertia': inertia,
            'static_moment': checked_vector('static_moment', self.static_moment, n, 'kg m'),
            'carried_mass': checked_vector('carried_mass', self.carried_mass, n, 'kg', 0.0),
            'viscous_friction': checked_vector(
                'viscous_friction', self.viscous_friction, n - 1, 'N m s/rad', 0.0
            ),
            'coulomb_friction': checked_vector(
                'coulomb_friction', self.coulomb_friction, n - 1, 'N m', 0.0
            ),
        }
        for name, value in fields.items():
            object.__setattr__(self, name, value)
        checked_vector('damping', [self.damping], 1, 'N m s/rad', 0.0)
        checked_vector('gravity', [self.gravity], 1, 'm/s^2')
        checked_vector('stiffness', [self.stiffness], 1, 'N m/rad')
        if self.stiffness <= 0.0:
            raise InvalidModel(f'stiffness must be above 0 N m/rad, got {self.stiffness:g}')
        check_realizable(self.inertia, self.static_moment, self.carried_mass)

    @classmethod
    def reduced(
        cls,
        *,
        inertia_star: npt.ArrayLike,
        stiffness: float,
        damping: float,
        link_length: npt.ArrayLike = (),
        link_com: npt.ArrayLike = (),
        link_mass: npt.ArrayLike = (),
        link_inertia: npt.ArrayLike = (),
        tip_mass: float = 0.0,
        gravity: float = 0.0,
        viscous_friction: npt.ArrayLike | None = None,
        coulomb_friction: npt.ArrayLike | None = None,
    ) -> 'PlanarArm':
        """
        Return a flat arm from the constants of its last two, balanced links.

        Parameters
        ----------
        inertia_star
            I*_{n-1} and I*_n, I*_{n-1} > I*_n > 0, shape (2,) [kg m^2].
        stiffness, damping
            Passive joint [N m/rad], [N m s/rad].
        link_length, link_com, link_mass, link_inertia
            First n-2 links: length [m], centre of mass from the link's joint [m], mass [kg] and
            barycentric inertia [kg m^2], shape (n-2,).
        tip_mass
            All that rides at joint n-1 [kg].
        gravity
            Gravity along -y [m/s^2].
        viscous_friction, coulomb_friction
            Actuated joints, shape (n-1,) [N m s/rad], [N m]; None for no friction.

        Raises
        ------
        InvalidModel
            If this is no physical arm.

        """
        both, last = checked_vector('inertia_star', inertia_star, 2, 'kg m^2')
        if not both > last > 0.0:
            raise InvalidModel(
                f'inertia_star must satisfy I*_(n-1) > I*_n > 0 kg m^2, got {both:g}, {last:g}'
            )
        length, com, mass, own = checked_links(link_length, link_com, link_mass, link_inertia)
        (tip,) = checked_vector('tip_mass', [tip_mass], 1, 'kg', 0.0)
        count = length.size
        rider = np.arange(count)[-1:]  # empty for n = 2: the tip is then the base
        chain = chain_load(
            length,
            np.append(np.arange(count), rider),
            np.append(com, length[rider]),
            np.append(mass, np.full(rider.size, tip)),
        )
        inertia = np.diag(np.concatenate((own, [both - last, last])))
        inertia[:count, :count] += chain.inertia
        return cls(
            inertia=inertia,
            static_moment=np.append(chain.static_moment, [0.0, 0.0]),
            carried_mass=np.append(chain.carried_mass, [tip, tip]),
            stiffness=stiffness,
            damping=damping,
            gravity=gravity,
            viscous_friction=per_motor(viscous_friction, count + 1),
            coulomb_friction=per_motor(coulomb_friction, count + 1),
        )

    @classmethod
    def from_links(
        cls,
        *,
        link_length: npt.ArrayLike,
        link_com: npt.ArrayLike,
        link_mass: npt.ArrayLike,
        link_inertia: npt.ArrayLike,
        counterbalance_mass: npt.ArrayLike = (0.0, 0.0),
        counterbalance_arm: npt.ArrayLike = (0.0, 0.0),
        stiffness: float,
        damping: float,
        gravity: float = 0.0,
        viscous_friction: npt.ArrayLike | None = None,
        coulomb_friction: npt.ArrayLike | None = None,
    ) -> 'PlanarArm':
        """
        Return an arm, flat or not, from its n links and two counterbalances.

        Parameters
        ----------
        link_length, link_com, link_mass, link_inertia
            Length [m], centre of mass from the link's joint [m], mass [kg] and barycentric
            inertia [kg m^2] of each link without its counterbalance, shape (n,).
        counterbalance_mass, counterbalance_arm
            Point masses [kg] of links n-1 and n and their distances from the link's joint, on the
            other side of it [m], shape (2,).
        stiffness, damping
            Passive joint [N m/rad], [N m s/rad].
        gravity
            Gravity along -y [m/s^2].
        viscous_friction, coulomb_friction
            Actuated joints, shape (n-1,) [N m s/rad], [N m]; None for no friction.

        Raises
        ------
        InvalidModel
            If this is no physical arm.

        """
        length, com, mass, own = checked_links(link_length, link_com, link_mass, link_inertia)
        n = length.size
        if n < 2:
            raise InvalidModel(f'an arm must have at least 2 links, got {n}')
        load = chain_load(
            length,
            np.append(np.arange(n), [n - 2, n - 1]),
            np.append(com, -checked_vector('counterbalance_arm', counterbalance_arm, 2, 'm', 0.0)),
            np.append(
                mass, checked_vector('counterbalance_mass', counterbalance_mass, 2, 'kg', 0.0)
            ),
        )
        return cls(
            inertia=load.inertia + np.diag(own),
            static_moment=load.static_moment,
            carried_mass=load.carried_mass,
            stiffness=stiffness,
            damping=damping,
            gravity=gravity,
            viscous_friction=per_motor(viscous_friction, n - 1),
            coulomb_friction=per_motor(coulomb_friction, n - 1),
        )

    def scaled(
        self, *, stiffness: float = 1.0, damping: float = 1.0, inertia: float = 1.0
    ) -> 'PlanarArm':
        """Return a mismatched copy: factors [-] on the spring, the damper and all masses."""
        return replace(
            self,
            inertia=inertia * self.inertia,
            static_moment=inertia * self.static_moment,
            carried_mass=inertia * self.carried_mass,
            stiffness=stiffness * self.stiffness,
            damping=damping * self.damping,
        )

    @property
    def n(self) -> int:
        """Return the number of joints."""
        return self.static_moment.size

    @property
    def inertia_star(self) -> InertiaStar:
        """Return I*_{n-1} and I*_n [kg m^2]; raise NotFlat if the arm has no such constants."""
        self.check_flat()
        last = float(self.inertia[-1, -1])
        return InertiaStar(float(self.inertia[-2, -2]) + last, last)

    @property
    def stiffness_matrix(self) -> FloatArray:
        """Return the paper's K_n, shape (n, n) [N m/rad]."""
        return np.diag(np.append(np.zeros(self.n - 1), self.stiffness))

    @property
    def damping_matrix(self) -> FloatArray:
        """Return the paper's C_n, shape (n, n) [N m s/rad]."""
        return np.diag(np.append(np.zeros(self.n - 1), self.damping))

    def check_flat(self) -> None:
        """
        Accept only an arm whose last two links are balanced, link n first.

        Raises
        ------
        NotFlat
            With the first link whose centre of mass, carried masses included, is off its joint
            axis, and the counterbalance that would mend it.

        """
        for i in (self.n - 1, self.n - 2):
            moment, mass = float(self.static_moment[i]), float(self.carried_mass[i])
            limit = BALANCE_TOLERANCE * sqrt(mass * self.inertia[i, i])
            if abs(moment) > limit:
                raise NotFlat(
                    i + 1,
                    moment,
                    f'link {i + 1} is not balanced: the centre of mass of all it carries is '
                    f'{moment / mass:.6g} m off the axis of joint {i + 1} (static moment '
                    f'{moment:.9g} kg m, limit {limit:.3g} kg m); change its counterbalance '
                    f'(mass * arm) by {moment:+.12g} kg m',
                )

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
        return self.viscous_friction * motor + self.coulomb_friction * np.tanh(
            motor / COULOMB_VELOCITY
        )

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
        torque = cos * ((cos * along - sin * across) @ self.inertia + self._static_load)
        torque += sin * ((sin * along + cos * across) @ self.inertia)
        effort: FloatArray = torque @ self._sum
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

    def natural_mode(self, *, held: bool = False) -> NaturalMode:
        """
        Return the free oscillation of a flat arm's passive joint.

        Parameters
        ----------
        held
            Whether the actuated joints are held; otherwise joint n-1 is free.

        Raises
        ------
        NotFlat
            If the arm is not flat: its oscillation then depends on the pose.

        """
        both, last = self.inertia_star
        inertia = last if held else last * (both - last) / both  # rotors n-1 and n in series
        frequency = sqrt(self.stiffness / inertia)
        return NaturalMode(frequency, self.damping / (2 * inertia * frequency))

    def _link_inertia(self, apart: FloatArray) -> FloatArray:
        """Return H(theta), shape (..., n, n)."""
        return self.inertia * np.cos(apart)

    def _centrifugal(self, apart: FloatArray, dq: FloatArray) -> FloatArray:
        """Return the centrifugal torque on each link, shape (..., n)."""
        return applied(self.inertia * np.sin(apart), dq.cumsum(axis=-1) ** 2)

    def _weight(self, theta: FloatArray) -> FloatArray:
        """Return the torque that holds each link against gravity, shape (..., n)."""
        return self._static_load * np.cos(theta)

    @cached_property
    def _sum(self) -> FloatArray:
        """S: absolute link angles are S q, joint efforts are S^T times link torques."""
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
        """Torque that holds each link when it points along x, shape (n,) [N m]."""
        return self.gravity * self.static_moment

    @cached_property
    def _has_friction(self) -> bool:
        return bool(self.viscous_friction.any() or self.coulomb_friction.any())

    @cached_property
    def has_weight(self) -> bool:
        """Whether gravity moves the arm, so that it takes efforts to keep it at rest."""
        return self.gravity != 0.0 and bool(self.static_moment.any())


def _apart(theta: FloatArray) -> FloatArray:
    """Return theta_i - theta_j, shape (..., n, n)."""
    return theta[..., :, None] - theta[..., None, :]
