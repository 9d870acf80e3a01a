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

"""Planar serial arm whose last joint is elastic and not actuated: its constants, checked."""

from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from math import inf, sqrt
from typing import NamedTuple

from flat_planner_ros.core.arm.arrays import check_number, checked_array, FloatArray, locked
from flat_planner_ros.core.arm.dynamics import ArmDynamics, Real
from flat_planner_ros.core.arm.errors import InvalidModel, NotFlat
from flat_planner_ros.core.arm.links import (
    chain_load,
    check_definite,
    check_realizable,
    checked_counterbalances,
    checked_inertia_star,
    checked_links,
    per_motor,
)
import numpy as np
import numpy.typing as npt

BALANCE_TOLERANCE = 1e-6
"""Largest static moment of a balanced link, relative to sqrt(carried mass * inertia) [-]."""


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
class PlanarArm(ArmDynamics):
    """
    Planar serial arm of n >= 2 links whose last joint is elastic and not actuated.

    It is kept in absolute link angles, where the dynamics of any planar chain have constant
    coefficients; efforts and accelerations are those of `ArmDynamics`.

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
        object.__setattr__(self, 'inertia', locked(inertia))
        for name, unit, size, lower in (
            ('static_moment', 'kg m', n, -inf),
            ('carried_mass', 'kg', n, 0.0),
            ('viscous_friction', 'N m s/rad', n - 1, 0.0),
            ('coulomb_friction', 'N m', n - 1, 0.0),
        ):
            value = checked_array(name, getattr(self, name), unit, shape=(size,), lower=lower)
            object.__setattr__(self, name, value)
        check_number('damping', self.damping, 'N m s/rad', lower=0.0)
        check_number('gravity', self.gravity, 'm/s^2')
        check_number('stiffness', self.stiffness, 'N m/rad', above=0.0)
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
        both, last = checked_inertia_star(inertia_star)
        length, com, mass, own = checked_links(link_length, link_com, link_mass, link_inertia)
        check_number('tip_mass', tip_mass, 'kg', lower=0.0)
        count = length.size
        rider = np.arange(count)[-1:]  # empty for n = 2: the tip is then the base
        chain = chain_load(
            length,
            np.append(np.arange(count), rider),
            np.append(com, length[rider]),
            np.append(mass, np.full(rider.size, tip_mass)),
        )
        inertia = np.diag(np.concatenate((own, [both - last, last])))
        inertia[:count, :count] += chain.inertia
        return cls(
            inertia=inertia,
            static_moment=np.append(chain.static_moment, [0.0, 0.0]),
            carried_mass=np.append(chain.carried_mass, [tip_mass, tip_mass]),
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
        weights, arms = checked_counterbalances(counterbalance_mass, counterbalance_arm)
        load = chain_load(
            length,
            np.append(np.arange(n), [n - 2, n - 1]),
            np.append(com, -arms),
            np.append(mass, weights),
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

    def with_last_links(
        self,
        *,
        inertia_star: tuple[float, float],
        stiffness: float,
        damping: float,
        viscous: float,
        coulomb: float,
    ) -> 'PlanarArm':
        """
        Return a copy that differs in what moves the last two links.

        Parameters
        ----------
        inertia_star
            I*_{n-1} and I*_n [kg m^2].
        stiffness, damping
            Passive joint [N m/rad], [N m s/rad].
        viscous, coulomb
            Friction of joint n-1 [N m s/rad], [N m].

        """
        both, last = inertia_star
        inertia = self.inertia.copy()
        inertia[-2, -2], inertia[-1, -1] = both - last, last
        frictions = self.viscous_friction.copy(), self.coulomb_friction.copy()
        frictions[0][-1], frictions[1][-1] = viscous, coulomb
        return replace(
            self,
            inertia=inertia,
            stiffness=stiffness,
            damping=damping,
            viscous_friction=frictions[0],
            coulomb_friction=frictions[1],
        )

    @cached_property
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
        moments, masses = self.static_moment.tolist(), self.carried_mass.tolist()
        for i in (self.n - 1, self.n - 2):
            moment, mass = moments[i], masses[i]
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
        frequency, ratio = free_oscillation(both, last, self.stiffness, self.damping, held=held)
        return NaturalMode(float(frequency), float(ratio))


def free_oscillation(
    both: Real, last: Real, stiffness: Real, damping: Real, *, held: bool
) -> tuple[Real, Real]:
    """
    Return undamped angular frequency [rad/s] and damping ratio [-] of a passive joint.

    Parameters
    ----------
    both, last
        I*_{n-1} and I*_n, of one arm or of many [kg m^2].
    stiffness, damping
        Passive joint [N m/rad], [N m s/rad].
    held
        Whether the actuated joints are held; otherwise joint n-1 is free.

    """
    inertia = last if held else last * (both - last) / both  # rotors n-1 and n in series
    frequency = np.sqrt(stiffness / inertia)
    return frequency, damping / (2 * inertia * frequency)
